"""Values with units, and tables of them."""

from __future__ import annotations

import html
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from . import _native

if TYPE_CHECKING:
    import pandas
    import polars
    from matplotlib.axes import Axes

__all__ = ["Budget", "Measured", "Summary", "Table"]


@dataclass(frozen=True, repr=False)
class Measured:
    """A value with its unit and its 95 % interval."""

    value: float
    unit: str
    #: An end that the log does not tell is None.
    interval: tuple[float | None, float | None] | None = None

    @property
    def si(self) -> float:
        """The value in SI units and rad."""
        return self.value * _native.unit(self.unit)[0]

    def __float__(self) -> float:
        return self.value

    def __repr__(self) -> str:
        ends = ["-" if end is None else f"{end:.4g}" for end in self.interval or ()]
        inside = f" [{' … '.join(ends)}]" if ends else ""
        return f"{self.value:.4g} {self.unit}{inside}"

    @staticmethod
    def of(document: Mapping[str, Any]) -> Measured:
        """That of a document."""
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
        rows = zip(*self.columns.values())
        return [list(self.columns), *([_cell(value) for value in values] for values in rows)]

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


def _cell(value: object) -> str:
    return "" if value is None else f"{value:.5g}" if isinstance(value, float) else str(value)


class Budget(Table):
    """Where the error of one output comes from."""

    def plot(self, ax: Axes | None = None) -> Axes:
        """Shares as bars; returns the Axes."""
        from . import plot

        return plot.budget(self, ax)


class Summary(str):
    """A text that a notebook shows as it is."""

    def __repr__(self) -> str:
        return str(self)
