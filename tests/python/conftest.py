"""What the tests share: the command to compare with, and files in a folder of their own."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

import kfdesign as kf

ROOT = Path(__file__).resolve().parents[2]
#: The command: a build of its own where one is named, else the one that the wheel installs.
COMMAND = shlex.split(os.environ.get("KFDESIGN", "")) or [sys.executable, "-m", "kfdesign"]

Cli = Callable[..., str]


@pytest.fixture(scope="session")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a log at rest of three axes at 20 Hz, its parameters, and a filter."""
    folder = tmp_path_factory.mktemp("files")
    os.symlink(ROOT / "data", folder / "data")
    kf.simulate(folder / "data/params.json", output=folder / "log.npy", duration="30min", rate=20, seed=5)
    kf.identify(folder / "log.npy").save(folder / "params.json")
    kf.tune(folder / "params.json").save(folder / "filter.json")
    return folder


@pytest.fixture
def here(files: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """That folder as the working directory: the command and the package then name files alike."""
    monkeypatch.chdir(files)
    return files


@pytest.fixture
def cli(here: Path) -> Cli:
    """The command's stdout; its exit status may be 0 or 1."""

    def run(*words: str) -> str:
        done = subprocess.run([*COMMAND, *words], capture_output=True, text=True, cwd=here)
        assert done.returncode in (0, 1), done.stderr
        return done.stdout

    return run


@pytest.fixture(scope="session")
def found(files: Path) -> kf.Identified:
    """What is identified of the log."""
    return kf.identify(files / "log.npy")


@pytest.fixture(scope="session")
def design(files: Path) -> kf.Design:
    """The filter."""
    return kf.tune(files / "params.json")
