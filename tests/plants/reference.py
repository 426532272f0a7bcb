"""Plants joined with their sensors, built with NumPy alone: prints reference.json, which tests/plants/matrices.rs compares with.

Every matrix is written down block by block from the equations in docs/plants.md; the steady state is the plain Riccati recursion,
run until it repeats. numpy 2, scipy 1 (matrix exponential of the custom plant).
"""
import json
import numpy as np
from scipy.linalg import expm

DEG = np.pi / 180


def blocks(*parts):
    n = sum(p.shape[0] for p in parts)
    out, at = np.zeros((n, n)), 0
    for p in parts:
        out[at:at + len(p), at:at + len(p)] = p
        at += len(p)
    return out


def bias(sigma):
    return np.eye(1), np.zeros((1, 1)), np.array([[sigma**2]]), [1.0]


def gm(sigma, tc, dt):
    a = np.exp(-dt / tc)
    return np.array([[a]]), np.array([[-sigma**2 * np.expm1(-2 * dt / tc)]]), np.array([[sigma**2]]), [1.0]


def quantization(c, dt):
    return np.array([[0, 0], [1.0, 0]]), np.diag([c**2, 0]), c**2 * np.eye(2), [1 / dt, -1 / dt]


def average(density, q, dt):
    v = density**2 / dt
    return np.eye(q, k=-1), np.diag([v] + [0] * (q - 1)), v * np.eye(q), [1 / q] * q


def sensor(*parts):
    f, q, p0 = (blocks(*(p[i] for p in parts)) for i in range(3))
    return f, q, p0, np.concatenate([p[3] for p in parts])


def settle(f, h, q, r, p0, every):
    """P before the update at a sample at which all are taken, iterated from P0 with the constants learnt (their P0 zero)."""
    period = int(np.lcm.reduce(every))
    p, steps = p0.copy(), 0
    while True:
        before = p.copy()
        for k in range(period):
            for i in range(len(r)):
                if k % every[i] == 0:
                    s = h[i] @ p @ h[i] + r[i]
                    g = p @ h[i] / s
                    keep = np.eye(len(p)) - np.outer(g, h[i])
                    p = keep @ p @ keep.T + r[i] * np.outer(g, g)
            p = f @ p @ f.T + q
        steps += period
        scale = np.sqrt(np.outer(np.diag(p), np.diag(p))) + 1e-300
        if np.max(np.abs(p - before) / scale) < 1e-14 or steps > 3_000_000:
            break
    s = h @ p @ h.T + np.diag(r)
    return period, p, p @ h.T @ np.linalg.inv(s)


def case(name, params, f, g, h, q, r, p0, every, constants):
    start = p0.copy()
    start[constants, :] = start[:, constants] = 0
    period, p, gain = settle(f, h, q, r, start, every)
    return dict(name=name, params=params, F=f.tolist(), G=g.tolist(), H=h.tolist(), Q=q.tolist(), R=r.tolist(),
                P0=p0.tolist(), every=every, period=period, predicted_covariance=p.tolist(), gain=gain.tolist())


def params(rate, axis, design):
    return {"format": "kfdesign-params/1", "quantity": "angular-rate", "sample_rate": f"{rate} Hz", "axes": [axis], "design": design}


def angle():
    dt = 0.1
    n2 = (0.0562 * DEG)**2
    fs, qs, ps, hs = sensor(bias(0.6 * DEG), gm(0.028 * DEG, 190, dt))
    fa, qa, pa, ha = gm(1 * DEG, 60, dt)
    f = blocks(np.eye(1), fs, fa)
    f[0, 1:3] = -dt * hs
    q = blocks(np.array([[dt**2 * n2 / dt]]), qs, qa)
    p0 = blocks(np.array([[(90 * DEG)**2]]), ps, pa)
    h = np.array([[1.0, 0, 0, 1.0]])
    g = np.array([[dt], [0], [0], [0]])
    doc = params(10, {"name": "z", "turn_on_bias": {"std_dev": "0.6 deg/s"}, "white": {"density": "0.0562 deg/s/sqrt(Hz)"},
                      "gauss_markov": {"std_dev": "0.028 deg/s", "correlation_time": "190 s"}},
                 {"plant": "angle", "initial_std_dev": "90 deg", "aids": [
                     {"name": "heading", "std_dev": "2 deg", "rate": "1 Hz",
                      "gauss_markov": {"std_dev": "1 deg", "correlation_time": "60 s"}}]})
    return case("angle", doc, f, g, h, q, np.array([(2 * DEG)**2]), p0, [10], [1])


def vertical():
    dt, gravity = 0.02, 9.8
    n2 = (0.05 * DEG)**2
    fs, qs, ps, hs = sensor(bias(0.5 * DEG), quantization(0.001 * DEG, dt), average(0.02 * DEG, 3, dt), gm(0.03 * DEG, 100, dt))
    fa, qa, pa, ha = sensor(bias(0.05), gm(0.3, 2, dt))
    k = len(hs)
    f = blocks(np.eye(1), fs, fa)
    f[0, 1:1 + k] = -dt * hs
    q = blocks(np.array([[dt**2 * n2 / dt]]), qs, qa)
    p0 = blocks(np.array([[(20 * DEG)**2]]), ps, pa)
    h = np.array([np.concatenate([[gravity], np.zeros(k), ha]), np.concatenate([[1.0], np.zeros(k + 2)])])
    g = np.zeros((len(f), 1))
    g[0, 0] = dt
    r = np.array([0.004**2 / dt, (1 * DEG)**2])
    doc = params(50, {"name": "x", "turn_on_bias": {"std_dev": "0.5 deg/s"}, "white": {"density": "0.05 deg/s/sqrt(Hz)"},
                      "quantization": {"coefficient": "0.001 deg"}, "moving_average": {"density": "0.02 deg/s/sqrt(Hz)", "samples": 3},
                      "gauss_markov": {"std_dev": "0.03 deg/s", "correlation_time": "100 s"}},
                 {"plant": "vertical", "initial_std_dev": "20 deg", "gravity": "9.8 m/s^2",
                  "accelerometer": {"name": "x", "turn_on_bias": {"std_dev": "0.05 m/s^2"}, "white": {"density": "0.004 m/s^2/sqrt(Hz)"},
                                    "gauss_markov": {"std_dev": "0.3 m/s^2", "correlation_time": "2 s"}},
                  "aids": [{"name": "horizon", "std_dev": "1 deg", "rate": "5 Hz"}]})
    return case("vertical", doc, f, g, h, q, r, p0, [1, 10], [1, 1 + k])


def rate():
    dt, k2 = 0.05, (5 * DEG)**2
    fs, qs, ps, hs = sensor(bias(0.6 * DEG), gm(0.1 * DEG, 30, dt))
    motion = k2 * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
    f = blocks(np.array([[1, dt], [0, 1.0]]), fs)
    q = blocks(motion, qs)
    p0 = blocks((50 * DEG)**2 * np.eye(2), ps)
    h = np.array([np.concatenate([[1.0, 0], hs]), [1.0, 0, 0, 0]])
    doc = params(20, {"name": "y", "turn_on_bias": {"std_dev": "0.6 deg/s"}, "white": {"density": "0.05 deg/s/sqrt(Hz)"},
                      "gauss_markov": {"std_dev": "0.1 deg/s", "correlation_time": "30 s"}},
                 {"plant": "rate", "initial_std_dev": "50 deg/s", "motion": {"integrated_random_walk": {"density": "5 deg/s^2/sqrt(s)"}},
                  "aids": [{"name": "odometer", "std_dev": "1 deg/s", "rate": "2 Hz"}]})
    r = np.array([(0.05 * DEG)**2 / dt, (1 * DEG)**2])
    return case("rate", doc, f, np.zeros((4, 0)), h, q, r, p0, [1, 10], [2])


def custom():
    """A damped pendulum with a torque that is known; the gyro sees its rate, an encoder its angle."""
    dt = 0.04
    a = np.array([[0, 1.0], [-4.0, -0.3]])
    b, noise = np.array([[0], [2.0]]), np.array([[0], [0.05]])
    m = expm(np.block([[a, b], [np.zeros((1, 3))]]) * dt)
    van = expm(np.block([[-a, noise @ noise.T], [np.zeros((2, 2)), a.T]]) * dt)
    fp = van[2:, 2:].T
    fs, qs, ps, hs = sensor(bias(0.6 * DEG), gm(0.1 * DEG, 30, dt))
    f = blocks(fp, fs)
    q = blocks(fp @ van[:2, 2:], qs)
    p0 = blocks(np.diag([0.1**2, 0.2**2]), ps)
    h = np.array([np.concatenate([[0, 1.0], hs]), [1.0, 0, 0, 0]])
    g = np.vstack([m[:2, 2:], np.zeros((2, 1))])
    doc = params(25, {"name": "y", "turn_on_bias": {"std_dev": "0.6 deg/s"}, "white": {"density": "0.05 deg/s/sqrt(Hz)"},
                      "gauss_markov": {"std_dev": "0.1 deg/s", "correlation_time": "30 s"}},
                 {"plant": "custom", "custom": {
                     "time": "continuous", "sensor": "rate",
                     "states": [{"name": "swing", "unit": "rad", "std_dev": "0.1 rad"},
                                {"name": "swing_rate", "unit": "rad/s", "std_dev": "0.2 rad/s"}],
                     "inputs": [{"name": "torque", "unit": "1"}],
                     "outputs": [{"name": "rate", "unit": "rad/s"}, {"name": "angle", "unit": "rad"}],
                     "A": a.tolist(), "B": b.tolist(), "G": noise.tolist(), "H": [[0, 1], [1, 0]]},
                  "aids": [{"name": "encoder", "std_dev": "1 deg", "rate": "5 Hz"}]})
    r = np.array([(0.05 * DEG)**2 / dt, (1 * DEG)**2])
    return case("custom", doc, f, g, h, q, r, p0, [1, 5], [2])


print(json.dumps([angle(), vertical(), rate(), custom()]))
