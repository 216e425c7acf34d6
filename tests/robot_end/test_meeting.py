"""Several programs of one process in one simulated world: who runs when, and what can go wrong at the door."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
import serial

from khepera_hil.controllers import PROGRAMS
from khepera_hil.errors import UsageError, WorldError
from khepera_hil.experiments.meeting import meet
from khepera_hil.experiments.trial import Trial
from khepera_hil.opening import open_port
from khepera_hil.ports import meeting as meetings
from khepera_hil.ports.meeting import Turns

BODY = 0.057


@pytest.fixture(autouse=True)
def handlers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(serial, "protocol_handler_packages", ["serial.urlhandler", "khepera_hil.ports"])


def together(*work: Callable[[], None]) -> None:
    """Each in a thread of its own."""
    errors: list[BaseException] = []

    def run(one: Callable[[], None]) -> None:
        try:
            one()
        except BaseException as error:  # noqa: BLE001 - raised below
            errors.append(error)

    threads = [threading.Thread(target=run, args=(one,), daemon=True) for one in work]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
        assert not thread.is_alive()
    if errors:
        raise errors[0]


def url(number: int, share: str, robots: int = 2, **more: object) -> str:
    keys = {"seed": 1, "clock": "simulated", "robots": robots, "number": number, "share": share, **more}
    return "emulator://empty?" + "&".join(f"{key}={value}" for key, value in keys.items())


def test_turns_are_taken_by_the_first_to_wake() -> None:
    turns = Turns(range(1, 4))
    order: list[tuple[int, float]] = []

    def one(number: int, pace: float) -> Callable[[], None]:
        def run() -> None:
            assert turns.arrive(number) == set()
            for turn in range(1, 6):
                turns.sleep(number, pace * turn)
                order.append((number, turns.now))
                turns.sleep(number, 0.0)  # it is later already
            turns.leave(number)

        return run

    together(one(2, 2.0), one(1, 3.0), one(3, 2.0))
    expected = [(number, pace * turn) for number, pace in ((1, 3.0), (2, 2.0), (3, 2.0)) for turn in range(1, 6)]
    assert order == sorted(expected, key=lambda one: (one[1], one[0]))


def columns(trials: list[Trial]) -> list[list[tuple[Any, ...]]]:
    """Everything of each tick but the host's own columns."""
    return [
        [
            (tick.t, tick.raw, tick.evidence, tick.u, tick.draws, tick.command, tick.pose, tick.moved)
            for tick in trial.ticks
        ]
        for trial in trials
    ]


@pytest.mark.parametrize("programs", [("avoid", "home"), ("watchman", "avoid", "push")])
def test_whole_programs_that_meet_do_the_same_every_time(programs: tuple[str, ...]) -> None:
    def run(seed: int) -> list[Trial]:
        return meet([PROGRAMS[name].make() for name in programs], world="furnished", seed=seed, duration=8.0)

    first = run(5)
    assert columns(run(5)) == columns(first)
    assert columns(run(6)) != columns(first)
    assert [len(trial.ticks) for trial in first] == [80] * len(programs)
    # Each saw the other where the other was.
    for tick, other in zip(first[0].ticks, first[1].ticks, strict=True):
        if "robot 2" in tick.moved:
            assert tick.moved["robot 2"] == other.pose
    assert sum("robot 2" in tick.moved for tick in first[0].ticks) > 40
    assert [trial.score["robots_met_s"] >= 0 for trial in first] == [True] * len(programs)


def test_who_ends_first_leaves_the_others_in_peace() -> None:
    heard: list[float] = []

    def short() -> None:
        with closing(open_port(url(1, "peace"), 38400)) as port:
            port.write(b"D,5,5\n")
            port.clock.sleep_until(0.5)  # type: ignore[attr-defined]

    def long() -> None:
        with closing(open_port(url(2, "peace"), 38400)) as port:
            port.timeout = 1.0
            while port.clock.now() < 3.0:  # type: ignore[attr-defined]
                port.write(b"B\n")
                port.read(len(b"b,5.01,5.00\r\n"))
                heard.append(port.clock.now())  # type: ignore[attr-defined]
            poses = port.witness.poses()  # type: ignore[attr-defined]
            # The robot that was left goes on as it was told.
            assert sum(abs(a - b) for a, b in zip(poses["robot 1"], started["robot 1"], strict=True)) > 0.05

    with closing(open_port("emulator://empty?seed=1&clock=simulated&robots=2&number=2", 38400)) as alone:
        started = alone.witness.poses()  # type: ignore[attr-defined]
    together(short, long)
    assert len(heard) > 100
    assert not meetings._MEETINGS


def test_nobody_waits_for_ever_for_who_does_not_come(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(meetings, "PATIENCE", 0.1)
    for _ in range(2):
        with pytest.raises(UsageError, match="share=alone: nobody has opened the port of robot 1, robot 3"):
            open_port(url(2, "alone", 3), 38400)
    assert not meetings._MEETINGS


def test_a_place_is_taken_once_and_the_world_is_one(monkeypatch: pytest.MonkeyPatch) -> None:
    inside = threading.Event()

    def first() -> None:
        with closing(open_port(url(1, "door"), 38400)) as port:
            inside.wait(30)
            port.clock.sleep_until(1.0)  # type: ignore[attr-defined]

    def second() -> None:
        with closing(open_port(url(2, "door"), 38400)) as port:
            port.clock.sleep_until(0.5)  # type: ignore[attr-defined]

    def third() -> None:
        while not meetings._MEETINGS or len(meetings._MEETINGS["door"]._emulators) < 2:
            pass
        for asked, sentence in (
            (url(1, "door"), "share=door: robot 1 has its program already"),
            (url(2, "door", seed=4), "share=door is a world with seed 1, not 4"),
            (url(2, "door", 3), "share=door is a world with robots 2, not 3"),
        ):
            with pytest.raises(UsageError, match=sentence):
                open_port(asked, 38400)
        inside.set()

    together(first, second, third)
    assert not meetings._MEETINGS


@pytest.mark.parametrize(
    ("query", "sentence"),
    [
        ("robots=0", "takes from 1 to 32 robots, not 0"),
        ("robots=1000", "takes from 1 to 32 robots, not 1000"),
        ("robots=two", "takes a whole number for robots, not 'two'"),
        ("robots=2&number=3", "has robots 1 to 2 here, but no number 3"),
        ("number=0", "has robots 1 to 1 here, but no number 0"),
        ("robots=2&share=x", "shares a world in simulated time only; add clock=simulated"),
        (
            "robots=2&share=x&clock=simulated&faults=disconnect@3",
            "does not unplug the line of a shared world; leave disconnect out",
        ),
    ],
)
def test_a_mistake_in_the_name_is_a_sentence(query: str, sentence: str) -> None:
    with pytest.raises(UsageError, match=sentence):
        open_port(f"emulator://empty?{query}", 38400)


def test_what_goes_wrong_with_one_is_raised_when_all_have_ended(tmp_path: Path) -> None:
    class Broken:
        name, needs, decides, questions = "broken", ("N",), (), {}  # type: ignore[var-annotated]

        def step(self, readings: object, rng: object) -> None:
            raise ZeroDivisionError("broken")

    with pytest.raises(ZeroDivisionError):
        meet([Broken(), PROGRAMS["avoid"].make()], world="empty", seed=1, duration=2.0)  # type: ignore[list-item]
    assert not meetings._MEETINGS
    with pytest.raises(WorldError, match="no room for robot"):
        meet([PROGRAMS["avoid"].make() for _ in range(9)], world=str(_small(tmp_path)), seed=1, duration=1.0)


def _small(folder: Path) -> Path:
    path = folder / "small.toml"
    path.write_text("title = 'small'\nsize_mm = [300, 300]\n")
    return path


def test_each_run_is_recorded_and_can_be_read_back(tmp_path: Path) -> None:
    trials = meet(
        [PROGRAMS["avoid"].make(), PROGRAMS["avoid"].make()], world="empty", seed=2, duration=2.0, record=tmp_path
    )
    folders = [trial.folder for trial in trials]
    assert len({str(folder) for folder in folders}) == 2
    for folder, trial in zip(folders, trials, strict=True):
        assert folder is not None
        manifest = json.loads((folder / "manifest.json").read_text())
        assert {shape["name"] for shape in manifest["world"]["shapes"]} > {"robot"}
        assert len((folder / "ticks.jsonl").read_text().splitlines()) == len(trial.ticks) == 20


def test_a_watchman_sounds_the_alarm_when_another_robot_comes_by() -> None:
    """As its movement is seen: by the grey levels of the camera, over the line."""
    watchman, _ = meet(
        [PROGRAMS["watchman"].make(), PROGRAMS["avoid"].make()],
        world="watchman",
        seed=3,
        duration=50.0,
        options={"scenario": "meeting"},
    )
    alarms = [tick.t for tick in watchman.ticks for level, _ in tick.events if level == "alarm"]
    assert len(alarms) == watchman.score["alarms"] == 1
    assert watchman.score["alarms_false"] == 0
    assert watchman.score["movers_seen"] == 1
    assert watchman.score["movers_entered"] == 0  # it was there from the start
