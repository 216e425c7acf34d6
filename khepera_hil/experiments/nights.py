"""Nights by chance: what happens in an arena while the watchman is on duty, as a scenario's file.

Fires and movers come at random moments and places, bulbs are shaken, the operator changes his mind, furniture is
put down and taken away, sensors break and are mended. All of it is drawn from the seed alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

__all__ = ["CALL", "Night", "night"]

CALL = 240.0
"""Seconds for which a watchman that is called in stays so."""

_FREE = 330.0  # mm from the base's corner within which nothing is lit or put down
_FROM_WALL = 130.0
_SIDE = 1000.0
_FIRE_LASTS = 900.0
_SHAKEN = 40.0
_COMPRESSION = 8.0  # of the battery's time: half an hour becomes four minutes


@dataclass(frozen=True)
class Night:
    """A scenario's text, and when what was to happen."""

    text: str
    calls: tuple[float, ...]
    """When the watchman was called in (vigil off)."""


def night(seed: int, seconds: float, world: str) -> Night:
    """One of ``seconds`` in ``world``, a floor of 1 m by 1 m with its base in the corner at the origin."""
    rng = np.random.default_rng(np.random.SeedSequence([seed, 0x6E69676874]))
    events: list[tuple[float, str]] = [(0.0, _order("vigil", on=True))]
    calls = []
    for moment in _moments(rng, seconds, 300.0):
        x, y = _place(rng)
        real = rng.random() < 0.75
        lasts = _FIRE_LASTS if real else _SHAKEN
        body = f"at_mm = [{x}, {y}]\nreal = {str(real).lower()}\nlasts_s = {lasts}"
        events.append((moment, f'kind = "fire"\nname = "{"fire" if real else "bulb"} {len(events)}"\n{body}'))
    for moment in _moments(rng, seconds, 120.0):
        path = [_door(rng), *([round(float(value)) for value in rng.uniform(50, _SIDE - 50, 2)] for _ in range(3))]
        body = str(rng.choice(["mouse", "ball"]))
        events.append(
            (
                moment,
                f'kind = "mover"\nname = "{body} {len(events)}"\nbody = "{body}"\nspeed_mm_s = '
                f"{rng.uniform(60, 200):.0f}\nrounds = 2\npath_mm = {path}",
            )
        )
    for moment in _moments(rng, seconds, 900.0):
        calls.append(moment)
        events += [(moment, _order("vigil", on=False)), (moment + CALL, _order("vigil", on=True))]
    for moment in _moments(rng, seconds, 600.0):
        events.append((moment, _order("identify", on=True)))
    for number, moment in enumerate(_moments(rng, seconds, 700.0)):
        x, y = _door(rng, 50)
        box = f'name = "box {number}"\nshape = "box"\nsize_mm = [70, 50]\nmass_g = {rng.integers(40, 400)}'
        events.append((moment, f'kind = "object"\n{box}\nat_mm = [{x}, {y}]\nangle_deg = {rng.integers(0, 90)}'))
        events.append((moment + 400, f'kind = "take-away"\nname = "box {number}"'))
    for moment in _moments(rng, seconds, 1800.0):
        sensor = f'sensor = {rng.integers(0, 8)}\nof = "{rng.choice(["proximity", "light"])}"'
        events.append((moment, f'kind = "broken-sensor"\n{sensor}\nreads = {rng.choice([0, 250, 1023])}'))
        events.append((moment + 120, f'kind = "mended-sensor"\n{sensor}'))
    lines = [f'title = "a night by chance, seed {seed}"', f'world = "{world}"']
    lines.append(f"battery_compression = {_COMPRESSION}")
    lines += [
        f"\n[[event]]\nat_s = {moment:.1f}\n{body}" for moment, body in sorted(events, key=lambda one: one[0])
    ]
    return Night("\n".join(lines) + "\n", tuple(calls))


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


def _place(rng: np.random.Generator) -> tuple[int, int]:
    """Somewhere on the floor, but not before the base."""
    while True:
        x, y = rng.uniform(_FROM_WALL, _SIDE - _FROM_WALL, 2)
        if x > _FREE or y > _FREE:
            return round(float(x)), round(float(y))
