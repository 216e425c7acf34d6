"""Every shape that an arena may have, hit at full speed: light ones go, heavy ones stay, nothing sinks in."""

import math
from collections.abc import Iterator
from pathlib import Path

import pytest

from khepera_hil.units import MAX_SPEED, SPEED_UNIT_MM_S
from khepera_hil.world import World
from khepera_hil.world.shapes import BODY_RADIUS, Pose, disc, gap
from tests.robot_end.bodies import closer

_SUNK = 0.25  # mm on every side, so that half a millimetre is never passed

_FORMS = {
    "box": "size_mm = [50, 60]",
    "plank": "size_mm = [20, 140]",
    "disc": "radius_mm = 30",
    "triangle": "side_mm = 80",
    "hexagon": "side_mm = 35",
    "L": "side_mm = 80\nleg_mm = 30",
    "pyramid": "size_mm = [60, 60]",
    "cone": "radius_mm = 30",
}


def world(form: str, mass: float, folder: Path) -> World:
    path = folder / "made.toml"
    path.write_text(
        f'title = "made"\nsize_mm = [1000, 1000]\n[[object]]\nname = "thing"\nat_mm = [620, 500]\nangle_deg = 12\n'
        f'shape = "{"box" if form == "plank" else form}"\n{_FORMS[form]}\nheight_mm = 40\nmass_g = {mass}\n'
        f"[start]\nat_mm = [350, 500]\nheading_deg = 0\n"
    )
    return World(str(path), 1)


def seen(there: World, seconds: float) -> Iterator[dict[str, Pose]]:
    """Where everything is, mm, every 20 ms."""
    for look in range(1, round(seconds / 0.02) + 1):
        there.advance(look * 0.02)
        yield {name: (1000 * x, 1000 * y, theta) for name, (x, y, theta) in there.poses().items()}


@pytest.mark.parametrize("form", _FORMS)
@pytest.mark.parametrize(("mass", "least", "most"), [(40, 50, 1000), (300, 0, 8)])
def test_what_is_rammed_at_full_speed_goes_or_stays_and_sinks_into_nothing(
    form: str, mass: float, least: float, most: float, tmp_path: Path
) -> None:
    # 300 g, hit by 80 g at a metre a second, are jolted by some 5 mm and then hold the robot.
    there = world(form, mass, tmp_path)
    thing = next(shape for shape in there.layout.shapes if shape.movable)
    walls = [shape for shape in there.layout.shapes if shape.kind == "wall"]
    there.set_speed(MAX_SPEED * SPEED_UNIT_MM_S, MAX_SPEED * SPEED_UNIT_MM_S)
    moved = 0.0
    for poses in seen(there, 2.0):
        robot, there_now = disc("robot", "robot", BODY_RADIUS - _SUNK, poses["robot"], 29), poses["thing"]
        moved = max(moved, math.dist(there_now[:2], thing.pose[:2]))
        thing_now = closer(thing, _SUNK).at(there_now)
        assert gap(robot, thing_now) > 0
        assert all(gap(robot, wall) > 0 and gap(thing_now, wall) > 0 for wall in walls)
    assert least <= moved <= most
    assert there.score()["contacts"] > 0
    assert there.wheel_travel()[0] > 1000  # the encoders went on
