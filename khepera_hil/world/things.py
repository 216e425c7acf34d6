"""What stands on a floor, as a file describes it: form, material, weight."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from khepera_hil.world.shapes import FLOOR_FRICTION, Kind, Pose, Shape, box, disc
from khepera_hil.world.tables import Table

__all__ = ["FORMS", "MATERIALS", "MOST_ROBOTS", "read_body", "read_starts", "read_thing"]

MOST_ROBOTS = 32
"""In one arena: what one core still moves at the wall's pace, and more than most floors have room for."""

MATERIALS: dict[str, tuple[float, float]] = {
    "white": (1.0, 0.95),
    "yellow": (0.95, 0.8),
    "red": (0.9, 0.5),
    "wood": (0.8, 0.6),
    "grey": (0.75, 0.45),
    "blue": (0.75, 0.25),
    "green": (0.75, 0.35),
    "cork": (0.6, 0.4),
    "glass": (0.5, 0.3),
    "black": (0.3, 0.08),
    "reflector": (1.3, 0.9),
}
"""What each reflects of infrared light, 1 for white paper, and how bright it is to the camera, 0..1 (proposed)."""

FORMS = ("box", "disc", "triangle", "hexagon", "L", "pyramid", "cone")
"""Of objects: ``triangle`` and ``hexagon`` are regular, ``L`` has two legs at a right angle."""

_MOVERS = {"mouse": (18.0, 50.0, 25.0, 0.4), "ball": (25.0, 50.0, 40.0, 0.05)}
"""Radius and height in mm, mass in g, friction on the floor (proposed). High enough for the camera's 40 mm."""


def read_thing(table: Table, kind: Kind, floor: float) -> Shape:
    """A ``[[wall]]``, ``[[block]]`` or ``[[disc]]``: a box or a disc on the floor."""
    name = table.text("name")
    pose = read_pose(table, floor)
    height = table.number("height_mm", 1, 1000)
    if kind == "disc":
        shape = disc(name, kind, table.number("radius_mm", 5, 500), pose, height)
    else:
        width, depth = table.numbers("size_mm", 2, 5, 2000)
        shape = box(name, kind, width, depth, pose, height)
    return _surfaced(table, shape if kind == "fixed" else _weighed(table, shape))


def read_pose(table: Table, floor: float) -> Pose:
    """Where it stands: ``at_mm`` and ``angle_deg``."""
    x, y = table.numbers("at_mm", 2, 0, floor)
    return x, y, math.radians(table.number("angle_deg", -360, 360, 0.0))


def read_starts(table: Table, floor: float) -> tuple[tuple[int, Pose], ...]:
    """Every ``[[robot]]``: the start of a further robot (mm, radians) by its number; the first's is ``[start]``."""
    starts: dict[int, Pose] = {}
    for item in table.tables("robot"):
        number = item.whole("number", 2, MOST_ROBOTS)
        if number in starts:
            raise item.wrong("number", f"must be new; robot {number} has its start already")
        x, y = item.numbers("at_mm", 2, 0, floor)
        starts[number] = x, y, math.radians(item.number("heading_deg", -360, 360, 0.0))
        item.end()
    return tuple(sorted(starts.items()))


def read_body(table: Table, pose: Pose, *, name: str | None = None, kinds: tuple[str, ...] = ()) -> Shape:
    """An object by its ``shape``, one of :data:`FORMS`; or, with ``kinds``, a mover by its ``body``."""
    if kinds:
        body = table.word("body", kinds)
        radius, height, mass, friction = _MOVERS[body]
        moving = disc(
            table.text("name", body),
            "mover",
            table.number("radius_mm", 5, 100, radius),
            pose,
            table.number("height_mm", 1, 1000, height),
            mass=table.number("mass_g", 1, 10_000, mass),
            floor_friction=friction,
        )
        return _surfaced(table, moving)
    name = table.text("name") if name is None else name
    form = table.word("shape", FORMS)
    height = table.number("height_mm", 1, 1000, 40.0)
    if form in ("disc", "cone"):
        shape = disc(name, "disc", table.number("radius_mm", 5, 500), pose, height)
    elif form in ("box", "pyramid"):
        width, depth = table.numbers("size_mm", 2, 5, 2000)
        shape = box(name, "block", width, depth, pose, height)
    else:
        side = table.number("side_mm", 5, 2000)
        parts: tuple[_Corners, ...] = ()
        if form == "L":
            corners, parts = _legs(side, table.number("leg_mm", 5, side / 2))
        else:
            corners = _regular(3 if form == "triangle" else 6, side)
        shape = Shape(name, "block", pose, height, corners, parts=parts)
    return _surfaced(table, _weighed(table, replace(shape, pointed=form in ("pyramid", "cone"))))


def _weighed(table: Table, shape: Shape) -> Shape:
    return replace(
        shape,
        mass=table.number("mass_g", 1, 10_000),
        floor_friction=table.number("floor_friction", 0, 2, FLOOR_FRICTION),
    )


def _surfaced(table: Table, shape: Shape) -> Shape:
    """With what the file says of its surface: a material, its two figures, stripes."""

    def accept(value: Any) -> tuple[float, float]:
        return MATERIALS[value]

    expected = "one of " + ", ".join(MATERIALS)
    reflectance, albedo = table.take("material", expected, accept, (1.0, shape.albedo))
    return replace(
        shape,
        reflectance=table.number("reflectance", 0, 1.5, reflectance),
        albedo=table.number("albedo", 0, 1, albedo),
        stripes=table.range("stripes_mm", 2, 500, None),
    )


_Corners = tuple[tuple[float, float], ...]


def _regular(count: int, side: float) -> _Corners:
    radius = side / (2 * math.sin(math.pi / count))
    angles = [2 * math.pi * place / count for place in range(count)]
    return tuple((radius * math.cos(angle), radius * math.sin(angle)) for angle in angles)


def _legs(
    side: float, leg: float
) -> tuple[tuple[tuple[float, float], ...], tuple[tuple[tuple[float, float], ...], ...]]:
    """An L about the centre of its mass: its outline, and its two legs."""
    area = leg * (2 * side - leg)
    middle = (leg * side * side / 2 + leg * (side - leg) * leg / 2) / area

    def at(*points: tuple[float, float]) -> _Corners:
        return tuple((x - middle, y - middle) for x, y in points)

    outline = at((0, 0), (side, 0), (side, leg), (leg, leg), (leg, side), (0, side))
    return outline, (
        at((0, 0), (side, 0), (side, leg), (0, leg)),
        at((0, leg), (leg, leg), (leg, side), (0, side)),
    )
