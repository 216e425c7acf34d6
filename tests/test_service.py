"""One tick after the other against a robot that can be told to fall silent, on the simulated clock."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest

from brp import ImpossibleEvidence, Question
from khepera_hil import errors
from khepera_hil.clock import SimulatedClock
from khepera_hil.conduct import HOLD
from khepera_hil.controllers import PROGRAMS, Decision
from khepera_hil.errors import LinkLost, NoAnswer, RecordingError
from khepera_hil.khepera import Khepera
from khepera_hil.link import Link
from khepera_hil.perception import Readings
from khepera_hil.protocol import RequestLines
from khepera_hil.recording import Recording, Tick
from khepera_hil.service import Service
from tests.client_end.lines import BOOT_TEXT, SimulatedPort

ANSWERS = {
    b"N": b"n,0,0,0,0,0,0,0,0\r\n",
    b"O": b"o,500,500,500,500,500,500,500,500\r\n",
    b"B": b"b,5.01,5.00\r\n",
    b"E": b"e,0,0\r\n",
    b"K": b"k,1,0,0,1,0,0\r\n",
    b"H": b"h,700,650\r\n",
}


class Robot(SimulatedPort):
    """Answers as a robot in an empty world, unless it is told to be silent; keeps what it was told to drive."""

    def __init__(self, clock: SimulatedClock) -> None:
        super().__init__(clock)
        self.silent: Callable[[float, bytes], bool] = lambda now, request: False
        self.gone_at = float("inf")
        self.resets: list[float] = []  # moments at which it is switched off and on
        self.answers = dict(ANSWERS)
        self.speeds: list[tuple[float, bytes]] = []
        self._lines = RequestLines()

    def respond(self, data: bytes) -> None:
        if self.clock.now() >= self.gone_at:
            raise OSError(5, "Input/output error")
        while self.resets and self.clock.now() >= self.resets[0]:
            self.resets.pop(0)
            self.come(BOOT_TEXT)
        for line in self._lines.feed(data):
            if not line:
                continue
            if line.startswith(b"D"):
                self.speeds.append((self.clock.now(), line))
            if not self.silent(self.clock.now(), line):
                self.come(self.answers.get(line, b"d\r\n"))


@dataclass
class Bench:
    robot: Robot
    service: Service
    recording: Recording

    def ticks(self) -> list[dict[str, Any]]:
        return [json.loads(line) for line in (self.recording.folder / "ticks.jsonl").read_text().splitlines()]


PATIENCE = 2.0
"""Seconds, of all services here."""


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return at_the_bench(tmp_path, PROGRAMS["avoid"][1]())


def at_the_bench(folder: Path, controller: Any, **more: Any) -> Bench:
    clock = SimulatedClock()
    robot = Robot(clock)
    service = Service(
        Khepera(Link(robot, clock, baud=38400)),
        controller,
        clock=clock,
        period=0.1,
        rng=np.random.default_rng(1),
        stopwatch=clock.now,
        wall=clock.now,
        **{"patience": PATIENCE, **more},
    )
    recording = Recording.create(
        folder, program="avoid", seed=1, manifest=service.program(), started=datetime(2026, 1, 1)
    )
    return Bench(robot, service, recording)


def test_a_run_begins_and_ends_with_wheels_that_were_told_to_stand_still(bench: Bench) -> None:
    assert bench.service.connect() == ("5.01", "5.00")
    bench.service.run(bench.recording, duration=2.0)
    assert bench.service.ended == "duration"
    assert bench.service.rested
    assert bench.service.lifecycle.current_state_value == "stopped"
    assert bench.robot.speeds[0][1] == bench.robot.speeds[-1][1] == b"D,0,0"
    assert [tick["tick"] for tick in bench.ticks()] == list(range(20))
    assert len(bench.robot.speeds) == 20 + 2


def test_a_tick_without_readings_is_told_as_such_and_the_wheels_are_held_for_two_ticks_only(bench: Bench) -> None:
    bench.service.connect()
    start = bench.robot.clock.now()
    bench.robot.silent = lambda now, request: start + 0.95 < now < start + 2.45
    bench.service.run(bench.recording, duration=5.0)
    ticks = bench.ticks()
    blind = [tick for tick in ticks if not tick["evidence"]]
    assert blind
    assert len(blind) == bench.service.blind
    for tick in blind:
        assert tick["draws"] == tick["answers"] == {}
        assert any("no data" in text for _, text in tick["events"])
    # Held at first, then told to stop, whether or not the robot could hear it.
    told = [line for moment, line in bench.robot.speeds if start + 0.95 < moment < start + 2.45]
    assert set(told) == {b"D,0,0"}
    first_stop = min(moment for moment, line in bench.robot.speeds if line == b"D,0,0" and moment > start + 0.95)
    assert first_stop > start + 1.0 + (HOLD - 1) * 0.1
    # And when the readings are back so is the program.
    assert ticks[-1]["evidence"]
    assert bench.service.ended == "duration"


def test_a_robot_that_stays_silent_ends_the_run(bench: Bench) -> None:
    bench.service.connect()
    start = bench.robot.clock.now()
    bench.robot.silent = lambda now, request: now > start + 0.5
    with pytest.raises(NoAnswer, match=f"for {PATIENCE:g} s"):
        bench.service.run(bench.recording, duration=60.0)
    assert bench.service.ended == "error"
    assert not bench.service.rested
    assert bench.service.lifecycle.current_state_value == "faulted"
    assert bench.robot.speeds[-1][1] == b"D,0,0"


def test_a_robot_that_never_confirms_its_speeds_ends_the_run_too(bench: Bench) -> None:
    bench.service.connect()
    start = bench.robot.clock.now()
    bench.robot.silent = lambda now, request: now > start + 0.5 and request.startswith(b"D")
    with pytest.raises(NoAnswer, match=f"for {PATIENCE:g} s"):
        bench.service.run(bench.recording, duration=60.0)
    assert not bench.service.rested


def test_what_was_written_is_not_changed_by_what_the_robot_says_later(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    ticks: list[Tick] = []
    monkeypatch.setattr(bench.recording, "write", ticks.append)
    bench.service.connect()
    start = bench.robot.clock.now()
    bench.robot.silent = lambda now, request: now > start + 1.8 and request.startswith(b"D")
    bench.service.run(bench.recording, duration=2.0)
    assert set(ticks[-1].raw) <= {"N", "D", "E", "K", "B", "?"}
    assert ticks[-1].raw["D"] == ""


def test_a_line_that_is_lost_ends_the_run_as_lost(bench: Bench) -> None:
    bench.service.connect()
    bench.robot.gone_at = bench.robot.clock.now() + 1.0
    with pytest.raises(LinkLost):
        bench.service.run(bench.recording, duration=60.0)
    assert bench.service.lifecycle.current_state_value == "faulted"
    last = bench.ticks()[-1]
    assert last["tick"] == 10
    assert last["events"][-1][0] == "error"
    assert bench.service.error is not None


def test_a_log_that_cannot_be_written_stops_the_wheels(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    bench.service.connect()

    def full(tick: Tick) -> None:
        raise RecordingError("the disk is full")

    monkeypatch.setattr(bench.recording, "write", full)
    with pytest.raises(RecordingError):
        bench.service.run(bench.recording, duration=60.0)
    assert bench.robot.speeds[-1][1] == b"D,0,0"
    assert bench.service.rested


class Refusing:
    """A program whose evidence is impossible now and then, or that has a bug."""

    name, needs, decides = "refusing", ("N",), "Vrot"
    questions: Mapping[str, Question] = MappingProxyType({})

    def __init__(self, error: Exception) -> None:
        self.error, self.count, self.always = error, 0, False

    def step(self, readings: Readings, rng: np.random.Generator) -> Decision:
        self.count += 1
        if self.always or self.count % 2:
            raise self.error
        return Decision({"Prox": 0}, {}, {}, {}, 4, 4)


def test_impossible_evidence_is_a_tick_without_data_and_the_loop_goes_on(tmp_path: Path) -> None:
    bench = at_the_bench(tmp_path, Refusing(ImpossibleEvidence("nothing fits", ())))
    bench.service.connect()
    bench.service.run(bench.recording, duration=2.0)
    assert bench.service.ended == "duration"
    assert bench.service.blind == 10
    assert all(any("nothing fits" in text for _, text in tick["events"]) for tick in bench.ticks()[::2])


def test_even_a_bug_in_a_program_stops_the_wheels(tmp_path: Path) -> None:
    bench = at_the_bench(tmp_path, Refusing(ZeroDivisionError("a bug")))
    bench.service.connect()
    with pytest.raises(ZeroDivisionError):
        bench.service.run(bench.recording, duration=2.0)
    assert bench.robot.speeds[-1][1] == b"D,0,0"
    assert bench.service.ended == "error"


def test_stop_ends_the_loop_at_its_next_tick_with_the_first_reason(bench: Bench) -> None:
    bench.service.connect()
    bench.service.stop("signal")
    bench.service.stop("later")
    bench.service.run(bench.recording)
    assert bench.service.ended == "signal"
    assert bench.service.ticks == 0
    assert bench.service.rested


def test_persistent_impossible_evidence_does_not_end_the_run(tmp_path: Path) -> None:
    controller = Refusing(ImpossibleEvidence("nothing fits", ()))
    controller.always = True
    bench = at_the_bench(tmp_path, controller)
    bench.service.connect()
    bench.service.run(bench.recording, duration=2 * PATIENCE)
    assert bench.service.ended == "duration"
    assert bench.ticks()[-1]["command"] == [0, 0]


def test_errors_of_ours_have_the_exit_codes_that_their_tree_says() -> None:
    assert errors.__doc__ is not None
    names = r"\w+Error|\w+Lost|\w+Answer|\w*Refused|RobotReset|Implausible|WireTooSlow|Stopped"
    said = dict(re.findall(rf"^ *[|`]?.*?({names}) +(\d)", errors.__doc__, re.M))
    assert len(said) == 18
    for name, code in said.items():
        assert getattr(errors, name).exit_code == int(code)
