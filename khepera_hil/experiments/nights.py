"""Nights by chance: what happens in an arena while the watchman is on duty, as a scenario's file.

Fires and movers come at random moments and places, bulbs are shaken, the operator changes his mind, furniture is
put down and taken away, sensors break and are mended. All of it is drawn from the seed alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import hypot

import numpy as np

from khepera_hil.world import World
from khepera_hil.world.cast import CANDLE
from khepera_hil.world.shapes import Shape, disc, gap

__all__ = ["CALL", "FIRE_LASTS", "SHORT", "Night", "night", "short_night"]

CALL = 240.0
"""Seconds for which a watchman that is called in stays so."""

_FREE = 330.0  # mm from the base's corner within which nothing is lit or put down
_FROM_WALL = 130.0
_FROM_THINGS = 70.0  # mm: a fire inside a cupboard nobody can blow out
_SIDE = 1000.0
FIRE_LASTS = 900.0
"""Seconds after which a fire has burned down."""

SHORT = 600.0
"""Seconds of a short night at the most: it is over when its fire is out, or its call answered."""

_SHAKEN = 40.0
_COMPRESSION = 4.0  # of the battery's time: 45 minutes become eleven, so that a day has its recharges
_EARLY = 60.0  # s, in which a short night's fire is lit or its call comes

_NAMES = 12
"""Fires have so many names, and movers and boxes fewer: what has gone comes again, and the world of a long night
stays small. Fires come a hundred seconds apart at the least, so that none is lit while its namesake burns."""

_PLACES = 4  # on a mover's way
_TRIES = 200
_WIDTH = 30.0  # mm: half of a mover, and some room
_ROUND = 150.0  # s that a mover may take

_AT_ONCE = 3
_MASSES = (60, 150, 400)  # g, of the boxes

_Event = tuple[float, str]


@dataclass(frozen=True)
class Night:
    """A scenario's text, and when what was to happen."""

    text: str
    seconds: float
    calls: tuple[float, ...]
    """When the watchman was called in (vigil off)."""
    given: float
    """Seconds of the night that must be left when a fire is lit, for it to count."""


def night(seed: int, seconds: float, world: str) -> Night:
    """One of ``seconds`` in ``world``, a floor of 1 m by 1 m with its base in the corner at the origin."""
    rng, floor = _chance(seed), _Floor.of(world, seed)
    events: list[_Event] = [(0.0, _order("vigil", on=True))]
    calls = []
    for number, moment in enumerate(_moments(rng, seconds, 300.0)):
        events.append(_fire(rng, floor, moment, number, real=rng.random() < 0.75))
    for number, moment in enumerate(_moments(rng, seconds, 60.0)):
        events.append(_mover(rng, floor, moment, number))
    for moment in _moments(rng, seconds, 900.0):
        calls.append(moment)
        events += [(moment, _order("vigil", on=False)), (moment + CALL, _order("vigil", on=True))]
    for moment in _moments(rng, seconds, 600.0):
        events.append((moment, _order("identify", on=True)))
    for number, moment in enumerate(_moments(rng, seconds, 700.0)):
        events += _box(rng, moment, number)
    for moment in _moments(rng, seconds, 1800.0):
        events += _broken(rng, moment)
    return _night(f"a night by chance, seed {seed}", world, seconds, events, calls, FIRE_LASTS, _COMPRESSION)


def short_night(seed: int, world: str) -> Night:
    """One of `SHORT` seconds. With an even seed a fire is early in it; with an odd one the watchman is called in.

    What else happens is the same: movers, and now and then a bulb that is shaken, an order to identify, a box, a
    broken sensor.
    """
    rng, floor = _chance(seed), _Floor.of(world, seed)
    events: list[_Event] = [(0.0, _order("vigil", on=True))]
    calls = []
    moment = float(rng.uniform(15, _EARLY))
    if seed % 2:
        calls.append(moment)
        events.append((moment, _order("vigil", on=False)))
    else:
        events.append(_fire(rng, floor, moment, 0, real=True))
    for number, moment in enumerate(_moments(rng, SHORT, 30.0)):
        events.append(_mover(rng, floor, moment, number))
    if rng.random() < 0.3:
        events.append(_fire(rng, floor, float(rng.uniform(20, SHORT / 2)), 0, real=False))
    if rng.random() < 0.3:
        events.append((float(rng.uniform(20, SHORT / 2)), _order("identify", on=True)))
    if rng.random() < 0.3:
        events += _box(rng, float(rng.uniform(20, SHORT / 2)), 0)
    if rng.random() < 0.3:
        events += _broken(rng, float(rng.uniform(20, SHORT / 2)))
    return _night(f"a short night, seed {seed}", world, SHORT, events, calls, SHORT - _EARLY, 1.0)


def _chance(seed: int) -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence([seed, 0x6E69676874]))


def _night(
    title: str,
    world: str,
    seconds: float,
    events: list[_Event],
    calls: list[float],
    given: float,
    compression: float,
) -> Night:
    lines = [f'title = "{title}"', f'world = "{world}"', f"battery_compression = {compression}"]
    lines += [
        f"\n[[event]]\nat_s = {moment:.1f}\n{body}" for moment, body in sorted(events, key=lambda one: one[0])
    ]
    return Night("\n".join(lines) + "\n", seconds, tuple(calls), given)


def _fire(rng: np.random.Generator, floor: _Floor, moment: float, number: int, *, real: bool) -> _Event:
    """A candle, or a bulb that is shaken."""
    x, y = floor.place(rng)
    if real:
        floor.candles.append((moment, x, y))
    name, lasts = ("fire", FIRE_LASTS) if real else ("bulb", _SHAKEN)
    body = f"at_mm = [{x}, {y}]\nreal = {str(real).lower()}\nlasts_s = {lasts}"
    return moment, f'kind = "fire"\nname = "{name} {number % _NAMES}"\n{body}'


def _mover(rng: np.random.Generator, floor: _Floor, moment: float, number: int) -> _Event:
    """It comes in beside a wall and goes from place to place, round what stands there."""
    path = floor.path(rng, moment)
    body, speed = str(rng.choice(["mouse", "ball"])), rng.uniform(60, 200)
    way = f"speed_mm_s = {speed:.0f}\nrounds = 2\npath_mm = {path}"
    return moment, f'kind = "mover"\nname = "{body} {number % _AT_ONCE}"\nbody = "{body}"\n{way}'


def _box(rng: np.random.Generator, moment: float, number: int) -> list[_Event]:
    """Put down, and taken away again."""
    x, y = _door(rng, 50)
    which = number % _AT_ONCE
    box = f'name = "box {which}"\nshape = "box"\nsize_mm = [70, 50]\nmass_g = {_MASSES[which]}'
    return [
        (moment, f'kind = "object"\n{box}\nat_mm = [{x}, {y}]\nangle_deg = {rng.integers(0, 90)}'),
        (moment + 400, f'kind = "take-away"\nname = "box {which}"'),
    ]


def _broken(rng: np.random.Generator, moment: float) -> list[_Event]:
    """A sensor that says always the same, for two minutes."""
    sensor = f'sensor = {rng.integers(0, 8)}\nof = "{rng.choice(["proximity", "light"])}"'
    reads = rng.choice([0, 250, 1023])
    return [
        (moment, f'kind = "broken-sensor"\n{sensor}\nreads = {reads}'),
        (moment + 120, f'kind = "mended-sensor"\n{sensor}'),
    ]


def _order(order: str, *, on: bool) -> str:
    return f'kind = "order"\norder = "{order}"\non = {str(on).lower()}'


def _moments(rng: np.random.Generator, seconds: float, apart: float) -> list[float]:
    """Moments of a Poisson process, not nearer to each other than a third of their mean distance."""
    moments, now = [], 20.0
    while (now := now + apart * (1 / 3 + 2 / 3 * float(rng.exponential()))) < seconds:
        moments.append(now)
    return moments


def _door(rng: np.random.Generator, off: int = 45) -> list[int]:
    """Beside a wall, ``off`` mm from it and far from the base: nothing fixed stands so near to one."""
    along, side = round(float(rng.uniform(400, _SIDE - off))), int(rng.integers(4))
    there = round(_SIDE) - off
    return [[off, along], [along, off], [there, along], [along, there]][side]


@dataclass(frozen=True)
class _Floor:
    """Where fires can be, and movers go: on the floor, and not where something stands in the way."""

    things: tuple[Shape, ...]
    candles: list[tuple[float, int, int]] = field(default_factory=list)
    """When they are lit, and where."""

    @classmethod
    def of(cls, world: str, seed: int) -> _Floor:
        layout = World(world, seed).layout
        return cls(tuple(shape for shape in layout.shapes if shape.name not in layout.shelved))

    def place(self, rng: np.random.Generator) -> tuple[int, int]:
        """Of a fire: not before the base either."""
        while True:
            x, y = (round(float(value)) for value in rng.uniform(_FROM_WALL, _SIDE - _FROM_WALL, 2))
            flame = disc("flame", "flame", 0.0, (float(x), float(y), 0.0), 0.0)
            if max(x, y) > _FREE and all(gap(flame, thing) >= _FROM_THINGS for thing in self.things):
                return x, y

    def path(self, rng: np.random.Generator, moment: float) -> list[list[int]]:
        """From beside a wall to three other places, from a moment on; the way back to the first is as free."""
        stands = [
            (*thing.pose[:2], max((hypot(*corner) for corner in thing.corners), default=0.0) + thing.radius)
            for thing in self.things
            if thing.kind != "wall"
        ]
        stands += [(x, y, CANDLE) for lit, x, y in self.candles if lit - _ROUND <= moment <= lit + FIRE_LASTS]
        while True:
            path = [_door(rng)]
            for _ in range(_TRIES):
                there = [round(float(value)) for value in rng.uniform(50, _SIDE - 50, 2)]
                if _is_free(path[-1], there, stands) and (
                    len(path) < _PLACES - 1 or _is_free(there, path[0], stands)
                ):
                    path.append(there)
                if len(path) == _PLACES:
                    return path


def _is_free(start: Sequence[float], end: Sequence[float], stands: Sequence[tuple[float, float, float]]) -> bool:
    """Whether a mover comes from one place to the other; ``stands`` are places and radii, as round as long."""
    (ax, ay), (bx, by) = start, end
    long = hypot(bx - ax, by - ay) or 1.0
    for x, y, reach in stands:
        along = min(max(((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / long, 0.0), long)
        if hypot(x - ax - along * (bx - ax) / long, y - ay - along * (by - ay) / long) < reach + _WIDTH:
            return False
    return True
