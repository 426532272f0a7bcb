"""The deviations of allantools with its signatures: ``from kfdesign import allantools``.

Each gives ``(taus, deviations, errors, counts)``; the error is deviation / √count, as there. :func:`kfdesign.allan`
gives intervals that know the noise. `totdev` ends at half of the record, as its definition does (Greenhall, Howe and
Percival 1999); allantools goes on, where all that is averaged is reflected.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from . import _native

__all__ = ["adev", "hdev", "mdev", "oadev", "ohdev", "totdev"]

Floats = npt.NDArray[np.float64]
Taus = str | Sequence[float] | Floats | None
Four = tuple[Floats, Floats, Floats, Floats]


def _factors(length: int, rate: float, taus: Taus) -> Floats:
    """Averaging factors, chosen as allantools does: of the points of the phase."""
    if taus is None or (not isinstance(taus, str) and len(taus) == 0):
        taus = "octave"
    if isinstance(taus, str):
        if taus == "all":
            wanted = np.linspace(1.0, length, length)
        elif taus == "octave":
            most = int(np.floor(np.log2(length)))
            wanted = np.logspace(0, most, most + 1, base=2.0)
        elif taus == "log10":
            decades = np.log10(length)
            wanted = np.logspace(0, decades, int(10 * decades), base=10.0)
        elif taus == "decade":
            powers = range(int(np.floor(np.log10(length))) + 1)
            wanted = np.array([step * 10.0**power for power in powers for step in (1.0, 2.0, 4.0)])
        else:
            raise ValueError(f"taus '{taus}': expected all, octave, decade, log10 or times in seconds")
        wanted = wanted / rate
    else:
        wanted = np.asarray(taus, float)
    factors = np.round(wanted * rate)
    return np.unique(factors[(factors > 0) & (factors < length)])


def _deviation(kind: str, data: npt.ArrayLike, rate: float, data_type: str, taus: Taus) -> Four:
    if rate <= 0:
        raise ValueError(f"rate {rate}: expected a number above zero")
    values = np.asarray(data, float)
    if values.ndim != 1:
        raise ValueError(f"data of {values.ndim} dimensions; expected one")
    if not np.isfinite(values).all():
        raise ValueError("data hold what is no number; kfdesign.allan takes logs with gaps")
    if data_type == "freq":
        phase = np.concatenate([[0.0], np.cumsum(values - values.mean()) / rate])
    elif data_type == "phase":
        phase = values
    else:
        raise ValueError(f"data_type '{data_type}': expected phase or freq")
    factors = _factors(len(phase), rate, taus)
    # rate samples that one difference takes: longer averages have none
    spans = {"mdev": 3.0 * factors - 1.0, "hdev": 3.0 * factors, "ohdev": 3.0 * factors}
    factors = factors[spans.get(kind, 2.0 * factors) <= len(phase) - 1]
    found = _native.deviations(kind, phase.tobytes(), 1.0 / rate, [int(m) for m in factors])
    deviations = np.array([one for one, _ in found], float)
    counts = np.array([count for _, count in found], float)
    # one difference says nothing of its own error, and allantools leaves such averages out
    kept = counts > 1
    taus_used = factors / rate
    return taus_used[kept], deviations[kept], deviations[kept] / np.sqrt(counts[kept]), counts[kept]


def adev(data: npt.ArrayLike, rate: float = 1.0, data_type: str = "phase", taus: Taus = None) -> Four:
    """Allan deviation, differences that do not overlap.

    Parameters
    ----------
    data : array_like
        Phase in seconds, or fractional frequency; of a gyro angle, or rate.
    rate : float
        Samples per second, Hz.
    data_type : {"phase", "freq"}
        What `data` are.
    taus : str or array_like
        all, octave, decade, log10, or averaging times in seconds.

    Returns
    -------
    taus, deviations, errors, counts : ndarray

    Examples
    --------
    >>> import numpy as np
    >>> from kfdesign import allantools as at
    >>> at.adev(np.arange(8.0) ** 2, taus=[1.0])[1].round(6).tolist()
    [1.414214]
    """
    return _deviation("adev", data, rate, data_type, taus)


def oadev(data: npt.ArrayLike, rate: float = 1.0, data_type: str = "phase", taus: Taus = None) -> Four:
    """Overlapping Allan deviation; see :func:`adev`."""
    return _deviation("oadev", data, rate, data_type, taus)


def mdev(data: npt.ArrayLike, rate: float = 1.0, data_type: str = "phase", taus: Taus = None) -> Four:
    """Modified Allan deviation; see :func:`adev`."""
    return _deviation("mdev", data, rate, data_type, taus)


def hdev(data: npt.ArrayLike, rate: float = 1.0, data_type: str = "phase", taus: Taus = None) -> Four:
    """Hadamard deviation, differences that do not overlap; see :func:`adev`."""
    return _deviation("hdev", data, rate, data_type, taus)


def ohdev(data: npt.ArrayLike, rate: float = 1.0, data_type: str = "phase", taus: Taus = None) -> Four:
    """Overlapping Hadamard deviation; see :func:`adev`."""
    return _deviation("ohdev", data, rate, data_type, taus)


def totdev(data: npt.ArrayLike, rate: float = 1.0, data_type: str = "phase", taus: Taus = None) -> Four:
    """Total deviation; see :func:`adev`."""
    return _deviation("totdev", data, rate, data_type, taus)


def __getattr__(name: str) -> object:
    if name.startswith("__"):
        raise AttributeError(name)
    raise AttributeError(f"kfdesign.allantools has no {name}; it has {', '.join(__all__)}, and allantools has the rest")
