"""Arena files: what they promise, and what they say about a mistake."""

import math
from itertools import combinations
from pathlib import Path

import pytest

from khepera_hil.errors import WorldError
from khepera_hil.world import World, arenas, load_arena
from khepera_hil.world.shapes import BODY_RADIUS, box, disc, gap


def test_the_shipped_arenas_are_named_with_a_line_each() -> None:
    assert {"empty", "furnished"} <= set(arenas())
    assert all(line and "\n" not in line for line in arenas().values())


@pytest.mark.parametrize("seed", range(25))
def test_the_furnished_arena_keeps_its_promises(seed: int) -> None:
    layout = World("furnished", seed).layout
    base = box("base", "base", 180, 180, (90, 90, 0), 0)
    things = [shape for shape in layout.shapes if shape.kind != "wall"]
    pushable = [thing for thing in things if thing.movable]
    fixed = [thing for thing in things if thing.kind == "fixed"]
    walls = [shape for shape in layout.shapes if shape.kind == "wall"]
    assert len(pushable) >= 6
    assert len({thing.height for thing in pushable}) == 2
    assert len({thing.mass for thing in pushable}) == 2
    assert len(fixed) == 2
    assert all(max(x for x, _ in wall.corners) == 100 for wall in fixed)
    assert 0.08 <= sum(thing.area for thing in things) / 1e6 <= 0.12
    # Every way between things is wide enough for the robot, so there is no pocket at all.
    for one, other in combinations(things, 2):
        assert gap(one, other) >= 1.5 * 2 * BODY_RADIUS
    for thing in things:
        assert all(gap(thing, wall) >= 1.5 * 2 * BODY_RADIUS for wall in walls)
        assert gap(thing, base) >= 100
    x, y, _ = layout.start
    assert math.hypot(max(x - 180, 0), max(y - 180, 0)) >= 400
    robot = disc("robot", "robot", BODY_RADIUS, layout.start, 29)
    assert all(gap(robot, shape) >= 40 - 1e-6 for shape in layout.shapes)


def test_the_bases_mouth_faces_the_middle_of_the_floor() -> None:
    world = World("furnished", 0)
    walls = [shape for shape in world.layout.shapes if shape.name in world.layout.base_walls]
    assert len(walls) == 2
    assert {wall.height for wall in walls} == {60}
    inside = box("base", "base", 180, 180, (90, 90, 0), 0)
    for wall in walls:
        assert max(abs(x) * 2 for x, _ in wall.corners) in (95, 10)
        assert gap(wall, inside) == pytest.approx(0)
        assert not any(0 < x < 180 and 0 < y < 180 for x, y in wall.points().tolist())
    # A robot that comes along the diagonal has room on both sides.
    for way in range(400, 90, -10):
        robot = disc("robot", "robot", BODY_RADIUS, (way, way, 0), 29)
        assert all(gap(robot, wall) > 15 for wall in walls)
    lamp = world.layout.lamps[0]
    assert (lamp.x, lamp.y, lamp.intensity) == (90, 90, 7)
    assert 65 <= lamp.height <= 90


def test_seeds_differ_and_repeat() -> None:
    layouts = [World("furnished", seed).layout for seed in (1, 2, 1)]
    assert layouts[0] == layouts[2]
    assert layouts[0].start != layouts[1].start
    assert layouts[0].shapes != layouts[1].shapes


def test_an_unknown_arena_is_told_which_there_are() -> None:
    with pytest.raises(WorldError, match=r"no arena 'moon'; there are empty, furnished"):
        load_arena("moon")


def test_a_file_that_is_not_there_is_named() -> None:
    with pytest.raises(WorldError, match=r"nowhere/x\.toml cannot be read: No such file"):
        load_arena("nowhere/x.toml")


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", r"title is missing; expected one line of text"),
        ("title = 3", r"title must be one line of text, not 3"),
        ("title = 'x'\nsize = [1, 2]", r"size is not known here; expected one of title, size_mm, wall"),
        ("title = 'x'\nsize_mm = [1000]", r"size_mm must be a list of 2 numbers from 200 to 5000, not \[1000\]"),
        ("title = 'x'\n[base]\nside_mm = 180", r"base\.corner is missing; expected one of south-west"),
        ("title = 'x'\n[[lamp]]\nname = 'l'\nat_mm = [1, 2]", r"lamp\[0\]\.height_mm is missing"),
        (
            "title = 'x'\n[[block]]\nname='b'\nat_mm=[1,2]\nheight_mm=3\nsize_mm=[9,9]\nmass_g='heavy'",
            r"block\[0\]\.mass_g must be a number from 1 to 10000, not 'heavy'",
        ),
        ("title = ", r"is no TOML"),
    ],
)
def test_a_mistake_in_a_file_names_file_key_and_what_was_expected(
    tmp_path: Path, text: str, complaint: str
) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(text)
    with pytest.raises(WorldError, match=r"mine\.toml.*" + complaint):
        load_arena(str(path))


def test_an_arena_that_is_too_full_says_so(tmp_path: Path) -> None:
    path = tmp_path / "full.toml"
    path.write_text(
        "title = 'x'\n[scatter]\ngap_mm = 450\nbase_gap_mm = 0\nfloor_share = [0, 1]\nheights_mm = [30]\n"
        "blocks = 20\nmasses_g = [50]\n"
    )
    with pytest.raises(WorldError, match="too full"):
        World(str(path))
