"""What a teacher's hand is to the loop: a stick whose position is looked at once a tick."""

from __future__ import annotations

from typing import Protocol

__all__ = ["MOST", "Hand"]

MOST = 10
"""The stick's greatest deflection, in units of Vrot."""


class Hand(Protocol):
    """Somebody, or something, that steers. Looking at it never waits."""

    def vrot(self) -> int:
        """Where the stick is now: -10 (turn left) .. 10 (turn right)."""

    @property
    def done(self) -> bool:
        """Whether the teacher has asked to end the lesson."""

    def close(self) -> None:
        """Give back what was taken, such as the terminal; twice is once."""
