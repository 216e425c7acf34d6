"""What a run was worth, seen from outside the robot."""

from __future__ import annotations

import math

__all__ = ["Score"]

_MERGED = 0.050
"""Seconds: two touches with no longer a gap are one contact."""
_LONG = 0.5
_EPSILON = 1e-9


class Score:
    """Fed once a step; times in seconds since power-up, lengths in mm.

    ``base`` is the base's square (x0, y0, x1, y1), if there is one. A contact is a time in which the robot
    touches anything but the base's walls, while its centre is outside the base; touches that are at most
    50 ms apart are one contact.
    """

    def __init__(self, start: tuple[float, float], base: tuple[float, float, float, float] | None) -> None:
        self._base = base
        self._place = start
        self._distance = 0.0
        self._reached: float | None = None
        self._contact_began = 0.0
        self._last_touch = -math.inf
        self._counted = False
        self._longest = 0.0
        self._long_ones = 0
        self._inside_base(0.0)

    def step(self, now: float, step: float, place: tuple[float, float], touching: bool) -> None:
        """The robot has moved to ``place`` in the ``step`` seconds before ``now``."""
        self._distance += math.hypot(place[0] - self._place[0], place[1] - self._place[1])
        self._place = place
        if self._inside_base(now) or not touching:
            return
        if now - step - self._last_touch > _MERGED + _EPSILON:
            self._contact_began = now - step
            self._counted = False
        self._last_touch = now
        lasted = now - self._contact_began
        self._longest = max(self._longest, lasted)
        if lasted > _LONG + _EPSILON and not self._counted:
            self._long_ones += 1
            self._counted = True

    def figures(self) -> dict[str, float | int | None]:
        """The figures, JSON-able:

        base_reached_s
            when the robot's centre was first inside the base's square, in seconds since power-up, or None;
        contact_longest_s
            how long the longest contact lasted;
        contacts_over_half_second
            how many contacts lasted longer than 0.5 s;
        distance_m
            the length of the robot's true path.
        """
        return {
            "base_reached_s": None if self._reached is None else round(self._reached, 6),
            "contact_longest_s": round(self._longest, 6),
            "contacts_over_half_second": self._long_ones,
            "distance_m": round(self._distance / 1000, 6),
        }

    def _inside_base(self, now: float) -> bool:
        if self._base is None:
            return False
        left, low, right, high = self._base
        inside = left <= self._place[0] <= right and low <= self._place[1] <= high
        if inside and self._reached is None:
            self._reached = now
        return inside
