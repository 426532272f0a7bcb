"""The Python package beside the command: import, processor time of `allan`, memory of `identify`.

    python benches/python.py COMMAND [GIGABYTES]

in an environment with the package; COMMAND is a `kfdesign` of the same build. Every figure is that of a process of its
own, ours and the command's in turn. Two gigabytes take a quarter of an hour and eight gigabytes of memory.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

ROUNDS = 5
ALLAN, IDENTIFY = (f"import kfdesign as kf; kf.{name}('log.npy')" for name in ("allan", "identify"))


def child(folder: str, *words: str) -> tuple[float, int]:
    """Processor seconds and kilobytes at the peak."""
    with open(os.devnull, "w") as nothing:
        pid = subprocess.Popen(words, cwd=folder, stdout=nothing, stderr=nothing).pid
        _, status, used = os.wait4(pid, 0)
    if status:
        raise SystemExit(f"{words}: status {status}")
    return used.ru_utime + used.ru_stime, used.ru_maxrss


def log(folder: str, rows: int, axes: int) -> None:
    """White noise on a slow walk, written in parts."""
    names = [f"gyro_{name} (rad/s)" for name in "xyz"[:axes]]
    table = np.lib.format.open_memmap(
        Path(folder, "log.npy"), "w+", np.dtype([("time (s)", float), *((name, float) for name in names)]), (rows,)
    )
    random = np.random.default_rng(1)
    for start in range(0, rows, 1_000_000):
        part = table[start : start + 1_000_000]
        part["time (s)"] = (start + np.arange(len(part))) / 100.0
        for name in names:
            part[name] = random.normal(0.0, 1e-3, len(part))
    del table


def main() -> None:
    command = os.path.abspath(sys.argv[1])
    size = float(sys.argv[2]) if len(sys.argv) > 2 else 0.0
    with tempfile.TemporaryDirectory() as folder:
        python = [sys.executable, "-c"]
        idle = "import numpy"
        over = [child(folder, *python, idle)[0] for _ in range(ROUNDS)]
        ours = [child(folder, *python, "import kfdesign")[0] for _ in range(ROUNDS)]
        print(f"import over numpy's: {1e3 * (min(ours) - min(over)):.0f} ms of processor time")

        log(folder, 10_000_000, 1)
        rounds = []
        for _ in range(ROUNDS):
            theirs, _ = child(folder, command, "allan", "log.npy")
            mine, _ = child(folder, *python, ALLAN)
            start, _ = child(folder, *python, "import kfdesign")
            rounds.append((theirs, mine - start))
            print(f"allan of 10⁷: command {theirs:.2f} s, package {mine:.2f} s, of them import {start:.2f} s")
        least = [min(column) for column in zip(*rounds)]
        print(f"allan of 10⁷, least of {ROUNDS}: the call takes {least[1] / least[0]:.3f} of the command")

        if size:
            log(folder, int(size * 1e9 / 32), 3)
            _, theirs = child(folder, command, "identify", "log.npy")
            _, mine = child(folder, *python, IDENTIFY)
            print(f"identify of {size:g} GB: command {theirs / 1e3:.0f} MB, package {mine / 1e3:.0f} MB, {mine / theirs:.3f}")


if __name__ == "__main__":
    main()
