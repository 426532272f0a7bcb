"""Instructions that the five hot roads take, counted by valgrind's callgrind: the same on a busy machine.

    python benches/instructions.py [KFDESIGN] [--folder target/instructions]

Whole commands on simulated logs, one thread, as compiled for a processor with AVX2 (valgrind knows no AVX-512). The table is kept in
docs/performance.md; counts repeat to a few in a thousand (hash maps and allocation), so that more than a hundredth is a change.
"""
import argparse, os, re, subprocess
from pathlib import Path

from growth import PARAMS

SAMPLES, RUNS, STEPS = 100_000, 200, 3000


def instructions(command, folder):
    valgrind = ["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null", *map(str, command)]
    done = subprocess.run(valgrind, cwd=folder, capture_output=True, text=True, env=dict(os.environ, RAYON_NUM_THREADS="1"))
    found = re.search(r"Collected : (\d+)", done.stderr)
    if done.returncode not in (0, 1) or not found:
        raise SystemExit(f"{' '.join(map(str, command))}: {done.stderr}")
    return int(found[1])


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("kfdesign", nargs="?", type=Path, default=Path("target/release/kfdesign"))
    parser.add_argument("--folder", type=Path, default=Path("target/instructions"))
    args = parser.parse_args()
    program, folder = args.kfdesign.resolve(), args.folder
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "params.json").write_text(PARAMS)
    quietly = dict(cwd=folder, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    subprocess.run([program, "tune", "params.json", "-o", "filter.json"], **quietly)
    for suffix in ("npy", "csv"):
        simulate = ["simulate", "params.json", "--duration", f"{SAMPLES // 100}s", "--seed", "1", "-o", f"log.{suffix}"]
        subprocess.run([program, *simulate], **quietly)
    roads = [
        ("allan", ["allan", "log.npy", "--taus", "log"], SAMPLES, "sample"),
        ("filter", ["replay", "filter.json", "log.npy"], SAMPLES, "sample"),
        ("montecarlo", ["montecarlo", "filter.json", "--runs", str(RUNS), "--duration", f"{STEPS // 100}s", "--every-step", "every.csv"],
         RUNS * STEPS, "run and step"),
        ("likelihood", ["identify", "log.npy", "--model", "white+gm"], SAMPLES, "sample"),
        ("text", ["replay", "filter.json", "log.csv"], SAMPLES, "row"),
    ]
    print("| road | command | instructions | of each |\n| --- | --- | --- | --- |")
    for name, command, count, unit in roads:
        found = instructions([program, *command], folder)
        print(f"| {name} | `{' '.join(command)}` | {found / 1e6:.1f} million | {found / count:.0f} a {unit} |", flush=True)


if __name__ == "__main__":
    main()
