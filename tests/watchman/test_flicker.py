"""What flickers: told all round by a robot that stands still, aimed at, and told from lamps, shadows and breaks."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from khepera_hil.perception.fire import Fire
from khepera_hil.perception.flicker import Flicker
from khepera_hil.world.lights import Lamp
from khepera_hil.world.sensors import Sensors

NOISE = 4.4
STOP = 18
"""Ticks of a stop in which the wheels stand."""


def shares(bearing: float, distance: float) -> np.ndarray:
    """What a flame of a candle's strength adds to the eight sensors, counts."""
    sensors = Sensors(np.ones(8), np.zeros(8))
    lamp = Lamp("flame", distance * np.cos(bearing), distance * np.sin(bearing), 22.0, 1.2)

    class Nothing:
        def shadows(self, *_: object) -> list[object]:
            return []

    light = sensors.light(Nothing(), [(0.0, 0.0, 0.0)], [(lamp, [1.2] * 8)])  # type: ignore[arg-type]  # no scene
    return 500 - np.array(light)


def read(bright: np.ndarray, rng: np.random.Generator) -> list[int]:
    return [int(value) for value in np.clip(np.rint(500 - bright + rng.normal(0, NOISE, 8)), 0, 1023)]


LAMP = np.array([0.0, 0.0, 20.0, 60.0, 150.0, 120.0, 10.0, 5.0])
"""A steady one, at the right."""


@pytest.mark.parametrize("degrees", range(-180, 180, 45))
def test_a_flame_350_mm_away_is_told_from_a_stop_wherever_it_is_beside_a_brighter_lamp(degrees: int) -> None:
    rng = np.random.default_rng(1)
    flame = shares(np.radians(degrees), 350.0)
    told, off = 0, []
    for _ in range(60):
        flicker = Flicker()
        for _ in range(STOP):
            flicker.step(read(LAMP + flame * (1 + 0.15 * rng.normal()), rng), 0.0, 0.0)
        if flicker.around:
            told += 1
            flicker.aim()
            off.append(abs((np.degrees(flicker.bearing) - degrees + 180) % 360 - 180))
    assert told >= (24 if abs(degrees) < 90 else 10)  # fewer sensors look to the back
    assert np.median(off) <= 25


def test_few_of_a_thousand_stops_beside_lamps_shadows_and_breaks_are_mistaken_for_fires() -> None:
    rng = np.random.default_rng(2)
    mistaken = 0
    for stop in range(1000):
        flicker = Flicker()
        lamp = LAMP.copy()
        for tick in range(STOP):
            if stop % 2 and tick == 5:
                lamp[3:6] *= 0.7  # something comes before the lamp
            if stop % 4 == 3 and tick == 9:
                lamp[1] = 250.0  # a sensor breaks
            flicker.step(read(lamp, rng), 0.0, 0.0)
        mistaken += flicker.around
    assert mistaken <= 15


def test_the_bearing_turns_with_the_robot() -> None:
    rng = np.random.default_rng(3)
    flicker = Flicker()
    for _ in range(30):
        flicker.step(read(shares(np.radians(60), 200.0) * (1 + 0.15 * rng.normal()), rng), 3.0, 0.0)
    assert np.degrees(flicker.bearing) == pytest.approx(60, abs=25)
    for _ in range(4):  # too fast for second differences to say anything
        flicker.step(read(LAMP, rng), 3.0, np.radians(20))
    assert np.degrees(flicker.bearing) == pytest.approx(-20, abs=25)


def test_a_robot_that_blows_at_a_steady_lamp_finds_that_nothing_flickers() -> None:
    rng = np.random.default_rng(4)
    fire = Fire()
    known: dict[str, Any] = {"aim": 0, "near": 4, "direction": 0, "prox": 0, "base": 0.0, "way": 3.0, "turn": 0.0}
    found = False
    while not found:
        candle = shares(0.0, 200.0) * (1 + 0.15 * rng.normal())
        found = fire.step(read(candle, rng), **known, move="wander")
    ticks = 0
    while fire.step(read(LAMP, rng), **(known | {"near": 5, "way": 0.0}), move="blow"):
        ticks += 1
        assert ticks < 30
    assert fire.events == ["the fire is lost from sight"]
