"""Logs from arrays and tables, and what is none."""

from __future__ import annotations

import datetime
import os
from pathlib import Path

import numpy as np
import pytest

import kfdesign as kf

N = 3000
X = np.random.default_rng(2).normal(0.0, 1e-2, (N, 3))
T = np.arange(N) / 100.0


def log(x: object = X, **given: object) -> kf.Log:
    return kf.Log.from_array(x, **{"rate": 100, "unit": "rad/s", **given})  # type: ignore[arg-type]


def test_an_array_is_not_copied() -> None:
    made = log()
    assert np.shares_memory(made.data, X)
    assert (made.axes, made.unit, made.rate, len(made)) == (("x", "y", "z"), "rad/s", 100.0, N)
    np.testing.assert_array_equal(made.data, X)
    np.testing.assert_allclose(made.time, T, atol=1e-12)
    in_degrees = log(np.degrees(X), unit="deg/s")
    np.testing.assert_allclose(in_degrees.data, X, rtol=1e-14)


def test_an_array_gives_the_numbers_of_a_file(tmp_path: Path) -> None:
    np.save(tmp_path / "x.npy", X)
    by_file = kf.read_log(tmp_path / "x.npy", columns=[1, 2, 3], rate=100, unit="rad/s")
    np.testing.assert_array_equal(by_file.data, X)
    mine, theirs = kf.identify(log()).document["axes"], kf.identify(by_file).document["axes"]
    for one, other in zip(mine, theirs):
        assert {**one, "name": ""} == {**other, "name": ""}


@pytest.mark.parametrize(
    ("x", "note"),
    [
        (X.astype(np.float32), "float32 was converted"),
        ((X * 1e4).astype(np.int16), "int16 was converted"),
        (X.astype(">f8"), "other byte order was converted"),
        (np.asfortranarray(X), None),
        (np.repeat(X, 2, axis=0)[::2], None),
        (X[::-1][::-1], None),
    ],
)
def test_layouts(x: np.ndarray, note: str | None) -> None:
    made = log(x)
    np.testing.assert_allclose(made.data, np.asarray(x, float))
    assert (note is None and not made.check.notes) or note in made.check.notes[0]
    assert kf.allan(made).axes[0].deviation[0] > 0


def test_read_only_and_masked() -> None:
    frozen = X.copy()
    frozen.setflags(write=False)
    assert len(log(frozen)) == N
    mask = np.zeros_like(X, bool)
    mask[100:103, 1] = True
    masked = log(np.ma.MaskedArray(X, mask))
    assert np.isnan(masked.data[100:103, 1]).all() and np.isfinite(masked.data[:, 0]).all()
    assert masked.check.notes == ("3 masked values are missing",)


BAD = [
    (dict(unit=None), "no unit.*for example: unit="),
    (dict(unit="m/s"), "expected an? .*angular rate|m/s"),
    (dict(unit="furlong"), "`unit`"),
    (dict(time=T), "rate and time: each says when"),
    (dict(rate=None, time=T[::-1].copy()), "time goes back"),
    (dict(rate=None), "rate"),
    (dict(rate=-1.0), "`rate` must be a positive number"),
    (dict(x=np.full((N, 3), np.nan)), "holds no number in 3000 rows"),
    (dict(x=np.column_stack([X[:, 0], np.full(N, np.nan)])), "column 'y' holds no number"),
    (dict(x=np.ones((N, 1))), "column 'x' is constant"),
    (dict(x=X[:1]), "only one sample"),
    (dict(x=X[:0]), "the array is empty"),
    (dict(x=X + 1j), "complex numbers; expected real ones"),
    (dict(x=X.astype(object)), "values of the kind 'object'"),
    (dict(x=X.astype(str)), "values of the kind '<U"),
    (dict(x=np.zeros((N, 3), "M8[s]")), "is time; give it as `time`"),
    (dict(x=X[None]), "an array of 3 dimensions; expected samples in rows"),
    (dict(names=["x", "y"]), "2 names for 3 columns"),
    (dict(names=["x", "y", "y"]), "two columns have the same name"),
    (dict(sensor="compass"), "unknown value `compass`"),
]


@pytest.mark.parametrize(("given", "message"), BAD)
def test_bad_arrays_are_one_clear_line(given: dict[str, object], message: str) -> None:
    of_request = "sensor" in given or given.get("unit") == "furlong"
    with pytest.raises(kf.KfdesignError if of_request else kf.LogError, match=message) as error:
        log(**given)
    assert "\n" not in str(error.value)


def test_a_missing_file_and_a_name_that_no_document_can_have(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="there is no such file"):
        kf.read_log(tmp_path / "none.csv")
    name = os.path.join(os.fsencode(tmp_path), b"log\xff.csv")
    with open(name, "wb") as file:
        file.write(b"gyro_x (deg/s)\n1\n")
    with pytest.raises(kf.KfdesignError, match="the name is not UTF-8"):
        kf.read_log(os.fsdecode(name))
    with pytest.raises(TypeError, match="read_log\\(\\) has no keyword 'colums'; did you mean 'columns'\\?"):
        kf.read_log("x.csv", colums=["x"])  # type: ignore[call-arg]
    with pytest.raises(TypeError, match="read_log\\(FILE, unit=...\\) takes it and gives a log for identify\\(\\)"):
        kf.identify("log.csv", unit="deg/s")  # type: ignore[call-arg]


def test_an_end_that_the_log_does_not_tell_is_shown() -> None:
    assert repr(kf.Measured(1.5, "s", (1.25, None))) == "1.5 s [1.25 … -]"


def test_serious_findings_are_warnings() -> None:
    moving = X.copy()
    moving[1000:2000, 0] += 5.0
    with pytest.warns(kf.LogWarning, match="not at rest") as warned:
        found = log(moving)
    assert any(finding.serious for finding in found.check.findings)
    assert warned[0].filename == __file__


class TestFrames:
    names = ("gyro_x (deg/s)", "gyro_y (deg/s)")

    def columns(self) -> dict[str, np.ndarray]:
        return {"time (s)": T, **{name: X[:, axis].copy() for axis, name in enumerate(self.names)}}

    def same(self, made: kf.Log) -> None:
        assert made.axes == ("gyro_x", "gyro_y")
        np.testing.assert_allclose(made.data, np.radians(X[:, :2]), rtol=1e-14)

    def test_pandas(self) -> None:
        pandas = pytest.importorskip("pandas")
        frame = pandas.DataFrame(self.columns())
        self.same(kf.Log.from_frame(frame))
        stamps = pandas.date_range("2026-01-01", periods=N, freq="10ms", tz="Europe/Berlin")
        indexed = frame.drop(columns="time (s)").set_index(stamps)
        made = kf.Log.from_frame(indexed)
        self.same(made)
        assert made.rate == pytest.approx(100.0) and "taken as UTC" in made.check.notes[0]
        holes = frame.convert_dtypes()
        holes.loc[7, self.names[0]] = pandas.NA
        assert np.isnan(kf.Log.from_frame(holes).data[7, 0])
        twice = frame.rename(columns={self.names[1]: self.names[0]})
        with pytest.raises(kf.LogError, match="two columns are called 'gyro_x \\(deg/s\\)'; rename one"):
            kf.Log.from_frame(twice)
        assert list(kf.Log.from_frame(frame).to_pandas().columns)[1] == "gyro_x (rad/s)"

    def test_polars(self) -> None:
        polars = pytest.importorskip("polars")
        frame = polars.DataFrame(self.columns())
        self.same(kf.Log.from_frame(frame))
        holes = frame.with_columns(
            polars.when(polars.int_range(polars.len()) == 7)
            .then(None)
            .otherwise(polars.col(self.names[0]))
            .alias(self.names[0])
        )
        assert np.isnan(kf.Log.from_frame(holes).data[7, 0])

    def test_pyarrow_and_others(self) -> None:
        pyarrow = pytest.importorskip("pyarrow")
        table = pyarrow.table(self.columns())
        self.same(kf.Log.from_frame(table))

        class Stream:
            def __arrow_c_stream__(self, requested_schema: object = None) -> object:
                return table.__arrow_c_stream__(requested_schema)

        self.same(kf.Log.from_frame(Stream()))
        self.same(kf.Log.from_frame(self.columns()))
        with pytest.raises(kf.LogError, match="expected a table of pandas, polars or pyarrow, found int"):
            kf.Log.from_frame(3)
        with pytest.raises(kf.LogError, match="there is no column of numbers"):
            kf.Log.from_frame({"name": np.array(["a", "b"])})


def test_datetimes_are_stamps() -> None:
    start = np.datetime64(datetime.datetime(2026, 1, 1), "ns")
    made = log(rate=None, time=start + (T * 1e9).astype("m8[ns]"))
    assert made.rate == pytest.approx(100.0, rel=1e-6)


def test_logs_that_are_read_differently_do_not_mix(files: Path) -> None:
    first, second = kf.read_log(files / "log.npy"), kf.read_log(files / "log.npy", columns="gyro_x")
    with pytest.raises(kf.LogError, match="read in different ways"):
        kf.identify([first, second])
    with pytest.raises(kf.KfdesignError, match="the same samples as"):
        kf.identify([log(), log()])
