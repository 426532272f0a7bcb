"""Results: their numbers, tables, figures, and the ways out of the process and back."""

from __future__ import annotations

import copy
import json
import pickle
import tempfile
from pathlib import Path

import numpy as np
import pytest

import kfdesign as kf


def test_numbers_have_names(found: kf.Identified) -> None:
    density = found.x.white.density
    assert density.unit == "deg/s/sqrt(Hz)" and density.interval is not None
    assert density.interval[0] < float(density) < density.interval[1]
    assert density.si == pytest.approx(np.radians(density.value))
    assert "deg/s/sqrt(Hz) [" in repr(density)
    axis = found.axis("x")
    assert axis.bse["white.density"] == pytest.approx(
        density.value
        * next(p for p in axis.document["precision"] if p["parameter"] == "white.density")["std_dev_percent"]
        / 100
    )
    assert axis.conf_int()["white.density"] == density.interval
    assert axis.nobs == 36_000 and axis.llf > 0 and axis.bic < 0
    with pytest.raises(kf.KfdesignError, match="95 % intervals"):
        axis.conf_int(alpha=0.1)
    with pytest.raises(AttributeError, match="there is no axis 'roll'; there are gyro_x, gyro_y, gyro_z"):
        found.roll  # noqa: B018
    with pytest.raises(kf.ParamsError, match="has no flicker"):
        found.x.flicker  # noqa: B018


def test_every_result_goes_out_and_back(found: kf.Identified, design: kf.Design, files: Path) -> None:
    run = kf.replay(design, files / "log.npy")
    gate = kf.montecarlo(design, runs=20, duration="60s")
    for result in (found, design, run, gate, kf.allan(files / "log.npy")):
        for other in (pickle.loads(pickle.dumps(result)), copy.deepcopy(result)):
            assert other == result and hash(other) == hash(result)
            assert other.summary() == result.summary()
            other.report(files / "again.html")
        assert "\n" not in repr(result)
        assert "<pre>" in result._repr_html_()
        again = type(result).from_json(result.to_json())
        assert again.to_dict() == result.to_dict()
    assert set(pickle.loads(pickle.dumps(run)).estimates) == set(run.estimates)
    assert "<svg" in found._repr_html_() and "consistent" in design._repr_html_()
    assert pickle.loads(pickle.dumps(kf.read_log(files / "log.npy"))).sha256 == kf.read_log(files / "log.npy").sha256


def test_a_document_of_a_newer_version_is_refused(found: kf.Identified) -> None:
    newer = found.to_json().replace("kfdesign-identify/1", "kfdesign-identify/2")
    with pytest.raises(kf.KfdesignError, match="kfdesign-identify/2.*pip install --upgrade kfdesign"):
        kf.Identified.from_json(newer)
    with pytest.raises(kf.KfdesignError, match="this is a document 'kfdesign-identify/1', expected kfdesign-allan"):
        kf.Allan.from_json(found.to_json())
    with pytest.raises(kf.KfdesignError, match="not valid JSON"):
        kf.Allan.from_json("{")
    with pytest.raises(kf.KfdesignError, match="read from JSON, has no page"):
        kf.Identified.from_json(found.to_json()).report("never.html")


def test_matrices_and_predictions(design: kf.Design) -> None:
    axis = design["x"]
    document = design.filter["axes"][0]
    np.testing.assert_array_equal(axis.F, document["F"])
    np.testing.assert_array_equal(axis.P0, document["P0"])
    assert axis.G.shape == (len(axis.states), 0)
    predicted = design.document["reports"][0]["predicted"]
    np.testing.assert_allclose(design.sigma(predicted["time_s"], axis="x"), predicted["total"], rtol=1e-12)
    budget = design.budget["drift"]
    shares = [row["share"] for row in budget.rows() if row["axis"] == "gyro_x"]
    assert sum(shares) == pytest.approx(1.0, abs=1e-9)


def test_insight_says_what_parts_buy(files: Path) -> None:
    angle = kf.tune(files / "params.json", plant="angle", aids=["2 deg @ 1 Hz"], runs=20, insight=True)
    worth = angle.worth
    assert {"angle", "drift"} == set(worth["output"])
    sensor = [row for row in worth.rows() if row["parameter"] == "sensor" and row["factor"] == 2.0]
    assert all(row["change"] > 0 for row in sensor)
    assert set(angle.budget) == {"drift", "angle"}


def test_estimates_are_arrays(design: kf.Design, files: Path) -> None:
    run = kf.replay(design, files / "log.npy")
    assert len(run.estimates["time (s)"]) == len(run["gyro_x_nis"]) == 36_000
    nis = run["gyro_x_nis"]
    assert np.mean(nis) == pytest.approx(run.document["axes"][0]["nis"]["mean"], rel=1e-9)
    assert run.to_pandas().shape[0] == run.to_polars().height == 36_000
    assert kf.replay(design, files / "log.npy", estimates=False).columns == {}


def test_verdicts(design: kf.Design, files: Path) -> None:
    kf.assert_consistent(design)
    wrong = kf.tune(files / "data/wrong/sigma_x2.24.json", truth=files / "data/wrong/truth.json")
    gate = kf.montecarlo(wrong, truth=files / "data/wrong/truth.json", runs=100)
    assert gate.consistent is False and gate.verdict == "inconsistent"
    with pytest.raises(AssertionError, match="inconsistent: "):
        kf.assert_consistent(gate)
    with pytest.raises(kf.KfdesignError, match="nothing is judged there"):
        kf.assert_consistent(kf.allan(files / "log.npy"))


def test_plots(found: kf.Identified, design: kf.Design, files: Path) -> None:
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("agg")
    import matplotlib.pyplot as plt

    flown = kf.fly(files / "data/flights/aerosonde.json", duration=2)
    steady = kf.trim(files / "data/airplanes/aerosonde.json", speed="25 m/s", altitude="100 m")
    gate = kf.montecarlo(design, runs=20, duration="60s")
    results = [found, design, kf.allan(files / "log.npy"), kf.compare(files / "params.json", files / "log.npy")]
    for result in [*results, kf.replay(design, files / "log.npy"), flown, steady, gate]:
        ax = result.plot()
        assert ax.has_data() and ax.get_xlabel()
        assert result.plot(ax=ax) is ax
        plt.close(ax.figure)
    assert design.budget["drift"].plot().has_data()
    ax = design.plot_sigma(until="1min", label="mine")
    assert ax.lines[0].get_xdata()[-1] <= 60.0
    plt.close("all")
    with pytest.raises(kf.KfdesignError, match="there is nothing to plot"):
        kf.plan(files / "params.json", parameter="white.density", precision=0.01).plot()


def test_params_of_others(files: Path, tmp_path: Path) -> None:
    yaml = tmp_path / "imu.yaml"
    kf.export(files / "params.json", to="kalibr", path=yaml)
    sheet = kf.read_params(yaml)
    assert sheet.quantity == "angular-rate" and sheet.axes
    assert kf.read_params(files / "params.json").x.white.density.value > 0
    with pytest.raises(kf.KfdesignError, match="no sensor is a 'accel'"):
        kf.read_params(yaml, sensor="accel")
    louder = kf.inflate(files / "params.json", files / "log.npy", from_=2)
    assert kf.tune(louder, runs=20).verdict
    assert kf.read_design(files / "filter.json")["x"].name == "gyro_x"


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda f: kf.identify(f / "log.npy", model="white+gmm"), kf.KfdesignError, "gmm"),
        (lambda f: kf.identify(f / "log.npy", modle="auto"), TypeError, "did you mean 'model'"),
        (lambda f: kf.montecarlo(f / "filter.json", runs=1), kf.KfdesignError, "one run judges nothing"),
        (lambda f: kf.montecarlo(f / "filter.json", runs=10**13), kf.KfdesignError, "run numbers up to"),
        (lambda f: kf.montecarlo(f / "log.npy"), kf.KfdesignError, "expected filter.json, found no JSON"),
        (lambda f: kf.tune(f / "none.json"), FileNotFoundError, "there is no such file"),
        (lambda f: kf.tune(3), TypeError, "expected params.json as a path or an object of this package"),
        (lambda f: kf.tune(f / "filter.json"), kf.ParamsError, "filter.json"),
        (lambda f: kf.plan(f / "params.json", parameter="white", precision=0.1), kf.KfdesignError, "no such parameter"),
        (lambda f: kf.inflate(f / "params.json", f / "log.npy", from_="2 s"), kf.KfdesignError, "expected a frequency"),
        (lambda f: kf.allan(f / "log.npy", taus="often"), kf.KfdesignError, "`taus` often: expected octave"),
        (lambda f: kf.replay(f / "filter.json", f / "log.npy", aid={"heading": "yaw"}), kf.KfdesignError, "heading"),
        (lambda f: kf.read_params(f / "params.json").save(f / "no/such.json"), kf.KfdesignError, "no/such.json"),
        (
            lambda f: kf.plan(f / "params.json", parameter="white.density", precision=0.1).report("/proc/x.html"),
            kf.KfdesignError,
            "/proc/x.html",
        ),
        (lambda f: kf.export(f / "params.json", to="nobody"), kf.KfdesignError, "unknown value `nobody`"),
        (lambda f: kf.set_threads(0), kf.KfdesignError, "expected 1 to 1024"),
        (lambda f: kf.identify([]), kf.LogError, "there is no log"),
    ],
)
def test_bad_requests_are_one_clear_line(call: object, error: type[Exception], message: str, files: Path) -> None:
    with pytest.raises(error, match=message) as raised:
        call(files)  # type: ignore[operator]
    assert "\n" not in str(raised.value)
    assert tempfile.gettempdir() + "/kfdesign-" not in str(raised.value)
    assert not (files / "no").exists()


def test_json_is_a_copy(found: kf.Identified) -> None:
    found.to_dict()["params"]["axes"].clear()
    assert json.loads(found.to_json()) == found.document
