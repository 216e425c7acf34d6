"""Arenas as TOML files: what may stand in them, with every mistake named by file, key and what was expected."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from khepera_hil.world.shapes import Shape
from khepera_hil.world.tables import Range, Table, read_table, shipped
from khepera_hil.world.things import read_thing

__all__ = ["Arena", "Base", "LampPlan", "Scatter", "Start", "arenas", "load_arena"]

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


@dataclass(frozen=True)
class Start:
    """Where the robot starts: ``pose``, or anywhere this far from the base and everything else (mm)."""

    pose: tuple[float, float, float] | None = None
    from_base: float = 0.0
    clearance: float = 40.0


@dataclass(frozen=True)
class Arena:
    """What a file says; lengths in mm. Its origin is the lower left corner of the floor."""

    name: str
    title: str
    size: tuple[float, float] = (1000.0, 1000.0)
    wall_height: float = 100.0
    wall_reflectance: float = 1.0
    base: Base | None = None
    lamps: tuple[LampPlan, ...] = ()
    things: tuple[Shape, ...] = ()
    scatter: Scatter | None = None
    start: Start = field(default_factory=Start)

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
    width, depth = table.numbers("size_mm", 2, 200, 5000, (1000.0, 1000.0))
    arena = Arena(
        name=name,
        title=table.text("title"),
        size=(width, depth),
        wall_height=table.number("wall_height_mm", 0, 1000, 100.0),
        wall_reflectance=table.number("wall_reflectance", 0, 1.5, 1.0),
        base=_base(table.table("base"), min(width, depth)),
        lamps=tuple(_lamp(lamp, width, depth) for lamp in table.tables("lamp")),
        things=_things(table, width, depth),
        scatter=_scatter(table.table("scatter")),
        start=_start(table.table("start"), width, depth),
    )
    table.end()
    return arena


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


def _things(table: Table, width: float, depth: float) -> tuple[Shape, ...]:
    things: list[Shape] = []
    floor = max(width, depth)
    for key, kind in (("wall", "fixed"), ("block", "block"), ("disc", "disc")):
        for item in table.tables(key):
            things.append(read_thing(item, kind, floor))  # type: ignore[arg-type] # literals
            item.end()
    names = [thing.name for thing in things]
    for name in names:
        if names.count(name) > 1:
            raise table.wrong("name", f"must be different for each thing; {name!r} is there twice")
    return tuple(things)


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
    )
    table.end()
    return scatter


def _start(table: Table | None, width: float, depth: float) -> Start:
    if table is None:
        return Start()
    at = table.numbers("at_mm", 2, 0, max(width, depth), None)
    heading = math.radians(table.number("heading_deg", -360, 360, 0.0))
    start = Start(
        pose=None if at is None else (*at, heading),
        from_base=table.number("from_base_mm", 0, 5000, 0.0),
        clearance=table.number("clearance_mm", 1, 500, 40.0),
    )
    table.end()
    return start
