"""Logs: of a file in any format that the command reads, of arrays, of tables."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from . import _native
from ._call import Call, StrPath, existing, suggesting, text_of
from .errors import LogError

if TYPE_CHECKING:
    import pandas
    import polars

    from .results import Info

__all__ = ["Check", "Finding", "Log", "read_log"]

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Finding:
    """Something that is unusual in a log."""

    kind: str
    message: str
    serious: bool
    axis: str | None = None

    def __str__(self) -> str:
        return f"{'warning' if self.serious else 'note'}: {self.message}"


@dataclass(frozen=True, repr=False)
class Check:
    """What the log check says; it prints as words."""

    samples: int
    sample_rate_hz: float
    span_s: float
    findings: tuple[Finding, ...]
    #: What was done to the data before they were looked at.
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        head = f"{self.samples} samples at {self.sample_rate_hz:.6f} Hz, {self.span_s:.1f} s"
        said = [str(finding) for finding in self.findings] + [f"note: {note}" for note in self.notes]
        return "\n  ".join([head, *said]) if said else f"{head}, nothing unusual"


class Log:
    """A log of one sensor: some axes, uniform in time but for gaps.

    Made by :func:`read_log`, :meth:`Log.from_array` or :meth:`Log.from_frame`. Nothing is held in memory that is in
    a file until :attr:`data` is wanted.

    Attributes
    ----------
    name : str
        What messages call it.
    path : str or None
        The file, where it is one.
    """

    def __init__(
        self,
        path: str | None,
        columns: Mapping[str, Floats],
        reading: Mapping[str, Any],
        name: str,
        notes: tuple[str, ...] = (),
        whole: Floats | None = None,
    ) -> None:
        self.path = path
        self.name = name
        self._columns = dict(columns)
        self._reading = {key: value for key, value in reading.items() if value is not None}
        self._whole = whole
        self._notes = notes

        self._read: dict[str, Any] | None = None

    # no cached_property: a warning belongs to the line that called this package, with no other code between
    @property
    def _head(self) -> dict[str, Any]:
        if self._read is None:
            with Call() as call:
                self._read = call.read(call.log(self), self._reading, data=False)[0]
        return self._read

    def _opened(self) -> Log:
        """This log, of which is known that it can be read."""
        self._head  # noqa: B018
        return self

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the axes."""
        return tuple(axis for axis, _ in self._head["axes"])

    @property
    def unit(self) -> str:
        """Unit of the axes as the log has it."""
        return str(self._head["axes"][0][1])

    @property
    def quantity(self) -> str:
        """What the sensor measures."""
        return str(self._head["quantity"])

    @property
    def sha256(self) -> str:
        """Of the file; of an array, of its numbers."""
        return str(self._head["sha256"])

    @property
    def rate(self) -> float:
        """Sample rate, Hz."""
        return self.check.sample_rate_hz

    @property
    def check(self) -> Check:
        """What is unusual about the log."""
        found = self._head["check"]
        said = tuple(Finding(one["kind"], one["message"], one["serious"], one.get("axis")) for one in found["findings"])
        return Check(found["samples"], found["sample_rate_hz"], found["span_s"], said, self._notes)

    def _lent(self) -> tuple[list[str], int, int, Any]:
        """As the native module reads it: names, number of columns and rows, and what hands over rows as bytes."""
        columns = list(self._columns.values())

        def rows(column: int, start: int, end: int) -> bytes:
            return columns[column][start:end].tobytes()

        return list(self._columns), len(columns), len(columns[0]), rows

    @cached_property
    def _table(self) -> tuple[Floats, Floats]:
        with Call() as call:
            _, _, columns = call.read(call.log(self), self._reading, data=True)
        time = np.frombuffer(columns.pop())
        values = np.empty((len(columns), len(time)))
        for axis in range(len(values)):
            values[axis] = np.frombuffer(columns[axis])
            columns[axis] = b""
        return values.T, time

    @property
    def data(self) -> Floats:
        """Samples in SI units, n by axes; NaN where one is unusable.

        An array that was given as C-contiguous doubles in an SI unit is this one, not a copy of it.
        """
        return self._table[0] if self._whole is None else self._whole

    @property
    def time(self) -> Floats:
        """Seconds from the start of the log, n."""
        return self._table[1]

    @property
    def info(self) -> Info:
        """What is in the file: its topics, columns, units, rates and spans."""
        from .results import Info

        with Call() as call:
            return Info(call.run("info", {"log": call.log(self)}))

    def _columns_si(self) -> dict[str, Floats]:
        unit = si_unit(self.quantity)
        names = {f"{name} ({unit})": self.data[:, axis] for axis, name in enumerate(self.axes)}
        return {"time (s)": self.time, **names}

    def to_pandas(self) -> pandas.DataFrame:
        """Time and axes in SI units as a table of pandas."""
        import pandas

        return pandas.DataFrame(self._columns_si())

    def to_polars(self) -> polars.DataFrame:
        """Time and axes in SI units as a table of polars."""
        import polars

        return polars.DataFrame(self._columns_si())

    def __len__(self) -> int:
        return self.check.samples

    def __repr__(self) -> str:
        axes = ", ".join(self.axes)
        return f"<Log {self.name}: {self.check.samples} samples at {self.rate:g} Hz, {axes} in {self.unit}>"

    def __getstate__(self) -> dict[str, Any]:
        return {key: value for key, value in self.__dict__.items() if key != "_table"}

    @staticmethod
    def from_array(
        x: npt.ArrayLike,
        *,
        rate: float | None = None,
        unit: str | None = None,
        names: Sequence[str] | None = None,
        time: npt.ArrayLike | None = None,
        sensor: str | None = None,
        input: str | None = None,
        name: str = "array",
    ) -> Log:
        """A log of an array: samples in rows, axes in columns.

        Parameters
        ----------
        x : array_like
            n or n by axes. Integers and single precision are converted, which is noted; what is masked is missing.
        rate : float
            Sample rate in Hz, if there is no `time`.
        unit : str
            Of the values: ``"rad/s"``, ``"deg/s"``, ``"m/s^2"``, ``"1/131 deg/s"``. It is never guessed.
        names : sequence of str
            Of the axes, x, y, z if there are three; a unit may stand behind one as in a text log, ``"gx (deg/s)"``.
        time : array_like
            Stamps in seconds, or datetimes.
        sensor : {"gyro", "accel"}
            Where the unit does not say it.
        input : {"rate", "increments", "angle"}
            What the values are.
        name : str
            What messages call the log.

        Returns
        -------
        Log

        Raises
        ------
        LogError
            A unit is missing, the array has another shape, its numbers are none.

        Examples
        --------
        >>> import numpy as np, kfdesign as kf
        >>> x = np.random.default_rng(1).normal(0.0, 1e-3, (6000, 3))
        >>> kf.Log.from_array(x, rate=100, unit="rad/s")
        <Log array: 6000 samples at 100 Hz, x, y, z in rad/s>
        """
        if rate is not None and time is not None:
            raise LogError("rate and time: each says when a sample was taken; give one of them")
        notes: list[str] = []
        whole = _numbers(x, name, notes)
        if whole.ndim == 1:
            whole = whole[:, None]
        if whole.ndim != 2:
            raise LogError(f"{name}: an array of {whole.ndim} dimensions; expected samples in rows and axes in columns")
        count = whole.shape[1]
        if whole.size == 0:
            raise LogError(f"{name}: the array is empty")
        if names is None:
            names = ["x", "y", "z"][:count] if count <= 3 else [f"axis_{i + 1}" for i in range(count)]
        if len(names) != count:
            raise LogError(f"{name}: {len(names)} names for {count} columns")
        if len(set(names)) != count:
            raise LogError(f"{name}: two columns have the same name; names are {', '.join(names)}")
        columns = {own: whole[:, axis] for axis, own in enumerate(names)}
        if time is not None:
            columns["time (s)"] = _stamps(time, name, notes)
            if len(columns["time (s)"]) != len(whole):
                raise LogError(f"{name}: {len(columns['time (s)'])} stamps for {len(whole)} samples")
        reading = {
            "columns": list(names),
            "unit": unit,
            "rate": rate,
            "sensor": sensor,
            "input": input,
            "time": None if time is None else "time (s)",
        }
        is_si = unit is not None and input in (None, "rate") and _is_one(unit) and bool(np.isfinite(whole).all())
        return Log(None, columns, reading, name, tuple(notes), whole if is_si else None)._opened()

    @staticmethod
    def from_frame(
        frame: Any,
        *,
        unit: str | None = None,
        time: str | None = None,
        columns: Sequence[str] | str | None = None,
        rate: float | None = None,
        sensor: str | None = None,
        input: str | None = None,
        name: str = "table",
    ) -> Log:
        """A log of a table of pandas, polars or pyarrow, or of anything that hands itself over as an Arrow stream.

        Parameters
        ----------
        frame : table
            Columns are found by their names and the units in them, as in a text log.
        unit : str
            Of the columns, if their names do not say it.
        time : str
            The column of time; of pandas an index of times is taken otherwise.
        columns : sequence of str
            The axes, if they are not found by name.
        rate : float
            Sample rate in Hz if there is no time; with one, it replaces the stamps.
        sensor : {"gyro", "accel"}
            Which, if there are both.
        input : {"rate", "increments", "angle"}
            What the values are.
        name : str
            What messages call the log.

        Returns
        -------
        Log

        Examples
        --------
        >>> import numpy as np, pandas as pd, kfdesign as kf
        >>> x = np.random.default_rng(1).normal(0.0, 0.1, 6000)
        >>> kf.Log.from_frame(pd.DataFrame({"t": np.arange(6000) / 100, "gyro_x (deg/s)": x}), time="t:s")
        <Log table: 6000 samples at 100 Hz, gyro_x in deg/s>
        """
        notes: list[str] = []
        found = _columns(frame, name)
        names = [own for own, _ in found]
        twice = sorted({own for own in names if names.count(own) > 1})
        if twice:
            raise LogError(f"{name}: two columns are called '{twice[0]}'; rename one")
        wanted = [columns] if isinstance(columns, str) else columns
        given: dict[str, Floats] = {}
        for own, values in found:
            array = np.asarray(values)
            # times of a zone are objects to NumPy
            if array.dtype.kind == "M" or getattr(getattr(values, "dtype", None), "tz", None) is not None:
                given[own if own != _INDEX else "time (s)"] = _stamps(values, name, notes)
            elif array.dtype.kind in "iuf":
                given[own] = _numbers(array, f"{name}: column '{own}'", notes)
            elif wanted is not None and own in wanted:
                _numbers(array, f"{name}: column '{own}'", notes)
        if not given:
            raise LogError(f"{name}: there is no column of numbers")
        if time is None and rate is None and "time (s)" in given:
            time = "time (s)"
        reading = {
            "columns": None if wanted is None else list(wanted),
            "unit": unit,
            "time": time,
            "rate": rate,
            "sensor": sensor,
            "input": input,
        }
        return Log(None, given, reading, name, tuple(notes))._opened()


#: Under which the index of a table of pandas is handed over.
_INDEX = "\0index"


@suggesting
def read_log(
    path: StrPath,
    *,
    topic: str | None = None,
    columns: Sequence[str | int] | str | None = None,
    sensor: str | None = None,
    unit: str | None = None,
    rate: float | None = None,
    time: str | None = None,
    start: str | float | None = None,
    end: str | float | None = None,
    input: str | None = None,
) -> Log:
    """A log of a file: text, NumPy, MATLAB, HDF5, Parquet, ULog, ArduPilot, ROS bag, MCAP.

    Parameters
    ----------
    path : path
        The file; what it is, its content says.
    topic : str
        Which table of a file with several.
    columns : sequence of str
        Names or numbers from 1 of the axes, if they are not found by name.
    sensor : {"gyro", "accel"}
        Which, if the log holds both.
    unit : str
        Of the columns if the header does not say it; it is never guessed.
    rate : float
        Sample rate in Hz if there is no time column; with one, it replaces the stamps.
    time : str
        The column of time, with its unit if the header does not say it, ``"t:ms"``; ``"none"``: ignore such columns.
    start, end : str or float
        From and to when, from the start of the log: seconds, or with a unit, ``"10min"``.
    input : {"rate", "increments", "angle"}
        What the values are.

    Returns
    -------
    Log

    Raises
    ------
    FileNotFoundError
        There is no such file.
    LogError
        It cannot be read, or what is missing is not said.

    Examples
    --------
    >>> import kfdesign as kf
    >>> log = kf.simulate("data/params.json", duration="10min").log
    >>> log.axes
    ('gyro_x', 'gyro_y', 'gyro_z')
    """
    if isinstance(columns, str):
        columns = columns.split(",")
    reading = {
        "topic": topic,
        "columns": None if columns is None else [str(column) for column in columns],
        "sensor": sensor,
        "unit": unit,
        "rate": rate,
        "time": time,
        "start": None if start is None else text_of(start),
        "end": None if end is None else text_of(end),
        "input": input,
    }
    found = existing(path)
    return Log(found, {}, reading, os.path.basename(found))._opened()


def si_unit(quantity: str) -> str:
    """Of what a sensor measures."""
    return "rad/s" if quantity == "angular-rate" else "m/s^2"


def _is_one(unit: str) -> bool:
    try:
        return _native.unit(unit)[0] == 1.0
    except ValueError:
        return False


def _numbers(x: npt.ArrayLike, name: str, notes: list[str]) -> Floats:
    """Doubles in the order of this machine, without a copy where they are that already."""
    if isinstance(x, np.ma.MaskedArray):
        masked = np.ma.getmaskarray(x)
        notes.append(f"{int(masked.sum())} masked values are missing")
        x = np.where(masked, np.nan, np.asarray(x.data))
    array = np.asarray(x)
    kind = array.dtype.kind
    if kind == "c":
        raise LogError(f"{name}: complex numbers; expected real ones, one column for each axis")
    if kind in "mM":
        raise LogError(f"{name}: {array.dtype} is time; give it as `time`, and the samples as numbers")
    if kind not in "iuf":
        raise LogError(f"{name}: values of the kind '{array.dtype}'; expected numbers")
    if not array.dtype.isnative:
        notes.append("the other byte order was converted")
    elif array.dtype != np.float64:
        notes.append(f"{array.dtype.name} was converted to float64")
    return np.require(array, np.float64, "A")


def _stamps(time: Any, name: str, notes: list[str]) -> Floats:
    """Seconds; of datetimes from the first one on."""
    if getattr(getattr(time, "dtype", None), "tz", None) is not None:
        notes.append(f"times of the zone {time.dtype.tz} are taken as UTC")
        time = time.dt.tz_convert(None) if hasattr(time, "dt") else time.tz_convert(None)
    array = np.asarray(time)
    if array.dtype.kind == "M":
        if not len(array):
            raise LogError(f"{name}: the array is empty")
        whole = array.astype("datetime64[ns]")
        seconds: Floats = (whole - whole[0]) / np.timedelta64(1, "s")
        return seconds
    return _numbers(array, f"{name}: time", notes).reshape(-1)


def _columns(frame: Any, name: str) -> list[tuple[str, Any]]:
    """Names and values of the columns, whosever table it is."""
    if hasattr(frame, "iloc") and hasattr(frame, "index"):
        found = [(str(own), _plain(frame.iloc[:, at])) for at, own in enumerate(frame.columns)]
        if type(frame.index).__name__ == "DatetimeIndex":
            found.insert(0, (_INDEX, frame.index))
        return found
    if hasattr(frame, "get_columns") and hasattr(frame, "columns"):
        return [(str(own.name), own.to_numpy()) for own in frame.get_columns()]
    if hasattr(frame, "column_names") and hasattr(frame, "column"):
        own = [(str(column), frame.column(at)) for at, column in enumerate(frame.column_names)]
        return [
            (column, values.to_numpy(zero_copy_only=False) if _is_array(values) else values.to_numpy())
            for column, values in own
        ]
    if isinstance(frame, Mapping):
        return [(str(own), values) for own, values in frame.items()]
    if hasattr(frame, "__arrow_c_stream__"):
        if _can_import("polars"):
            import polars

            return _columns(polars.DataFrame(frame), name)
        if _can_import("pyarrow"):
            import pyarrow

            return _columns(pyarrow.table(frame), name)
        raise LogError(f"{name}: an Arrow stream needs polars or pyarrow to be read")
    raise LogError(f"{name}: expected a table of pandas, polars or pyarrow, found {type(frame).__name__}")


def _plain(values: Any) -> Any:
    """A column of pandas; where numbers have a missing value of pandas' own, NumPy would see objects."""
    own = not isinstance(values.dtype, np.dtype) and getattr(values.dtype, "kind", None) in ("i", "u", "f")
    return values.to_numpy(float, na_value=np.nan) if own else values


def _is_array(values: Any) -> bool:
    return type(values).__name__ != "ChunkedArray"


def _can_import(module: str) -> bool:
    from importlib.util import find_spec

    return find_spec(module) is not None
