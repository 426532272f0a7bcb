"""Kalman-filter design for inertial sensors: identify, tune, replay, prove.

A log at rest goes in; noise parameters with intervals, a tuned filter, and a proof that its covariance tells the truth
come out. Units are strings and are never guessed; every number is that of the command ``kfdesign``.
"""

from __future__ import annotations

from . import allantools
from ._call import set_threads
from ._native import __version__
from .commands import (
    allan,
    assert_consistent,
    compare,
    datasheet,
    export,
    fly,
    identify,
    inflate,
    judge,
    loop,
    merge,
    montecarlo,
    nees,
    plan,
    rank,
    read_design,
    read_params,
    replay,
    simulate,
    trim,
    tune,
)
from .design import AxisFilter, Design
from .errors import DesignError, KfdesignError, LogError, LogWarning, ParamsError
from .log import Check, Finding, Log, read_log
from .params import AxisParams, Params
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
)
from .table import Measured, Table

__all__ = [
    "Allan",
    "AxisFilter",
    "AxisParams",
    "Check",
    "Comparison",
    "Design",
    "DesignError",
    "Finding",
    "Flight",
    "Identified",
    "Inflation",
    "KfdesignError",
    "Log",
    "LogError",
    "LogPlan",
    "LogWarning",
    "Loop",
    "Measured",
    "MonteCarlo",
    "Nees",
    "Params",
    "ParamsError",
    "Ranking",
    "Replay",
    "Result",
    "Simulation",
    "Table",
    "Trim",
    "__version__",
    "allan",
    "allantools",
    "assert_consistent",
    "compare",
    "datasheet",
    "export",
    "fly",
    "identify",
    "inflate",
    "judge",
    "loop",
    "merge",
    "montecarlo",
    "nees",
    "plan",
    "rank",
    "read_design",
    "read_log",
    "read_params",
    "replay",
    "set_threads",
    "simulate",
    "trim",
    "tune",
]
