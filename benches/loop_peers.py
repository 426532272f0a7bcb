#!/usr/bin/env python3
"""The control loop against NumPy, SciPy and python-control: disk and gain margins, rms, damping.

    python -m venv peers && peers/bin/pip install numpy scipy control
    cargo build --release
    peers/bin/python benches/loop_peers.py target/release/kfdesign

The loops are built here once more from the matrices that `kfdesign trim` writes. python-control's disk margins are a
minimum over a grid; its `stability_margins` falls back on loops of some twenty discrete states and is then wrong, which
the eigenvalues show: its gain margin is printed beside ours and the radius of the closed loop at both.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import control
import numpy as np
import scipy.linalg as sl
import scipy.signal as ss

DT, DEG = 0.01, np.pi / 180
N, SD, TC, WALK = 0.0562 * DEG, 0.0280596 * DEG, 193.9312, 0.0005 * DEG
R_ATTITUDE = (20 * DEG) ** 2
GAINS = {"kq": 0.3, "ktheta": 1.0, "kp": 0.12, "kphi": 0.9, "kr": 0.3}


def turbulence(wind, h=100.0, v=25.0, b=2.8956):
    """Dryden, MIL-F-8785C: (A, B, C) of u w q and of v p r."""
    ft = h / 0.3048
    k = 0.177 + 0.000823 * ft
    sw = 0.1 * wind * 1852 / 3600
    su = sw / k**0.4
    tu, tw = ft / k**1.2 * 0.3048 / v, h / v
    spans = 4 * b / np.pi / v, 3 * b / np.pi / v

    def slope(sigma, t, span, sign):
        g = np.array([sigma * t**-1.5, sigma * np.sqrt(3 / t)])
        a = np.array([[0, 1, 0], [-1 / t**2, -2 / t, 0], [*(g / span), -1 / span]])
        return a, np.array([[*g, 0], [*(sign / (v * span) * g), -sign / (v * span)]])

    aw, cw = slope(sw, tw, spans[0], -1)
    av, cv = slope(su, tu, spans[1], 1)
    roll = sw**2 * 0.8 * (np.pi * h / 4 / b) ** (1 / 3) / (v * h)
    along = sl.block_diag([[-1 / tu]], aw)
    across = sl.block_diag(av, [[-1 / spans[0]]])
    ba, bl = np.zeros((4, 2)), np.zeros((4, 2))
    ba[0, 0], ba[2, 1] = su * np.sqrt(2 / tu), 1
    bl[1, 0], bl[3, 1] = 1, np.sqrt(np.pi * roll) / spans[0]
    ca, cl = np.zeros((3, 4)), np.zeros((3, 4))
    ca[0, 0], ca[1:, 1:] = 1, cw
    cl[[0, 2], :3], cl[1, 3] = cv, 1
    return (along, ba, ca), (across, bl, cl)


def discrete(a, b, g):
    n, m = b.shape
    block = np.block([[-a, g @ g.T], [np.zeros((n, n)), a.T]])
    x = sl.expm(block * DT)
    f = x[n:, n:].T
    held = sl.expm(np.block([[a, b], [np.zeros((m, n + m))]]) * DT)
    return f, held[:n, n:], f @ x[:n, n:]


def plant(model, surfaces, gust):
    a, b, e = (np.array(model[k]) for k in "ABE")
    b = b[:, [[i["name"] for i in model["inputs"]].index(s) for s in surfaces]]
    m = len(surfaces)
    n = 8 + 2 * m
    ac, bc, gc = np.zeros((n, n)), np.zeros((n, m)), np.zeros((n, 2))
    ac[:4, :4] = a
    for i in range(m):
        s = 4 + 2 * i
        ac[:4, s], ac[s, s + 1], ac[s + 1, s : s + 2], bc[s + 1, i] = b[:, i], 1, (-2500, -70), 2500
    ac[:4, 4 + 2 * m :], ac[4 + 2 * m :, 4 + 2 * m :], gc[4 + 2 * m :] = e @ gust[2], gust[0], gust[1]
    f, g, q = discrete(ac, bc, gc)
    full, enter = np.zeros((n + m, n + m)), np.zeros((n + m, m))
    full[:n, :n], full[:n, n:], enter[n:] = f, g, np.eye(m)
    return full, enter, sl.block_diag(q, np.zeros((m, m)))


def build(model, pitch, feed, wind=15):
    """Open loop (A, B, C) at the commands, noise enters, covariances per source."""
    surfaces = ["elevator"] if pitch else ["aileron", "rudder"]
    f, g, q = plant(model, surfaces, turbulence(wind)[0 if pitch else 1])
    rates = [2] if pitch else [1, 2]
    k, m, n = len(rates), len(surfaces), len(f)
    phi = np.exp(-DT / TC)
    ft, gt = sl.block_diag(f, phi * np.eye(k)), np.vstack([g, np.zeros((k, m))])
    h = np.zeros((k + 1, n + k))
    for i, r in enumerate(rates):
        h[i, r] = h[i, n + i] = 1
    h[k, 3] = 1
    c = 1 - np.exp(-DT / 5)
    if feed == "airframe":
        fk = sl.block_diag(f, np.eye(k), phi * np.eye(k))
        gk = np.vstack([g, np.zeros((2 * k, m))])
        qk = sl.block_diag(q, WALK**2 * DT * np.eye(k), SD**2 * (1 - phi**2) * np.eye(k))
        hk = np.hstack([h[:, :n], np.vstack([np.hstack([np.eye(k)] * 2), np.zeros((1, 2 * k))])])
        rk = np.diag([N**2 / DT] * k + [R_ATTITUDE])
        p = sl.solve_discrete_are(fk.T, hk.T, qk, rk)
        gain = p @ hk.T @ np.linalg.inv(hk @ p @ hk.T + rk)
        rest = np.eye(len(fk)) - gain @ hk
        af, bf, bu, cf, df = fk @ rest, fk @ gain, gk, rest[rates + [3]], gain[rates + [3]]
    else:
        af, bf = np.array([[1 - c]]), np.zeros((1, k + 1))
        bf[0, 0], bf[0, k] = DT, c
        cf, df = np.zeros((k + 1, 1)), np.eye(k + 1)
        cf[k, 0], df[k, k] = 1 - c, c
        if isinstance(feed, tuple):
            a, b, cc, d = ss.tf2ss(*ss.butter(feed[0], feed[1] * 2 * DT))
            for i in range(k):
                at, s = len(af), len(a)
                af = sl.block_diag(af, a)
                bf = np.vstack([bf, np.zeros((s, k + 1))])
                bf[at:, i] = b[:, 0]
                cf = np.hstack([cf, np.zeros((k + 1, s))])
                cf[i, at:], df[i, i] = cc[0], d[0, 0]
        bu = np.zeros((len(af), m))
    if pitch:
        al, bl, cl = np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((1, 0))
        dl = np.array([[GAINS["kq"], GAINS["ktheta"]]])
    else:
        a, b = (2 - DT) / (2 + DT), 2 / (2 + DT)
        al, bl, cl = np.array([[a]]), np.array([[0, a * b - b, 0]]), np.array([[0], [GAINS["kr"]]])
        dl = np.array([[-GAINS["kp"], 0, -GAINS["kphi"]], [0, GAINS["kr"] * b, 0]])
    nl = len(al)
    cc, dc = np.hstack([dl @ cf, cl]), dl @ df
    known = np.vstack([bu, np.zeros((nl, m))])
    ac = np.block([[af, np.zeros((len(af), nl))], [bl @ cf, al]]) + known @ cc
    bc = np.vstack([bf, bl @ df]) + known @ dc
    nc, nt = len(ac), n + k
    opened = np.block([[ft, np.zeros((nt, nc))], [bc @ h, ac]])
    b, c_ = np.vstack([gt, np.zeros((nc, m))]), np.hstack([dc @ h, cc])
    enter = np.vstack([gt @ dc, bc])
    total = sl.block_diag(q, SD**2 * (1 - phi**2) * np.eye(k), np.zeros((nc, nc)))
    total = total + enter @ np.diag([N**2 / DT] * k + [R_ATTITUDE]) @ enter.T
    return opened, b, c_, total, rates, surfaces


def main():
    program = sys.argv[1] if len(sys.argv) > 1 else "target/release/kfdesign"
    root = Path(__file__).resolve().parent.parent
    feeds = [("raw", {"type": "raw"}), ((2, 10), {"type": "lowpass", "order": 2, "corner": "10 Hz"}), ("airframe", {"type": "airframe"})]
    flight = json.loads((root / "data/flights/aerosonde-loop.json").read_text())
    flight["airplane"], flight["sensors"]["gyro"] = str(root / "data/airplanes/aerosonde.json"), str(root / "data/params.json")
    flight["feeds"] = [entry for _, entry in feeds]
    flight.pop("criteria")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "flight.json"
        path.write_text(json.dumps(flight))
        run = lambda *args: json.loads(subprocess.run([program, *args, "--json"], capture_output=True, text=True, check=True).stdout)
        found, linear = run("loop", str(path)), run("trim", str(path))
    worst = 0.0
    for (feed, _), ours in zip(feeds, found["feeds"]):
        for half, model in [("pitch", "longitudinal"), ("roll_yaw", "lateral")]:
            a, b, c, q, rates, surfaces = build(linear["models"][model], half == "pitch", feed)
            closed = a + b @ c
            x = sl.solve_discrete_lyapunov(closed, q)
            for i, surface in enumerate(surfaces):
                others = [j for j in range(len(surfaces)) if j != i]
                broken = a + b[:, others] @ c[others]
                system = control.ss(broken, b[:, [i]], -c[[i]], 0, DT)
                margin = ours[half]["margins"][i]
                disk = float(control.disk_margins(system, np.geomspace(1, np.pi / DT, 20000))[0])
                theirs = 20 * np.log10(control.stability_margins(system)[0])
                radius = lambda db: np.abs(np.linalg.eigvals(broken + 10 ** (db / 20) * np.outer(b[:, i], c[i]))).max()
                rate = np.sqrt(x[5 + 2 * i, 5 + 2 * i]) / DEG
                rms = ours[half]["rms"][f"{surface}_rate"]["all"]
                worst = max(worst, abs(disk - margin["disk"]), abs(rate / rms - 1))
                print(
                    f"{ours['name']:12} {surface:9} disk {margin['disk']:.5f} (python-control {disk:.5f}), gain "
                    f"{margin['gain_db']:.4f} dB, radius there {radius(margin['gain_db']):.6f} (python-control {theirs:.4f} dB, "
                    f"radius {radius(theirs):.6f}), rate {rms:.5f} ({rate:.5f}) deg/s"
                )
    print(f"largest difference {worst:.1e}")
    return 0 if worst < 1e-3 else 1


if __name__ == "__main__":
    sys.exit(main())
