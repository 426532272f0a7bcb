"""Noise parameters."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from . import _native
from ._call import StrPath, writable
from .errors import ParamsError
from .table import Measured, Table

__all__ = ["AxisParams", "Params", "Term"]


def place_of(names: Sequence[str], wanted: str) -> int:
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
        """ "angular-rate" or "specific-force"."""
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
        at = place_of([axis.name for axis in axes], name)
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
