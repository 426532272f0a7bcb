"""What the package gives is what the command prints, byte for byte, paths and versions included."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

import kfdesign as kf
from conftest import ROOT, Cli

AIRPLANE, FLIGHT = "data/airplanes/aerosonde.json", "data/flights/aerosonde.json"

#: A command line and the same request in Python.
PAIRS: dict[str, Callable[[], kf.Result]] = {
    "allan log.npy": lambda: kf.allan("log.npy"),
    "allan log.npy --taus decade --deviation mdev --columns gyro_x": lambda: kf.allan(
        kf.read_log("log.npy", columns=["gyro_x"]), taus="decade", deviation="mdev"
    ),
    "allan log.npy --taus octave --columns gyro_x --window 10min": lambda: kf.allan(
        kf.read_log("log.npy", columns="gyro_x"), window="10min"
    ),
    "identify log.npy": lambda: kf.identify("log.npy"),
    "identify log.npy --method graphical --columns gyro_x": lambda: kf.identify(
        kf.read_log("log.npy", columns=["gyro_x"]), method="graphical"
    ),
    "identify log.npy --model white+gm --hold gauss_markov.correlation_time=200s --start 1min": lambda: kf.identify(
        kf.read_log("log.npy", start="1min"), model="white+gm", hold={"gauss_markov.correlation_time": "200s"}
    ),
    "plan data/params.json --parameter gauss_markov.correlation_time --precision 10%": lambda: kf.plan(
        "data/params.json", parameter="gauss_markov.correlation_time", precision="10%"
    ),
    "compare params.json log.npy --parameters": lambda: kf.compare("params.json", "log.npy", parameters=True),
    "inflate params.json log.npy --from 2": lambda: kf.inflate("params.json", "log.npy", from_="2 Hz"),
    "simulate data/params.json -o made.npy --duration 1min --seed 2": lambda: kf.simulate(
        "data/params.json", output="made.npy", duration="1min", seed=2
    ),
    "tune params.json": lambda: kf.tune("params.json"),
    "tune data/wrong/sigma_x2.24.json --truth data/wrong/truth.json": lambda: kf.tune(
        "data/wrong/sigma_x2.24.json", truth="data/wrong/truth.json"
    ),
    "tune params.json --plant angle --aid 'heading: 2 deg @ 1 Hz' --runs 20 --insight": lambda: kf.tune(
        "params.json", plant="angle", aids=["heading: 2 deg @ 1 Hz"], runs=20, insight=True
    ),
    "tune --rank filter.json params.json log.npy": lambda: kf.rank(["filter.json", "params.json"], "log.npy"),
    "replay filter.json log.npy --alpha 0.02": lambda: kf.replay("filter.json", "log.npy", alpha=0.02, estimates=False),
    "replay filter.json log.npy --alpha 0.02 -o estimates.npy": lambda: kf.replay("filter.json", "log.npy", alpha=0.02),
    "replay filter.json log.npy -o smoothed.npy --smooth --end 900": lambda: kf.replay(
        "filter.json", kf.read_log("log.npy", end=900), smooth=True
    ),
    "replay filter.json log.npy --follow 5min -o estimates.npy": lambda: kf.replay(
        "filter.json", "log.npy", follow="5min"
    ),
    "montecarlo filter.json --runs 20 --duration 60s": lambda: kf.montecarlo("filter.json", runs=20, duration="60s"),
    f"trim {AIRPLANE} --speed '25 m/s' --altitude '100 m'": lambda: kf.trim(AIRPLANE, speed="25 m/s", altitude="100 m"),
    "loop data/flights/aerosonde-loop.json": lambda: kf.loop("data/flights/aerosonde-loop.json"),
    f"fly {FLIGHT} -o flight.npy --duration 2s": lambda: kf.fly(FLIGHT, output="flight.npy", duration=2),
}


@pytest.mark.parametrize("command", PAIRS)
def test_document_is_the_commands(command: str, cli: Cli) -> None:
    words = [word.strip("'") for word in re.findall(r"'[^']*'|\S+", command)]
    printed = cli(*words, "--json")
    assert PAIRS[command]().to_json() == printed


def test_every_command_of_the_tour_is_compared() -> None:
    shown = set(re.findall(r"^kfdesign (\w+)", (ROOT / "docs/tour.md").read_text(encoding="utf-8"), re.MULTILINE))
    compared = {command.split()[0] for command in PAIRS}
    # `man` writes manual pages of the command line
    assert shown - {"man"} <= compared


def test_info_is_the_commands(cli: Cli) -> None:
    assert kf.read_log("log.npy").info.to_json() == cli("info", "log.npy", "--json")


def test_files_are_the_commands(cli: Cli, here: Path) -> None:
    found = kf.identify("log.npy")
    found.save("mine.json")
    found.report("mine.html")
    cli("identify", "log.npy", "-o", "theirs.json", "--report", "theirs.html", "--plot", "theirs.svg")
    for ending in ("json", "html"):
        assert (here / f"mine.{ending}").read_bytes() == (here / f"theirs.{ending}").read_bytes()
    assert found.figures() == (here / "theirs.svg").read_text(encoding="utf-8")
    design = kf.tune("params.json")
    design.save("mine.json")
    cli("tune", "params.json", "-o", "theirs.json")
    assert (here / "mine.json").read_bytes() == (here / "theirs.json").read_bytes()
    gate = kf.montecarlo("filter.json", runs=20, duration="60s")
    gate.junit("mine.xml")
    gate.report("mine.html")
    cli("montecarlo", "filter.json", "--runs", "20", "--duration", "60s", "--junit", "theirs.xml", "--report", "t.html")
    assert (here / "mine.xml").read_bytes() == (here / "theirs.xml").read_bytes()
    assert (here / "mine.html").read_bytes() == (here / "t.html").read_bytes()


@pytest.mark.parametrize("target", ["kalibr", "px4", "matlab", "c", "rust"])
def test_exports_are_the_commands(target: str, cli: Cli, here: Path) -> None:
    what = "filter.json" if target in ("c", "rust") else "params.json"
    name = {"c": "drift.c", "rust": "drift.rs"}.get(target, "file.txt")
    for folder in ("mine", "theirs"):
        (here / folder).mkdir(exist_ok=True)
    text = kf.export(what, to=target, path=f"mine/{name}")
    cli("export", what, "--to", target, "-o", f"theirs/{name}")
    mine, theirs = (sorted((here / folder).iterdir()) for folder in ("mine", "theirs"))
    assert [one.name for one in mine] == [one.name for one in theirs]
    for one, other in zip(mine, theirs):
        assert one.read_bytes() == other.read_bytes()
    assert any(one.read_text(encoding="utf-8") == text for one in mine)


def test_summary_is_the_commands_answer(cli: Cli) -> None:
    said = kf.identify("log.npy").summary().split("(-v")[0].rstrip()
    assert cli("identify", "log.npy").startswith(said)


def test_an_object_in_the_place_of_a_file_gives_the_same_numbers(here: Path) -> None:
    found = kf.identify("log.npy")
    by_object = kf.tune(found)
    found.save("same.json")
    by_file = kf.tune("same.json")
    assert by_object.filter == by_file.filter
    assert "kfdesign-" not in by_object.summary().replace("kfdesign-filter", "")
    judged = kf.compare(found, "log.npy")
    # what was lent as a file is called by its name alone
    assert judged.document["params"] == "params.json"


def test_shards_merge_into_the_whole(here: Path) -> None:
    whole = kf.montecarlo("filter.json", runs=20, duration="60s")
    parts = [kf.montecarlo("filter.json", runs=part, duration="60s") for part in ("0..10", "10..20")]
    assert kf.merge(parts).to_json() == whole.to_json()
