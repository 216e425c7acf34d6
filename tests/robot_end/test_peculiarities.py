"""What differs from robot to robot and from thing to thing."""

import math

import numpy as np
import pytest

from khepera_hil.units import SPEED_UNIT_MM_S
from khepera_hil.world import Arena, World
from khepera_hil.world.arena import LampPlan, Start
from khepera_hil.world.scene import Scene
from khepera_hil.world.sensors import SENSOR_HEIGHT
from khepera_hil.world.shapes import Shape, box
from khepera_hil.world.things import MATERIALS


def world(
    *things: Shape,
    at: tuple[float, float, float] = (500, 500, 0),
    seed: int = 0,
    lamps: tuple[LampPlan, ...] = (),
    room_light: float = 0.0,
) -> World:
    return World(Arena("made", "", things=things, start=Start(pose=at), lamps=lamps, room_light=room_light), seed)


def test_each_robot_has_gains_and_mountings_of_its_own() -> None:
    # Where everything is seen from one place before noise.
    wall = box("wall", "fixed", 20, 400, (560, 500, 0), 60)
    seen = []
    for seed in range(40):
        there = world(wall, seed=seed)
        values = there.sensors.proximity(Scene(there.layout.shapes, SENSOR_HEIGHT), [(500, 500, 0)])
        assert values is not None
        seen.append(values[2:4])
        again = world(wall, seed=seed).sensors.proximity(Scene(there.layout.shapes, SENSOR_HEIGHT), [(500, 500, 0)])
        assert again is not None
        assert list(again) == list(values)
    spread = np.std(np.log(np.array(seen) + 394.0))  # the threshold that is taken off
    assert 0.15 < spread < 0.4  # the gains' 0.25, and what the mountings add


def test_each_robots_wheels_differ_always_alike_and_slip_at_random() -> None:
    turned = []
    for seed in range(40):
        there = world(at=(200, 500, 0), seed=seed)
        there.set_speed(10 * SPEED_UNIT_MM_S, 10 * SPEED_UNIT_MM_S)
        headings = []
        for now in (1.0, 4.5, 8.0):
            there.advance(now)
            headings.append(there.pose()[2])
        turned.append(np.diff(headings))
    first, second = np.array(turned).T
    # A per cent of difference in diameter: 0.01 * sqrt(2) * 292 mm of way over 53 mm between the wheels.
    assert np.std(second) == pytest.approx(0.01 * math.sqrt(2) * 292 / 53, rel=0.35)
    assert np.corrcoef(first, second)[0, 1] > 0.9  # the systematic part is the same in both halves
    assert np.std(first - second) > 0.005  # and the random part is not


def test_what_reflects_less_is_seen_less() -> None:
    read = {}
    for name in ("white", "grey", "black"):
        reflectance, _ = MATERIALS[name]
        wall = box("wall", "fixed", 20, 400, (560, 500, 0), 60)
        there = world(Shape("wall", "fixed", wall.pose, 60, wall.corners, reflectance=reflectance))
        values = []
        for frame in range(1, 50):
            there.advance(frame * 0.02)
            values += there.proximity()[2:4]
        read[name] = np.mean(values)
    assert read["white"] > read["grey"] + 50
    assert read["grey"] > read["black"] + 50


def test_room_light_makes_all_of_the_arena_brighter() -> None:
    dark, lit = world(), world(room_light=25)
    for there in (dark, lit):
        there.advance(1.0)
    assert [a - b for a, b in zip(dark.light(), lit.light(), strict=True)] == [25] * 8


@pytest.mark.parametrize(("height", "hides"), [(44, False), (50, True)])
def test_a_wall_hides_a_lamp_when_it_is_higher_than_the_line_of_sight(height: float, hides: bool) -> None:
    # From a sensor 14.5 mm above 527 to a lamp 60 mm above 900: at 792, the wall, the line is 46.9 mm high.
    lamp = (LampPlan("lamp", (900, 500), (60, 60), 7, 5),)
    open_ = world(lamps=lamp)
    behind = world(box("wall", "fixed", 16, 400, (800, 500, 0), height), lamps=lamp)
    for there in (open_, behind):
        there.advance(0.02)
    if hides:
        assert min(behind.light()[2:4]) > max(open_.light()[2:4]) + 30
    else:
        assert behind.light() == open_.light()
