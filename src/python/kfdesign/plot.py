"""Figures with matplotlib, of which the package otherwise knows nothing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ._call import number_of
from .errors import KfdesignError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from .results import Curve
    from .table import Budget

Floats = npt.NDArray[np.float64]


def _axes(ax: Axes | None) -> Axes:
    if ax is not None:
        return ax
    try:
        import matplotlib.pyplot as plt
    except ImportError:
        raise KfdesignError("plots need matplotlib: pip install 'kfdesign[plot]'") from None
    made: Axes = plt.subplots(figsize=(7.0, 4.3), layout="constrained")[1]
    made.spines[["top", "right"]].set_visible(False)
    return made


def _legend(ax: Axes) -> Axes:
    # above the lines, which may be anywhere below
    if ax.get_legend_handles_labels()[1]:
        ax.legend(frameon=False, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=4, borderaxespad=0.0)
    return ax


def curves(found: Sequence[Curve], ax: Axes | None) -> Axes:
    """Deviations with their intervals, and the model's as a line."""
    ax = _axes(ax)
    for curve in found:
        (line,) = ax.loglog(curve.tau, curve.deviation, "." if curve.model is not None else ".-", label=curve.name)
        ax.fill_between(curve.tau, curve.lower, curve.upper, color=line.get_color(), alpha=0.2, linewidth=0)
        if curve.model is not None:
            ax.loglog(curve.tau, curve.model, color=line.get_color(), linewidth=1.0)
    ax.set_xlabel("averaging time, s")
    ax.set_ylabel(f"deviation, {found[0].unit}")
    return _legend(ax)


def comparison(axes: Sequence[Mapping[str, Any]], ax: Axes | None) -> Axes:
    """The measured curve over the model's, within the envelope."""
    ax = _axes(ax)
    for axis in axes:
        allan = {key: np.array(axis["allan"][key], float) for key in ("tau_s", "measured", "model", "lower", "upper")}
        measured, lower, upper = (allan[key] / allan["model"] for key in ("measured", "lower", "upper"))
        (line,) = ax.semilogx(allan["tau_s"], measured, ".-", label=axis["name"])
        ax.fill_between(allan["tau_s"], lower, upper, color=line.get_color(), alpha=0.12, linewidth=0)
    ax.axhline(1.0, color="0.4", linewidth=0.8)
    ax.set_xlabel("averaging time, s")
    ax.set_ylabel("Allan deviation of the log over the model's")
    return _legend(ax)


def sigma(
    reports: Sequence[Mapping[str, Any]], unit: str, until: str | float | None, ax: Axes | None, label: str | None
) -> Axes:
    """Predicted sigma of the drift; axes that are alike are one line."""
    ax = _axes(ax)
    end = number_of(until, "s", "until")
    lines: dict[str, tuple[list[str], Floats, Floats]] = {}
    for report in reports:
        time, total = (np.array(report["predicted"][key], float) for key in ("time_s", "total"))
        lines.setdefault(repr(report["predicted"]["total"]), ([], time, total))[0].append(report["name"])
    colour: object = None
    for names, time, total in lines.values():
        inside = time > 0.0 if end is None else (time > 0.0) & (time <= end)
        # with a label of its own a design is one colour and one entry, however many axes it has
        shown = ", ".join(names) if label is None else label if colour is None else None
        (line,) = ax.loglog(time[inside], total[inside], label=shown, color=colour if label is not None else None)
        colour = line.get_color()
    ax.set_xlabel("time, s")
    ax.set_ylabel(f"predicted 1 sigma of the drift, {unit}")
    return _legend(ax)


def budget(table: Budget, ax: Axes | None) -> Axes:
    """Shares of the error of one output, one bar for each axis."""
    ax = _axes(ax)
    names = list(dict.fromkeys(table["axis"]))
    sources = list(dict.fromkeys(table["source"]))
    left = np.zeros(len(names))
    for source in sources:
        shares = np.zeros(len(names))
        for row in table.rows():
            if row["source"] == source:
                shares[names.index(row["axis"])] += 100.0 * row["share"]
        ax.barh(names, shares, left=left, label=source)
        left += shares
    ax.invert_yaxis()
    ax.set_xlabel("share of the steady variance, %")
    ax.legend(frameon=False, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=min(len(sources), 4))
    return ax


#: Points of a line: more are not seen, and a line of millions takes seconds.
_POINTS = 4000


def lines(columns: Mapping[str, Floats], names: Sequence[str], ax: Axes | None) -> Axes:
    """Columns over time."""
    ax = _axes(ax)
    step = max(len(columns["time (s)"]) // _POINTS, 1)
    for name, values in columns.items():
        if name.split(" (")[0] in names:
            ax.plot(columns["time (s)"][::step], values[::step], label=name)
    ax.set_xlabel("time, s")
    return _legend(ax)


def estimates(columns: Mapping[str, Floats], axes: Sequence[str], ax: Axes | None) -> Axes:
    """The last state of every axis, which is its drift or bias, with two sigmas."""
    ax = _axes(ax)
    if "time (s)" not in columns:
        raise KfdesignError("the replay has no estimates: ask for them with estimates=True")
    time = columns["time (s)"]
    step = max(len(time) // _POINTS, 1)
    unit, states = "", dict[str, None]()
    for axis in axes:
        sigmas = [name for name in columns if name.startswith(f"{axis}_") and name.split(" (")[0].endswith("_sigma")]
        if not sigmas:
            continue
        name = sigmas[-1].replace("_sigma (", " (")
        states[name.split(" (")[0].removeprefix(f"{axis}_")] = None
        unit = name.rsplit(" (", 1)[-1].rstrip(")")
        values, sigma_of = columns[name][::step], columns[sigmas[-1]][::step]
        (line,) = ax.plot(time[::step], values, label=axis, linewidth=1.0)
        ax.fill_between(
            time[::step],
            values - 2.0 * sigma_of,
            values + 2.0 * sigma_of,
            color=line.get_color(),
            alpha=0.2,
            linewidth=0,
        )
    ax.set_xlabel("time, s")
    ax.set_ylabel(f"{', '.join(states)} ± 2 sigma, {unit}")
    return _legend(ax)


def nees(axes: Sequence[Mapping[str, Any]], ax: Axes | None) -> Axes:
    """Mean NEES over runs, and the band in which it is expected."""
    ax = _axes(ax)
    bands = set()
    for axis in axes:
        found = axis["nees"]
        time = np.array(found["time_s"], float)
        ax.plot(time, found["mean"], label=axis["name"], linewidth=1.0)
        # axes of as many states have one band, but for the last digits
        band = (f"{found['lower']:.3g}", f"{found['upper']:.3g}")
        if band not in bands:
            bands.add(band)
            ax.fill_between(time, found["lower"], found["upper"], color="0.5", alpha=0.15, linewidth=0)
    ax.axhline(float(axes[0]["nees"]["expected"][-1]), color="0.4", linewidth=0.8)
    ax.set_xlabel("time, s")
    ax.set_ylabel("NEES per component, mean of all runs")
    return _legend(ax)


def poles(found: Sequence[complex], ax: Axes | None) -> Axes:
    """Eigenvalues in the plane."""
    ax = _axes(ax)
    ax.plot([one.real for one in found], [one.imag for one in found], "x")
    ax.plot([one.real for one in found if one.imag], [-one.imag for one in found if one.imag], "x", color="C0")
    ax.axvline(0.0, color="0.4", linewidth=0.8)
    ax.set_xlabel("real part, 1/s")
    ax.set_ylabel("imaginary part, rad/s")
    return ax
