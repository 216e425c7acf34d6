"""Movement while the robot stands: what is told, what is chance, and what the exposure does."""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from khepera_hil.perception.movement import SETTLE, Movement

Frames = NDArray[Any]

STOP = 16
"""Ticks that the wheels stand still in a stop of 20."""
SEEN = STOP - SETTLE
NOISE = 4.0
"""Grey levels: what `Movement` takes it to be before stops have told."""


def noisy(picture: Frames, rng: np.random.Generator) -> list[int]:
    frame = np.clip(np.rint(picture + rng.normal(0, NOISE, len(picture))), 0, 255)
    return [int(value) for value in frame]


def stop(movement: Movement, frames: list[list[int]]) -> tuple[int, float]:
    """How many alarms there are, and the greatest change; the wheels stand still before the first that counts."""
    told, most = 0, 0.0
    for frame in [*[frames[0]] * SETTLE, *frames]:
        told += movement.step(frame, standing=True)
        most = max(most, movement.changed or 0.0)
    assert not movement.step(None, standing=False)
    return told, most


def test_a_still_picture_with_noise_gives_at_most_one_alarm_in_a_thousand_stops() -> None:
    rng = np.random.default_rng(8)
    picture = rng.uniform(50, 200, 16)
    movement = Movement()
    alarms = 0
    for _ in range(1000):
        lamp = 1.0
        for _ in range(20):
            lamp *= 1 + 0.01 * rng.normal()
            alarms += movement.step(noisy(picture * lamp, rng), standing=True)
        assert not movement.step(noisy(picture, rng), standing=False)
    assert alarms <= 1


def test_an_exposure_that_settles_by_a_fifth_while_some_cells_are_at_their_ceiling_moves_nothing() -> None:
    rng = np.random.default_rng(10)
    movement = Movement()
    alarms = 0
    for _ in range(500):
        picture, end = rng.uniform(50, 200, 16), rng.uniform(-0.2, 0.2)
        ceiling = np.where(np.arange(16) % 8 == 0, picture * 0.8, 255.0)
        frames = [noisy(np.minimum(picture * (1 + end * 0.8**k), ceiling), rng) for k in range(SEEN)]
        alarms += stop(movement, frames)[0]
    assert alarms <= 2


@given(
    darker=st.integers(20, 80),
    begin=st.integers(0, SEEN - 1),
    long=st.integers(1, 5),
    cell=st.integers(0, 15),
)
def test_what_is_in_a_cell_for_some_frames_weighs_as_a_difference_of_two_means(
    darker: int, begin: int, long: int, cell: int
) -> None:
    """The law: d sqrt(n (N - n) / N) over the noise, in the tick of the stop in which that is greatest.

    It is the same for what is there at first, and for what comes at the end; only what has changed once and for all
    after three frames or less is not told.
    """
    end = min(begin + long, SEEN)
    picture = np.linspace(100, 200, 16)
    frames = [[round(float(value)) for value in picture] for _ in range(SEEN)]
    for frame in frames[begin:end]:
        frame[cell] -= darker
    law = 0.0
    for now in range(5, SEEN + 1):
        n = max(0, min(end, now) - begin)
        law = max(law, darker * sqrt(n * (now - n) / now) / NOISE)
    told, most = stop(Movement(), frames)
    assert most <= 1.12 * law + 0.3
    if begin > 3 or (begin == 0 and end > 3):
        assert most >= 0.88 * law - 0.3
    assert told == (most > 5)


def test_what_has_changed_once_and_for_all_after_three_frames_is_the_robot_that_settled() -> None:
    picture = [100 + 5 * cell for cell in range(16)]
    for cell in range(16):
        first = list(picture)
        first[cell] -= 40
        for frames, alarms in ((1, 0), (2, 0), (3, 0), (5, 1), (SEEN - 3, 1)):
            assert stop(Movement(), [first] * frames + [picture] * (SEEN - frames))[0] == alarms


def test_a_robot_that_is_shoved_settles_anew_and_gives_no_second_alarm() -> None:
    before = [100 + 5 * cell for cell in range(16)]
    after = before[1:] + before[:1]
    movement = Movement()

    def alarms(frame: list[int], ticks: int) -> int:
        return sum(movement.step(frame, standing=True) for _ in range(ticks))

    assert alarms(before, 8) == 0
    assert not movement.step(after, standing=True, touched=True)
    assert alarms(after, 8) == 0
    assert alarms(before, 2) == 1
    assert not movement.step(after, standing=True, touched=True)
    assert alarms(after, 8) + alarms(before, 8) == 0
    assert not movement.step(None, standing=False)
    assert alarms(before, 8) + alarms(after, 2) == 1


@pytest.mark.parametrize(("darker", "cells"), [(60.0, 1), (25.0, 3)])
def test_what_passes_by_is_told_once_although_it_was_there_when_the_stop_began(darker: float, cells: int) -> None:
    rng = np.random.default_rng(9)
    picture = rng.uniform(80, 200, 16)
    movement = Movement()
    told = 0
    for _ in range(50):
        alarms = 0
        for tick in range(20):
            frame = picture.copy()
            first = tick * 16 // 20
            frame[first : first + cells] -= darker
            alarms += movement.step(noisy(frame, rng), standing=True)
        movement.step(None, standing=False)
        assert alarms <= 1
        told += alarms
    assert told >= 48


def test_stops_in_which_nothing_moves_tell_the_noise() -> None:
    """A camera twice as noisy gives a few alarms at first, and then no more than another."""
    rng = np.random.default_rng(11)
    picture = rng.uniform(60, 190, 16)
    movement = Movement()
    alarms = [
        stop(movement, [[int(v) for v in np.rint(picture + rng.normal(0, 8, 16))] for _ in range(SEEN)])[0]
        for _ in range(320)
    ]
    assert sum(alarms[:20]) > 0
    assert sum(alarms[20:]) <= 1


def test_a_camera_that_says_nothing_gives_no_alarm() -> None:
    movement = Movement()
    for frame in (None, [0] * 16, [255] * 16, None, [0] * 16, [1] * 8, [], [200] * 16) * 4:
        assert not movement.step(frame, standing=True)


@given(st.lists(st.lists(st.integers(0, 255), min_size=1, max_size=4), max_size=12))
def test_whatever_is_read_there_is_an_answer(frames: list[list[int]]) -> None:
    movement = Movement()
    with np.errstate(all="raise"):
        for frame in frames:
            movement.step(frame, standing=True)
            assert movement.changed is None or 0 <= movement.changed < np.inf
