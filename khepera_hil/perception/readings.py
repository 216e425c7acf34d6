"""What one tick's readings are, and what is made of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

__all__ = ["BEARINGS", "DARK", "LIGHT_MAX", "Need", "Percept", "Readings", "Sense"]

BEARINGS = (-90, -45, -10, 10, 45, 90, 175, -175)
"""Where the eight sensors look, in degrees, clockwise from ahead: the order of the manual's N and O and of the
paper's Px1..Px8, L1..L8 (figure 3). The two behind point to 180; the five degrees tell them apart."""

LIGHT_MAX = 511
"""The paper's L1..L8 take values in 0..511 (section 4.1); the robot's A/D converter could say more."""

DARK = 490
"""Light readings below this are brightness; a sensor in the dark reads about 497."""


@dataclass(frozen=True)
class Need:
    """A reading that a program takes: a command's letter and values, and that it is due every so many ticks.

    ``Need("N")`` is the proximity of each tick, ``Need("T", (2, "N"), every=3)`` the camera's image of each third.
    """

    letter: str
    values: tuple[int | str, ...] = ()
    every: int = 1
    without: str = ""
    """What is to be told of a robot that refuses it, for which the program goes on without it; empty: it cannot."""

    def __post_init__(self) -> None:
        if not 1 <= self.every <= 100:
            raise ValueError(f"{self} cannot be due every {self.every} ticks: use 1 to 100")

    def __str__(self) -> str:
        return ",".join(map(str, (self.letter, *self.values)))


@dataclass(frozen=True)
class Readings:
    """One tick's answers: proximity (manual's N, 0..1023) and ambient light (O), eight each, or not asked.

    ``answers`` has those to all other needs that were due, by letter and values: ``answers["T", 2, "N"]`` is the
    turret's letter and its numbers.
    """

    proximity: tuple[int, ...] = ()
    light: tuple[int, ...] = ()
    answers: Mapping[tuple[int | str, ...], tuple[int | str, ...]] = field(default_factory=dict)


@dataclass(frozen=True)
class Percept:
    """Values of the paper's variables, and how many readings of each had to be clipped to get them."""

    values: dict[str, int]
    clipped: dict[str, int] = field(default_factory=dict)


class Sense(Protocol):
    """Computes some of the paper's variables, tick by tick; may remember earlier ticks."""

    needs: str
    """The letter of the command whose readings it takes."""

    def step(self, readings: Readings) -> Percept:
        """The variables' values at this tick."""
