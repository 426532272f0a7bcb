"""Results: each is a document of the command, with the numbers a program wants by their names."""

from __future__ import annotations

import html
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

import numpy as np
import numpy.typing as npt

from . import _native
from ._call import Call, Kept, Source, StrPath, writable
from .errors import DesignError, KfdesignError, ParamsError
from .log import Log

if TYPE_CHECKING:
    import pandas
    import polars
    from matplotlib.axes import Axes

__all__ = [
    "Allan",
    "AxisFilter",
    "AxisParams",
    "Budget",
    "Comparison",
    "Design",
    "Flight",
    "Identified",
    "IdentifiedAxis",
    "Inflation",
    "Info",
    "LogPlan",
    "Measured",
    "MonteCarlo",
    "Nees",
    "Params",
    "Ranking",
    "Replay",
    "Result",
    "Simulation",
    "Table",
    "Term",
    "Trim",
]

Floats = npt.NDArray[np.float64]
Self = TypeVar("Self", bound="Result")

#: Texts that go with a result into a pickle.
_TEXTS = ("brief", "full", "page", "figures", "junit")


@dataclass(frozen=True, repr=False)
class Measured:
    """A value with its unit and its 95 % interval."""

    value: float
    unit: str
    interval: tuple[float, float] | None = None

    @property
    def si(self) -> float:
        """The value in SI units and rad."""
        return self.value * _native.unit(self.unit)[0]

    def __float__(self) -> float:
        return self.value

    def __repr__(self) -> str:
        inside = "" if self.interval is None else f" [{self.interval[0]:.4g} … {self.interval[1]:.4g}]"
        return f"{self.value:.4g} {self.unit}{inside}"

    @staticmethod
    def of(document: Mapping[str, Any]) -> Measured:
        inside = document.get("interval")
        return Measured(document["value"], document["unit"], None if inside is None else (inside[0], inside[1]))


@dataclass(frozen=True, repr=False)
class Table:
    """Columns of one length."""

    columns: Mapping[str, Sequence[Any]]

    @staticmethod
    def of(rows: Sequence[Mapping[str, Any]]) -> Table:
        """Rows by their scalar values; what is a list or a mapping stays in the document."""
        names: dict[str, None] = {}
        for row in rows:
            names.update(dict.fromkeys(key for key, value in row.items() if not isinstance(value, (list, dict))))
        return Table({name: [row.get(name) for row in rows] for name in names})

    def __len__(self) -> int:
        return len(next(iter(self.columns.values()), ()))

    def __getitem__(self, column: str) -> Sequence[Any]:
        return self.columns[column]

    def rows(self) -> Iterator[dict[str, Any]]:
        """One mapping for each row."""
        for values in zip(*self.columns.values()):
            yield dict(zip(self.columns, values))

    def _cells(self) -> list[list[str]]:
        shown = lambda value: "" if value is None else f"{value:.5g}" if isinstance(value, float) else str(value)  # noqa: E731
        return [list(self.columns), *([shown(value) for value in values] for values in zip(*self.columns.values()))]

    def __repr__(self) -> str:
        cells = self._cells()
        widths = [max(map(len, column)) for column in zip(*cells)]
        return "\n".join("  ".join(cell.ljust(w) for cell, w in zip(row, widths)).rstrip() for row in cells)

    def _repr_html_(self) -> str:
        head, *rows = ["".join(f"<td>{html.escape(cell)}</td>" for cell in row) for row in self._cells()]
        head = head.replace("td>", "th>")
        return f"<table><tr>{head}</tr>{''.join(f'<tr>{row}</tr>' for row in rows)}</table>"

    def to_pandas(self) -> pandas.DataFrame:
        """As a table of pandas."""
        import pandas

        return pandas.DataFrame(dict(self.columns))

    def to_polars(self) -> polars.DataFrame:
        """As a table of polars."""
        import polars

        return polars.DataFrame(dict(self.columns), strict=False)


class Budget(Table):
    """Where the error of one output comes from."""

    def plot(self, ax: Axes | None = None) -> Axes:
        """Shares as bars; returns the Axes."""
        from . import plot

        return plot.budget(self, ax)


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
        """"consistent", "inconsistent" or "inconclusive"; None: nothing is judged here."""
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
        verdict = f": {self.verdict}, {self.meaning}" if self.verdict else f" {self._about()}"
        return f"<{type(self).__name__}{verdict.rstrip()}>"

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


class Summary(str):
    """A text that a notebook shows as it is."""

    def __repr__(self) -> str:
        return str(self)


def _axis(names: Sequence[str], wanted: str) -> int:
    """The axis of this name, or whose last word it is; -1: none."""
    if wanted in names:
        return names.index(wanted)
    short = [at for at, name in enumerate(names) if name.replace(" ", "_").rsplit("_", 1)[-1] == wanted]
    return short[0] if len(short) == 1 else -1


class Term(Mapping[str, Measured]):
    """A noise term: its coefficients by their names, also as attributes."""

    def __init__(self, name: str, document: Mapping[str, Any]) -> None:
        self._name = name
        self._own = {key: Measured.of(one) for key, one in document.items() if isinstance(one, dict) and "value" in one}

    def __getitem__(self, key: str) -> Measured:
        return self._own[key]

    def __iter__(self) -> Iterator[str]:
        return iter(self._own)

    def __len__(self) -> int:
        return len(self._own)

    def __getattr__(self, name: str) -> Measured:
        own: dict[str, Measured] = self.__dict__.get("_own", {})
        if name in own:
            return own[name]
        raise AttributeError(f"{name}: {self.__dict__.get('_name', 'a term')} has {', '.join(own)}")

    def __repr__(self) -> str:
        return f"{self._name}({', '.join(f'{key}={one!r}' for key, one in self._own.items())})"


class AxisParams:
    """Noise parameters of one axis."""

    def __init__(self, document: Mapping[str, Any]) -> None:
        self.document = document
        self.name: str = document["name"]

    def _terms(self, name: str) -> tuple[Term, ...]:
        found = self.document.get(name, [])
        return tuple(Term(name, one) for one in (found if isinstance(found, list) else [found]))

    def _term(self, name: str) -> Term:
        found = self._terms(name)
        if found:
            return found[0]
        why = [one["reason"] for one in self.document.get("not_identified", []) if one["term"] == name]
        raise ParamsError(f"{self.name} has no {name}" + (f": {why[0]}" if why else ""))

    @property
    def bias(self) -> Measured | None:
        """Constant bias."""
        found = self.document.get("bias")
        return None if found is None else Measured.of(found)

    @property
    def white(self) -> Term:
        """White noise: ``density``."""
        return self._term("white")

    @property
    def gauss_markov(self) -> tuple[Term, ...]:
        """Gauss-Markov processes: ``std_dev``, ``correlation_time``."""
        return self._terms("gauss_markov")

    @property
    def rate_random_walk(self) -> Term:
        """Random walk of the rate: ``density``."""
        return self._term("rate_random_walk")

    @property
    def flicker(self) -> Term:
        """Flicker: ``coefficient``."""
        return self._term("flicker")

    @property
    def terms(self) -> dict[str, tuple[Term, ...]]:
        """All terms by their kind."""
        names = [key for key, one in self.document.items() if key not in ("name", "bias", "not_identified")]
        return {name: self._terms(name) for name in names if isinstance(self.document[name], (dict, list))}

    @property
    def not_identified(self) -> Table:
        """What the log does not tell: term, reason, and how long a log would."""
        return _not_identified([self.document])

    def __repr__(self) -> str:
        return f"AxisParams({self.name}: {', '.join(repr(one) for some in self.terms.values() for one in some)})"


def _not_identified(axes: Sequence[Mapping[str, Any]]) -> Table:
    rows: list[dict[str, Any]] = []
    for axis in axes:
        for one in axis.get("not_identified", []):
            needed = one.get("needed_log")
            log = None if needed is None else repr(Measured.of(needed))
            rows.append({"axis": axis["name"], "term": one["term"], "needed_log": log, "reason": one["reason"]})
    return Table.of(rows)


class Params:
    """Noise parameters of a sensor: params.json.

    Attributes
    ----------
    origin : str or None
        The file they are from.
    """

    def __init__(self, text: str, origin: str | None = None) -> None:
        self._text = text
        self.origin = origin
        self.document: dict[str, Any] = json.loads(text)

    def _document_text(self) -> str:
        return self._text

    @property
    def quantity(self) -> str:
        """"angular-rate" or "specific-force"."""
        return str(self.document["quantity"])

    @property
    def sample_rate(self) -> Measured:
        """Of the log behind them."""
        return Measured.of(self.document["sample_rate"])

    @property
    def axes(self) -> tuple[AxisParams, ...]:
        """Every axis."""
        return tuple(AxisParams(one) for one in self.document["axes"])

    @property
    def not_identified(self) -> Table:
        """What the log does not tell."""
        return _not_identified(self.document["axes"])

    def axis(self, name: str) -> AxisParams:
        """One axis, by its name or its last word."""
        axes = self.axes
        at = _axis([axis.name for axis in axes], name)
        if at < 0:
            raise ParamsError(f"there is no axis '{name}'; there are {', '.join(axis.name for axis in axes)}")
        return axes[at]

    def __getattr__(self, name: str) -> AxisParams:
        if name.startswith("_") or "document" not in self.__dict__:
            raise AttributeError(name)
        try:
            return self.axis(name)
        except ParamsError as error:
            raise AttributeError(str(error)) from None

    def to_json(self) -> str:
        """params.json, byte for byte as the command writes it."""
        return self._text

    def save(self, path: StrPath) -> None:
        """Write params.json; it appears whole or not at all."""
        _native.write([(writable(path), self._text)])

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Params) and self._text == other._text

    def __hash__(self) -> int:
        return hash(self._text)

    def __getstate__(self) -> dict[str, Any]:
        return dict(self.__dict__)

    def __repr__(self) -> str:
        axes = ", ".join(axis.name for axis in self.axes)
        return f"<Params of {self.quantity}: {axes} at {self.sample_rate!r}>"


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
        at = _axis([axis.name for axis in axes], name)
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

    def conf_int(self, alpha: float = 0.05) -> dict[str, tuple[float, float]]:
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
        pair = lambda one: (one["interval"][0], one["interval"][1])  # noqa: E731
        return {one["name"]: Measured(one["factor"], "1", pair(one)) for one in self.document["axes"]}

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

    def __init__(self, source: Source, columns: Mapping[str, Floats]) -> None:
        self._columns = dict(columns)
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


@dataclass(frozen=True, eq=False)
class AxisFilter:
    """The filter of one axis, SI: x(k+1) = F x(k) + G u(k) + v, z(k) = H x(k) + w.

    x0 and P0 belong to the first measurement: update first, then predict.
    """

    name: str
    states: tuple[str, ...]
    measurements: tuple[str, ...]
    every: tuple[int, ...]
    F: Floats
    G: Floats
    H: Floats
    Q: Floats
    R: Floats
    x0: Floats
    P0: Floats
    #: Of the steady state, at a sample at which every measurement is taken: x⁺ = x⁻ + K ν.
    gain: Floats
    #: P(k|k-1) of the steady state.
    predicted_covariance: Floats
    #: S of the steady state.
    innovation_covariance: Floats

    @staticmethod
    def of(document: Mapping[str, Any]) -> AxisFilter:
        count = len(document["states"])
        steady = document["steady_state"]
        matrix = lambda rows: np.array(rows, float).reshape(len(rows), -1)  # noqa: E731
        return AxisFilter(
            document["name"],
            tuple(one["name"] for one in document["states"]),
            tuple(one["name"] for one in document["measurements"]),
            tuple(one.get("every", 1) for one in document["measurements"]),
            matrix(document["F"]),
            matrix(document.get("G") or [[]] * count),
            matrix(document["H"]),
            matrix(document["Q"]),
            matrix(document["R"]),
            np.array(document["x0"], float),
            matrix(document["P0"]),
            matrix(steady["gain"]),
            matrix(steady["predicted_covariance"]),
            matrix(steady["innovation_covariance"]),
        )


class Design(Result):
    """A Kalman filter, and where it was made here what is expected of it.

    Of a design with one axis the matrices are attributes of the design too; of several say which: ``design["x"].F``.
    """

    _format = "kfdesign-tune|kfdesign-filter|kfdesign-tune-attitude|kfdesign-attitude"

    def __init__(self, source: Source, origin: str | None = None) -> None:
        self.origin = origin
        super().__init__(source)

    def _document_text(self) -> str:
        text = self._source.file
        return text if text is not None else json.dumps(self.filter, indent=2) + "\n"

    @property
    def filter(self) -> dict[str, Any]:
        """The document filter.json."""
        found: dict[str, Any] = self.document.get("filter", self.document)
        return found

    @property
    def verdict(self) -> str | None:
        found: str | None = self.document.get("verification", {}).get("verdict")
        return found

    @property
    def meaning(self) -> str:
        return str(self.document.get("verification", {}).get("meaning", ""))

    @property
    def tests(self) -> Table:
        return Table.of(self.document.get("verification", {}).get("tests", []))

    @property
    def rate(self) -> float:
        """Sample rate, Hz."""
        return Measured.of(self.filter["sample_rate"]).value

    @cached_property
    def axes(self) -> tuple[AxisFilter, ...]:
        """The filter of every axis."""
        if "attitude" in self.filter["format"]:
            raise DesignError("an attitude filter is nonlinear: it has no matrices; see to_dict()")
        return tuple(AxisFilter.of(one) for one in self.filter["axes"])

    def _at(self, axis: str | None) -> int:
        names = [one.name for one in self.axes]
        if axis is None:
            if len(names) == 1:
                return 0
            raise DesignError(f"the design has the axes {', '.join(names)}; say which, such as design['{names[0]}']")
        at = _axis(names, axis)
        if at < 0:
            raise DesignError(f"there is no axis '{axis}'; there are {', '.join(names)}")
        return at

    def __getitem__(self, axis: str) -> AxisFilter:
        return self.axes[self._at(axis)]

    @property
    def F(self) -> Floats:
        """Transition, states by states."""
        return self.axes[self._at(None)].F

    @property
    def G(self) -> Floats:
        """Input, states by inputs."""
        return self.axes[self._at(None)].G

    @property
    def H(self) -> Floats:
        """Measurement, measurements by states."""
        return self.axes[self._at(None)].H

    @property
    def Q(self) -> Floats:
        """Process noise covariance of a sample."""
        return self.axes[self._at(None)].Q

    @property
    def R(self) -> Floats:
        """Measurement noise covariance."""
        return self.axes[self._at(None)].R

    @property
    def P0(self) -> Floats:
        """Covariance before the first measurement."""
        return self.axes[self._at(None)].P0

    @property
    def x0(self) -> Floats:
        """Estimate before the first measurement."""
        return self.axes[self._at(None)].x0

    @property
    def gain(self) -> Floats:
        """K of the steady state."""
        return self.axes[self._at(None)].gain

    def _reports(self) -> list[dict[str, Any]]:
        found: list[dict[str, Any]] = self.document.get("reports", [])
        if not found:
            raise DesignError("the design was not made here: nothing is predicted of it; see montecarlo()")
        return found

    def sigma(self, t: npt.ArrayLike, axis: str | None = None) -> Floats:
        """Predicted 1 sigma of the sensor's drift, or of a state.

        Parameters
        ----------
        t : array_like
            Seconds from the first measurement.
        axis : str
            Needed where there are several.

        Returns
        -------
        ndarray
            SI, of the shape of `t`: straight lines in log t between the times of the document, which is exact there;
            behind the last one its value.
        """
        predicted = self._reports()[self._at(axis)]["predicted"]
        time, total = (np.array(predicted[key], float) for key in ("time_s", "total"))
        # t = 0 has no logarithm, and half the first step stands for it
        place = lambda t: np.log(np.maximum(t, 0.5 * time[1]))  # noqa: E731
        return np.asarray(np.interp(place(np.asarray(t, float)), place(time), total))

    @property
    def budget(self) -> dict[str, Budget]:
        """Where the steady error comes from: of the drift, and of every state of the plant."""
        rows: dict[str, list[dict[str, Any]]] = {}
        for report in self._reports():
            parts = [("drift", report["error_budget"])]
            parts += [(one["state"], one["error_budget"]) for one in report.get("plant_budgets", [])]
            for output, items in parts:
                rows.setdefault(output, []).extend({"axis": report["name"], **item} for item in items)
        return {output: Budget(Table.of(items).columns) for output, items in rows.items()}

    @property
    def worth(self) -> Table:
        """What other parts would buy: the steady sigma of every output, by factor; ask with ``insight=True``."""
        found = self.document.get("insight", [])
        if not found:
            raise DesignError("nothing is known of other parts: tune(…, insight=True)")
        rows = [
            {
                "axis": insight["axis"],
                "output": output["name"],
                "parameter": one["parameter"],
                "factor": factor,
                "sigma": sigma,
                "change": None if sigma is None else sigma / output["sigma"] - 1.0,
                "unit": output["unit"],
            }
            for insight in found
            for output in insight["outputs"]
            for one in output["worth"]
            for factor, sigma in zip(one["factors"], one["sigma"])
            if factor != 1.0
        ]
        return Table.of(sorted(rows, key=lambda row: -abs(row["change"] or 0.0)))

    def save(self, path: StrPath) -> None:
        """Write filter.json. A design that its own verification found inconsistent is not written."""
        if self.verdict not in (None, "consistent"):
            raise DesignError(f"the verification says {self.verdict}: {self.meaning}; to_json() has the whole design")
        _native.write([(writable(path), self._document_text())])

    def plot_sigma(
        self, until: str | float | None = None, ax: Axes | None = None, label: str | None = None
    ) -> Axes:
        """Predicted sigma over time of every axis.

        Parameters
        ----------
        until : str or float
            Seconds, or with a unit; None: all that is predicted.
        ax : matplotlib.axes.Axes
            Where; None: a new figure.
        label : str
            Before the names of the axes.

        Returns
        -------
        matplotlib.axes.Axes
        """
        from . import plot

        return plot.sigma(self._reports(), until, ax, label)

    def plot(self, ax: Axes | None = None) -> Axes:
        return self.plot_sigma(ax=ax)

    @staticmethod
    def from_matrices(
        F: npt.ArrayLike,
        H: npt.ArrayLike,
        Q: npt.ArrayLike,
        R: npt.ArrayLike,
        *,
        P0: npt.ArrayLike,
        x0: npt.ArrayLike | None = None,
        G: npt.ArrayLike | None = None,
        rate: float,
        name: str = "x",
        states: Sequence[str] | None = None,
        unit: str = "rad/s",
    ) -> Design:
        """A filter of one's own: it goes through :func:`replay` and :func:`montecarlo` like one of `tune`.

        Parameters
        ----------
        F, H, Q, R : array_like
            x(k+1) = F x(k) + G u(k) + v, z(k) = H x(k) + w; Q and R their covariances, R diagonal.
        P0, x0 : array_like
            Before the first measurement; without `x0` zeros.
        G : array_like
            Input; none without it.
        rate : float
            Samples per second, Hz.
        name : str
            Of the axis.
        states : sequence of str
            Names of the states.
        unit : str
            SI unit of the measurement, which is the sensor: "rad/s" or "m/s^2".

        Returns
        -------
        Design

        Examples
        --------
        >>> import kfdesign as kf
        >>> own = kf.Design.from_matrices(1.0, 1.0, 1e-8, 1e-4, P0=1e-3, rate=100)
        >>> kf.montecarlo(own, runs=50, duration="60s").verdict
        'consistent'
        """
        square = lambda a: np.atleast_2d(np.asarray(a, float))  # noqa: E731
        f, h, q, r, p = (square(a) for a in (F, H, Q, R, P0))
        count, measured = f.shape[0], h.shape[0]
        g = np.zeros((count, 0)) if G is None else square(G)
        start = np.zeros(count) if x0 is None else np.asarray(x0, float).reshape(-1)
        shapes = {"F": (f, (count, count)), "H": (h, (measured, count)), "Q": (q, (count, count))}
        shapes |= {"R": (r, (measured, measured)), "P0": (p, (count, count)), "x0": (start, (count,))}
        shapes["G"] = (g, (count, g.shape[1]))
        for key, (found, shape) in shapes.items():
            if found.shape != shape:
                raise DesignError(f"{key} is {_by(found.shape)}, expected {_by(shape)}: F has {count} states")
            if not np.isfinite(found).all():
                raise DesignError(f"{key} holds what is no number")
        if states is not None and len(states) != count:
            raise DesignError(f"{len(states)} names of states, expected {count}")
        quantity = {"rad/s": "angular-rate", "m/s^2": "specific-force"}.get(unit)
        if quantity is None:
            raise DesignError(f"unit '{unit}': expected rad/s or m/s^2, the sensor in SI")
        names = states or [f"x{at}" for at in range(count)]
        sensor = "angular_rate" if quantity == "angular-rate" else "specific_force"
        axis = {
            "name": name,
            "states": [{"name": one, "unit": unit} for one in names],
            "inputs": [{"name": f"u{at}", "unit": "1"} for at in range(g.shape[1])],
            "measurements": [{"name": sensor if at == 0 else f"z{at}", "unit": unit} for at in range(measured)],
            **{key: found.tolist() for key, (found, _) in shapes.items()},
        }
        document = {
            "format": "kfdesign-filter/1",
            "quantity": quantity,
            "sample_rate": {"value": float(rate), "unit": "Hz"},
            "plant": "static",
            "axes": [axis],
        }
        with Call() as call:
            path = call.place("filter.json")
            with open(path, "w", encoding="utf-8") as file:
                json.dump(document, file)
            # checked, and with its steady state
            return Design(call.run("design", {"file": path}))

    def to_filterpy(self, axis: str | None = None) -> Any:
        """A KalmanFilter of filterpy; run it with ``kf.batch_filter(z, update_first=True)``."""
        from . import convert

        return convert.to_filterpy(self.axes[self._at(axis)])

    def to_statsmodels(self, endog: npt.ArrayLike, axis: str | None = None) -> Any:
        """An MLEModel of statsmodels over these samples, with the known start; ``.smooth([])`` runs it."""
        from . import convert

        return convert.to_statsmodels(self.axes[self._at(axis)], endog)

    def to_control(self, axis: str | None = None) -> Any:
        """The steady filter as a StateSpace of python-control, with its gains in both forms.

        Returns
        -------
        StateSpace, filter gain, predictor gain
            x⁺ = x⁻ + K ν, and K_p = F K, which is the one that ``control.dlqe`` gives.
        """
        from . import convert

        return convert.to_control(self.axes[self._at(axis)], 1.0 / self.rate)

    def _about(self) -> str:
        return f"{self.filter.get('plant', 'attitude')}, {len(self.filter.get('axes', [])) or 3} axes"


def _by(shape: tuple[int, ...]) -> str:
    return " by ".join(map(str, shape))


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

        return plot.estimates(self.estimates, ax)


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


