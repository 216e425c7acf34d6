"""Energy, Fire and light: what they say, and how firmly."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from khepera_hil.perception import Readings
from khepera_hil.perception.base import Surroundings
from khepera_hil.perception.energy import LEVELS, Energy, charge
from khepera_hil.perception.fire import AT_THE_FLAME, BLOWS, Fire


@given(st.lists(st.integers(0, 1023), max_size=60))
def test_energy_is_a_level_and_charge_grows_with_the_reading(values: list[int]) -> None:
    energy = Energy()
    for value in values:
        assert energy.step(value) in LEVELS
        assert 0 <= charge(value) <= 1
        assert charge(value) <= charge(min(value + 1, 1023))


def reading_of(wanted: float) -> int:
    return next(value for value in range(1024) if charge(value) >= wanted)


def test_energy_does_not_flicker_on_a_border() -> None:
    energy = Energy()
    assert energy.step(None) == "high"
    assert energy.step(reading_of(0.6)) == "high"
    assert [energy.step(reading_of(value)) for value in (0.51, 0.49, 0.485, 0.51)] == ["high"] * 4
    assert energy.step(reading_of(0.46)) == "low"
    assert [energy.step(reading_of(value)) for value in (0.49, 0.505, 0.51)] == ["low"] * 3
    assert energy.step(reading_of(0.55)) == "high"
    assert energy.step(None) == "high"
    assert energy.step(reading_of(0.05)) == "very-low"
    assert energy.step(reading_of(0.95)) == "very-high"


def lit(brightness: list[float], rng: np.random.Generator) -> list[int]:
    noisy = 500 - np.array([*brightness, 0.0, 0.0]) + rng.normal(0, 4.4, 8)
    return [int(value) for value in np.clip(np.rint(noisy), 0, 511)]


CANDLE = [20.0, 80.0, 130.0, 130.0, 75.0, 20.0]
"""Some 200 mm ahead."""


def flickering(rng: np.random.Generator) -> list[int]:
    """One flame: all sensors see it grow and shrink together."""
    strength = 1 + 0.15 * rng.normal()
    return lit([b * strength for b in CANDLE], rng)


def told(fire: Fire, light: list[int], **known: float | str) -> bool:
    usual = {
        "aim": 0,
        "near": 4,
        "direction": 0,
        "prox": 0,
        "base": 0.0,
        "way": 3.3,
        "turn": 0.02,
        "move": "wander",
    }
    return fire.step(light, **(usual | known))  # type: ignore[arg-type]  # values of different types by name


def test_a_flame_is_told_within_two_seconds_and_a_lamp_is_not() -> None:
    rng = np.random.default_rng(1)
    slow = 0
    for _ in range(20):
        fire = Fire()
        ticks = 0
        while not told(fire, flickering(rng)):
            ticks += 1
            assert ticks < 60
        slow += ticks > 20
    assert slow <= 2
    fire = Fire()
    for _ in range(3000):
        assert not told(fire, lit(CANDLE, rng))


def test_what_a_turn_or_a_shadow_makes_of_a_lamp_is_no_flame() -> None:
    rng = np.random.default_rng(2)
    fire = Fire()
    for _ in range(2000):
        turn = 0.1 * rng.normal()
        left = 1 + 2 * turn
        turned = [b * (left if i < 3 else 2 - left) for i, b in enumerate(CANDLE)]
        assert not told(fire, lit(turned, rng), turn=turn)
    for tick in range(2000):
        shadow = [b if i != 2 or tick % 7 < 3 else 0.0 for i, b in enumerate(CANDLE)]
        assert not told(fire, lit(shadow, rng))


def test_inside_the_base_no_flame_is_believed() -> None:
    rng = np.random.default_rng(3)
    fire = Fire()
    for _ in range(100):
        assert not told(fire, flickering(rng), base=0.9)


def burning() -> Fire:
    fire = Fire()
    rng = np.random.default_rng(4)
    while not told(fire, flickering(rng)):
        pass
    return fire


def test_the_robot_has_arrived_82_mm_after_saturation() -> None:
    fire, rng = burning(), np.random.default_rng(5)
    way = 0.0
    while not fire.arrived:
        assert fire.near(14) == 14
        assert fire.near(15) == 14
        assert told(fire, lit([60, 300, 418, 418, 300, 60], rng), near=14, way=3.0, move="approach")
        way += 3
    assert 79 <= way <= 85
    assert fire.near(14) == AT_THE_FLAME


def test_a_flame_that_is_gone_is_out_after_half_a_second_and_not_before() -> None:
    fire, rng = burning(), np.random.default_rng(6)
    for _ in range(5):
        assert told(fire, lit([60, 300, 418, 418, 300, 60], rng), near=14, move="blow")
    # The step into darkness is in two second differences, and five ticks are quiet.
    dark = [told(fire, lit([0.0] * 6, rng), near=0, move="blow") for _ in range(7)]
    assert dark == [True] * 6 + [False]
    assert fire.events == ["the fire is out"]


def test_three_blows_in_vain_are_no_fire_and_it_is_left_alone_for_a_while() -> None:
    fire, rng = burning(), np.random.default_rng(7)
    lights = lit([60, 300, 418, 418, 300, 60], rng)
    for blow in range(BLOWS):
        for _ in range(20):
            assert told(fire, lights, near=14, move="blow")
        assert told(fire, lights, near=14, move="approach") == (blow < BLOWS - 1)
    assert fire.events == ["no fire: three blows changed nothing"]
    for _ in range(150):
        assert not told(fire, flickering(rng))


def test_light_above_511_is_clipped_and_counted() -> None:
    percept = Surroundings().step(Readings((0,) * 8, (511, 512, 1023, 0, 1, 2, 3, 4)))
    assert percept.values["L3"] == 511
    assert percept.clipped == {"L2": 1, "L3": 1}
    assert len(percept.values) == 16


def test_an_input_that_measures_no_battery_changes_no_level() -> None:
    energy = Energy()
    found = [(energy.step(value), energy.measured) for value in (0, reading_of(0.95), 3, reading_of(0.01))]
    assert found == [("high", False), ("very-high", True), ("very-high", False), ("very-low", True)]
