"""Arenas as TOML files: what may stand in them, with every mistake named by file, key and what was expected."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import Any

from khepera_hil.errors import WorldError
from khepera_hil.world.shapes import Kind, Shape, box, disc

__all__ = ["Arena", "Base", "LampPlan", "Scatter", "Start", "arenas", "load_arena"]

Range = tuple[float, float]

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
    shipped = sorted(entry.name for entry in files(__package__).joinpath("worlds").iterdir())
    names = [name.removesuffix(".toml") for name in shipped if name.endswith(".toml")]
    return {name: load_arena(name).title for name in names}


def load_arena(name: str) -> Arena:
    """An arena by its name, or by the path of a TOML file (anything with a slash or ending in .toml).

    Raises :class:`~khepera_hil.errors.WorldError`.
    """
    if "/" in name or name.endswith(".toml"):
        where, label = Path(name), Path(name).stem
        try:
            text = where.read_text("utf-8")
        except (OSError, UnicodeDecodeError) as error:
            reason = getattr(error, "strerror", None) or "it is no UTF-8 text"
            raise WorldError(f"the arena {name} cannot be read: {reason}") from None
    else:
        source, label = files(__package__).joinpath("worlds", f"{name}.toml"), name
        if not name.replace("-", "").replace("_", "").isalnum() or not source.is_file():
            raise WorldError(
                f"there is no arena {name!r}; there are {', '.join(arenas())}, or give the path of a TOML file"
            )
        text = source.read_text("utf-8")
        name = f"{name}.toml"
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise WorldError(f"{name} is no TOML: {error}") from None
    return _arena(label, _Table(name, "", table))


class _Table:
    """One table of a file: every key is asked for once, and what nobody asked for is a mistake."""

    def __init__(self, file: str, path: str, values: dict[str, Any]) -> None:
        self._file = file
        self._path = path
        self._values = dict(values)
        self._known: list[str] = []

    def take(self, key: str, expected: str, accept: Callable[[Any], Any], default: Any = ...) -> Any:
        """The value of ``key`` as ``accept`` makes it; it raises ValueError or TypeError for what is wrong."""
        self._known.append(key)
        if key not in self._values:
            if default is ...:
                raise self.wrong(key, f"is missing; expected {expected}")
            return default
        value = self._values.pop(key)
        try:
            return accept(value)
        except (TypeError, ValueError, KeyError):
            raise self.wrong(key, f"must be {expected}, not {value!r}") from None

    def wrong(self, key: str, what: str) -> WorldError:
        return WorldError(f"{self._file}: {self._path}{key} {what}")

    def number(self, key: str, low: float, high: float, default: Any = ...) -> float:
        return float(self.take(key, f"a number from {low:g} to {high:g}", lambda v: _number(v, low, high), default))

    def numbers(self, key: str, count: int | None, low: float, high: float, default: Any = ...) -> Any:
        many = "a list of" if count is None else f"a list of {count}"
        expected = f"{many} numbers from {low:g} to {high:g}"

        def accept(value: Any) -> tuple[float, ...]:
            if not isinstance(value, list) or not value or (count is not None and len(value) != count):
                raise ValueError
            return tuple(_number(item, low, high) for item in value)

        return self.take(key, expected, accept, default)

    def range(self, key: str, low: float, high: float, default: Any = ...) -> Any:
        def accept(value: Any) -> Range:
            if not isinstance(value, list):
                value = [value, value]
            first, last = (_number(item, low, high) for item in value)
            if first > last:
                raise ValueError
            return first, last

        return self.take(key, f"a number or [least, most] from {low:g} to {high:g}", accept, default)

    def count(self, key: str, high: int, default: Any = ...) -> Any:
        least, most = self.range(key, 0, high, default)
        if least != int(least) or most != int(most):
            raise self.wrong(key, f"must be whole numbers, not {[least, most]}")
        return int(least), int(most)

    def text(self, key: str, default: Any = ...) -> str:
        def accept(value: Any) -> str:
            if not isinstance(value, str) or not value.strip() or "\n" in value:
                raise ValueError
            return value.strip()

        return str(self.take(key, "one line of text", accept, default))

    def table(self, key: str) -> _Table | None:
        def accept(value: Any) -> _Table:
            if not isinstance(value, dict):
                raise TypeError
            return _Table(self._file, f"{self._path}{key}.", value)

        table: _Table | None = self.take(key, "a table", accept, None)
        return table

    def tables(self, key: str) -> list[_Table]:
        def accept(value: Any) -> list[_Table]:
            if not isinstance(value, list) or not all(isinstance(item, dict) for item in value):
                raise TypeError
            return [_Table(self._file, f"{key}[{place}].", item) for place, item in enumerate(value)]

        found: list[_Table] = self.take(key, f"tables, each written [[{key}]]", accept, [])
        return found

    def end(self) -> None:
        """Raises when something is left."""
        for key in self._values:
            raise self.wrong(key, f"is not known here; expected one of {', '.join(self._known)}")


def _number(value: Any, low: float, high: float) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= high:
        raise ValueError
    return float(value)


def _arena(name: str, table: _Table) -> Arena:
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


def _base(table: _Table | None, room: float) -> Base | None:
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


def _lamp(table: _Table, width: float, depth: float) -> LampPlan:
    lamp = LampPlan(
        name=table.text("name"),
        at=table.numbers("at_mm", 2, 0, max(width, depth)),
        height=table.range("height_mm", 30, 1000),
        intensity=table.number("intensity", 0, 100),
        radius=table.number("radius_mm", 0, 50, 5.0),
    )
    table.end()
    return lamp


def _things(table: _Table, width: float, depth: float) -> tuple[Shape, ...]:
    things: list[Shape] = []
    for key, kind in (("wall", "fixed"), ("block", "block"), ("disc", "disc")):
        things += [_thing(item, kind, width, depth) for item in table.tables(key)]  # type: ignore[arg-type] # literals
    names = [thing.name for thing in things]
    for name in names:
        if names.count(name) > 1:
            raise table.wrong("name", f"must be different for each thing; {name!r} is there twice")
    return tuple(things)


def _thing(table: _Table, kind: Kind, width: float, depth: float) -> Shape:
    name = table.text("name")
    x, y = table.numbers("at_mm", 2, 0, max(width, depth))
    angle = math.radians(table.number("angle_deg", -360, 360, 0.0))
    height = table.number("height_mm", 1, 1000)
    more = {"reflectance": table.number("reflectance", 0, 1.5, 1.0)}
    if kind != "fixed":
        more["mass"] = table.number("mass_g", 1, 10_000)
        more["floor_friction"] = table.number("floor_friction", 0, 2, 0.35)
    if kind == "disc":
        radius = table.number("radius_mm", 5, 500)
        shape = disc(name, kind, radius, (x, y, angle), height, **more)
    else:
        long, wide = table.numbers("size_mm", 2, 5, 2000)
        shape = box(name, kind, long, wide, (x, y, angle), height, **more)
    table.end()
    return shape


def _scatter(table: _Table | None) -> Scatter | None:
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


def _start(table: _Table | None, width: float, depth: float) -> Start:
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
