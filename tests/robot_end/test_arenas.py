"""Arena files: what they promise, and what they say about a mistake."""

import math
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from khepera_hil.errors import WorldError
from khepera_hil.world import World, arenas, load_arena
from khepera_hil.world.scene import Rays, Scene
from khepera_hil.world.shapes import BODY_RADIUS, box, disc, gap

BLOCK = "title = 'x'\n\n[[block]]\nname = 'b'\nat_mm = [500, 500]\nheight_mm = 30\nsize_mm = [90, 90]\n"


def test_the_shipped_arenas_are_named_with_a_line_each() -> None:
    assert {"empty", "furnished", "objects", "push", "watchman"} <= set(arenas())
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
    with pytest.raises(
        WorldError, match=r"no arena 'moon'; there are calibration, empty, furnished, lamp, objects"
    ):
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
        (BLOCK + "mass_g = inf", r"block\[0\]\.mass_g must be a number from 1 to 10000, not inf"),
        (
            BLOCK.replace("'b'", "'robot'") + "mass_g = 9",
            r"block\[0\]\.name must be new; there is a 'robot' already",
        ),
        (
            BLOCK.replace("'b'", "'east wall'") + "mass_g = 9",
            r"block\[0\]\.name must be new; there is a 'east wall'",
        ),
        (BLOCK + "mass_g = 9\nmaterial = 'gold'", r"material must be one of white, .*, not 'gold'"),
        (
            BLOCK + "mass_g = 9" + BLOCK.partition("\n")[2].replace("'b'", "'c'") + "mass_g = 9",
            r"block\[1\]\.at_mm must be free, but 'c' overlaps 'b'",
        ),
        (
            BLOCK + "mass_g = 9" + BLOCK.partition("\n")[2] + "mass_g = 9",
            r"block\[1\]\.name must be new; there is a 'b' already",
        ),
        (BLOCK.replace("500, 500", "5, 500") + "mass_g = 9", r"at_mm must leave all of 'b' on the floor"),
        (
            BLOCK + "mass_g = 9\n[start]\nat_mm = [520, 500]",
            r"start\.at_mm must have room for the robot, 57 mm wide, but 'b' is there",
        ),
        ("title = 'x'\n[start]\nat_mm = [10, 500]", r"start\.at_mm must have room .*, but 'west wall' is there"),
        (
            "title = 'x'\n[[object]]\nname = 'o'\nshape = 'banana'\nmass_g = 3",
            r"object\[0\]\.shape must be one of box, disc, triangle, hexagon, L, pyramid, cone, not 'banana'",
        ),
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


def test_the_fifteen_objects_can_be_told_apart_but_for_the_two_with_the_same_base() -> None:
    objects = {shape.name: shape for shape in load_arena("objects").things}
    assert len(objects) == 15
    square, tower = objects["square 60"], objects["tower 60"]
    assert square.corners == tower.corners
    assert square.height < tower.height
    for one, other in combinations(objects.values(), 2):
        if {one.name, other.name} == {"square 60", "tower 60"}:
            continue
        round_ = abs(one.outline - other.outline)
        longest = abs(one.longest_line - other.longest_line)
        assert round_ >= 25 or longest >= 60, (one.name, other.name)
        assert one.height > 14.5


@pytest.mark.parametrize("name", [shape.name for shape in load_arena("objects").things])
def test_each_object_can_be_presented_and_is_the_only_one_there(name: str) -> None:
    world = World("objects", 1, present=name)
    world.advance(0.02)
    standing = {name for name, (x, _, _) in world.poses().items() if x > 0} - {"robot"}
    assert standing == {name}
    x, y, _ = world.poses()[name]
    assert (x, y) == (0.5, 0.5)


def test_a_pyramid_and_a_cone_are_seen_where_their_sides_are_at_the_sensors_height() -> None:
    pyramid = replace(box("pyramid", "block", 60, 60, (0, 0, 0), 150), pointed=True)
    cone = replace(disc("cone", "disc", 30, (0, 0, 0), 150), pointed=True)
    for shape in (pyramid, cone):
        hits = Scene([shape.at((0, 0, 0))], 14.5).reflections(
            Rays(np.array([[100.0, 0.0]]), np.array([[-1.0, 0.0]])), [(0.0, 0.0, 0.0)], 130
        )
        assert hits is not None
        assert hits.distance[0] == pytest.approx(100 - 30 * (1 - 14.5 / 150))
        assert 0.9 < hits.reflectance[0] < 1.0


def test_an_object_that_is_not_there_cannot_be_presented() -> None:
    with pytest.raises(WorldError, match=r"the object's name must be a thing that can be moved \(L 100, .*'moon'"):
        World("objects", 1, present="moon")


def test_a_robot_pushes_what_is_light_and_not_what_is_heavy_in_the_arena_for_it() -> None:
    world = World("push", 3)
    world.set_speed(50, 50)
    world.advance(8.0)
    moved = world.poses()["disc"]
    assert moved[0] < 0.25
    assert world.score()["objects_moved"] == 1
    assert world.score()["object_moved_most_m"] > 0.05


def test_an_l_is_hit_in_its_corner_by_a_ray_that_passes_its_legs() -> None:
    arena = load_arena("push")
    shape = next(thing for thing in arena.things if thing.name == "L")
    assert shape.area == pytest.approx(40 * (2 * 100 - 40))
    scene = Scene([shape.at((0, 0, 0))], 14.5)
    middle = -min(x for x, _ in shape.corners)
    origin = np.array([[90.0 - middle, 70.0 - middle]])  # in the open square between the legs
    for direction, distance in (((-1, 0), 50), ((0, -1), 30)):
        hits = scene.reflections(Rays(origin, np.array([direction], float)), [(0.0, 0.0, 0.0)], 130)
        assert hits is not None
        assert hits.distance[0] == pytest.approx(distance)
