"""The watchman's controller, without a robot: readings in, a decision out."""

from __future__ import annotations

from itertools import product
from typing import cast

import numpy as np
import pytest

from brp.programs.behavior import Behavior, Energy, behavior
from khepera_hil.controllers import Decision, Setting
from khepera_hil.controllers.watchman import CAMERA, Watchman
from khepera_hil.controllers.watchman_mind import EARLY
from khepera_hil.errors import OrderRefused
from khepera_hil.perception import Readings
from khepera_hil.perception.fire import Fire
from tests.watchman.evidence import AT_BASE, OUTSIDE

STILL = tuple([120] * 16)


def readings(
    around: dict[str, int] = OUTSIDE,
    *,
    volts: int | None = 620,
    counters: tuple[int, int] = (0, 0),
    frame: tuple[int, ...] = STILL,
) -> Readings:
    answers: dict[tuple[int | str, ...], tuple[int | str, ...]] = {("H",): counters, ("T", *CAMERA): ("t", *frame)}
    if volts is not None:
        answers["I", 3] = (volts,)
    return Readings(
        tuple(around[f"Px{i}"] for i in range(1, 9)), tuple(around[f"L{i}"] for i in range(1, 9)), answers
    )


def test_every_combination_of_evidence_is_answered_and_the_filled_rows_are_told() -> None:
    """All 384; 18 of them are impossible under the paper's tables, and none stops the robot."""
    watchman = Watchman()
    rng = np.random.default_rng(384)
    filled = 0
    for before, vigil, energy, at_base, fire, identify in product(
        Behavior.values, (False, True), Energy.values, (False, True), (False, True), (False, True)
    ):
        watchman.vigil, watchman.identify = vigil, identify
        watchman._memory.behavior, watchman._memory.move, watchman._memory.age = str(before), "stop", 5
        watchman._unfilled = 10
        watchman.energy._level = Energy.place(energy)
        watchman.fire = Fire()
        watchman.fire.burning = fire
        decision = watchman.step(readings(AT_BASE if at_base else OUTSIDE, volts=None), rng)
        assert decision.evidence["Behavior_t-1"] == before
        assert decision.evidence["Energy"] == energy
        assert decision.evidence["Fire"] == fire
        assert decision.draws["Behavior"] in Behavior.values
        told = any("without Behavior_t-1" in text for _, text in decision.events)
        known = {"Vigil": vigil, "Energy": energy, "Fire": fire, "Identify": identify, "Behavior_t_1": before}
        p = decision.answers["Base"]
        weight = sum(p[base] for base in (False, True) if not behavior.possible(**known, Base=base))
        assert told == (weight > 0.01)
        filled += told
    assert filled == 18


def test_an_idle_robot_that_is_lifted_off_its_base_goes_home() -> None:
    """Counted as zero, the impossible row would leave it idle for ever."""
    watchman = Watchman()
    watchman._memory.behavior = "idle"
    watchman.energy._level = Energy.place("high")
    decision = watchman.step(readings(OUTSIDE, volts=None), np.random.default_rng(1))
    assert decision.draws["Behavior"] == "homing"
    assert decision.answers["Behavior"]["homing"] > 0.99


def patrol(watchman: Watchman, ticks: int, *, frames: list[tuple[int, ...]] | None = None) -> list[Decision]:
    """So many ticks of a patrol that has just stopped."""
    rng = np.random.default_rng(2)
    watchman.order("vigil on")
    decisions = []
    for tick in range(ticks):
        watchman._memory.behavior, watchman._memory.move, watchman._memory.age = "patrol", "stop", 1
        frame = STILL if frames is None else frames[tick]
        decisions.append(watchman.step(readings(frame=frame), rng))
    return decisions


def test_a_mouse_before_a_stopped_patrol_is_an_alarm_once() -> None:
    rng = np.random.default_rng(3)
    frames = []
    for tick in range(20):
        frame = 120 + rng.normal(0, 4, 16)
        if tick >= 12:
            frame[tick - 10 : tick - 7] = 60
        frames.append(tuple(int(value) for value in frame))
    decisions = patrol(Watchman(), 20, frames=frames)
    alarms = [tick for tick, one in enumerate(decisions) if any(level == "alarm" for level, _ in one.events)]
    assert len(alarms) == 1
    assert alarms[0] >= 12
    lit = decisions[alarms[0]]
    assert ("L", 1, 1) in lit.commands or ("L", 1, 1) in decisions[alarms[0] + 1].commands


def test_wheels_that_turn_see_nothing_move() -> None:
    rng = np.random.default_rng(4)
    watchman = Watchman()
    watchman.order("vigil on")
    for tick in range(30):
        watchman._memory.behavior, watchman._memory.move = "patrol", "wander"
        frame = tuple(int(v) for v in rng.integers(0, 255, 16))
        decision = watchman.step(readings(counters=(40 * tick, 40 * tick), frame=frame), rng)
        assert not any(level == "alarm" for level, _ in decision.events)


def test_the_turbine_follows_the_movement_and_rests_at_the_end() -> None:
    watchman = Watchman()
    rng = np.random.default_rng(5)
    watchman.fire.burning = True
    watchman._memory.behavior, watchman._memory.move, watchman._memory.age = "fire-intervention", "blow", 1
    blowing = watchman.step(readings(), rng)
    assert blowing.draws["Move"] == "blow"
    assert ("W", 1, 32) in blowing.commands
    assert (blowing.left, blowing.right) == (0, 0)
    watchman.fire.burning = False
    watchman.order("vigil on")
    after = watchman.step(readings(), rng)
    assert after.draws["Move"] != "blow"
    assert ("W", 0, 32) in after.commands
    assert ("W", 0, 32) in watchman.at_rest


def test_orders_are_vigil_and_identify_and_nothing_else() -> None:
    watchman = Watchman()
    assert watchman.order("vigil on") == "vigil is on"
    assert watchman.order("vigil") == "vigil is off"
    assert [watchman.order("identify") for _ in range(2)] == ["identify is on"] * 2
    assert watchman.order("identify off") == "identify is off"
    for words in ("vigil maybe", "sing", "vigil on off", "VIGIL on"):
        with pytest.raises(OrderRefused, match="vigil on"):
            watchman.order(words)


def test_a_tour_ends_the_order_and_is_learnt() -> None:
    watchman = Watchman()
    watchman.order("vigil on")
    watchman.order("identify")
    watchman._memory.behavior = "recognition"
    rng = np.random.default_rng(6)

    def toured(readings: Readings, prox: int) -> str:
        watchman._last_tour = {"Nlt": 0, "Nrt": 4, "Per": 540, "Lrl": 3}
        return "done"

    watchman._toured = toured  # type: ignore[method-assign]  # the tour itself is tested where it is made
    said = []
    for _ in range(2):
        watchman._memory.behavior, watchman._memory.move = "recognition", "follow"
        watchman.identify = True
        decision = watchman.step(readings(), rng)
        assert decision.evidence["Tour"] == "done"
        assert "O" in decision.answers
        assert not watchman.identify
        said += [text for _, text in decision.events if "object" in text]
    assert said[0].startswith("a new object, from now on 1")
    assert said[1].startswith("this is object 1")


@pytest.mark.parametrize(
    "setting", [Setting(), Setting(early=EARLY), Setting(early=("Move",)), Setting(memory="whole")]
)
def test_each_way_to_decide_drives_and_repeats(setting: Setting) -> None:
    def run() -> list[tuple[int, int]]:
        watchman = Watchman(setting)
        watchman.order("vigil on")
        rng = np.random.default_rng(7)
        return [(one.left, one.right) for one in (watchman.step(readings(), rng) for _ in range(40))]

    first = run()
    assert first == run()
    assert any(left + right > 0 for left, right in first)


def test_evidence_has_all_33_sensory_variables_in_every_tick() -> None:
    decision = Watchman().step(readings(), np.random.default_rng(8))
    assert len(decision.evidence) == 33
    assert cast(int, decision.evidence["Vtrans_c"]) == 5
