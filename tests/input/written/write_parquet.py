"""Writes the Parquet files of this folder: pyarrow 26.0.1, polars 2.1.0, fastparquet 2026.9.0 (with pandas 3.1.1 and NumPy 2.4.6).

Each has 40 rows at 100 Hz from 1.6e9 s on. Column k of row i is 0.5 i + 10 k - 3; one number of accel_x is missing (row 7).
"""

import decimal

import fastparquet
import numpy as np
import pandas
import polars
import pyarrow as pa
import pyarrow.parquet as pq

ROWS = 40
STAMPS = 1_600_000_000_000_000_000 + 10_000_000 * np.arange(ROWS)


def column(k):
    return 0.5 * np.arange(ROWS) + 10.0 * k - 3.0


gyro = {f"gyro_{axis} (deg/s)": column(k) for k, axis in enumerate("xyz")}
accel = {f"accel_{axis}_m_s2": column(k).astype(np.float32) for k, axis in enumerate("xyz")}
accel["accel_x_m_s2"] = pa.array([None if i == 7 else float(x) for i, x in enumerate(column(0))], pa.float32())
passed_over = {"note": [f"row {i}" for i in range(ROWS)], "buffer": [[1.0, 2.0]] * ROWS}
usual = pa.table({"stamp": pa.array(STAMPS, pa.timestamp("ns")), **gyro, **accel, **passed_over})
for name in ["snappy", "gzip", "lz4", "none", "brotli"]:
    pq.write_table(usual, f"{name}.parquet", compression=name, row_group_size=25, write_statistics=False)

# newer pages and encodings, a structure, and numbers of other kinds
axes = ["gyro_x", "gyro_y", "gyro_z"]
newer = pa.table(
    {
        "stamp": pa.array(STAMPS // 1000, pa.timestamp("us")),
        "imu": pa.StructArray.from_arrays([pa.array(column(k)) for k in range(3)], axes),
        "counts": pa.array(10 * np.arange(ROWS), pa.int32()),
        "above": pa.array(2**63 + 2**12 * np.arange(ROWS, dtype=np.uint64), pa.uint64()),
        "half": pa.array(column(0).astype(np.float16), pa.float16()),
        "price": pa.array([decimal.Decimal(f"{x:.1f}") for x in column(0)], pa.decimal128(7, 1)),
        "still": pa.array([i % 2 == 0 for i in range(ROWS)]),
    }
)
delta = dict.fromkeys(["stamp", "counts", "above"], "DELTA_BINARY_PACKED")
pq.write_table(
    newer,
    "newer.parquet",
    compression="zstd",
    data_page_version="2.0",
    use_dictionary=False,
    store_decimal_as_integer=True,
    column_encoding={**delta, "imu.gyro_x": "BYTE_STREAM_SPLIT", "imu.gyro_y": "BYTE_STREAM_SPLIT"},
)

polars.DataFrame({"time (ms)": 10 * np.arange(ROWS), **gyro}).write_parquet("polars.parquet")

# stamps of twelve bytes, and an index without a name
frame = pandas.DataFrame({"stamp": pandas.to_datetime(STAMPS), **gyro})
fastparquet.write("twelve.parquet", frame, times="int96")
frame.set_index("stamp").rename_axis(None).to_parquet("index.parquet")

# differences without compression, so that a test can damage them
counts = pa.table({"gyro_x (deg/s)": pa.array(7 * np.arange(ROWS) % 11, pa.int32())})
packed = {"gyro_x (deg/s)": "DELTA_BINARY_PACKED"}
bare = {"write_statistics": False, "store_schema": False, "use_dictionary": False}
pq.write_table(counts, "delta.parquet", compression="none", column_encoding=packed, **bare)
