"""Filters: made here, read, or by matrices of one's own."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from . import _native
from ._call import Call, Source, StrPath, writable
from .errors import DesignError
from .log import si_unit
from .params import place_of
from .results import Result
from .table import Budget, Measured, Table

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["AxisFilter", "Design"]

Floats = npt.NDArray[np.float64]


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
        """That of a document."""
        count = len(document["states"])
        steady = document["steady_state"]
        return AxisFilter(
            document["name"],
            tuple(one["name"] for one in document["states"]),
            tuple(one["name"] for one in document["measurements"]),
            tuple(one.get("every", 1) for one in document["measurements"]),
            _matrix(document["F"]),
            _matrix(document.get("G") or [[]] * count),
            _matrix(document["H"]),
            _matrix(document["Q"]),
            _matrix(document["R"]),
            np.array(document["x0"], float),
            _matrix(document["P0"]),
            _matrix(steady["gain"]),
            _matrix(steady["predicted_covariance"]),
            _matrix(steady["innovation_covariance"]),
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
        at = place_of(names, axis)
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
        wanted, known = (np.log(np.maximum(at, 0.5 * time[1])) for at in (np.asarray(t, float), time))
        return np.asarray(np.interp(wanted, known, total))

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

    def plot_sigma(self, until: str | float | None = None, ax: Axes | None = None, label: str | None = None) -> Axes:
        """Predicted sigma over time of every axis.

        Parameters
        ----------
        until : str or float
            Seconds, or with a unit; None: all that is predicted.
        ax : matplotlib.axes.Axes
            Where; None: a new figure.
        label : str
            One entry of the legend for the whole design; None: one for every axis.

        Returns
        -------
        matplotlib.axes.Axes
        """
        from . import plot

        return plot.sigma(self._reports(), si_unit(self.filter["quantity"]), until, ax, label)

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
        f, h, q, r, p = (np.atleast_2d(np.asarray(a, float)) for a in (F, H, Q, R, P0))
        count, measured = f.shape[0], h.shape[0]
        g = np.zeros((count, 0)) if G is None else np.atleast_2d(np.asarray(G, float))
        start = np.zeros(count) if x0 is None else np.asarray(x0, float).reshape(-1)
        shapes: dict[str, tuple[npt.NDArray[Any], tuple[int, ...]]] = {
            "F": (f, (count, count)),
            "G": (g, (count, g.shape[1])),
            "H": (h, (measured, count)),
            "Q": (q, (count, count)),
            "R": (r, (measured, measured)),
            "x0": (start, (count,)),
            "P0": (p, (count, count)),
        }
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
            return Design(call.run("design", path))

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


def _matrix(rows: Sequence[Sequence[float]]) -> Floats:
    return np.array(rows, float).reshape(len(rows), -1)


def _by(shape: tuple[int, ...]) -> str:
    return " by ".join(map(str, shape))
