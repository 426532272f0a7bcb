"""Filters and models in the types of other packages."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from .errors import DesignError

if TYPE_CHECKING:
    from .design import AxisFilter
    from .results import Trim


def _one_rate(axis: AxisFilter, program: str) -> None:
    if any(every != 1 for every in axis.every):
        slow = ", ".join(name for name, every in zip(axis.measurements, axis.every) if every != 1)
        raise DesignError(f"{axis.name}: {slow} is not taken at every sample, which a filter of {program} cannot say")


def to_filterpy(axis: AxisFilter) -> Any:
    """A ``filterpy.kalman.KalmanFilter`` with matrices, x0 and P0."""
    from filterpy.kalman import KalmanFilter

    _one_rate(axis, "filterpy")
    states, inputs = axis.G.shape
    made = KalmanFilter(dim_x=states, dim_z=len(axis.H), dim_u=inputs)
    made.F, made.H, made.Q, made.R = axis.F.copy(), axis.H.copy(), axis.Q.copy(), axis.R.copy()
    made.x, made.P = axis.x0.reshape(-1, 1).copy(), axis.P0.copy()
    if inputs:
        made.B = axis.G.copy()  # type: ignore[attr-defined,unused-ignore]  # pyright: ignore[reportAttributeAccessIssue]
    return made


def to_statsmodels(axis: AxisFilter, endog: npt.ArrayLike) -> Any:
    """A ``statsmodels`` state-space model of these samples, NaN where one is missing."""
    from statsmodels.tsa.statespace.mlemodel import MLEModel

    _one_rate(axis, "statsmodels")
    if axis.G.shape[1]:
        raise DesignError(f"{axis.name}: the sensor is an input of the filter; statsmodels has measurements alone")
    states = len(axis.F)
    # Q may be singular: the states are disturbed through its square root, whose columns are independent
    values, vectors = np.linalg.eigh(axis.Q)
    driven = values > values.max(initial=0.0) * np.finfo(float).eps * states
    selection = vectors[:, driven] * np.sqrt(values[driven])
    count = max(selection.shape[1], 1)
    model = MLEModel(np.asarray(endog, float), k_states=states, k_posdef=count)
    model["design"], model["transition"], model["obs_cov"] = axis.H, axis.F, axis.R
    if selection.shape[1]:
        model["selection"], model["state_cov"] = selection, np.eye(count)
    model.ssm.initialize_known(axis.x0, axis.P0)
    # nothing is estimated there
    model.loglikelihood_burn = 0
    return model


def to_control(axis: AxisFilter, dt: float) -> Any:
    """The steady filter from measurement to estimate before it, with its gains as filter and as predictor."""
    from control import StateSpace

    _one_rate(axis, "python-control")
    predictor = axis.F @ axis.gain
    states = len(axis.F)
    # x(k+1|k) = (F − F K H) x(k|k−1) + F K z(k) + G u(k)
    inputs = np.hstack([predictor, axis.G])
    direct = np.zeros((states, inputs.shape[1]))
    system = StateSpace(axis.F - predictor @ axis.H, inputs, np.eye(states), direct, dt)
    return system, axis.gain, predictor


def model_to_control(trim: Trim, model: str) -> Any:
    """A linear model of an airplane, whose outputs are its states."""
    from control import StateSpace

    a, b = trim.A(model), trim.B(model)
    return StateSpace(a, b, np.eye(len(a)), np.zeros(b.shape), states=trim.states(model), inputs=trim.inputs(model))
