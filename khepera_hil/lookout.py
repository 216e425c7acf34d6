"""Who else reads from our port, looked for when answers are missing, and never for long in one piece.

A loop that shares its processor with others gets little more than its share of it: what it takes in one piece it is
made to wait for afterwards, many times as long. So a search through all processes is cut into small ones.
"""

from __future__ import annotations

from collections.abc import Iterator

from khepera_hil.clock import Clock
from khepera_hil.opening import Port, search

__all__ = ["AGAIN", "PIECE", "Lookout"]

AGAIN = 1.0
"""Seconds between two searches."""

PIECE = 0.001
"""Seconds that a piece of a search may take, and what is left of the process that it has come to."""


class Lookout:
    """Looks for others at ``port``. Does nothing until somebody is suspected."""

    def __init__(self, port: Port, clock: Clock) -> None:
        self._port, self._clock = port, clock
        self._search: Iterator[str | None] | None = None
        self._finding: list[str] = []
        self._found: list[str] = []
        self._next = self._stale = 0.0

    @property
    def others(self) -> str:
        """Who was found last, such as ``pid 4711 (minicom)``; empty when that is long ago."""
        return ", ".join(self._found) if self._clock.now() < self._stale else ""

    def suspect(self) -> None:
        """An answer is missing: look who took it, unless that was just done."""
        if self._search is None and self._clock.now() >= self._next:
            self._search, self._finding = search(self._port), []

    def look(self) -> None:
        """Go on with the search, if there is one, for PIECE seconds."""
        end = self._clock.now() + PIECE
        while self._search is not None and self._clock.now() < end:
            try:
                found = next(self._search)
            except StopIteration:
                self._search, self._found = None, self._finding
                self._next = self._clock.now() + AGAIN
                self._stale = self._next + AGAIN
            else:
                if found is not None:
                    self._finding.append(found)
