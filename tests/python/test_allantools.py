"""The shim gives what allantools gives."""

from __future__ import annotations

import numpy as np
import pytest

from kfdesign import allantools as ours

theirs = pytest.importorskip("allantools")

GRIDS = ["octave", "decade", "all", np.array([0.02, 0.05, 0.33, 1.0, 1.0, 4.2, 1e6])]


@pytest.mark.parametrize("kind", ["adev", "oadev", "mdev", "hdev", "ohdev", "totdev"])
@pytest.mark.parametrize("data_type", ["phase", "freq"])
@pytest.mark.parametrize("grid", range(len(GRIDS)))
def test_four_tuple(kind: str, data_type: str, grid: int) -> None:
    # white noise on a random walk: neither the smallest nor the largest averages are alone
    random = np.random.default_rng(3)
    data = random.normal(size=700) + np.cumsum(random.normal(size=700)) * 0.1
    mine = getattr(ours, kind)(data, rate=50.0, data_type=data_type, taus=GRIDS[grid])
    other = getattr(theirs, kind)(data, rate=50.0, data_type=data_type, taus=GRIDS[grid])
    if kind == "totdev":
        # theirs goes on beyond half of the record
        other = tuple(column[: len(mine[0])] for column in other)
    np.testing.assert_array_equal(mine[3], other[3])
    np.testing.assert_allclose(mine[0], other[0], rtol=1e-15)
    # the same sums in another order: a few hundred roundings of 1e-16
    np.testing.assert_allclose(mine[1], other[1], rtol=1e-11)
    np.testing.assert_allclose(mine[2], other[2], rtol=1e-11)


def test_what_is_missing_is_named() -> None:
    with pytest.raises(AttributeError, match="kfdesign.allantools has no mtie"):
        ours.mtie  # noqa: B018
    with pytest.raises(ValueError, match="taus 'sometimes': expected all, octave"):
        ours.adev(np.zeros(10), taus="sometimes")
    with pytest.raises(ValueError, match="data_type 'angle': expected phase or freq"):
        ours.adev(np.zeros(10), data_type="angle")
