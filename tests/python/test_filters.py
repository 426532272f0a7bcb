"""Filters of other packages run the same filter, and filters of one's own go through ours."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import kfdesign as kf

#: Samples, of which some in the middle are missing.
COUNT, GAP = 100_000, slice(40_000, 40_500)


@pytest.fixture(scope="module")
def one_axis(files: Path) -> kf.Design:
    """A design of one axis with a Gauss-Markov process and a constant bias."""
    sheet = kf.datasheet(
        rate=100,
        angle_random_walk="3.4 deg/sqrt(h)",
        bias_instability="0.03 deg/s",
        instability="sigma",
        correlation_time="200 s",
        turn_on_bias="0.5 deg/s",
        axes=["x"],
    )
    return kf.tune(sheet)


@pytest.fixture(scope="module")
def samples(one_axis: kf.Design) -> np.ndarray:
    z = (
        kf.simulate(
            kf.datasheet(
                rate=100,
                angle_random_walk="3.4 deg/sqrt(h)",
                bias_instability="0.03 deg/s",
                instability="sigma",
                correlation_time="200 s",
                axes=["x"],
            ),
            duration=COUNT / 100,
        )
        .log.data[:COUNT, 0]
        .copy()
    )
    z[GAP] = np.nan
    return z


@pytest.fixture(scope="module")
def log_likelihood(one_axis: kf.Design, samples: np.ndarray) -> float:
    run = kf.replay(one_axis, kf.Log.from_array(samples, rate=100, unit="rad/s", names=["x"]))
    return run.document["axes"][0]["log_likelihood"]


def test_filterpy_runs_the_same_filter(one_axis: kf.Design, samples: np.ndarray, log_likelihood: float) -> None:
    pytest.importorskip("filterpy")
    filter_ = one_axis.to_filterpy()
    total = 0.0
    # our k = 0 is an update: filterpy's batch_filter(update_first=True), step by step
    for z in samples:
        if np.isnan(z):
            filter_.update(None)
        else:
            filter_.update(z)
            total += filter_.log_likelihood
        filter_.predict()
    assert total == pytest.approx(log_likelihood, rel=1e-9)


def test_statsmodels_runs_the_same_filter(one_axis: kf.Design, samples: np.ndarray, log_likelihood: float) -> None:
    pytest.importorskip("statsmodels")
    model = one_axis.to_statsmodels(samples)
    # it stops looking at the covariance where that has settled: here all of it is asked for
    model.ssm.tolerance = 0.0
    assert model.loglike([]) == pytest.approx(log_likelihood, rel=1e-9)


def test_control_has_both_gains(one_axis: kf.Design) -> None:
    control = pytest.importorskip("control")
    system, gain, predictor = one_axis.to_control()
    np.testing.assert_allclose(system.A, one_axis.F - one_axis.F @ one_axis.gain @ one_axis.H, rtol=1e-14)
    np.testing.assert_allclose(predictor, one_axis.F @ gain, rtol=1e-14)
    # of a filter with every state driven, whose Riccati equation control can solve
    driven = kf.Design.from_matrices(0.999, 1.0, 1e-8, 1e-4, P0=1e-3, rate=100)
    _, gain, predictor = driven.to_control()
    expected, _, _ = control.dlqe(driven.F, np.eye(1), driven.H, driven.Q, driven.R)
    np.testing.assert_allclose(predictor, expected, rtol=1e-9)


def test_matrices_of_ones_own_go_through(files: Path, one_axis: kf.Design, samples: np.ndarray) -> None:
    own = kf.Design.from_matrices(
        one_axis.F, one_axis.H, one_axis.Q, one_axis.R, P0=one_axis.P0, x0=one_axis.x0, rate=100, name="x"
    )
    np.testing.assert_array_equal(own.F, one_axis.F)
    np.testing.assert_allclose(own.gain, one_axis.gain, rtol=1e-9, atol=1e-15)
    log = kf.Log.from_array(samples, rate=100, unit="rad/s", names=["x"])
    mine, theirs = (kf.replay(one, log).document["axes"][0]["log_likelihood"] for one in (own, one_axis))
    assert mine == pytest.approx(theirs, rel=1e-12)
    assert kf.montecarlo(own, runs=50, duration="100s").consistent
    # a covariance that is four times too small is caught
    wrong = kf.Design.from_matrices(
        one_axis.F, one_axis.H, one_axis.Q, one_axis.R / 4, P0=one_axis.P0, x0=one_axis.x0, rate=100, name="x"
    )
    assert kf.replay(wrong, log).verdict == "inconsistent"


def test_matrices_that_do_not_fit_are_refused() -> None:
    with pytest.raises(kf.DesignError, match="Q is 2 by 2, expected 1 by 1: F has 1 states"):
        kf.Design.from_matrices(1.0, 1.0, np.eye(2), 1.0, P0=1.0, rate=100)
    with pytest.raises(kf.DesignError, match="R holds what is no number"):
        kf.Design.from_matrices(1.0, 1.0, 1.0, np.nan, P0=1.0, rate=100)
    with pytest.raises(kf.DesignError, match="axes\\[0\\].Q.*a variance cannot be negative"):
        kf.Design.from_matrices(1.0, 1.0, -1.0, 1.0, P0=1.0, rate=100)


def test_a_slow_aid_is_said(design: kf.Design, files: Path) -> None:
    angle = kf.tune(files / "params.json", plant="angle", aids=["2 deg @ 1 Hz"], runs=20)
    with pytest.raises(kf.DesignError, match="heading is not taken at every sample"):
        angle.to_filterpy("x")
    with pytest.raises(kf.DesignError, match="say which, such as design\\['gyro_x'\\]"):
        angle.F  # noqa: B018


def test_judge_takes_a_filter_of_any_origin() -> None:
    random = np.random.default_rng(4)
    nu, scale = random.normal(size=40_000), np.linspace(0.5, 2.0, 40_000)
    honest = kf.judge(nu * scale, scale**2, rate=50.0)
    assert honest.consistent
    coloured = np.convolve(nu, [0.6, 0.8], "same")
    judged = kf.judge(coloured, 1.0, rate=50.0)
    assert judged.verdict == "inconsistent"
    failed = [row["name"] for row in judged.tests.rows() if not row["pass"]]
    assert "whiteness" in failed
    with pytest.raises(kf.LogError, match="expected n scalars, and n variances or one"):
        kf.judge(np.zeros((5, 2)), 1.0, rate=1.0)
    with pytest.raises(kf.LogError, match="a variance is not above zero"):
        kf.judge(np.arange(5.0), 0.0, rate=1.0)


def test_nees_has_the_law_of_the_covariance() -> None:
    random = np.random.default_rng(6)
    root = np.array([[1.0, 0.0], [0.5, 0.2]])
    errors = random.normal(size=(500, 40, 2)) @ root.T
    covariance = np.broadcast_to(root @ root.T, (500, 40, 2, 2))
    found = kf.nees(errors, np.zeros_like(errors), covariance)
    # 20,000 independent values of chi-square with 2 degrees: the mean is 2 with deviation 0.0141
    assert found.values.mean() == pytest.approx(2.0, abs=4 * 0.0141)
    assert found.lower == pytest.approx(1.8285, abs=1e-3) and found.upper == pytest.approx(2.1791, abs=1e-3)
    assert kf.nees(2 * errors, np.zeros_like(errors), covariance).share_inside == 0.0
