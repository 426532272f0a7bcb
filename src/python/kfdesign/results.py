"""Results: each is a document of the command, with the numbers a program wants by their names."""

from __future__ import annotations

import html
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

import numpy as np
import numpy.typing as npt

from . import _native
from ._call import Kept, Source, StrPath, writable
from .errors import KfdesignError, ParamsError
from .log import Log
from .params import AxisParams, Params, place_of
from .table import Measured, Summary, Table

if TYPE_CHECKING:
    import pandas
    import polars
    from matplotlib.axes import Axes

__all__ = [
    "Allan",
    "Comparison",
    "Flight",
    "Identified",
    "IdentifiedAxis",
    "Inflation",
    "Info",
    "LogPlan",
    "MonteCarlo",
    "Nees",
    "Ranking",
    "Replay",
    "Result",
    "Simulation",
    "Trim",
]

Floats = npt.NDArray[np.float64]
Self = TypeVar("Self", bound="Result")

#: Texts that go with a result into a pickle.
_TEXTS = ("brief", "full", "page", "figures", "junit")


class Result:
    """What a command makes, as its document.

    It is not changed once it is there; it goes through pickle and deepcopy, and equals another of the same document.
    """

    #: As the document calls itself, without its version.
    _format: ClassVar[str] = ""
    _version: ClassVar[int] = 1

    def __init__(self, source: Source) -> None:
        self._source = source
        self._check_format()

    def _check_format(self) -> None:
        found = self.document.get("format") if isinstance(self.document, dict) else None
        if not self._format or found is None:
            return
        name, _, version = str(found).partition("/")
        if name not in self._format.split("|"):
            raise KfdesignError(f"this is a document '{found}', expected {self._format.replace('|', ' or ')}")
        if not version.isdigit() or int(version) > self._version:
            raise KfdesignError(
                f"the document is '{found}', and this version reads {name} up to {self._version}; "
                "a newer kfdesign reads it: pip install --upgrade kfdesign"
            )

    @cached_property
    def document(self) -> dict[str, Any]:
        """The document; treat it as read-only."""
        found: dict[str, Any] = json.loads(self._source.json)
        return found

    @property
    def notes(self) -> tuple[str, ...]:
        """What was noted on the way."""
        return self._source.notes

    def to_json(self) -> str:
        """The document, byte for byte what the command prints with ``--json``."""
        return self._source.json

    def to_dict(self) -> dict[str, Any]:
        """The document as a dict of its own."""
        found: dict[str, Any] = json.loads(self._source.json)
        return found

    @classmethod
    def from_json(cls: type[Self], text: str) -> Self:
        """The result of a document; its numbers are there, its texts and pages are not."""
        try:
            json.loads(text)
        except ValueError as error:
            raise KfdesignError(f"not valid JSON: {error}") from None
        return cls(Kept(text))

    def _shown(self, name: str, what: str) -> str:
        text = self._source.shown(name)
        if text is None:
            raise KfdesignError(f"{type(self).__name__}: a result of this kind, or read from JSON, has no {what}")
        return text

    def summary(self, *, full: bool = False) -> Summary:
        """What the command says.

        Parameters
        ----------
        full : bool
            Every table and note, not only the answer.

        Returns
        -------
        str
            It prints as on a terminal, also as the last line of a cell.
        """
        return Summary(self._shown("full" if full else "brief", "summary"))

    def report(self, path: StrPath) -> None:
        """Write the page that the command writes with ``--report``: tables and figures in one file.

        Parameters
        ----------
        path : path
            It appears whole or not at all.
        """
        _native.write([(writable(path), self._shown("page", "page"))])

    def figures(self) -> str:
        """The figures of the command as one SVG."""
        return self._shown("figures", "figures of its own; see report() and plot()")

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw with matplotlib.

        Parameters
        ----------
        ax : matplotlib.axes.Axes
            Where; None: a new figure.

        Returns
        -------
        matplotlib.axes.Axes
        """
        raise KfdesignError(f"{type(self).__name__}: there is nothing to plot")

    @property
    def verdict(self) -> str | None:
        """ "consistent", "inconsistent" or "inconclusive"; None: nothing is judged here."""
        return self.document.get("verdict")

    @property
    def consistent(self) -> bool:
        """Whether the verdict is "consistent"."""
        return self.verdict == "consistent"

    @property
    def meaning(self) -> str:
        """The verdict in words."""
        return str(self.document.get("meaning", ""))

    @property
    def tests(self) -> Table:
        """The tests behind the verdict."""
        return Table.of(self.document.get("tests", []))

    def __repr__(self) -> str:
        about = self.meaning or self._about()
        said = f": {self.verdict}, {about}" if self.verdict else f" {about}"
        return f"<{type(self).__name__}{said.rstrip()}>"

    def _about(self) -> str:
        return ""

    def _repr_html_(self) -> str:
        colour = {"consistent": "#2a7d3f", "inconsistent": "#b3261e"}.get(self.verdict or "", "#8a6d00")
        badge = (
            f'<b style="color:#fff;background:{colour};padding:.1em .5em;border-radius:.3em">{self.verdict}</b> '
            if self.verdict
            else ""
        )
        brief, figures = self._source.shown("brief"), self._source.shown("figures")
        text = f"<pre>{html.escape(brief or repr(self))}</pre>"
        return f"<div>{badge}{text}{figures or ''}</div>"

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other) and isinstance(other, Result) and self.to_json() == other.to_json()

    def __hash__(self) -> int:
        return hash(self.to_json())

    def _kept(self) -> Kept:
        texts = {name: self._source.shown(name) for name in _TEXTS}
        return Kept(self._source.json, self._source.file, self._source.notes, texts)

    def __getstate__(self) -> dict[str, Any]:
        own = {key: value for key, value in self.__dict__.items() if key not in ("document", "_source")}
        return {**own, "_source": self._kept()}


@dataclass(frozen=True)
class Curve:
    """Deviations of one axis in its unit."""

    name: str
    unit: str
    tau: Floats
    deviation: Floats
    lower: Floats
    upper: Floats
    edf: Floats
    model: Floats | None = None

    @staticmethod
    def of(name: str, document: Mapping[str, Any]) -> Curve:
        columns = [np.array(document[key], float) for key in ("tau_s", "deviation", "lower", "upper", "edf")]
        model = document.get("model")
        own = np.array(model, float) if isinstance(model, list) else None
        return Curve(name, document["unit"], columns[0], columns[1], columns[2], columns[3], columns[4], own)


class Allan(Result):
    """Deviations with 95 % intervals."""

    _format = "kfdesign-allan"

    @property
    def axes(self) -> tuple[Curve, ...]:
        """The curve of every axis."""
        return tuple(Curve.of(axis["name"], axis) for axis in self.document["axes"])

    def __getitem__(self, name: str) -> Curve:
        axes = self.axes
        at = place_of([axis.name for axis in axes], name)
        if at < 0:
            raise KeyError(f"there is no axis '{name}'; there are {', '.join(axis.name for axis in axes)}")
        return axes[at]

    @property
    def table(self) -> Table:
        """All curves, one row for each axis and averaging time."""
        rows = []
        for axis in self.document["axes"]:
            keys = [key for key, value in axis.items() if isinstance(value, list)]
            rows += [dict(zip(["axis", *keys], (axis["name"], *values))) for values in zip(*(axis[k] for k in keys))]
        return Table.of(rows)

    def to_pandas(self) -> pandas.DataFrame:
        """`table` of pandas."""
        return self.table.to_pandas()

    def to_polars(self) -> polars.DataFrame:
        """`table` of polars."""
        return self.table.to_polars()

    def plot(self, ax: Axes | None = None) -> Axes:
        from . import plot

        return plot.curves(self.axes, ax)

    def _about(self) -> str:
        return f"{self.document['deviation']} of {', '.join(axis.name for axis in self.axes)}"


class IdentifiedAxis:
    """What was found of one axis, under the names that statsmodels has."""

    def __init__(self, name: str, params: AxisParams, document: Mapping[str, Any], summary: str) -> None:
        self.name = name
        self._params = params
        self.document = document
        self._summary = summary

    def _values(self) -> dict[str, Measured]:
        found: dict[str, Measured] = {}
        for kind, terms in self._params.terms.items():
            for at, term in enumerate(terms):
                place = kind if at == 0 else f"{kind}[{at}]"
                found.update({f"{place}.{key}": one for key, one in term.items()})
        return found

    @property
    def params(self) -> dict[str, float]:
        """Estimates in the units of the document."""
        return {name: one.value for name, one in self._values().items()}

    @property
    def bse(self) -> dict[str, float]:
        """Standard errors of those whose bound is known."""
        own = {one["parameter"]: one["std_dev_percent"] for one in self.document.get("precision", [])}
        values = self._values()
        return {name: values[name].value * own[name] / 100.0 for name in values if own.get(name) is not None}

    def conf_int(self, alpha: float = 0.05) -> dict[str, tuple[float | None, float | None]]:
        """95 % intervals of the profile or of the bound.

        Parameters
        ----------
        alpha : float
            Only 0.05: the intervals are not symmetric, and another level is not in the document.
        """
        if alpha != 0.05:
            raise KfdesignError(f"alpha {alpha}: the document has 95 % intervals (alpha 0.05), and no others")
        return {name: one.interval for name, one in self._values().items() if one.interval is not None}

    @property
    def llf(self) -> float:
        """ln L of the samples in SI units."""
        found = self.document.get("exact_log_likelihood")
        if found is None:
            raise KfdesignError(f"{self.name}: only the method 'likelihood' has a log-likelihood")
        return float(found)

    @property
    def nobs(self) -> int:
        """Samples behind the parameters."""
        return int(self.document["samples"])

    @property
    def bic(self) -> float:
        """k ln n − 2 ln L, of the chosen model."""
        chosen = [one for one in self.document["candidates"] if one.get("chosen")]
        count = chosen[0]["parameters"] if chosen else len(self.params)
        return float(count * np.log(self.nobs) - 2.0 * self.llf)

    def summary(self) -> Summary:
        """What the command says, of all axes."""
        return Summary(self._summary)

    def __repr__(self) -> str:
        return f"<IdentifiedAxis {self._params!r}>"


class Identified(Result):
    """Noise parameters with intervals, and how they came about."""

    _format = "kfdesign-identify"

    def _document_text(self) -> str:
        return self.params.to_json()

    @property
    def params(self) -> Params:
        """The parameters: params.json."""
        text = self._source.file
        return Params(text if text is not None else json.dumps(self.document["params"], indent=2) + "\n")

    def save(self, path: StrPath) -> None:
        """Write params.json, as the command does with ``-o``."""
        self.params.save(path)

    def axis(self, name: str) -> IdentifiedAxis:
        """One axis under the names of statsmodels: ``bse``, ``conf_int()``, ``llf``, ``bic``."""
        own = self.params.axis(name)
        document = next(one for one in self.document["axes"] if one["name"] == own.name)
        return IdentifiedAxis(own.name, own, document, self._source.shown("full") or "")

    def __getattr__(self, name: str) -> AxisParams:
        if name.startswith("_") or "_source" not in self.__dict__:
            raise AttributeError(name)
        return self.params.__getattr__(name)

    @property
    def candidates(self) -> Table:
        """Models that were tried, the chosen ones too."""
        rows = [{"axis": axis["name"], **one} for axis in self.document["axes"] for one in axis["candidates"]]
        return Table.of(rows)

    @property
    def not_identified(self) -> Table:
        """What the log does not tell, and how long a log would."""
        return self.params.not_identified

    @property
    def curves(self) -> tuple[Curve, ...]:
        """The Allan curve of every axis, with that of the model."""
        return tuple(Curve.of(axis["name"], axis["allan"]) for axis in self.document["axes"])

    @property
    def table(self) -> Table:
        """Every parameter with its interval."""
        rows = []
        for axis in self.params.axes:
            for name, one in IdentifiedAxis(axis.name, axis, {}, "")._values().items():
                lower, upper = one.interval or (None, None)
                row = {"axis": axis.name, "parameter": name, "value": one.value, "lower": lower, "upper": upper}
                rows.append({**row, "unit": one.unit})
        return Table.of(rows)

    def to_pandas(self) -> pandas.DataFrame:
        """`table` of pandas."""
        return self.table.to_pandas()

    def to_polars(self) -> polars.DataFrame:
        """`table` of polars."""
        return self.table.to_polars()

    def plot(self, ax: Axes | None = None) -> Axes:
        from . import plot

        return plot.curves(self.curves, ax)

    def _about(self) -> str:
        return ", ".join(f"{axis.name} {' + '.join(axis.terms) or 'nothing'}" for axis in self.params.axes)


class LogPlan(Result):
    """How long to record."""

    _format = "kfdesign-plan"

    @property
    def duration(self) -> Measured | None:
        """Of the axis that needs most; None: no log of up to ten years is enough."""
        found = [axis["duration_s"] for axis in self.document["axes"]]
        return None if any(one is None for one in found) else Measured(max(found), "s")

    @property
    def table(self) -> Table:
        """Every axis at every rate."""
        rows = [{"axis": axis["name"], **one} for axis in self.document["axes"] for one in axis["rates"]]
        return Table.of(rows)

    def _about(self) -> str:
        return f"{self.document['parameter']} to {self.document['precision']:g}: {self.duration!r}"


class Comparison(Result):
    """A noise model held against a log."""

    _format = "kfdesign-compare"

    @property
    def parameters(self) -> Table:
        """Every number beside the log's own, where that was asked for."""
        return Table.of(self.document["parameters"])

    def plot(self, ax: Axes | None = None) -> Axes:
        from . import plot

        return plot.comparison(self.document["axes"], ax)


class Inflation(Result):
    """How many times louder than on the bench."""

    _format = "kfdesign-inflate"

    def _document_text(self) -> str:
        return self.params.to_json()

    @property
    def params(self) -> Params:
        """The parameters with their white noise multiplied by the factors."""
        if self._source.file is None:
            raise ParamsError("read from JSON, which has the factors and not the parameters")
        return Params(self._source.file)

    @property
    def factors(self) -> dict[str, Measured]:
        """The factor of every axis with its interval."""
        axes = self.document["axes"]
        return {one["name"]: Measured(one["factor"], "1", (one["interval"][0], one["interval"][1])) for one in axes}

    def save(self, path: StrPath) -> None:
        """Write the parameters."""
        self.params.save(path)

    def _about(self) -> str:
        return ", ".join(f"{name} {one.value:.3g}" for name, one in self.factors.items())


class Info(Result):
    """What is in a file."""

    _format = "kfdesign-info"

    @property
    def topics(self) -> Table:
        """Topics with their rows, spans and rates."""
        return Table.of(self.document["topics"])

    def _about(self) -> str:
        return f"{self.document['file']}, {len(self.document['topics'])} topics"


class Ranking(Result):
    """Designs ranked on logs."""

    _format = "kfdesign-ranking"


class _Recorded(Result):
    """A result with a table of numbers beside its document."""

    def __init__(self, source: Source, columns: Mapping[str, Floats] | None = None) -> None:
        self._columns = dict(columns or {})
        super().__init__(source)

    @property
    def columns(self) -> dict[str, Floats]:
        """The columns by their names, which carry the units."""
        return dict(self._columns)

    def __getitem__(self, name: str) -> Floats:
        if name in self._columns:
            return self._columns[name]
        short = [own for own in self._columns if own.split(" (")[0] == name]
        if len(short) != 1:
            raise KeyError(f"there is no column '{name}'; there are {', '.join(self._columns)}")
        return self._columns[short[0]]

    def to_pandas(self) -> pandas.DataFrame:
        """The columns as a table of pandas."""
        return Table(self._columns).to_pandas()  # type: ignore[arg-type]

    def to_polars(self) -> polars.DataFrame:
        """The columns as a table of polars."""
        return Table(self._columns).to_polars()  # type: ignore[arg-type]


class Simulation(_Recorded):
    """A simulated log with its truth."""

    _format = "kfdesign-simulation"

    @cached_property
    def log(self) -> Log:
        """The log."""
        path = self.document["log"]
        if os.path.exists(path):
            return Log(path, {}, {}, os.path.basename(path))
        return Log(None, self._columns, {}, "simulation")

    @property
    def truth(self) -> dict[str, Floats]:
        """The columns that no sensor shows."""
        return {name: one for name, one in self._columns.items() if name.startswith("truth_")}

    def _about(self) -> str:
        return f"{self.document['samples']} samples at {self.document['sample_rate_hz']:g} Hz"


class Flight(_Recorded):
    """An airplane over time: truth, and what its sensors show."""

    _format = "kfdesign-fly"

    @cached_property
    def log(self) -> Log:
        """The log of the first run, whose sensor is the gyro."""
        return Log(None, self._columns, {}, "flight")

    @property
    def truth(self) -> dict[str, Floats]:
        """The columns that no sensor shows."""
        return {name: one for name, one in self._columns.items() if name.startswith("truth_")}

    def plot(self, ax: Axes | None = None) -> Axes:
        from . import plot

        return plot.lines(self._columns, ["phi", "theta", "psi"], ax)

    def _about(self) -> str:
        return f"{self.document['airplane']}, {self.document['duration_s']:g} s"


class Loop(Result):
    """The feeds between sensors and gains, each in the closed loop, and which criteria they keep."""

    _format = "kfdesign-loop"

    @property
    def best(self) -> str | None:
        """Of the feeds that keep every criterion, the one with the least surface rate."""
        found = self.document["best"]
        return None if found is None else str(found)

    @property
    def criteria(self) -> Table:
        """One row per feed, limit and surface or axis."""
        return Table.of(self.document["criteria"])

    @property
    def warnings(self) -> tuple[str, ...]:
        """What would be unsafe although a margin looks good."""
        return tuple(self.document["warnings"])

    def modes(self, feed: str, half: str = "pitch") -> Table:
        """Motions of the closed loop of a feed, "pitch" or "roll_yaw"; those of filters among them."""
        names = [one["name"] for one in self.document["feeds"]]
        if feed not in names:
            raise KfdesignError(f"there is no feed '{feed}'; there are {', '.join(names)}")
        found = self.document["feeds"][names.index(feed)][half]["modes"]
        return Table.of([{**one, "eigenvalue": complex(*one["eigenvalue"])} for one in found])

    def plot(self, ax: Axes | None = None) -> Axes:
        from . import plot

        found = [mode for feed in self.document["feeds"] for mode in feed["pitch"]["modes"]]
        return plot.poles([complex(*mode["eigenvalue"]) for mode in found], ax)

    def _about(self) -> str:
        return f"{self.document['airplane']}, {len(self.document['feeds'])} feeds"


class Trim(Result):
    """Steady flight, and the linear models about it."""

    _format = "kfdesign-linear"

    def _matrix(self, model: str, name: str) -> Floats:
        models = self.document["models"]
        if model not in models:
            raise KfdesignError(f"there is no model '{model}'; there are {', '.join(models)}")
        return np.array(models[model][name], float)

    def A(self, model: str = "full") -> Floats:
        """dx/dt = A x + B u + E w of a model: "longitudinal", "lateral", "full"."""
        return self._matrix(model, "A")

    def B(self, model: str = "full") -> Floats:
        """Of the controls."""
        return self._matrix(model, "B")

    def E(self, model: str = "full") -> Floats:
        """Of the gusts."""
        return self._matrix(model, "E")

    def states(self, model: str = "full") -> tuple[str, ...]:
        """In the order of x."""
        return tuple(one["name"] for one in self.document["models"][model]["states"])

    def inputs(self, model: str = "full") -> tuple[str, ...]:
        """In the order of u."""
        return tuple(one["name"] for one in self.document["models"][model]["inputs"])

    @property
    def trim(self) -> dict[str, Any]:
        """The steady flight, SI."""
        return dict(self.document["trim"])

    @property
    def modes(self) -> Table:
        """Frequency and damping of the modes."""
        rows = [{**one, "eigenvalue": complex(*one["eigenvalue"])} for one in self.document["modes"]]
        return Table.of(rows)

    def to_control(self, model: str = "full") -> Any:
        """A StateSpace of python-control, whose outputs are the states."""
        from . import convert

        return convert.model_to_control(self, model)

    def plot(self, ax: Axes | None = None) -> Axes:
        from . import plot

        return plot.poles([complex(*one["eigenvalue"]) for one in self.document["modes"]], ax)

    def _about(self) -> str:
        trim = self.document["trim"]
        return f"{self.document['airplane']} at {trim['airspeed']:g} m/s, {trim['altitude']:g} m"


class Replay(_Recorded):
    """A log through a filter, with a verdict."""

    _format = "kfdesign-replay|kfdesign-attitude-replay"

    @property
    def estimates(self) -> dict[str, Floats]:
        """Time, states and their sigmas, SI; each by its name with its unit."""
        return {name: one for name, one in self._columns.items() if not _is_innovation(name)}

    @property
    def innovations(self) -> dict[str, Floats]:
        """Innovations, their sigmas and NIS, where they were asked for."""
        return {name: one for name, one in self._columns.items() if _is_innovation(name)}

    def plot(self, ax: Axes | None = None) -> Axes:
        from . import plot

        axes = list(dict.fromkeys(axis["axis"] for axis in self.document["axes"]))
        return plot.estimates(self.estimates, axes, ax)


def _is_innovation(name: str) -> bool:
    return name.endswith("_nis") or "_innovation" in name


class MonteCarlo(Result):
    """A design against simulated truth."""

    _format = "kfdesign-montecarlo"

    @property
    def false_alarm(self) -> Measured | None:
        """Probability that a true filter is called inconsistent by this gate."""
        found = self.document.get("false_alarm_rate")
        return None if found is None else Measured.of({"unit": "1", **found})

    @property
    def detects(self) -> Table:
        """What the gate sees with 90 % probability."""
        rows = []
        for one in self.document.get("detects", []):
            sizes = {key: (one.get(key) or {}).get("size") for key in ("too_large", "too_small")}
            rows.append({"axis": one["axis"], "parameter": one["parameter"], "measure": one["measure"], **sizes})
        return Table.of(rows)

    def junit(self, path: StrPath) -> None:
        """Write the tests as JUnit XML."""
        _native.write([(writable(path), self._shown("junit", "test report"))])

    def save(self, path: StrPath) -> None:
        """Write the document, which is also a shard for :func:`merge`."""
        _native.write([(writable(path), self.to_json())])

    def plot(self, ax: Axes | None = None) -> Axes:
        from . import plot

        return plot.nees(self.document["axes"], ax)


@dataclass(frozen=True, eq=False)
class Nees:
    """Normalised estimation errors squared of some runs, and whether their mean is what the covariance says."""

    #: Runs by epochs.
    values: Floats
    #: Mean over runs at each epoch; its expectation is the number of states.
    mean: Floats
    states: int
    #: 95 % bounds of the mean of one epoch when the covariance is true.
    lower: float
    upper: float

    @property
    def share_inside(self) -> float:
        """Share of epochs whose mean is within the bounds; 0.95 is expected."""
        return float(np.mean((self.mean >= self.lower) & (self.mean <= self.upper)))


def columns_of(path: str) -> dict[str, Floats]:
    """The columns of a table as the command writes them."""
    table = np.load(path)
    return {name: np.ascontiguousarray(table[name]) for name in table.dtype.names}
