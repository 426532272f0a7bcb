"""Maxima of the innovation likelihood by statsmodels, for tests/tune/likelihood.rs.

A sensor at rest (10 Hz) and a gyro integrated to an angle with a heading at every fifth sample; logs from a congruential generator, so that
the test makes the same ones. numpy 2.4.6, scipy 1.17.1, statsmodels 0.15.0: python3 tests/tune/reference.py
"""

import numpy as np
from scipy.optimize import minimize
from statsmodels.tsa.statespace.mlemodel import MLEModel


def uniform(n):
    """NIST SP 1065: n <- 16807 n mod (2^31 - 1), less a half."""
    out, state = np.empty(n), 16807
    for i in range(n):
        out[i] = state / 2147483647 - 0.5
        state = 16807 * state % 2147483647
    return out


DT = 0.1


def log_at_rest(n=3000):
    u, z, drift = uniform(2 * n), np.empty(n), 0.0
    for k in range(n):
        drift = 0.99 * drift + 0.05 * u[2 * k]
        z[k] = 0.1 + drift + 0.8 * u[2 * k + 1]
    return z


class Rest(MLEModel):
    """States bias, Gauss-Markov; deg/s."""

    def __init__(self, z):
        super().__init__(z, k_states=2, k_posdef=2, loglikelihood_burn=0)
        self["selection"] = np.eye(2)
        self["design"] = np.ones((1, 2))
        self.ssm.tolerance = 0

    def update(self, params, **kwargs):
        density, sigma, tc = np.exp(params)
        a = np.exp(-DT / tc)
        self["transition"] = np.diag([1.0, a])
        self["state_cov"] = np.diag([0.0, -(sigma**2) * np.expm1(-2 * DT / tc)])
        self["obs_cov"] = np.array([[density**2 / DT]])
        # a turn-on bias of 0.5 deg/s
        self.ssm.initialize_known(np.zeros(2), np.diag([0.25, sigma**2]))


def log_that_turns(n=4000):
    """Gyro (deg/s) and heading (deg), a number at every fifth sample."""
    u = uniform(3 * n)
    gyro, heading, drift, angle = np.empty(n), np.full(n, np.nan), 0.0, 0.0
    for k in range(n):
        drift = 0.99 * drift + 0.1 * u[3 * k]
        rate = 2.0 * np.sin(0.02 * k)
        gyro[k] = rate + 0.05 + drift + 0.5 * u[3 * k + 1]
        if k % 5 == 0:
            heading[k] = angle + 1.5 * u[3 * k + 2]
        angle += DT * rate
    return gyro, heading


class Angle(MLEModel):
    """States angle, bias, Gauss-Markov; deg, deg/s. angle+ = angle + dt (gyro - bias - drift - white)."""

    def __init__(self, gyro, heading):
        super().__init__(heading, k_states=3, k_posdef=3, loglikelihood_burn=0)
        self["selection"] = np.eye(3)
        self["design"] = np.array([[1.0, 0.0, 0.0]])
        intercept = np.zeros((3, len(gyro)))
        intercept[0] = DT * gyro
        self["state_intercept"] = intercept
        self.ssm.tolerance = 0

    def update(self, params, **kwargs):
        density, sigma, tc, aid = np.exp(params)
        a = np.exp(-DT / tc)
        self["transition"] = np.array([[1.0, -DT, -DT], [0.0, 1.0, 0.0], [0.0, 0.0, a]])
        self["state_cov"] = np.diag([DT**2 * density**2 / DT, 0.0, -(sigma**2) * np.expm1(-2 * DT / tc)])
        self["obs_cov"] = np.array([[aid**2]])
        # an angle known to 10 deg, a turn-on bias of 0.5 deg/s
        self.ssm.initialize_known(np.zeros(3), np.diag([100.0, 0.25, sigma**2]))


def best(model, start, names):
    f = lambda x: -model.loglike(x, transformed=True)
    x = np.log(start)
    print("  ln L at the start", repr(-f(x)))
    for _ in range(5):
        x = minimize(f, x, method="Nelder-Mead", options=dict(xatol=1e-9, fatol=1e-11, maxiter=20000, maxfev=20000)).x
    print("  ln L", repr(-f(x)), {n: float(v) for n, v in zip(names, np.exp(x))})
    h = 1e-3
    n = len(x)
    e = np.eye(n) * h
    hess = np.array([[(f(x + e[i] + e[j]) - f(x + e[i] - e[j]) - f(x - e[i] + e[j]) + f(x - e[i] - e[j])) / (4 * h * h) for j in range(n)] for i in range(n)])
    print("  standard deviations of the logarithms", np.sqrt(np.diag(np.linalg.inv(hess))))


print("at rest, deg/s")
best(Rest(log_at_rest()), [0.1, 0.05, 10.0], ["white.density", "gauss_markov.std_dev", "gauss_markov.correlation_time"])
print("angle, deg")
best(Angle(*log_that_turns()), [0.05, 0.1, 10.0, 0.5], ["white.density", "gauss_markov.std_dev", "gauss_markov.correlation_time", "heading.std_dev"])
