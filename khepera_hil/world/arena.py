"""Arenas as TOML files: what may stand in them, with every mistake named by file, key and what was expected."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field, replace

from khepera_hil.errors import WorldError
from khepera_hil.world.shapes import BODY_RADIUS, Kind, Pose, Shape, box, disc, overlap
from khepera_hil.world.tables import Range, Table, read_table, shipped
from khepera_hil.world.things import read_body, read_pose, read_starts, read_thing

__all__ = [
    "Arena",
    "Base",
    "LampPlan",
    "Scatter",
    "Start",
    "arena_walls",
    "arenas",
    "base_walls",
    "load_arena",
]

RESERVED = ("robot", "base")
"""Names that no thing may have, and neither "robot 2" and so on."""

_WALL = 20.0  # mm, thickness of the arena's walls, outside the floor
_ROBOT = re.compile(r"robot \d+")
_SCATTERED = re.compile(r"(wall|block|disc) \d+")

_CORNERS = {"south-west": (0, 0), "south-east": (1, 0), "north-east": (1, 1), "north-west": (0, 1)}


@dataclass(frozen=True)
class Base:
    """A square in a corner with two walls, which start at the arena's walls and leave its inner corner open.

    ``corner`` is (0 or 1, 0 or 1): left or right, low or high; ``diffuse`` the scattered light in it.
    """

    side: float
    corner: tuple[int, int]
    wall_length: float
    wall_height: float
    wall_thickness: float
    diffuse: float


@dataclass(frozen=True)
class LampPlan:
    """A lamp; its height is drawn from a range."""

    name: str
    at: tuple[float, float]
    height: Range
    intensity: float
    radius: float


@dataclass(frozen=True)
class Scatter:
    """Things that the seed chooses and places.

    ``gap`` is the least way between any two and to all walls, ``share`` the range of the floor's share that
    they cover together, ``heights`` what their heights are taken from in turn.
    """

    gap: float
    base_gap: float
    share: Range
    heights: tuple[float, ...]
    walls: int
    wall_length: float
    wall_thickness: float
    blocks: tuple[int, int]
    block_side: Range
    discs: tuple[int, int]
    disc_radius: Range
    masses: tuple[float, ...]
    stripes: Range | None = None


@dataclass(frozen=True)
class Start:
    """Where the robot starts: ``pose``, or anywhere this far from the base and everything else (mm)."""

    pose: tuple[float, float, float] | None = None
    from_base: float = 0.0
    clearance: float = 40.0


@dataclass(frozen=True)
class Arena:
    """What a file says; lengths in mm. Its origin is the lower left corner of the floor.

    ``wall_stripes`` are the least and the greatest width of the walls' black and white stripes, ``room_light`` what
    the light of the room takes from the sensors' dark, in counts. Things whose names are in ``shelved`` are not on
    the floor until somebody puts them there, by default on the ``stage``.
    """

    name: str
    title: str
    size: tuple[float, float] = (1000.0, 1000.0)
    wall_height: float = 100.0
    wall_reflectance: float = 1.0
    wall_stripes: Range | None = (10.0, 20.0)
    room_light: float = 0.0
    base: Base | None = None
    lamps: tuple[LampPlan, ...] = ()
    things: tuple[Shape, ...] = ()
    shelved: frozenset[str] = frozenset()
    stage: tuple[float, float] | None = None
    scatter: Scatter | None = None
    start: Start = field(default_factory=Start)
    starts: tuple[tuple[int, Pose], ...] = ()
    """Where further robots start, by number: what is not named there starts as ``start`` has it drawn."""

    @property
    def base_square(self) -> tuple[float, float, float, float] | None:
        """The base's square as x0, y0, x1, y1."""
        if self.base is None:
            return None
        x = self.base.corner[0] * (self.size[0] - self.base.side)
        y = self.base.corner[1] * (self.size[1] - self.base.side)
        return x, y, x + self.base.side, y + self.base.side


def arenas() -> dict[str, str]:
    """The arenas that come with the package: name and one line about each."""
    return {name: load_arena(name).title for name in shipped("worlds")}


def load_arena(name: str) -> Arena:
    """An arena by its name, or by the path of a TOML file (anything with a slash or ending in .toml).

    Raises :class:`~khepera_hil.errors.WorldError`.
    """
    return _arena(*read_table("arena", "worlds", name))


def _arena(name: str, table: Table) -> Arena:
    title = table.text("title")
    width, depth = table.numbers("size_mm", 2, 200, 5000, (1000.0, 1000.0))
    things, shelved = _things(table, width, depth)
    arena = Arena(
        name=name,
        title=title,
        size=(width, depth),
        wall_height=table.number("wall_height_mm", 0, 1000, 100.0),
        wall_reflectance=table.number("wall_reflectance", 0, 1.5, 1.0),
        wall_stripes=table.range("wall_stripes_mm", 2, 500, (10.0, 20.0)),
        room_light=table.number("room_light", 0, 30, 0.0),
        base=_base(table.table("base"), min(width, depth)),
        lamps=tuple(_lamp(lamp, width, depth) for lamp in table.tables("lamp")),
        things=tuple(thing for thing, _ in things),
        shelved=shelved,
        stage=_stage(table.table("stage"), width, depth),
        scatter=_scatter(table.table("scatter")),
    )
    arena = replace(arena, start=_start(table.table("start"), arena), starts=read_starts(table, max(width, depth)))
    table.end()
    _check(arena, things, table)
    check_starts(arena, table.where)
    return arena


def _check(arena: Arena, things: list[tuple[Shape, Table]], whole: Table) -> None:
    """Names and places of what the file puts on the floor, against each other and the base's walls."""
    standing: list[Shape] = base_walls(arena)
    names = {*RESERVED, *(wall.name for wall in arena_walls(arena) + standing)}
    for lamp in arena.lamps:
        if lamp.name in names:
            raise whole.wrong("lamp.name", f"must be new; there is a {lamp.name!r} already")
        names.add(lamp.name)
    for thing, table in things:
        if thing.name in names or _ROBOT.fullmatch(thing.name):
            raise table.wrong("name", f"must be new; there is a {thing.name!r} already")
        names.add(thing.name)
        if arena.scatter is not None and _SCATTERED.fullmatch(thing.name):
            raise table.wrong("name", f"must not be {thing.name!r}, which the scattered things are called by")
        if thing.name in arena.shelved:
            continue
        for x, y in thing.points().tolist():
            if not (
                thing.radius <= x <= arena.size[0] - thing.radius
                and thing.radius <= y <= arena.size[1] - thing.radius
            ):
                raise table.wrong("at_mm", f"must leave all of {thing.name!r} on the floor; it reaches into a wall")
        for other in standing:
            if overlap(thing, other):
                raise table.wrong("at_mm", f"must be free, but {thing.name!r} overlaps {other.name!r}")
        standing.append(thing)


def _base(table: Table | None, room: float) -> Base | None:
    if table is None:
        return None
    side = table.number("side_mm", 60, room)
    expected = "one of " + ", ".join(_CORNERS)
    base = Base(
        side=side,
        corner=table.take("corner", expected, lambda word: _CORNERS[word]),
        wall_length=table.number("wall_length_mm", 0, side),
        wall_height=table.number("wall_height_mm", 0, 1000),
        wall_thickness=table.number("wall_thickness_mm", 1, side / 2, 10.0),
        diffuse=table.number("diffuse", 0, 1, 0.6),
    )
    table.end()
    return base


def _lamp(table: Table, width: float, depth: float) -> LampPlan:
    lamp = LampPlan(
        name=table.text("name"),
        at=table.numbers("at_mm", 2, 0, max(width, depth)),
        height=table.range("height_mm", 30, 1000),
        intensity=table.number("intensity", 0, 100),
        radius=table.number("radius_mm", 0, 50, 5.0),
    )
    table.end()
    return lamp


def _things(table: Table, width: float, depth: float) -> tuple[list[tuple[Shape, Table]], frozenset[str]]:
    """Things with their tables, and the names of those that do not stand on the floor."""
    things: list[tuple[Shape, Table]] = []
    shelved = []
    floor = max(width, depth)
    kinds: dict[str, Kind] = {"wall": "fixed", "block": "block", "disc": "disc"}
    for key, kind in kinds.items():
        for item in table.tables(key):
            things.append((read_thing(item, kind, floor), item))
    for item in table.tables("object"):
        placed = item.has("at_mm")
        shape = read_body(item, read_pose(item, floor) if placed else (0.0, 0.0, 0.0))
        things.append((shape, item))
        if not placed:
            shelved.append(shape.name)
    for _, item in things:
        item.end()
    return things, frozenset(shelved)


def _stage(table: Table | None, width: float, depth: float) -> tuple[float, float] | None:
    if table is None:
        return None
    x, y = table.numbers("at_mm", 2, 0, max(width, depth))
    table.end()
    return x, y


def _scatter(table: Table | None) -> Scatter | None:
    if table is None:
        return None
    scatter = Scatter(
        gap=table.number("gap_mm", 0, 500),
        base_gap=table.number("base_gap_mm", 0, 500),
        share=table.range("floor_share", 0, 1),
        heights=table.numbers("heights_mm", None, 1, 1000),
        walls=table.count("walls", 20, (0, 0))[1],
        wall_length=table.number("wall_length_mm", 10, 2000, 200.0),
        wall_thickness=table.number("wall_thickness_mm", 2, 200, 16.0),
        blocks=table.count("blocks", 50, (0, 0)),
        block_side=table.range("block_side_mm", 5, 500, (50.0, 100.0)),
        discs=table.count("discs", 50, (0, 0)),
        disc_radius=table.range("disc_radius_mm", 5, 250, (25.0, 50.0)),
        masses=table.numbers("masses_g", None, 1, 10_000),
        stripes=table.range("stripes_mm", 2, 500, None),
    )
    table.end()
    return scatter


def _start(table: Table | None, arena: Arena) -> Start:
    if table is None:
        return Start()
    width, depth = arena.size
    at = table.numbers("at_mm", 2, 0, max(width, depth), None)
    heading = math.radians(table.number("heading_deg", -360, 360, 0.0))
    start = Start(
        pose=None if at is None else (*at, heading),
        from_base=table.number("from_base_mm", 0, 5000, 0.0),
        clearance=table.number("clearance_mm", 1, 500, 40.0),
    )
    table.end()
    if start.pose is not None:
        if not (start.pose[0] <= width and start.pose[1] <= depth):
            raise table.wrong("at_mm", f"must be on the floor of {width:g} x {depth:g} mm")
        if (other := in_the_way(arena, start.pose)) is not None:
            raise table.wrong("at_mm", f"must have room for the robot, 57 mm wide, but {other!r} is there")
    return start


def check_starts(arena: Arena, where: str) -> None:
    """Raises WorldError for a further robot's given start that is not on the floor, or not free."""
    width, depth = arena.size
    robots = [] if arena.start.pose is None else [disc("robot", "robot", BODY_RADIUS, arena.start.pose, 29.0)]
    for number, pose in arena.starts:
        key = f"{where}the start of robot {number}"
        if not (pose[0] <= width and pose[1] <= depth):
            raise WorldError(f"{key} is not on the floor of {width:g} x {depth:g} mm")
        robot = disc(f"robot {number}", "robot", BODY_RADIUS, pose, 29.0)
        other = in_the_way(arena, pose) or next((other.name for other in robots if overlap(robot, other)), None)
        if other is not None:
            raise WorldError(f"{key} has no room for the robot, 57 mm wide, since {other!r} is there")
        robots.append(robot)


def in_the_way(arena: Arena, pose: tuple[float, float, float]) -> str | None:
    """What stands where the robot would start, if anything that the file puts there does."""
    robot = disc("robot", "robot", BODY_RADIUS, pose, 29.0)
    standing = [thing for thing in arena.things if thing.name not in arena.shelved]
    everything = [*arena_walls(arena), *base_walls(arena), *standing]
    return next((other.name for other in everything if overlap(robot, other)), None)


def arena_walls(arena: Arena) -> list[Shape]:
    """The four walls round the floor."""
    width, depth = arena.size
    long, half = 2 * _WALL, _WALL / 2

    def wall(name: str, across: float, up: float, x: float, y: float) -> Shape:
        shape = box(name, "wall", across, up, (x, y, 0.0), arena.wall_height, reflectance=arena.wall_reflectance)
        return replace(shape, stripes=arena.wall_stripes)

    return [
        wall("south wall", width + long, _WALL, width / 2, -half),
        wall("east wall", _WALL, depth + long, width + half, depth / 2),
        wall("north wall", width + long, _WALL, width / 2, depth + half),
        wall("west wall", _WALL, depth + long, -half, depth / 2),
    ]


def base_walls(arena: Arena) -> list[Shape]:
    """Two walls on the inner sides of the base's square, from the arena's wall inwards, outside the square."""
    base = arena.base
    if base is None or base.wall_length == 0:
        return []
    right, high = base.corner
    along = base.wall_length / 2
    across = base.side + base.wall_thickness / 2

    def corner(x: float, y: float) -> Pose:
        return (arena.size[0] - x if right else x), (arena.size[1] - y if high else y), 0.0

    def wall(name: str, size: tuple[float, float], pose: Pose) -> Shape:
        return box(name, "wall", *size, pose, base.wall_height)

    return [
        wall("base wall 1", (base.wall_thickness, base.wall_length), corner(across, along)),
        wall("base wall 2", (base.wall_length, base.wall_thickness), corner(along, across)),
    ]
