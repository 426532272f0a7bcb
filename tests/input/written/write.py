"""Writes the small files of this folder: SciPy 1.17.1 and h5py 3.16.0.

Column k of row i of an array is 0.5 i + 10 k - 3, so that what is read is known without a reader.
"""

import h5py
import numpy as np
import scipy.io

ROWS = 40


def matrix(columns, rows=ROWS):
    return 0.5 * np.arange(rows)[:, None] + 10.0 * np.arange(columns) - 3.0


def mat(name, **how):
    scipy.io.savemat(
        name,
        {
            "gyr": matrix(3),
            "accT": matrix(3).T.astype(np.float32),
            "t": np.arange(ROWS, dtype=np.uint32)[:, None] * 10,
            "counts": np.arange(ROWS, dtype=np.int16)[:, None] - 7,
            "fs": 100.0,
            "note": "made for tests",
            "imu": {"omega": matrix(3, 30), "part": {"q": matrix(4, 30)}},
        },
        **how,
    )


def hdf5(name, libver):
    with h5py.File(name, "w", libver=libver) as f:
        f.attrs["sampling_rate"] = 100.0
        gyro = f.create_dataset("gyro", data=matrix(3), chunks=(16, 2), compression="gzip", shuffle=True, fletcher32=True)
        gyro.attrs["units"] = "deg/s"
        acc = f.create_dataset("acc", data=matrix(3).astype(">f4"))
        acc.attrs["unit"] = np.bytes_("m/s^2")
        f.create_dataset("still", data=np.arange(ROWS) % 2 == 0, chunks=(ROWS,), compression="lzf")
        f.create_dataset("stamp", data=1_600_000_000_000_000_000 + 10_000_000 * np.arange(ROWS))
        record = np.zeros(ROWS - 10, dtype=[("t_s", "<f8"), ("gyr_x_dps", "<f4"), ("n", "<i2")])
        record["t_s"] = 0.01 * np.arange(ROWS - 10)
        record["gyr_x_dps"] = matrix(1, ROWS - 10)[:, 0]
        f.create_group("other").create_dataset("log", data=record)


mat("level5.mat")
mat("level5-compressed.mat", do_compression=True)
hdf5("earliest.h5", "earliest")
hdf5("latest.h5", "latest")
