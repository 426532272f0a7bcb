"""Long calls: Ctrl-C, other threads, forks, listeners, silence."""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import kfdesign as kf

#: Work of seconds; each is stopped after a third of one.
LONG: dict[str, str] = {
    "allan": "kf.allan(log, taus='log:100')",
    "identify": "kf.identify(log)",
    "tune": "kf.tune('params.json', runs=10**6)",
    "replay": "kf.replay('filter.json', log)",
    "montecarlo": "kf.montecarlo('filter.json', runs=10**6)",
    "fly": "kf.fly('data/flights/aerosonde.json', duration='10h')",
}

STOPPED = """
import signal, sys, threading, time, warnings
import numpy as np, kfdesign as kf
warnings.simplefilter("ignore", kf.LogWarning)
log = kf.Log.from_array(np.load("large.npy"), rate=20, unit="rad/s", names=["gyro_x", "gyro_y", "gyro_z"])
sent = []
def interrupt():
    time.sleep(0.3)
    sent.append(time.perf_counter())
    signal.raise_signal(signal.SIGINT)
for turn in range(2):
    threading.Thread(target=interrupt).start()
    try:
        {call}
    except KeyboardInterrupt:
        print(f"{{1e3 * (time.perf_counter() - sent[-1]):.0f}}")
    else:
        sys.exit("it was not stopped")
print(len(kf.allan(kf.read_log("log.npy")).axes))
"""


@pytest.fixture(scope="module")
def large(files: Path) -> Path:
    """A log whose work takes seconds."""
    np.save(files / "large.npy", np.random.default_rng(1).normal(size=(3_000_000, 3)))
    return files


@pytest.mark.parametrize("name", LONG)
def test_ctrl_c_stops_within_a_fifth_of_a_second(name: str, large: Path) -> None:
    script = STOPPED.format(call=LONG[name])
    done = subprocess.run([sys.executable, "-c", script], cwd=large, capture_output=True, text=True, timeout=100)
    assert done.returncode == 0 and done.stderr == "", done.stderr
    *waits, axes = map(int, done.stdout.split())
    # the bar is 200 ms; a machine that others use may hold a process back for longer, but hardly twice
    assert min(waits) < 200 and axes == 3, waits
    print(f"{name}: stopped after {waits} ms")


def test_other_threads_go_on(design: kf.Design, files: Path) -> None:
    expected = kf.montecarlo(design, runs=40, duration="120s").to_json()
    found: list[str] = []
    ticks: list[float] = []
    over = threading.Event()

    def tick() -> None:
        while not over.is_set():
            ticks.append(time.perf_counter())
            time.sleep(0.001)

    def work() -> None:
        found.append(kf.montecarlo(design, runs=40, duration="120s").to_json())

    threads = [threading.Thread(target=work) for _ in range(2)]
    ticking = threading.Thread(target=tick)
    ticking.start()
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    over.set()
    ticking.join()
    assert found == [expected, expected]
    assert len(ticks) > 20
    # the interpreter is never held: what is left is the machine's own turn-taking
    assert np.median(np.diff(ticks)) < 0.02


def _in_child(path: str) -> str:
    return kf.montecarlo(path, runs=20, duration="60s").to_json()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork here")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_fork_after_a_parallel_call_works(files: Path) -> None:
    path = str(files / "filter.json")
    own = _in_child(path)
    with multiprocessing.get_context("fork").Pool(2) as pool:
        assert pool.map_async(_in_child, [path, path]).get(timeout=60) == [own, own]


def test_a_listener_hears_how_far_it_is(design: kf.Design) -> None:
    heard: list[tuple[str, int, int]] = []
    kf.montecarlo(design, runs=200, duration="600s", progress=lambda *said: heard.append(said))
    runs = [(done, parts) for stage, done, parts in heard if stage == "runs"]
    assert runs and runs[0][0] == 0 and all(done <= parts for done, parts in runs)
    assert [done for done, _ in runs] == sorted(done for done, _ in runs)


def test_what_a_listener_raises_comes_out(design: kf.Design) -> None:
    class Enough(Exception):
        pass

    def raises(stage: str, done: int, parts: int) -> None:
        raise Enough(stage)

    with pytest.raises(Enough):
        kf.montecarlo(design, runs=10**12, progress=raises)

    def interrupts(stage: str, done: int, parts: int) -> None:
        signal.raise_signal(signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        kf.montecarlo(design, runs=10**6, progress=interrupts)
    assert kf.montecarlo(design, runs=20, duration="60s").consistent


def test_a_stop_leaves_nothing(design: kf.Design, tmp_path: Path) -> None:
    def raises(stage: str, done: int, parts: int) -> None:
        if done:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        kf.simulate(
            Path(__file__).parents[2] / "data/params.json", output=tmp_path / "x.npy", duration="10h", progress=raises
        )
    assert list(tmp_path.iterdir()) == []


def test_nothing_is_printed(files: Path) -> None:
    script = (
        "import warnings; warnings.simplefilter('ignore'); import kfdesign as kf\n"
        "run = kf.replay(kf.tune(kf.identify('log.npy')), 'log.npy'); run.summary(); run.report('silent.html')\n"
        "try: kf.identify('params.json')\n"
        "except kf.LogError: pass\n"
    )
    done = subprocess.run([sys.executable, "-c", script], cwd=files, capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_a_bar_is_shown(design: kf.Design, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    kf.montecarlo(design, runs=200, duration="600s", progress=True)
    assert "runs" in capfd.readouterr().err
    monkeypatch.setitem(sys.modules, "tqdm.auto", None)
    kf.montecarlo(design, runs=200, duration="600s", progress=True)
    assert "runs [" in capfd.readouterr().err


def test_threads_do_not_change_the_result(design: kf.Design) -> None:
    one, two = (kf.montecarlo(design, runs=20, duration="60s", threads=count).to_json() for count in (1, 2))
    assert one == two
    kf.set_threads(1)
    try:
        assert kf.montecarlo(design, runs=20, duration="60s").to_json() == one
    finally:
        kf.set_threads(None)


def _peak(words: list[str], folder: Path) -> int:
    """The largest memory of a child, kB."""
    script = (
        "import resource, subprocess, sys; subprocess.run(sys.argv[1:], check=True, stdout=subprocess.DEVNULL);"
        "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)"
    )
    done = subprocess.run([sys.executable, "-c", script, *words], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return int(done.stdout)


@pytest.mark.skipif(sys.platform != "linux", reason="memory is counted in other units there")
def test_memory_is_that_of_the_command(files: Path, tmp_path: Path) -> None:
    from conftest import COMMAND

    np.save(tmp_path / "large.npy", np.random.default_rng(1).normal(size=(5_000_000, 3)))
    reading = ["--columns", "1,2,3", "--rate", "100", "--unit", "rad/s"]
    theirs = _peak([*COMMAND, "allan", "large.npy", *reading], tmp_path)
    call = "import kfdesign as kf; kf.allan(kf.read_log('large.npy', columns='1,2,3', rate=100, unit='rad/s'))"
    mine = _peak([sys.executable, "-c", call], tmp_path)
    interpreter = _peak([sys.executable, "-c", "import kfdesign"], tmp_path)
    assert mine < 1.05 * theirs + interpreter
    print(f"peak of allan: command {theirs} kB, package {mine} kB, of them the interpreter {interpreter} kB")
