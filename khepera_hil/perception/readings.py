"""What one tick's readings are, and what is made of them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

__all__ = ["BEARINGS", "LIGHT_MAX", "Percept", "Readings", "Sense"]

BEARINGS = (-90, -45, -10, 10, 45, 90, 175, -175)
"""Where the eight sensors look, in degrees, clockwise from ahead: the order of the manual's N and O and of the
paper's Px1..Px8, L1..L8 (figure 3). The two behind point to 180; the five degrees tell them apart."""

LIGHT_MAX = 511
"""The paper's L1..L8 take values in 0..511 (section 4.1); the robot's A/D converter could say more."""


@dataclass(frozen=True)
class Readings:
    """One tick's answers: proximity (manual's N, 0..1023) and ambient light (O), eight each, or not asked."""

    proximity: tuple[int, ...] = ()
    light: tuple[int, ...] = ()


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
