"""The commands, as functions: keywords are the flags of the command line, with `_`."""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _native
from ._call import Call, Kept, Progress, StrPath, existing, number_of, suggesting, text_of, texts, writable
from .design import Design
from .errors import KfdesignError, LogError, LogWarning
from .log import Log
from .params import Params
from .results import (
    Allan,
    Comparison,
    Flight,
    Identified,
    Inflation,
    LogPlan,
    Loop,
    MonteCarlo,
    Nees,
    Ranking,
    Replay,
    Result,
    Simulation,
    Trim,
    columns_of,
)

#: A log, or the path of one that says all that is needed.
LogLike = Log | StrPath
#: Noise parameters: found, read, or the path of params.json.
ParamsLike = Identified | Inflation | Params | StrPath
#: A filter, or the path of filter.json.
DesignLike = Design | StrPath
Texts = Sequence[str] | Mapping[str, object] | str | None


def _log(log: LogLike) -> Log:
    if isinstance(log, Log):
        return log
    # the work reads it, and need not find it read once more
    path = existing(log)
    return Log(path, {}, {}, os.path.basename(path))


def _logs(logs: LogLike | Sequence[LogLike]) -> list[Log]:
    found = [_log(logs)] if isinstance(logs, (Log, str, os.PathLike)) else [_log(one) for one in logs]
    if not found:
        raise LogError("there is no log")
    if any(one._reading != found[0]._reading for one in found):
        raise LogError("the logs are read in different ways; logs of one sensor are read alike")
    return found


def _params(call: Call, what: ParamsLike) -> str:
    return call.document(what, "params.json")


def _share(value: float | str) -> str:
    return value if isinstance(value, str) else repr(float(value))


def _plant(
    call: Call,
    plant: str | Mapping[str, Any] | None,
    aids: Texts,
    motion: str | None,
    accelerometer: ParamsLike | None,
) -> dict[str, Any]:
    if isinstance(plant, Mapping):
        import json

        path = call.place("plant.json")
        with open(path, "w", encoding="utf-8") as file:
            json.dump(plant, file)
        plant = path
    found = {"plant": plant, "aid": texts(aids) or None, "motion": motion}
    if accelerometer is not None:
        found["accelerometer"] = _params(call, accelerometer)
    return {key: value for key, value in found.items() if value is not None}


@suggesting
def allan(
    log: LogLike,
    *,
    deviation: str = "oadev",
    taus: str = "octave",
    window: str | None = None,
    progress: Progress = False,
) -> Allan:
    """Allan deviations with 95 % intervals and noise identification.

    Parameters
    ----------
    log : Log or path
        Sensor at rest.
    deviation : {"oadev", "adev", "mdev", "hdev", "ohdev", "totdev"}
        Which.
    taus : str
        Averaging times: octave, decade, log, log:N (N for each decade) or all.
    window : str
        Read the log in windows of this length, for logs too long for memory: "24h".
    progress : bool or function
        Show how far it is.

    Returns
    -------
    Allan

    Examples
    --------
    >>> import kfdesign as kf
    >>> log = kf.simulate("data/params.json", duration="10min", rate=20).log
    >>> kf.allan(log)["x"].tau[:3].tolist()
    [0.05, 0.1, 0.2]
    """
    log = _log(log)
    with Call() as call:
        request = {"log": call.log(log), "deviation": deviation, "taus": taus, "window": window}
        return Allan(call.run("allan", {**request, "reading": log._reading}, progress))


@suggesting
def identify(
    log: LogLike | Sequence[LogLike],
    *,
    method: str = "likelihood",
    model: str = "auto",
    hold: Texts = None,
    robust: bool = False,
    temperature: str | None = None,
    window: str | None = None,
    progress: Progress = False,
) -> Identified:
    """Noise parameters from a log at rest, with intervals.

    What the log cannot tell is under `not_identified`, with the reason.

    Parameters
    ----------
    log : Log, path or a sequence of them
        Sensor at rest; several logs, one for each start, also give its turn-on bias.
    method : {"likelihood", "allan", "gmwm", "graphical"}
        How parameters are taken from the log.
    model : str
        Terms: auto, or white+gm, white+rrw …
    hold : mapping or sequence of str
        Parameters that are kept: ``{"gauss_markov.correlation_time": "200s"}``.
    robust : bool
        Leave outliers out.
    temperature : str
        Column of temperature; "none" reads none.
    window : str
        Read the log in windows of this length: "24h".
    progress : bool or function
        Show how far it is.

    Returns
    -------
    Identified

    Examples
    --------
    >>> import kfdesign as kf
    >>> log = kf.simulate("data/params.json", duration="10min", rate=20).log
    >>> found = kf.identify(log, model="white")
    >>> abs(found.x.white.density.value / 0.0562 - 1) < 0.02
    True
    """
    logs = _logs(log)
    with Call() as call:
        request = {
            "logs": [call.log(one) for one in logs],
            "method": method,
            "model": model,
            "hold": texts(hold),
            "window": window,
            "without_outliers": robust,
            "temperature": temperature,
            "reading": logs[0]._reading,
        }
        return Identified(call.run("identify", request, progress))


@suggesting
def plan(
    params: ParamsLike, *, parameter: str, precision: float | str, axis: str | None = None, rate: float | None = None
) -> LogPlan:
    """How long to record, and at which rate, to know a parameter to a wished precision.

    Parameters
    ----------
    params : Identified, Params or path
        Guesses of the right size.
    parameter : str
        ``"gauss_markov.correlation_time"``.
    precision : float or str
        Relative standard deviation: 0.1 or "10%".
    axis : str
        One axis; None: every axis that has the parameter.
    rate : float
        Sample rate in Hz; None: that of the parameters.

    Returns
    -------
    LogPlan

    Examples
    --------
    >>> import kfdesign as kf
    >>> kf.plan("data/params.json", parameter="gauss_markov.correlation_time", precision="10%").duration
    5.861e+04 s
    """
    with Call() as call:
        request = {"parameter": parameter, "precision": _share(precision), "axis": axis, "rate": rate}
        return LogPlan(call.run("plan", {"params": _params(call, params), **request}))


@suggesting
def compare(
    params: ParamsLike,
    log: LogLike,
    *,
    alpha: float = 0.01,
    parameters: bool = False,
    progress: Progress = False,
) -> Comparison:
    """Whether a noise model fits a log that it may not come from.

    Parameters
    ----------
    params : Identified, Params or path
        The model; of a path also a file of another program that :func:`read_params` knows.
    log : Log or path
        Sensor at rest.
    alpha : float
        Probability of a false alarm, over all tests together.
    parameters : bool
        Identify the log too, and put every number beside the log's own.
    progress : bool or function
        Show how far it is.

    Returns
    -------
    Comparison

    Examples
    --------
    >>> import kfdesign as kf
    >>> log = kf.simulate("data/params.json", duration="20min", rate=20).log
    >>> kf.compare("data/params.json", log).consistent
    True
    """
    log = _log(log)
    with Call() as call:
        request = {"params": _params(call, params), "log": call.log(log), "alpha": alpha, "parameters": parameters}
        return Comparison(call.run("compare", {**request, "reading": log._reading}, progress))


@suggesting
def inflate(
    params: ParamsLike, log: LogLike, *, from_: float | str | None = None, progress: Progress = False
) -> Inflation:
    """How many times louder than on the bench: the factor that vibration puts on white noise.

    Parameters
    ----------
    params : Identified, Params or path
        From the bench.
    log : Log or path
        With vibration, moving or not.
    from_ : float or str
        Lowest frequency used, above all motion: Hz, or "10 Hz".
    progress : bool or function
        Show how far it is.

    Returns
    -------
    Inflation

    Examples
    --------
    >>> import kfdesign as kf
    >>> log = kf.simulate("data/params.json", duration="10min").log
    >>> louder = kf.inflate("data/params.json", log, from_="10 Hz")
    >>> 0.98 < float(louder.factors["x"]) < 1.02
    True
    """
    log = _log(log)
    with Call() as call:
        request = {"params": _params(call, params), "log": call.log(log), "from": number_of(from_, "Hz", "from_")}
        return Inflation(call.run("inflate", {**request, "reading": log._reading}, progress))


@suggesting
def simulate(
    params: ParamsLike,
    *,
    duration: str | float | None = None,
    output: StrPath | None = None,
    seed: int = 1,
    run: int = 0,
    rate: float | None = None,
    true_rate: str = "rest",
    turn_on: bool = False,
    saturate: str | None = None,
    quantise: str | None = None,
    unit: str | None = None,
    decimals: int | None = None,
    truth: bool = True,
    plant: str | Mapping[str, Any] | None = None,
    aids: Texts = None,
    motion: str | None = None,
    accelerometer: ParamsLike | None = None,
    progress: Progress = False,
) -> Simulation:
    """A sensor stream with its truth.

    Parameters
    ----------
    params : Identified, Params or path
        The sensor.
    duration : str or float
        "2h", "600s"; a number is in seconds.
    output : path
        A file to write (.npy, .csv, .csv.gz); None: the log is in memory.
    seed, run : int
        Another run of the same seed is independent of this one.
    rate : float
        Sample rate in Hz; None: that of the parameters.
    true_rate : str
        rest, ``constant:1deg/s``, ``sine:10deg/s,0.5Hz`` or ``file:RATE.csv``.
    turn_on : bool
        Draw the turn-on bias too.
    saturate, quantise : str
        Largest value and step of the output, with units.
    unit : str
        Of the columns; None: that of the parameters.
    decimals : int
        Round to so many.
    truth : bool
        Whether there are columns of truth.
    plant : str or mapping
        What the sensor is part of, as in :func:`tune`, like the next three.
    aids : sequence of str
        Measurements beside it.
    motion : str
        Of the plant rate.
    accelerometer : Identified, Params or path
        Of the plants vertical and attitude.
    progress : bool or function
        Show how far it is.

    Returns
    -------
    Simulation

    Examples
    --------
    >>> import kfdesign as kf
    >>> simulated = kf.simulate("data/params.json", duration="1min", seed=3)
    >>> len(simulated.log), simulated["truth_x_drift"].shape
    (6000, (6000,))
    """
    with Call() as call:
        path = call.place("log.npy") if output is None else writable(output)
        request = {
            "params": _params(call, params),
            "output": path,
            "duration": None if duration is None else text_of(duration) + ("" if isinstance(duration, str) else "s"),
            "seed": seed,
            "run": run,
            "rate": rate,
            "true_rate": true_rate,
            "turn_on": turn_on,
            "saturate": saturate,
            "quantise": quantise,
            "unit": unit,
            "decimals": decimals,
            "no_truth": not truth,
            "plant": _plant(call, plant, aids, motion, accelerometer),
        }
        done = call.run("simulate", request, progress)
        return Simulation(done, columns_of(path) if path.endswith(".npy") else {})


@suggesting
def tune(
    params: ParamsLike,
    *,
    plant: str | Mapping[str, Any] | None = None,
    aids: Texts = None,
    motion: str | None = None,
    accelerometer: ParamsLike | None = None,
    flight: StrPath | None = None,
    objective: str = "nominal",
    hold: Texts = None,
    logs: LogLike | Sequence[LogLike] | None = None,
    truth: ParamsLike | None = None,
    verify: bool = True,
    insight: bool = False,
    flicker_horizon: float | None = None,
    runs: int = 100,
    seed: int = 1,
    held_out: float | None = None,
    no_prior: bool = False,
    progress: Progress = False,
) -> Design:
    """The augmented Kalman filter of noise parameters.

    Parameters
    ----------
    params : Identified, Params or path
        The sensor.
    plant : str or mapping
        What it is part of: static, angle, rate, vertical, attitude, airplane, a design file, or what one holds.
    aids : sequence of str
        Measurements beside it: ``["heading: 2 deg @ 1 Hz, 3 deg over 60 s"]``; columns of logs, ``"heading=yaw:deg"``.
    motion : str
        Of the plant rate: ``"20 deg/s over 0.5 s"``.
    accelerometer : Identified, Params or path
        Of the plants vertical and attitude.
    flight : path
        Of the plant airplane: flight.json.
    objective : {"nominal", "robust", "likelihood", "nees", "als"}
        What the parameters are chosen by.
    hold : sequence of str
        Parameters that stay, with an objective.
    logs : Log, path or a sequence of them
        Replayed through the design; some objectives choose on them.
    truth : Identified, Params or path
        Also say what the design does when the sensor has these parameters.
    verify : bool
        False: two runs only, for a look at many designs; `verdict` says nothing then.
    insight : bool
        Also say what better parts would buy, and what wrong parameters would cost.
    flicker_horizon : float
        Slowest time constant that the states for flicker cover, s.
    runs, seed : int
        Of the Monte Carlo that verifies.
    held_out : float
        Last share of each log that is foretold, with an objective.
    no_prior : bool
        Leave the intervals of the parameters out, with an objective.
    progress : bool or function
        Show how far it is.

    Returns
    -------
    Design

    Examples
    --------
    >>> import kfdesign as kf
    >>> design = kf.tune("data/params.json")
    >>> design["x"].F.shape
    (2, 2)
    """
    with Call() as call:
        found = [] if logs is None else _logs(logs)
        choosing = {"objective": objective, "hold": texts(hold), "held_out": held_out, "no_prior": no_prior}
        request = {
            "params": _params(call, params),
            "truth": None if truth is None else _params(call, truth),
            "runs": runs if verify else 2,
            "seed": seed,
            "insight": insight,
            "flicker_horizon": flicker_horizon,
            "log": [call.log(one) for one in found],
            "choosing": {key: value for key, value in choosing.items() if value is not None},
            "plant": {
                **_plant(call, plant, aids, motion, accelerometer),
                "flight": None if flight is None else existing(flight),
            },
            "reading": found[0]._reading if found else {},
        }
        return Design(call.run("tune", request, progress))


@suggesting
def rank(
    designs: DesignLike | ParamsLike | Sequence[DesignLike | ParamsLike],
    logs: LogLike | Sequence[LogLike],
    *,
    held_out: float = 1.0 / 3.0,
    flicker_horizon: float = 1e4,
    aids: Texts = None,
    progress: Progress = False,
) -> Ranking:
    """Designs ranked on logs: which foretells best what they did not see.

    Parameters
    ----------
    designs : Design, Params, path or a sequence of them
        Filters, or parameters as identified.
    logs : Log, path or a sequence of them
        Files.
    held_out : float
        Last share of each log that is foretold.
    flicker_horizon : float
        Of filters that are made of parameters, s.
    aids : sequence of str
        Columns of aids: ``"heading=yaw:deg"``.
    progress : bool or function
        Show how far it is.

    Returns
    -------
    Ranking
    """
    found = _logs(logs)
    several = [designs] if isinstance(designs, (str, os.PathLike, Result, Params)) else list(designs)
    with Call() as call:
        files = [call.document(one, "design.json") for one in several]
        request = {
            "files": [*files, *(call.log(one) for one in found)],
            "held_out": held_out,
            "flicker_horizon": flicker_horizon,
            "plant": {"aid": texts(aids)},
            "reading": found[0]._reading,
        }
        return Ranking(call.run("rank", request, progress))


@suggesting
def replay(
    design: DesignLike,
    log: LogLike,
    *,
    aid: Texts = None,
    form: str = "joseph",
    smooth: bool = False,
    innovations: bool | None = None,
    follow: str | None = None,
    gate: float | None = None,
    clip: float | None = None,
    alpha: float = 0.01,
    attitude: Mapping[str, Any] | None = None,
    output: StrPath | None = None,
    estimates: bool = True,
    progress: Progress = False,
) -> Replay:
    """A recorded log through a filter, with a verdict.

    Parameters
    ----------
    design : Design or path
        The filter.
    log : Log or path
        The log.
    aid : mapping
        Columns of its aids: ``{"heading": "yaw:deg"}``; of several axes a list of columns.
    form : {"joseph", "square-root", "constant-gain"}
        How the filter carries its covariance.
    smooth : bool
        Also estimates from the whole log.
    innovations : bool
        Also innovations, their sigmas and NIS; None: where nothing speaks against it.
    follow : str
        Find the wideband noise anew along the log, from its last samples: "20min".
    gate, clip : float
        Leave out, or hold at it, what is further out than so many sigmas.
    alpha : float
        Probability of a false alarm, over all tests together.
    attitude : mapping
        Of an attitude filter: ``reference``, ``reference_sigma``, ``movement``.
    output : path
        Write the estimates there (.npy, .csv, .csv.gz); None: they are in memory.
    estimates : bool
        Whether there are any. Without them nothing grows with the log, and the numbers are those of the command without
        ``-o``, which adds up in another order: the last digits differ.
    progress : bool or function
        Show how far it is.

    Returns
    -------
    Replay

    Examples
    --------
    >>> import kfdesign as kf
    >>> log = kf.simulate("data/params.json", duration="30min", seed=7).log
    >>> run = kf.replay(kf.tune("data/params.json"), log)
    >>> run.verdict
    'consistent'
    """
    log = _log(log)
    with Call() as call:
        filter_path = call.document(design, "filter.json")
        path = writable(output) if output is not None else call.place("estimates.npy") if estimates else None
        if innovations is None:
            is_attitude = isinstance(design, Design) and "attitude" in design.filter["format"]
            innovations = path is not None and not smooth and not is_attitude and attitude is None
        request = {
            "filter": filter_path,
            "log": call.log(log),
            "output": path,
            "innovations": innovations,
            "smooth": smooth,
            "alpha": alpha,
            "gate": gate,
            "clip": clip,
            "form": form,
            "follow": follow,
            "aid": texts(aid),
            "attitude": None if attitude is None else dict(attitude),
            "reading": log._reading,
        }
        done = call.run("replay", request, progress)
        return Replay(done, columns_of(path) if path is not None and path.endswith(".npy") else {})


@suggesting
def montecarlo(
    design: DesignLike,
    *,
    runs: int | str = 1000,
    duration: str | float | None = None,
    seed: int = 1,
    alpha: float = 0.01,
    truth: ParamsLike | None = None,
    truth_spread: bool = False,
    replicates: int = 0,
    power: bool = False,
    confirm: int = 0,
    runs_for: Texts = None,
    threads: int | None = None,
    resume: bool = False,
    output: StrPath | None = None,
    progress: Progress = False,
) -> MonteCarlo:
    """Many simulated runs through a filter: whether its covariance tells the truth.

    Parameters
    ----------
    design : Design or path
        The filter.
    runs : int or str
        How many, or a range of run numbers, "500..1000".
    duration : str or float
        Of a run; a number is in seconds; None: as the filter needs.
    seed : int
        Of all random numbers.
    alpha : float
        Probability of a false alarm, over all tests and axes together.
    truth : Identified, Params or path
        Simulate these parameters instead of the design's own.
    truth_spread : bool
        Draw the parameters of every run from their intervals.
    replicates : int
        Measure the false-alarm probability with so many whole experiments.
    power : bool
        Also what mistuning the gate would see.
    confirm : int
        Simulate each of these so often and count.
    runs_for : sequence of str
        How many runs see this mistuning: ``"gauss_markov.std_dev x1.3"``.
    threads : int
        The results do not depend on it.
    resume : bool
        Go on from what `output` holds.
    output : path
        The document; unfinished work is kept there, too.
    progress : bool or function
        Show how far it is.

    Returns
    -------
    MonteCarlo

    Examples
    --------
    >>> import kfdesign as kf
    >>> kf.montecarlo(kf.tune("data/params.json"), runs=50).verdict
    'consistent'
    """
    with Call() as call:
        request = {
            "filter": call.document(design, "filter.json"),
            "runs": str(runs),
            "duration": None if duration is None else text_of(duration) + ("" if isinstance(duration, str) else "s"),
            "seed": seed,
            "alpha": alpha,
            "truth": None if truth is None else _params(call, truth),
            "truth_spread": truth_spread,
            "replicates": replicates,
            "resume": resume,
            "threads": threads,
            "output": None if output is None else writable(output),
            "judging": {"power": power, "confirm": confirm, "runs_for": texts(runs_for)},
        }
        return MonteCarlo(call.run("montecarlo", request, progress, threads))


@suggesting
def merge(
    shards: Sequence[StrPath | MonteCarlo],
    *,
    power: bool = False,
    confirm: int = 0,
    runs_for: Texts = None,
    output: StrPath | None = None,
    progress: Progress = False,
) -> MonteCarlo:
    """One verdict from documents of :func:`montecarlo` whose runs adjoin, byte for byte that of all runs in one go.

    Parameters
    ----------
    shards : sequence of path or MonteCarlo
        In any order.
    power : bool
        As in :func:`montecarlo`, like the next two.
    confirm : int
        Experiments of each size.
    runs_for : sequence of str
        Mistunings.
    output : path
        The document.
    progress : bool or function
        Show how far it is.

    Returns
    -------
    MonteCarlo
    """
    with Call() as call:
        files = []
        for one in shards:
            if isinstance(one, MonteCarlo):
                files.append(call.place("shard.json"))
                with open(files[-1], "w", encoding="utf-8") as file:
                    file.write(one.to_json())
            else:
                files.append(existing(one))
        judging = {"power": power, "confirm": confirm, "runs_for": texts(runs_for)}
        request = {"shards": files, "output": None if output is None else writable(output), "judging": judging}
        return MonteCarlo(call.run("merge", request, progress))


@suggesting
def export(
    what: ParamsLike | DesignLike,
    *,
    to: str,
    path: StrPath | None = None,
    accelerometer: ParamsLike | None = None,
    rate: float | None = None,
    inflate: float | None = None,
    axis: str | None = None,
    walk: str | None = None,
    allow_zero_walk: bool = False,
    precision: str | None = None,
    form: str | None = None,
) -> str:
    """Noise parameters in the file of another program, or a filter as source code.

    Parameters
    ----------
    what : Identified, Inflation, Params, Design or path
        Parameters; a design for "c" and "rust".
    to : str
        kalibr, openvins, vins, orbslam3, gtsam, px4, ardupilot, matlab, gnss-ins-sim, navego, gazebo, c, rust.
    path : path
        Where it is written, whole or not at all; c: NAME.c, which gets NAME.h and NAME_test.c beside it.
    accelerometer : Identified, Params or path
        The other sensor of the unit.
    rate : float
        Of the log that the program will read, or of its filter, Hz.
    inflate : float
        Multiply every density and every drift.
    axis : str
        worst, mean or the name of one.
    walk : str
        least, short or ``horizon=60s``.
    allow_zero_walk : bool
        Write zeros where no drift is known.
    precision : {"float", "double"}
        Of code.
    form : {"full", "constant-gain"}
        Of code.

    Returns
    -------
    str
        The text; of several files the first.

    Examples
    --------
    >>> import kfdesign as kf
    >>> print(kf.export("data/params.json", to="kalibr", rate=200).splitlines()[0])
    # kfdesign 0.1.0 export
    """
    with Call() as call:
        code = {key: value for key, value in (("precision", precision), ("form", form)) if value is not None}
        request = {
            "params": call.document(what, "filter.json" if to in ("c", "rust") else "params.json"),
            "to": to,
            "output": None if path is None else writable(path),
            "accelerometer": None if accelerometer is None else _params(call, accelerometer),
            "rate": rate,
            "inflate": inflate,
            "axis": axis,
            "walk": walk,
            "allow_zero_walk": allow_zero_walk,
            "code": code,
        }
        files = call.run("export", request).files
    _native.write([(place, text) for place, text in files if place is not None])
    return files[0][1]


@suggesting
def read_params(path: StrPath, *, rate: float | None = None, sensor: str | None = None) -> Params:
    """Noise parameters of a file: params.json, or one of another program, known by its content.

    Parameters
    ----------
    path : path
        params.json, or of Kalibr, OpenVINS, ORB-SLAM3, imu_utils, gnss-ins-sim.
    rate : float
        Of the sensor in Hz, where the file does not say it.
    sensor : {"gyro", "accel"}
        Which of two; None: the gyro.

    Returns
    -------
    Params

    Examples
    --------
    >>> import kfdesign as kf
    >>> kf.read_params("data/params.json").axes[0].white.density
    0.0562 deg/s/sqrt(Hz)
    """
    found = existing(path)
    with open(found, "rb") as file:
        own = file.read(64).lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"{")
    with Call() as call:
        if own and rate is None:
            call.run("params", found)
            with open(found, encoding="utf-8") as text:
                return Params(text.read(), found)
        sensors = [Params(text) for _, text in call.run("import", {"file": found, "rate": rate}).files]
    wanted = {None: None, "gyro": "angular-rate", "accel": "specific-force"}.get(sensor, sensor)
    chosen = [one for one in sensors if wanted in (None, one.quantity)]
    if not chosen:
        raise KfdesignError(f"{found}: no sensor is a '{sensor}'; there is {sensors[0].quantity}")
    return chosen[0]


def read_design(path: StrPath) -> Design:
    """A filter of a file: filter.json or attitude.json.

    Parameters
    ----------
    path : path
        As `tune` writes it.

    Returns
    -------
    Design
    """
    found = existing(path)
    with open(found, encoding="utf-8") as file:
        text = file.read()
    if "kfdesign-attitude/" not in text[:2000]:
        with Call() as call:
            call.run("design", found)
    return Design(Kept(text, text), found)


@suggesting
def datasheet(
    *,
    rate: float,
    angle_random_walk: str | None = None,
    velocity_random_walk: str | None = None,
    noise_density: str | None = None,
    sided: str | None = None,
    total_noise: str | None = None,
    bandwidth: str | None = None,
    filter_order: int = 1,
    bias_instability: str | None = None,
    instability: str = "floor",
    correlation_time: str | None = None,
    rate_random_walk: str | None = None,
    turn_on_bias: str | None = None,
    axes: Sequence[str] = ("x", "y", "z"),
    name: str | None = None,
) -> Params:
    """Noise parameters from the words that datasheets print, each with its unit.

    Parameters
    ----------
    rate : float
        Sample rate of the log in Hz.
    angle_random_walk, velocity_random_walk : str
        ``"0.15 deg/sqrt(h)"``, ``"0.03 m/s/sqrt(h)"``.
    noise_density, sided : str
        ``"2.8 mdps/sqrt(Hz)"``, and "one" or "two".
    total_noise, bandwidth : str
        ``"0.05 deg/s"`` in ``"92 Hz"``.
    filter_order : int
        Of the low-pass of that bandwidth.
    bias_instability, instability : str
        ``"2.3 deg/h"``, and what it is: floor, coefficient or sigma.
    correlation_time : str
        Of the drift.
    rate_random_walk, turn_on_bias : str
        ``"0.5 deg/h/sqrt(h)"``, ``"0.5 deg/s"``.
    axes : sequence of str
        Names, all alike.
    name : str
        The product.

    Returns
    -------
    Params

    Examples
    --------
    >>> import kfdesign as kf
    >>> kf.datasheet(angle_random_walk="0.13 deg/sqrt(h)", rate=100).x.white.density
    0.13 deg/sqrt(h)
    """
    request = {**locals(), "axes": list(axes)}
    with Call() as call:
        return Params(call.run("datasheet", request).file or "")


@suggesting
def trim(
    file: StrPath,
    *,
    speed: str | None = None,
    altitude: str | None = None,
    climb: str | None = None,
    turn_rate: str | None = None,
    bank: str | None = None,
    lateral: str | None = None,
    froude: float | None = None,
) -> Trim:
    """Steady flight, the linear model about it, its modes and handling-quality levels.

    Parameters
    ----------
    file : path
        airplane.json or flight.json.
    speed, altitude, climb, turn_rate, bank : str
        ``"25 m/s"``, ``"100 m"``, ``"3 deg"``, ``"10 deg/s"``; each before what the document says.
    lateral : str
        What fixes the sideways motion.
    froude : float
        Also levels of an airplane so many times as large.

    Returns
    -------
    Trim

    Examples
    --------
    >>> import kfdesign as kf
    >>> steady = kf.trim("data/airplanes/aerosonde.json", speed="25 m/s", altitude="100 m")
    >>> steady.A("longitudinal").shape
    (4, 4)
    """
    request = {**locals(), "file": existing(file)}
    with Call() as call:
        return Trim(call.run("trim", request))


@suggesting
def loop(
    flight: StrPath,
    *,
    truth: StrPath | None = None,
    sweep: str | None = None,
    spread: int | None = None,
    optimize: bool = False,
    montecarlo: int | None = None,
    duration: str | float = "60s",
    seed: int = 1,
    progress: Progress = False,
) -> Loop:
    """The filter in the control loop: what every feed does to damping, margins, gusts and accuracy.

    Parameters
    ----------
    flight : path
        flight.json with autopilot, feeds and criteria.
    truth : path
        Another flight.json, in which the same gains and filters fly.
    sweep : {"lowpass", "noise", "airspeed", "gust", "gain", "delay"}
        Also vary one thing.
    spread : int
        Also judge so many drawn airplanes and sensors.
    optimize : bool
        Also choose corner and gains of each feed.
    montecarlo : int
        Also fly every feed so many times.
    duration : str or float
        Of a flight; a number is in seconds.
    seed : int
        Of all random numbers.
    progress : bool or function
        Show how far it is.

    Returns
    -------
    Loop

    Examples
    --------
    >>> import kfdesign as kf
    >>> judged = kf.loop("data/flights/aerosonde-loop.json")
    >>> judged.best
    'drift KF'
    """
    request = {
        "flight": existing(flight),
        "truth": None if truth is None else existing(truth),
        "sweep": sweep,
        "spread": spread,
        "optimize": optimize,
        "montecarlo": montecarlo,
        "duration": text_of(duration) + ("" if isinstance(duration, str) else "s"),
        "seed": seed,
    }
    with Call() as call:
        return Loop(call.run("loop", request, progress))


@suggesting
def fly(
    flight: StrPath,
    *,
    duration: str | float = "60s",
    output: StrPath | None = None,
    every: str | None = None,
    step: str | None = None,
    seed: int = 1,
    runs: int = 1,
    progress: Progress = False,
) -> Flight:
    """An airplane over time: truth, and what its sensors show.

    Parameters
    ----------
    flight : path
        flight.json.
    duration : str or float
        "60s", "5min"; a number is in seconds.
    output : path
        A file to write (.npy, .csv, .csv.gz), of several runs one for each; None: one run in memory.
    every, step : str
        Time between two rows, and the longest step of the integration.
    seed, runs : int
        Each run has its own gusts and noise.
    progress : bool or function
        Show how far it is.

    Returns
    -------
    Flight

    Examples
    --------
    >>> import kfdesign as kf
    >>> flown = kf.fly("data/flights/aerosonde.json", duration="2s")
    >>> flown["theta"].shape
    (201,)
    """
    with Call() as call:
        path = writable(output) if output is not None else call.place("flight.npy") if runs == 1 else None
        request = {
            "flight": existing(flight),
            "output": path,
            "duration": text_of(duration) + ("" if isinstance(duration, str) else "s"),
            "every": every,
            "step": step,
            "seed": seed,
            "runs": runs,
        }
        done = call.run("fly", request, progress)
        held = path is not None and path.endswith(".npy") and runs == 1
        return Flight(done, columns_of(path) if held and path is not None else {})


@suggesting
def judge(
    innovations: npt.ArrayLike, S: npt.ArrayLike, *, rate: float, alpha: float = 0.01, name: str = "innovation"
) -> Replay:
    """The tests of :func:`replay` for the innovations of a filter of any origin.

    The innovations over their own sigma are white noise of variance one if the filter tells the truth. They go
    through a filter that knows all (no drift, R = 1), so that its tests are about them.

    Parameters
    ----------
    innovations : array_like
        n, of one scalar measurement; NaN: there was none.
    S : array_like
        Their variance as the filter says it: n, or one number.
    rate : float
        Samples per second, Hz.
    alpha : float
        Probability of a false alarm, over all tests together.
    name : str
        Of the measurement.

    Returns
    -------
    Replay

    Examples
    --------
    >>> import numpy as np, kfdesign as kf
    >>> nu = 0.2 * np.random.default_rng(1).normal(size=20000)
    >>> kf.judge(nu, 0.04, rate=50).verdict, kf.judge(nu, 0.16, rate=50).verdict
    ('consistent', 'inconsistent')
    """
    nu, variance = np.asarray(innovations, float), np.asarray(S, float)
    nu, variance = (a.reshape(len(a)) if a.ndim > 1 and a.size == len(a) else a for a in (nu, variance))
    if nu.ndim != 1 or variance.shape not in ((), nu.shape):
        raise LogError(f"innovations {nu.shape} and S {variance.shape}: expected n scalars, and n variances or one")
    if not (variance > 0).all():
        raise LogError("S: a variance is not above zero")
    with warnings.catch_warnings():
        # the check of a log at rest would speak of motion
        warnings.simplefilter("ignore", LogWarning)
        return _judged(nu / np.sqrt(variance), rate, alpha, name)


def _judged(normalised: npt.NDArray[np.float64], rate: float, alpha: float, name: str) -> Replay:
    log = Log.from_array(normalised, rate=rate, unit="rad/s", names=[name], name="innovations")
    known = Design.from_matrices(1.0, 1.0, 0.0, 1.0, P0=0.0, rate=rate, name=name)
    return replay(known, log, alpha=alpha)


def nees(x: npt.ArrayLike, xhat: npt.ArrayLike, P: npt.ArrayLike) -> Nees:
    """Normalised estimation errors squared of a filter of any origin, over runs.

    (x − x̂)ᵀ P⁻¹ (x − x̂) is χ² with as many degrees of freedom as there are states, if the covariance is true. It is
    correlated in time, so bounds are those of the mean over runs at one epoch (Bar-Shalom, Li, Kirubarajan 2001,
    5.4.2), never of one run's mean.

    Parameters
    ----------
    x, xhat : array_like
        Runs by epochs by states; of one run epochs by states.
    P : array_like
        The same with states by states in the place of states.

    Returns
    -------
    Nees

    Examples
    --------
    >>> import numpy as np, kfdesign as kf
    >>> errors = np.random.default_rng(1).normal(size=(200, 50, 2))
    >>> kf.nees(errors, np.zeros_like(errors), np.broadcast_to(np.eye(2), (200, 50, 2, 2))).share_inside > 0.85
    True
    """
    error = np.asarray(x, float) - np.asarray(xhat, float)
    covariance = np.asarray(P, float)
    if error.ndim == 2:
        error, covariance = error[None], covariance[None]
    states = error.shape[-1]
    if error.ndim != 3 or covariance.shape != (*error.shape, states):
        raise KfdesignError(
            f"x {error.shape} and P {covariance.shape}: expected runs by epochs by states, and by states"
        )
    values = np.einsum("...i,...i->...", error, np.linalg.solve(covariance, error[..., None])[..., 0])
    runs = len(values)
    lower, upper = (_native.chi_square(share, float(runs * states)) / runs for share in (0.025, 0.975))
    return Nees(values, values.mean(axis=0), states, lower, upper)


def assert_consistent(result: Result) -> None:
    """Fail, as a test does, unless the verdict is "consistent".

    Parameters
    ----------
    result : Result
        Of replay, montecarlo, compare or tune.

    Raises
    ------
    AssertionError
        With the verdict in words.

    Examples
    --------
    >>> import kfdesign as kf
    >>> kf.assert_consistent(kf.tune("data/params.json"))
    """
    if result.verdict is None:
        raise KfdesignError(f"{type(result).__name__}: nothing is judged there")
    if not result.consistent:
        raise AssertionError(f"{result.verdict}: {result.meaning}")
