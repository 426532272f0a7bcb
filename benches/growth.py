"""Time and memory against size, over four decades: whole commands of kfdesign on simulated logs.

    python benches/growth.py [KFDESIGN] [--svg docs/performance/growth.svg] [--folder target/growth] [--most 7]

Prints a table (the last column is the slope over the last decade) and draws it. Nothing but Python is needed; --most is the largest power of ten of samples (or rows).
"""
import argparse, math, os, subprocess, time
from pathlib import Path

PARAMS = """{"format": "kfdesign-params/1", "quantity": "angular-rate", "sample_rate": "100 Hz", "axes": [{"name": "x", "bias": "0 deg/s",
"turn_on_bias": {"std_dev": "0.6 deg/s"}, "white": {"density": "0.0562 deg/s/sqrt(Hz)"},
"gauss_markov": [{"std_dev": "0.02806 deg/s", "correlation_time": "20 s"}]}]}"""
COLOURS = ["#1b6ca8", "#c8553d", "#3a7d44", "#8a4fff", "#7a6c5d"]


def run(command, folder):
    """Wall seconds and peak memory in MB of a command that may fail with 1 (a verdict)."""
    start = time.perf_counter()
    child = subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    message = child.stderr.read()
    _, status, usage = os.wait4(child.pid, 0)
    code = os.waitstatus_to_exitcode(status)
    if code not in (0, 1):
        raise SystemExit(f"{' '.join(map(str, command))}: {message.decode()}")
    return time.perf_counter() - start, usage.ru_maxrss / 1024


def draw(rows, path):
    """Two log-log panels side by side."""
    width, height, left, top, size = 900, 400, 60, 40, 330
    parts = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="sans-serif" font-size="12">',
             f'<rect width="{width}" height="{height}" fill="white"/>']
    for panel, (which, title) in enumerate([(1, "time in s"), (2, "peak memory in MB")]):
        x0 = left + panel * 400
        values = [r[which] for points in rows.values() for r in points]
        low, high = math.floor(math.log10(min(values))), math.ceil(math.log10(max(values)))
        sizes = [r[0] for points in rows.values() for r in points]
        first, last = math.log10(min(sizes)), math.log10(max(sizes))
        x = lambda v: x0 + 300 * (math.log10(v) - first) / (last - first)
        y = lambda v: top + size - 20 - (size - 20) * (math.log10(v) - low) / (high - low)
        parts.append(f'<text x="{x0}" y="{top - 14}" font-weight="bold">{title}</text>')
        for power in range(low, high + 1):
            parts.append(f'<line x1="{x0}" x2="{x0 + 300}" y1="{y(10.0**power):.1f}" y2="{y(10.0**power):.1f}" stroke="#ddd"/>'
                         f'<text x="{x0 - 6}" y="{y(10.0**power) + 4:.1f}" text-anchor="end">10<tspan dy="-5" font-size="9">{power}</tspan></text>')
        for power in range(math.ceil(first), math.floor(last) + 1):
            parts.append(f'<line x1="{x(10.0**power):.1f}" x2="{x(10.0**power):.1f}" y1="{top}" y2="{top + size - 20}" stroke="#eee"/>'
                         f'<text x="{x(10.0**power):.1f}" y="{top + size}" text-anchor="middle">10<tspan dy="-5" font-size="9">{power}</tspan></text>')
        for colour, (name, points) in zip(COLOURS, rows.items()):
            line = " ".join(f"{x(p[0]):.1f},{y(p[which]):.1f}" for p in points)
            parts.append(f'<polyline points="{line}" fill="none" stroke="{colour}" stroke-width="2"/>')
            if panel == 1:
                row = list(rows).index(name)
                parts.append(f'<text x="{x0 + 10}" y="{top + 14 + 16 * row}" fill="{colour}">{name}</text>')
    parts.append(f'<text x="{width / 2 - 60}" y="{height - 6}">samples, rows or runs</text></svg>')
    path.write_text("\n".join(parts) + "\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("kfdesign", nargs="?", type=Path, default=Path("target/release/kfdesign"))
    parser.add_argument("--svg", type=Path)
    parser.add_argument("--folder", type=Path, default=Path("target/growth"))
    parser.add_argument("--most", type=int, default=7)
    args = parser.parse_args()
    program, folder = args.kfdesign.resolve(), args.folder
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "params.json").write_text(PARAMS)
    run([program, "tune", "params.json", "-o", "filter.json"], folder)
    rows = {name: [] for name in ("allan", "identify", "replay", "montecarlo", "text")}
    for power in range(args.most - 4, args.most + 1):
        n = 10**power
        for suffix in ("npy", "csv"):
            run([program, "simulate", "params.json", "--duration", f"{n // 100}s", "--seed", "1", "-o", f"log.{suffix}"], folder)
        commands = {
            "allan": ["allan", "log.npy"],
            "identify": ["identify", "log.npy", "--model", "white+gm", "-o", "found.json"],
            "replay": ["replay", "filter.json", "log.npy"],
            "montecarlo": ["montecarlo", "filter.json", "--runs", str(n // 100), "--duration", "30s"],
            "text": ["replay", "filter.json", "log.csv"],
        }
        for name, command in commands.items():
            times = [run([program, *command], folder) for _ in range(3 if power < args.most else 1)]
            size = n // 100 if name == "montecarlo" else n
            rows[name].append((size, min(t for t, _ in times), max(m for _, m in times)))
    for name, points in rows.items():
        (few, first, _), (many, last, _) = points[-2:]
        slope = math.log(last / first) / math.log(many / few)
        print(f"| {name} | " + " | ".join(f"{t:.3g} s, {m:.0f} MB" for _, t, m in points) + f" | {slope:.2f} |", flush=True)
    if args.svg:
        args.svg.parent.mkdir(parents=True, exist_ok=True)
        draw(rows, args.svg)


if __name__ == "__main__":
    main()
