"""The five hot roads side by side with other programs, on the same data, in one run.

    python benches/peers.py [ROAD ...] [--folder target/peers] [--rounds 5] [--slow]

Roads: allan filter montecarlo likelihood text (default: all). Makes a virtual environment and the data (about 1 GB) in the folder, builds
the benches, runs ours and theirs in turn, each in a process of its own, and prints best times and ratios. --slow adds what takes minutes.
C++ with Eigen takes part where g++ and /usr/include/eigen3 are there. Needs the network once, for the environment.
"""
import argparse, json, os, re, subprocess, sys, time
from pathlib import Path

PACKAGES = ["allantools==2024.6", "filterpy==2.0.0", "numba==0.68.1", "numpy==2.4.6", "pandas==3.1.1", "polars==2.1.0",
            "scipy==1.17.1", "statsmodels==0.15.0", "jax==0.10.2"]
# gyroscope of all roads: 100 Hz, deg/s
DT, N, SIGMA, TC, BIAS, SB = 0.01, 0.0035, 0.002, 100.0, 0.05, 0.1
RUNS, STEPS = 1000, 10_000
EIGEN = r"""
#include <Eigen/Dense>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <vector>
int main(int, char** a) {
  const double dt = 0.01, n = 0.0035, s = 0.002, phi = std::exp(-dt / 100), q = s * s * (1 - phi * phi), R = n * n / dt;
  std::ifstream file(a[1], std::ios::binary); std::vector<double> z(1000000), v(z), nis(z);
  file.read((char*)z.data(), z.size() * 8); double best = 1e9, l = 0;
  for (int round = 0; round < 9; round++) {
    auto start = std::chrono::steady_clock::now();
    Eigen::Matrix2d F = Eigen::Vector2d(1, phi).asDiagonal(), Q = Eigen::Vector2d(0, q).asDiagonal(), P = Eigen::Vector2d(0.01, s * s).asDiagonal();
    Eigen::RowVector2d h(1, 1); Eigen::Vector2d x(0, 0); double product = 1; l = 0;
    for (size_t k = 0; k < z.size(); k++) {
      Eigen::Vector2d Ph = P * h.transpose(); double S = h.dot(Ph) + R, e = z[k] - h.dot(x); Eigen::Vector2d K = Ph / S;
      v[k] = e; nis[k] = e * e / S; l += nis[k]; product *= S; if (k % 16 == 15) { l += std::log(product); product = 1; }
      x = F * (x + K * e); P = (F * (P - K * Ph.transpose()) * F.transpose() + Q).eval();
    }
    best = std::min(best, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  }
  printf("{\"seconds\": %g, \"answer\": %.9g}\n", best, -0.5 * (l + z.size() * std::log(2 * M_PI)));
}
"""


def gyro(n, seed):
    import numpy as np
    from scipy.signal import lfilter
    g, phi = np.random.Generator(np.random.PCG64(seed)), np.exp(-DT / TC)
    w = g.standard_normal(n) * SIGMA * np.sqrt(1 - phi * phi)
    w[0] = SIGMA * g.standard_normal()
    return BIAS + lfilter([1.0], [1.0, -phi], w) + N / np.sqrt(DT) * g.standard_normal(n)


def make_data(folder):
    import numpy as np
    from scipy.signal import lfilter
    for name, n, seed in [("rate_1e6", 10**6, 1), ("rate_1e7", 10**7, 2)]:
        gyro(n, seed).tofile(folder / f"{name}.f64")
    g, phi, n = np.random.Generator(np.random.PCG64(4)), np.exp(-DT / TC), 10**6
    w = g.standard_normal(n) * SIGMA * np.sqrt(1 - phi * phi)
    rate = BIAS + lfilter([1.0], [1.0, -phi], w)
    angle = np.concatenate([[0.0], np.cumsum(DT * rate + N * np.sqrt(DT) * g.standard_normal(n))[:-1]])
    (angle + 0.01 * g.standard_normal(n)).tofile(folder / "angle_1e6.f64")
    axes = [np.arange(10**7) * DT] + [gyro(10**7, s) for s in (11, 12, 13)]
    with open(folder / "log.csv", "w") as f:
        f.write("t,gx,gy,gz\n")
        for i in range(0, 10**7, 100_000):
            f.write("".join("%.12g,%.12g,%.12g,%.12g\n" % r for r in zip(*(a[i:i + 100_000] for a in axes))))


def best(work, rounds):
    work()
    times, answer = [], None
    for _ in range(rounds):
        start = time.perf_counter()
        answer = work()
        times.append(time.perf_counter() - start)
    return min(times), answer


def one(peer, folder, rounds):
    """Best seconds of one peer, and a number of its answer."""
    import numpy as np
    road, name = peer.split("/")
    if road == "allan":
        y = np.fromfile(folder / "rate_1e7.f64")
        n = len(y)
        m = np.unique(np.round(np.logspace(0, np.log2(n // 10), 100, base=2)).astype(int))
        if name == "allantools":
            import allantools
            return best(lambda: allantools.oadev(y, rate=1 / DT, data_type="freq", taus=m * DT)[1][50], rounds)
        import numba

        @numba.njit(parallel=True, fastmath=True)
        def kernel(y, m, out):
            n = len(y); s = np.empty(n + 1); s[0] = 0.0; mean = y.mean()
            for i in range(n): s[i + 1] = s[i] + (y[i] - mean)
            for j in numba.prange(len(m)):
                k = m[j]; a = 0.0
                for i in range(n + 1 - 2 * k):
                    d = s[i + 2 * k] - 2 * s[i + k] + s[i]; a += d * d
                out[j] = np.sqrt(a / (2.0 * (n + 1 - 2 * k))) / k

        def run():
            out = np.empty(len(m)); kernel(y, m, out); return out[50]
        return best(run, rounds)
    phi = float(np.exp(-DT / TC)); q = SIGMA**2 * (1 - phi**2); r = N**2 / DT
    if road == "filter":
        from statsmodels.tsa.statespace import kalman_filter as K
        z = np.fromfile(folder / "rate_1e6.f64")
        f = K.KalmanFilter(k_endog=1, k_states=2, k_posdef=2)
        f["design"] = np.array([[1.0, 1.0]]); f["transition"] = np.diag([1.0, phi]); f["selection"] = np.eye(2)
        f["state_cov"] = np.diag([0.0, q]); f["obs_cov"] = np.array([[r]])
        f.initialize_known(np.zeros(2), np.diag([SB**2, SIGMA**2])); f.tolerance = 0; f.filter_method = K.FILTER_UNIVARIATE
        f.bind(z[:, None])

        def run():
            result = f.filter(); v, s = result.forecasts_error[0], result.forecasts_error_cov[0, 0]
            return (v * v / s, result.llf_obs.sum())[1]
        return best(run, min(rounds, 3))
    if road == "montecarlo":
        gain, S, I, P = np.empty((STEPS, 2)), np.empty(STEPS), np.empty((STEPS, 3)), np.diag([SB**2, SIGMA**2])
        F, Q, h = np.diag([1.0, phi]), np.diag([0.0, q]), np.ones(2)
        for k in range(STEPS):
            g = P @ h; S[k] = h @ g + r; gain[k] = g / S[k]; P = P - np.outer(gain[k], g)
            I[k] = np.array([P[1, 1], -P[0, 1], P[0, 0]]) / (P[0, 0] * P[1, 1] - P[0, 1]**2); P = F @ P @ F.T + Q
        if name == "numpy":
            def run():
                g = np.random.Generator(np.random.PCG64(1)); nees, nis = np.empty(STEPS), np.empty(STEPS)
                b = SB * g.standard_normal(RUNS); x = SIGMA * g.standard_normal(RUNS); xb, xg = np.zeros(RUNS), np.zeros(RUNS)
                for k in range(STEPS):
                    v = b + x + np.sqrt(r) * g.standard_normal(RUNS) - xb - xg; nis[k] = v @ v / S[k]
                    xb += gain[k, 0] * v; xg += gain[k, 1] * v; eb, eg = b - xb, x - xg
                    nees[k] = I[k, 0] * (eb @ eb) + 2 * I[k, 1] * (eb @ eg) + I[k, 2] * (eg @ eg)
                    xg *= phi; x = phi * x + np.sqrt(q) * g.standard_normal(RUNS)
                return nees.mean() / RUNS
            return best(run, min(rounds, 3))
        if name == "numba":
            import numba

            @numba.njit(parallel=True, fastmath=True)
            def kernel(seed, gain, S, I, sq, sr, phi, total):
                for t in numba.prange(2):
                    np.random.seed(seed + t)
                    for _ in range(t * RUNS // 2, (t + 1) * RUNS // 2):
                        b = SB * np.random.normal(); x = SIGMA * np.random.normal(); xb = 0.0; xg = 0.0
                        for k in range(STEPS):
                            v = b + x + sr * np.random.normal() - xb - xg
                            total[t, 1, k] += v * v / S[k]; xb += gain[k, 0] * v; xg += gain[k, 1] * v; eb = b - xb; eg = x - xg
                            total[t, 0, k] += I[k, 0] * eb * eb + 2 * I[k, 1] * eb * eg + I[k, 2] * eg * eg
                            xg *= phi; x = phi * x + sq * np.random.normal()

            def run():
                total = np.zeros((2, 2, STEPS)); kernel(1, gain, S, I, np.sqrt(q), np.sqrt(r), phi, total)
                return total.sum(0)[0].mean() / RUNS
            return best(run, rounds)
        if name == "jax":
            import jax, jax.numpy as jnp
            jax.config.update("jax_enable_x64", True)

            def run_of(key):
                k0, k1, k2 = jax.random.split(key, 3); i = jax.random.normal(k0, (2,), dtype="float64")
                w, e = jax.random.normal(k1, (STEPS,), dtype="float64"), jax.random.normal(k2, (STEPS,), dtype="float64")

                def step(c, a):
                    t, x, P = c; z = t.sum() + np.sqrt(r) * a[1]; Ph = P @ h; s = h @ Ph + r; v = z - x.sum()
                    x = x + Ph * (v / s); P = P - jnp.outer(Ph, Ph) / s; d = t - x; det = P[0, 0] * P[1, 1] - P[0, 1]**2
                    nees = (P[1, 1] * d[0]**2 - 2 * P[0, 1] * d[0] * d[1] + P[0, 0] * d[1]**2) / det
                    return (jnp.array([t[0], phi * t[1] + np.sqrt(q) * a[0]]), F @ x, F @ P @ F.T + Q), (nees, v * v / s)
                start = (jnp.array([SB, SIGMA]) * i, jnp.zeros(2), jnp.diag(jnp.array([SB**2, SIGMA**2])))
                return jax.lax.scan(step, start, (w, e))[1]
            g = jax.jit(lambda key: tuple(a.mean(0) for a in jax.vmap(run_of)(jax.random.split(key, RUNS))))
            return best(lambda: float(np.asarray(g(jax.random.key(1))[0]).mean()), min(rounds, 3))
        from filterpy.kalman import KalmanFilter
        few, g = 4, np.random.Generator(np.random.PCG64(1))

        def run():
            nees = 0.0
            for _ in range(few):
                f = KalmanFilter(2, 1); f.x = np.zeros((2, 1)); f.P = np.diag([SB**2, SIGMA**2]); f.F = F; f.Q = Q; f.H = h[None]; f.R = np.array([[r]])
                t = np.array([SB, SIGMA]) * g.standard_normal(2)
                for _ in range(STEPS):
                    f.update(t.sum() + np.sqrt(r) * g.standard_normal()); e = t - f.x[:, 0]; nees += e @ np.linalg.solve(f.P, e)
                    f.predict(); t = np.array([t[0], phi * t[1] + np.sqrt(q) * g.standard_normal()])
            return nees / few / STEPS
        seconds, answer = best(run, 1)
        return seconds * RUNS / few, answer
    if road == "likelihood":
        from scipy.optimize import minimize
        y = np.fromfile(folder / "rate_1e6.f64"); y = y - y.mean(); n = len(y)
        start = np.log([np.std(np.diff(y[:100_000])) / np.sqrt(2) * np.sqrt(DT), np.std(y) / 10, 10.0])
        fit = lambda f: minimize(f, start, method="L-BFGS-B", jac="3-point", options=dict(ftol=1e-15, gtol=1e-3, finite_diff_rel_step=1e-4))
        if name == "statsmodels":
            from statsmodels.tsa.statespace.mlemodel import MLEModel

            class Model(MLEModel):
                start_params = start; param_names = ["logN", "logsigma", "logTc"]
                def __init__(s, endog):
                    super().__init__(endog, k_states=1, k_posdef=1, initialization="stationary")
                    s["design", 0, 0] = 1; s["selection", 0, 0] = 1; s.ssm.memory_conserve = 0b11111
                def update(s, p, **k):
                    p = super().update(p, **k); s["obs_cov", 0, 0] = np.exp(2 * p[0]) / DT; a = np.exp(-DT / np.exp(p[2]))
                    s["transition", 0, 0] = a; s["state_cov", 0, 0] = np.exp(2 * p[1]) * (1 - a * a)
            c = 1 / np.std(y); shift = np.log([c, c, 1.0])
            model = Model(y * c)
            begin = time.perf_counter()
            result = fit(lambda p: -model.loglike(p + shift))
            return time.perf_counter() - begin, float(np.exp(result.x[2]))
        import numba

        @numba.njit
        def minus_log_likelihood(y, R, P, ph, q):
            x = 0.0; a = 0.0; l = 0.0; k = 0; n = len(y)
            while k < n:
                S = P + R; v = y[k] - x; K = P / S; a += v * v / S; l += np.log(S); x = ph * (x + K * v); Pn = ph * ph * (P - K * P) + q; k += 1
                if abs(Pn - P) < 1e-16 * P: break
                P = Pn
            c = ph * (1 - K); d = ph * K; t = 0.0
            for i in range(k, n): v = y[i] - x; t += v * v; x = c * x + d * y[i]
            return 0.5 * (a + t / S + l + (n - k) * np.log(S) + n * 1.8378770664093453)

        def at(p):
            n, s, t = np.exp(p)
            return minus_log_likelihood(y, n * n / DT, s * s, np.exp(-DT / t), -s * s * np.expm1(-2 * DT / t))
        return best(lambda: float(np.exp(fit(at).x[2])), rounds)
    path = str(folder / "log.csv")
    if name == "pandas":
        import pandas
        return best(lambda: float(pandas.read_csv(path, engine="c").to_numpy()[-1, 1]), rounds)
    import polars
    return best(lambda: float(polars.read_csv(path)["gx"][-1]), rounds)


# road: bench, the peers, and those that take minutes
ROADS = {
    "allan": ("allan", ["allantools", "numba"], []),
    "filter": ("filter", ["eigen", "statsmodels"], []),
    "montecarlo": ("montecarlo", ["numpy", "numba", "jax", "filterpy"], []),
    "likelihood": ("likelihood", ["numba"], ["statsmodels"]),
    "text": ("text", ["polars", "pandas"], []),
}


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("roads", nargs="*", choices=[[], *ROADS], help="default: all")
    parser.add_argument("--folder", type=Path, default=Path("target/peers"))
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--slow", action="store_true", help="with statsmodels' maximum likelihood (minutes)")
    parser.add_argument("--one", help=argparse.SUPPRESS)
    args = parser.parse_args()
    folder = args.folder.resolve()
    if args.one:
        seconds, answer = one(args.one, folder, args.rounds)
        print(json.dumps({"seconds": seconds, "answer": float(answer)}))
        return
    folder.mkdir(parents=True, exist_ok=True)
    python = folder / "venv/bin/python"
    if not python.exists():
        subprocess.run([sys.executable, "-m", "venv", folder / "venv"], check=True)
        subprocess.run([python, "-m", "pip", "install", "-q", *PACKAGES], check=True)
    if not (folder / "log.csv").exists():
        code = f"import sys; sys.path.insert(0, {str(Path(__file__).parent)!r}); import peers, pathlib; peers.make_data(pathlib.Path({str(folder)!r}))"
        subprocess.run([python, "-c", code], check=True)
    if Path("/usr/include/eigen3").exists() and not (folder / "eigen").exists():
        (folder / "eigen.cpp").write_text(EIGEN)
        subprocess.run(["g++", "-O3", "-march=native", "-I/usr/include/eigen3", folder / "eigen.cpp", "-o", folder / "eigen"], check=True)
    environment = dict(os.environ, KFDESIGN_BENCH_DATA=str(folder))
    for road in args.roads or ROADS:
        bench, peers, slow = ROADS[road]
        def ours():
            command = ["cargo", "bench", "-q", "--bench", bench, "--", "no criterion"]
            text = subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout
            found = re.findall(rf"^peers: {road} (?:seconds )?(\S+)", text, re.M)
            return float(found[-1]) if found else sys.exit(f"the bench {bench} prints no line 'peers: {road} SECONDS'")
        times = [ours()]
        rows = []
        for peer in peers + (slow if args.slow else []):
            if peer == "eigen":
                if not (folder / "eigen").exists():
                    continue
                command = [folder / "eigen", folder / "rate_1e6.f64"]
            else:
                command = [python, __file__, "--one", f"{road}/{peer}", "--folder", folder, "--rounds", str(args.rounds)]
            out = subprocess.run(command, capture_output=True, text=True, check=True).stdout
            rows.append((peer, json.loads(out.splitlines()[-1])["seconds"]))
        times.append(ours())
        print(f"{road}: ours {min(times):.4g} s (before and after the others: {times[0]:.4g}, {times[1]:.4g})")
        for peer, seconds in rows:
            print(f"  {peer:12} {seconds:10.4g} s {seconds / min(times):10.4g} times ours", flush=True)


if __name__ == "__main__":
    main()
