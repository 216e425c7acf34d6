"""Lines that are lost and robots that are reset in mid-run; the guard that is told; orders in between."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest

from brp import Question
from khepera_hil.controllers import PROGRAMS, Decision
from khepera_hil.errors import GuardLost, LinkLost, OrderRefused, PortError
from khepera_hil.khepera import Khepera
from khepera_hil.link import Link
from khepera_hil.orders import Order
from khepera_hil.perception import Readings
from khepera_hil.scheduler import PAUSE
from tests.test_service import PATIENCE, Bench, Robot, at_the_bench

STOP = b"D,0,0"


class Watching:
    """A guard that writes down what it hears, among the orders that the robot gets."""

    def __init__(self) -> None:
        self.said: list[str | tuple[str, Any]] = []
        self.gone = False

    def watch(self, descriptor: int | None) -> None:
        self.said.append("watch")

    def beat(self) -> None:
        if self.gone:
            self.gone = False  # it is said once
            raise GuardLost("the guard is gone")

    def moving(self) -> None:
        if self.gone:
            raise GuardLost("the guard is gone")
        self.said.append("moving")

    def check(self) -> None:
        if self.gone:
            self.gone = False
            raise GuardLost("the guard is gone")

    def resting(self) -> None:
        self.said.append("resting")

    def record_in(self, folder: Path) -> None:
        self.said.append("folder")

    def close(self) -> None:
        self.said.append("close")


class Unplugged:
    """A line that is lost at some moment and back at another, with the robot that is there then."""

    def __init__(self, folder: Path, *, gone: float, back: float, **more: Any) -> None:
        self.bench: Bench = at_the_bench(
            folder, PROGRAMS["avoid"][1](), reopen=self.reopen, **{"patience": 30.0, **more}
        )
        self.clock = self.bench.robot.clock
        self.other = Robot(self.clock)
        self.other.port = "/dev/another"
        self.tried: list[float] = []
        self.bench.service.connect()
        start = self.clock.now()
        self.bench.robot.gone_at, self.back = start + gone, start + back

    def reopen(self) -> Khepera:
        self.tried.append(self.clock.now())
        if self.clock.now() < self.back:
            raise PortError("there is no port")
        return Khepera(Link(self.other, self.clock, baud=38400))

    def states(self) -> list[str]:
        return [tick["state"] for tick in self.bench.ticks()]


def said(ticks: list[dict[str, Any]], word: str) -> list[int]:
    """Numbers of the ticks with an event that holds the word."""
    return [tick["tick"] for tick in ticks if any(word in text for _, text in tick["events"])]


def test_a_line_that_comes_back_is_found_and_the_run_goes_on(tmp_path: Path) -> None:
    line = Unplugged(tmp_path, gone=1.0, back=6.0)
    line.bench.service.run(line.bench.recording, duration=10.0)
    ticks = line.bench.ticks()
    assert line.bench.service.ended == "duration"
    assert [tick["tick"] for tick in ticks] == list(range(100))
    assert [tick["missed"] for tick in ticks] == [0] * 100
    # First of all the wheels, before anything is asked; and then not until the whole handshake is through.
    assert line.other.written.startswith(b"\nD,0,0\n")
    handshake = line.other.written.split(b"N\n")[0]
    assert b"B\n" in handshake
    assert handshake.count(STOP) >= 2
    # No tick in between has readings, and none is passed over.
    without = [tick["tick"] for tick in ticks if not tick["evidence"]]
    assert without == list(range(without[0], without[-1] + 1))
    assert line.bench.service.blind == len(without)
    assert ticks[without[0]]["t"] == pytest.approx(1.0, abs=0.11)
    # The first valid reading within a second of the device's return.
    assert ticks[without[-1] + 1]["t"] - 6.0 < 1.0
    assert ticks[-1]["state"] == "running"
    assert line.bench.service.losses == 1


def test_each_step_of_the_way_is_recorded_as_a_transition(tmp_path: Path) -> None:
    line = Unplugged(tmp_path, gone=1.0, back=3.0)
    line.bench.service.run(line.bench.recording, duration=6.0)
    steps = [
        text for tick in line.bench.ticks() for level, text in tick["events"] if " -> " in text and level == "info"
    ]
    assert steps == [
        "disconnected -> connecting -> ready -> running",
        "running -> disconnected",
        "disconnected -> connecting -> ready -> degraded",
        "degraded -> running",
    ]
    states = line.states()
    assert states[:10] == ["running"] * 10
    assert states[10:29] == ["disconnected"] * 19
    lost = said(line.bench.ticks(), "is gone")
    assert len(lost) == 1, "it is said once"
    # Running again after ten good ticks.
    good = [tick["tick"] for tick in line.bench.ticks() if tick["evidence"] and tick["tick"] > lost[0]]
    assert states.index("running", lost[0]) == good[0] + 9


def test_the_pauses_between_two_attempts_are_never_longer_than_a_fifth_of_a_second(tmp_path: Path) -> None:
    line = Unplugged(tmp_path, gone=1.0, back=5.0)
    line.bench.service.run(line.bench.recording, duration=6.0)
    pauses = [after - before for before, after in pairwise(line.tried)]
    assert max(pauses) < 0.2 + 0.1  # looked at once a tick
    assert len(line.tried) > 15


def test_a_line_that_stays_away_ends_the_run_with_the_ports_own_sentence(tmp_path: Path) -> None:
    line = Unplugged(tmp_path, gone=1.0, back=1e9, patience=PATIENCE)
    with pytest.raises(LinkLost, match=f"within {PATIENCE:g} s") as raised:
        line.bench.service.run(line.bench.recording, duration=60.0)
    assert raised.value.exit_code == 3
    assert line.bench.service.lifecycle.current_state_value == "faulted"
    # Counted from the last tick that went as it should.
    assert line.bench.ticks()[-1]["t"] == pytest.approx(0.9 + PATIENCE)


def test_a_line_may_be_lost_again_while_it_is_found(tmp_path: Path) -> None:
    line = Unplugged(tmp_path, gone=1.0, back=2.0)
    line.other.gone_at = line.clock.now() + 2.3
    third = Robot(line.clock)
    robots = [line.other, third]

    def reopen() -> Khepera:
        if line.clock.now() < line.back:
            raise PortError("there is no port")
        return Khepera(Link(robots.pop(0), line.clock, baud=38400))

    line.bench.service._way_back._reopen = reopen
    line.bench.service.run(line.bench.recording, duration=6.0)
    assert line.bench.service.losses >= 2
    assert line.bench.ticks()[-1]["state"] == "running"
    assert third.speeds[-1][1] == STOP


def test_another_robot_or_one_that_was_switched_off_meanwhile_does_not_drive_by_itself(tmp_path: Path) -> None:
    line = Unplugged(tmp_path, gone=5.0, back=6.0)
    line.other.answers[b"H"] = b"h,0,0\r\n"  # its counters begin anew
    line.bench.service.run(line.bench.recording, duration=10.0)
    assert line.bench.ticks()[-1]["state"] == "ready"
    assert {order for _, order in line.other.speeds} == {STOP}
    assert line.bench.service.resets == 1
    assert said(line.bench.ticks(), "khepera-hil order resume")


def test_a_boot_text_on_the_new_line_says_the_same(tmp_path: Path) -> None:
    line = Unplugged(tmp_path, gone=1.0, back=2.0)
    line.other.resets = [line.clock.now()]  # as soon as somebody speaks to it
    line.bench.service.run(line.bench.recording, duration=5.0)
    assert line.bench.ticks()[-1]["state"] == "ready"
    assert {order for _, order in line.other.speeds} == {STOP}


# A reset in mid-session.


class Said:
    """Orders that come at the beginning of some tick."""

    def __init__(self, **at: str) -> None:
        self.at = {int(number.lstrip("t")): words for number, words in at.items()}
        self.tick = -1
        self.answers: list[dict[str, str]] = []

    def take(self) -> list[Order]:
        self.tick += 1
        return [Order(self.at[self.tick], self.answers.append)] if self.tick in self.at else []


def was_reset(folder: Path, **more: Any) -> Bench:
    bench = at_the_bench(folder, PROGRAMS["avoid"][1](), **more)
    bench.service.connect()
    bench.robot.resets = [bench.robot.clock.now() + 1.0]
    return bench


def moves(bench: Bench, after: float) -> set[bytes]:
    return {order for moment, order in bench.robot.speeds if moment > after} - {STOP}


def test_a_robot_that_was_reset_is_not_set_in_motion_by_itself(tmp_path: Path) -> None:
    bench = was_reset(tmp_path)
    reset = bench.robot.resets[0]
    bench.service.run(bench.recording, duration=5.0)
    ticks = bench.ticks()
    assert moves(bench, 0.0)
    assert not moves(bench, reset)
    assert ticks[-1]["state"] == "ready"
    assert ticks[-1]["command"] == [0, 0]
    assert not ticks[-1]["evidence"]
    assert bench.service.ended == "duration", "it waits, and the line is good: nothing to lose patience over"
    assert bench.service.resets == 1


def test_it_is_recognised_within_a_tick_and_said_in_one_line(tmp_path: Path) -> None:
    bench = was_reset(tmp_path)
    bench.service.run(bench.recording, duration=3.0)
    [known] = [tick for tick in bench.ticks() if any(level == "error" for level, _ in tick["events"])]
    assert known["t"] == pytest.approx(1.0, abs=0.11)
    assert not known["evidence"]


def test_the_order_to_resume_sets_it_in_motion_again(tmp_path: Path) -> None:
    bench = was_reset(tmp_path)
    orders = Said(t30="resume", t40="resume")
    bench.service.run(bench.recording, duration=5.0, orders=[orders])
    ticks = bench.ticks()
    assert ticks[29]["state"] == "ready"
    assert ticks[30]["orders"] == ["resume"]
    assert ticks[30]["evidence"]
    assert [("ok" in answer) for answer in orders.answers] == [True, False], "the second has nothing to resume"
    assert said(ticks, "order refused: there is nothing to resume") == [40]


def test_with_resume_it_drives_on_after_a_handshake(tmp_path: Path) -> None:
    bench = was_reset(tmp_path, resume=True)
    reset = bench.robot.resets[0]
    bench.service.run(bench.recording, duration=3.0)
    orders = [order for moment, order in bench.robot.speeds if moment > reset]
    assert orders[0] == STOP
    assert moves(bench, reset)
    assert bench.service.state == "stopped"


# Degraded and well again.


def test_three_bad_ticks_in_ten_degrade_a_run_and_ten_good_ones_mend_it(tmp_path: Path) -> None:
    bench = at_the_bench(tmp_path, PROGRAMS["avoid"][1]())
    bench.service.connect()
    start = bench.robot.clock.now()
    bench.robot.silent = lambda now, request: (
        request == b"N" and any(start + t < now < start + t + 0.1 for t in (0.95, 1.25, 1.55))
    )
    bench.service.run(bench.recording, duration=5.0)
    ticks = bench.ticks()
    bad = [tick["tick"] for tick in ticks if not tick["evidence"]]
    assert len(bad) == 3
    states = [tick["state"] for tick in ticks]
    assert states.index("degraded") == bad[-1]
    assert states[bad[-1] : bad[-1] + 10] == ["degraded"] * 10
    assert set(states[bad[-1] + 10 :]) == {"running"}


# The guard.


def guarded(folder: Path, **more: Any) -> tuple[Bench, Watching]:
    guard = Watching()
    bench = at_the_bench(folder, PROGRAMS["avoid"][1](), guard=guard, **more)
    heard = bench.robot.respond

    def respond(data: bytes) -> None:
        guard.said += [("told", line) for line in data.split(b"\n") if line.startswith(b"D")]
        heard(data)

    bench.robot.respond = respond  # type: ignore[method-assign] # the witness stands between the two
    return bench, guard


def test_the_guard_is_armed_before_each_order_to_move_and_rests_once_the_wheels_do(tmp_path: Path) -> None:
    bench, guard = guarded(tmp_path)
    bench.service.connect()
    bench.service.run(bench.recording, duration=2.0)
    bench.service.close()
    assert guard.said[0] == "watch", "before anything is said: the wheels may be moving"
    for before, now in pairwise(guard.said):
        if isinstance(now, tuple) and now[1] != STOP:
            assert before == "moving"
        if now == "resting":
            assert before == ("told", STOP)
    assert guard.said[-2:] == ["resting", "close"]


def test_a_guard_that_is_gone_stops_the_wheels_and_ends_the_run(tmp_path: Path) -> None:
    bench, guard = guarded(tmp_path)
    bench.service.connect()
    end = bench.robot.clock.now() + 1.0

    def go(now: float, request: bytes) -> bool:
        guard.gone |= now > end
        return False

    bench.robot.silent = go
    with pytest.raises(GuardLost):
        bench.service.run(bench.recording, duration=60.0)
    assert not moves(bench, end + 0.01)
    assert bench.robot.speeds[-1][1] == STOP
    assert bench.service.rested
    assert bench.ticks()[-1]["events"][-1][0] == "error"
    assert bench.service.ended == "error"


def test_a_guard_that_goes_between_two_ticks_is_missed_at_once_and_the_next_tick_tells_it(tmp_path: Path) -> None:
    bench, guard = guarded(tmp_path)
    bench.service.connect()
    clock = bench.robot.clock
    clock.simulated = False  # as one that is waited for
    gone = clock.now() + 1.055

    def beat() -> None:
        if clock.now() > gone:
            raise GuardLost("the guard is gone")

    guard.beat = beat  # type: ignore[method-assign]
    with pytest.raises(GuardLost):
        bench.service.run(bench.recording, duration=60.0)
    assert bench.robot.speeds[-1][1] == STOP
    first = next(moment for moment, order in bench.robot.speeds if order == STOP and moment > gone)
    assert first - gone < PAUSE + 0.001
    assert not moves(bench, gone)
    assert bench.ticks()[-1]["events"][-1] == ["error", "the guard is gone"]


def test_an_order_that_went_out_although_the_guard_had_acted_is_taken_back_at_once(tmp_path: Path) -> None:
    """A process that is held up may wake between its look at the guard and its order."""
    bench, guard = guarded(tmp_path)
    bench.service.connect()
    end = bench.robot.clock.now() + 1.0
    looked = guard.moving

    def moving() -> None:
        looked()
        guard.gone |= bench.robot.clock.now() > end  # and now it is stopped for a while

    guard.moving = moving  # type: ignore[method-assign]
    with pytest.raises(GuardLost):
        bench.service.run(bench.recording, duration=60.0)
    orders = [(moment, order) for moment, order in bench.robot.speeds if moment > end]
    assert orders[0][1] != STOP
    assert orders[1][1] == STOP
    assert orders[1][0] - orders[0][0] < 0.001, "not a tick later, and without waiting for an answer"
    assert {order for _, order in orders[1:]} == {STOP}


def test_a_guard_lets_go_of_a_lost_line_and_watches_the_next(tmp_path: Path) -> None:
    guard = Watching()
    line = Unplugged(tmp_path, gone=1.0, back=2.0, guard=guard)
    line.bench.service.run(line.bench.recording, duration=4.0)
    assert [word for word in guard.said if word in ("watch", "folder")] == ["watch", "folder", "watch", "watch"]


# Orders.


class Watchman:
    """A program that takes orders."""

    name, needs, decides = "watchman", ("N",), "Vrot"
    questions: Mapping[str, Question] = MappingProxyType({})

    def __init__(self) -> None:
        self.vigil = False
        self.seen: list[bool] = []

    def order(self, words: str) -> str:
        if words not in ("vigil on", "vigil off"):
            raise OrderRefused(f"the watchman knows no order {words!r}")
        self.vigil = words == "vigil on"
        return words

    def step(self, readings: Readings, rng: np.random.Generator) -> Decision:
        self.seen.append(self.vigil)
        return Decision({"Prox": 0}, {}, {}, {}, 4, 4)


def test_an_order_holds_from_its_own_tick_on_and_stands_in_it(tmp_path: Path) -> None:
    watchman = Watchman()
    bench = at_the_bench(tmp_path, watchman)
    orders = Said(t3="vigil on", t5="dance", t7="vigil off")
    bench.service.connect()
    bench.service.run(bench.recording, duration=1.0, orders=[orders])
    assert watchman.seen == [False] * 3 + [True] * 4 + [False] * 3
    assert [tick["orders"] for tick in bench.ticks()] == [
        {3: ["vigil on"], 5: ["dance"], 7: ["vigil off"]}.get(n, []) for n in range(10)
    ]
    assert said(bench.ticks(), "order refused") == [5]
    assert orders.answers[1] == {"error": "the watchman knows no order 'dance'"}


class World:
    """A witness whose operator orders something now and then."""

    def __init__(self) -> None:
        self.asked = 0

    def pose(self) -> tuple[float, float, float]:
        return 0.0, 0.0, 0.0

    def poses(self) -> dict[str, tuple[float, float, float]]:
        return {}

    def orders(self) -> list[tuple[str, bool]]:
        self.asked += 1
        return {3: [("vigil", True)], 5: [("dance", True)], 7: [("vigil", False)]}.get(self.asked - 1, [])


def test_a_scenarios_operator_is_obeyed_as_any_other(tmp_path: Path) -> None:
    watchman = Watchman()
    bench = at_the_bench(tmp_path, watchman, witness=World())
    bench.service.connect()
    bench.service.run(bench.recording, duration=1.0)
    ticks = bench.ticks()
    assert watchman.seen == [False] * 3 + [True] * 4 + [False] * 3
    assert [tick["orders"] for tick in ticks if tick["orders"]] == [["vigil on"], ["dance on"], ["vigil off"]]
    assert said(ticks, "no order 'dance on'") == [5]


def test_a_program_that_knows_no_orders_says_so_and_drives_on(bench: Bench) -> None:
    orders = Said(t3="vigil on")
    bench.service.connect()
    bench.service.run(bench.recording, duration=1.0, orders=[orders])
    assert "avoid knows no order 'vigil on'" in orders.answers[0]["error"]
    assert all(tick["evidence"] for tick in bench.ticks())
    assert said(bench.ticks(), "order refused") == [3]


def test_every_program_takes_stop(bench: Bench) -> None:
    orders = Said(t5="stop")
    bench.service.connect()
    bench.service.run(bench.recording, duration=60.0, orders=[orders])
    assert bench.service.ended == "order"
    assert bench.service.ticks == 6
    assert bench.service.rested
    assert "ok" in orders.answers[0]


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return at_the_bench(tmp_path, PROGRAMS["avoid"][1]())
