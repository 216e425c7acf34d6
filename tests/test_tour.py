"""Tours by odometry: paths of known shape, driven exactly."""

from __future__ import annotations

from math import cos, hypot, pi, sin

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from khepera_hil.perception import LightAhead, Odometry, Readings, ScaledLight, Tour
from khepera_hil.perception.tour import Point, measured

PULSES = 12  # a mm
BASE = 53.0  # mm between the wheels


class Path:
    """Wheel counters of a robot that drives straight pieces and arcs, a tick at a time."""

    def __init__(self) -> None:
        self.left = self.right = 0.0

    def read(self) -> Readings:
        return Readings(answers={("H",): (round(self.left * PULSES), round(self.right * PULSES))})

    def go(self, way: float, turn: float) -> Readings:
        self.left += way - turn * BASE / 2
        self.right += way + turn * BASE / 2
        return self.read()


def rounded(sides: list[float], radius: float, laps: float, side: int) -> list[tuple[float, float]]:
    """(way, turn) for each tick, 3.3 mm each, around a polygon with right angles and round corners."""
    steps: list[tuple[float, float]] = []
    for _ in range(int(laps * len(sides)) + 1):
        for length in sides[:1]:
            steps += [(length / max(1, round(length / 3.3)), 0.0)] * max(1, round(length / 3.3))
        arc = radius * pi / 2
        count = max(1, round(arc / 3.3))
        steps += [(arc / count, side * pi / 2 / count)] * count
        sides = sides[1:] + sides[:1]
    return steps


@pytest.mark.parametrize("side", [1, -1])
def test_a_square_with_round_corners_is_four_turns_and_its_own_length(side: int) -> None:
    tour, path = Tour(), Path()
    found = {}
    for way, turn in rounded([150.0] * 4, 40.0, 4, side):
        found = tour.step(path.go(way, turn), near=True).values
        if found:
            break
    turns = ("Nlt", "Nrt") if side > 0 else ("Nrt", "Nlt")
    assert found[turns[0]] == 4
    assert found[turns[1]] == 0
    assert found["Per"] == pytest.approx(4 * 150 + 2 * pi * 40, abs=4)
    assert 40 <= found["Lrl"] <= 110  # 150 mm less the window, and what the smoothing takes of it


def test_a_circle_is_one_turn_without_an_end() -> None:
    tour, path = Tour(), Path()
    found = {}
    for _ in range(400):
        found = tour.step(path.go(3.3, -3.3 / 70), near=True).values
        if found:
            break
    assert (found["Nlt"], found["Nrt"], found["Lrl"]) == (0, 4, 0)
    assert found["Per"] == pytest.approx(2 * pi * 70, abs=4)


def test_a_robot_that_loses_the_object_has_made_no_tour() -> None:
    tour, path = Tour(), Path()
    for tick in range(600):
        near = tick % 120 < 70  # lost for five seconds before a lap (133 ticks) is done
        assert not tour.step(path.go(3.3, -3.3 / 70), near=near).values


@settings(deadline=None, max_examples=30)
@given(start=st.integers(0, 100), radius=st.floats(40, 90))
def test_where_a_tour_began_makes_no_difference(start: int, radius: float) -> None:
    points, heading = [], 0.0
    x = y = way = 0.0
    # An oval: two half circles, each bent enough for a turn to begin, and two straight pieces.
    bend, straight = round(pi * radius / 3.3), 40
    for tick in range(3 * (2 * bend + 2 * straight)):
        place = tick % (bend + straight)
        heading += pi / bend if place < bend else 0.0
        x, y, way = x + 3.3 * cos(heading), y + 3.3 * sin(heading), way + 3.3
        points.append(Point(way, heading, x, y))
    one, other = measured(points), measured(points[start:])
    assert one is not None
    assert other is not None
    assert one[:2] == other[:2] == (4, 0)
    assert one[2] == pytest.approx(other[2], abs=1)
    assert one[3] == pytest.approx(other[3], abs=8)


@given(st.lists(st.tuples(st.floats(-20, 20), st.floats(-20, 20)), min_size=1, max_size=40), st.integers(0, 2**32))
def test_odometry_does_not_mind_counters_that_wrap(steps: list[tuple[float, float]], offset: int) -> None:
    def wrapped(pulses: int) -> int:
        return (pulses + offset + 2**31) % 2**32 - 2**31

    plain, far = Odometry(), Odometry()
    left = right = 0
    for a, b in [(0.0, 0.0), *steps]:
        left, right = left + round(a * PULSES), right + round(b * PULSES)
        plain.step(Readings(answers={("H",): (left, right)}))
        far.step(Readings(answers={("H",): (wrapped(left), wrapped(right))}))
    assert (plain.x, plain.y, plain.heading, plain.way) == (far.x, far.y, far.heading, far.way)
    assert hypot(plain.x, plain.y) <= plain.way + 1e-9


eight = st.tuples(*[st.integers(0, 511)] * 8)


@given(eight)
def test_scaled_light_is_the_frame_over_its_whole_range_or_nothing(light: tuple[int, ...]) -> None:
    values = ScaledLight().step(Readings(light=light)).values
    if max(light) - min(light) < 25:
        assert values == {}
        return
    assert min(values.values()) == 0
    assert max(values.values()) == 511
    order = sorted(range(8), key=lambda i: light[i])
    scaled = [values[f"N{i + 1}"] for i in order]
    assert scaled == sorted(scaled)


@given(eight)
def test_the_light_ahead_stays_in_its_ranges_and_mirrors(light: tuple[int, ...]) -> None:
    values = LightAhead().step(Readings(light=light)).values
    assert -10 <= values["DirL"] <= 10
    assert 0 <= values["ProxL"] <= 15
    mirrored = (*light[5::-1], light[7], light[6])
    other = LightAhead().step(Readings(light=mirrored)).values
    assert other["ProxL"] == values["ProxL"]
    assert abs(other["DirL"] + values["DirL"]) <= 1  # Floor gives -1 to the least imbalance to the left


def test_a_bright_sensor_in_front_is_near_and_ahead() -> None:
    light = (490, 490, 72, 72, 490, 490, 490, 490)
    assert LightAhead().step(Readings(light=light)).values == {"DirL": 0, "ProxL": 14}
    assert LightAhead().step(Readings(light=(497,) * 8)).values == {"DirL": 0, "ProxL": 0}
