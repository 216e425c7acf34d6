"""What a run was worth, seen from outside the robot."""

from __future__ import annotations

import math
from collections.abc import Sequence

__all__ = ["Score"]

_MERGED = 0.050
"""Seconds: two touches with no longer a gap are one contact."""
_LONG = 0.5
_LAMP = 60.0
"""mm from the lamp's foot within which the robot's centre has reached it."""
_MOVED = 10.0
"""mm by which a thing must have been shifted to count as moved."""
_STILL_IN_MIND = 1.0
"""Seconds after a mover was last in view in which an alarm is still about it."""
_EPSILON = 1e-9

Place = tuple[float, float]


class Score:
    """Fed once a step; times in seconds since power-up, lengths in mm.

    ``base`` is the base's square (x0, y0, x1, y1) and ``lamp`` the foot of the homing lamp, if there are any. A
    contact is a time in which the robot touches anything but the base's walls and movers, which walk into it by
    themselves, while its centre is outside the base; touches that are at most 50 ms apart are one contact. Other
    robots are told apart, and only where there are any (``company``).
    """

    def __init__(
        self,
        start: Place,
        base: tuple[float, float, float, float] | None,
        lamp: Place | None = None,
        *,
        company: bool = False,
    ) -> None:
        self.inside = False
        """Whether the robot's centre is in the base's square."""
        self._base, self._lamp = base, lamp
        self._place = start
        self._distance = 0.0
        self._base_reached: float | None = None
        self._lamp_reached: float | None = None
        self._contacts = 0
        self._contact_began = 0.0
        self._last_touch = -math.inf
        self._longest = 0.0
        self._long_ones = 0
        self._put: dict[str, Place] = {}
        self._shifted: dict[str, float] = {}
        self._lit: dict[str, float] = {}
        self._burned: list[float] = []
        self._fires = 0
        self._entered = 0
        self._seen: set[str] = set()
        self._in_view = 0.0
        self._last_seen = -math.inf
        self._alarms = self._false_alarms = 0
        self._company = company
        self._meetings = 0
        self._last_met = -math.inf
        self._met_for = 0.0
        self._reach(0.0)

    def step(self, now: float, step: float, place: Place, touching: bool) -> None:
        """The robot has moved to ``place`` in the ``step`` seconds before ``now``."""
        if place != self._place:
            self._distance += math.hypot(place[0] - self._place[0], place[1] - self._place[1])
            self._place = place
            self._reach(now)
        if not touching or self.inside:
            return
        if now - step - self._last_touch > _MERGED + _EPSILON:
            self._contact_began = now - step
            self._contacts += 1
        before = self._last_touch - self._contact_began
        self._last_touch = now
        lasted = now - self._contact_began
        self._longest = max(self._longest, lasted)
        if lasted > _LONG + _EPSILON >= before:
            self._long_ones += 1

    def met(self, now: float, step: float) -> None:
        """The robot has touched another one in the ``step`` seconds before ``now``."""
        self._meetings += now - step - self._last_met > _MERGED + _EPSILON
        self._met_for += step
        self._last_met = now

    def put(self, name: str, place: Place) -> None:
        """A movable thing was put there, by whoever furnished the arena or by hand."""
        self._put[name] = place

    def taken(self, name: str, place: Place) -> None:
        """A movable thing was taken away from ``place``."""
        if name in self._put:
            self._shifted[name] = max(self._shifted.get(name, 0.0), math.dist(self._put.pop(name), place))

    def lit(self, name: str, now: float) -> None:
        """A real fire was lit."""
        self._lit[name] = now
        self._fires += 1

    def put_out(self, name: str, now: float) -> None:
        """The robot put a fire out."""
        if name in self._lit:
            self._burned.append(now - self._lit.pop(name))

    def burned_down(self, name: str) -> None:
        """A fire has ended by itself, if it burned."""
        self._lit.pop(name, None)

    def entered(self) -> None:
        """A mover has entered the arena."""
        self._entered += 1

    def saw(self, name: str, now: float, seconds: float) -> None:
        """A mover was in the camera's view for the ``seconds`` before ``now``."""
        self._seen.add(name)
        self._in_view += seconds
        self._last_seen = now

    def alarm(self, now: float) -> None:
        """The watchman sounded its alarm."""
        self._alarms += 1
        self._false_alarms += now - self._last_seen > _STILL_IN_MIND + _EPSILON

    def figures(
        self, things: Sequence[tuple[str, Place]] = (), used_mah: float = 0.0
    ) -> dict[str, float | int | None]:
        """The figures, JSON-able; ``things`` are where the movable things stand now (mm).

        base_reached_s
            when the robot's centre was first inside the base's square, in seconds since power-up, or None;
        lamp_reached_s
            when it was first within 60 mm of the foot of the arena's first lamp, or None;
        contacts
            how many there were (see the class);
        contact_longest_s
            how long the longest contact lasted;
        contacts_over_half_second
            how many contacts lasted longer than 0.5 s;
        distance_m
            the length of the robot's true path;
        objects_moved
            how many movable things stand, or stood when they were taken away, more than 10 mm from where they had
            been put; movers go by themselves and are left out;
        objects_moved_m
            the sum of these shifts, each as the crow flies;
        object_moved_most_m
            the greatest of them, or 0;
        fires_lit
            real fires that were lit;
        fires_put_out
            those that the turbine has put out;
        fire_burned_longest_s
            how long the longest of the fires that were put out had burned, or None;
        movers_entered
            how many times a mover entered;
        movers_seen
            how many different movers, other robots among them while they go, were in view: their middle within the
            camera's 36 degrees, higher than its 40 mm, and nothing of that height in between;
        movers_in_view_s
            for how long a mover was in view, two of them counted twice;
        alarms
            how many alarms were sounded;
        alarms_false
            how many of them while no mover was in view, nor had been within the last second;
        energy_mah
            the charge that robot, camera, wheels and turbine drew, whoever paid for it;
        robots_met, robots_met_s
            where there are other robots: how many times one was touched, wherever and whoever ran into whom
            (touches that are at most 50 ms apart are one), and for how long together.

        Fires and moved things are the world's, whichever of several robots was there; but each has put out its
        own fires.
        """
        shifted = dict(self._shifted)
        for name, place in things:
            if name in self._put:
                shifted[name] = max(shifted.get(name, 0.0), math.dist(self._put[name], place))
        moved = [way for way in shifted.values() if way > _MOVED]
        return {
            "base_reached_s": _rounded(self._base_reached),
            "lamp_reached_s": _rounded(self._lamp_reached),
            "contacts": self._contacts,
            "contact_longest_s": round(self._longest, 6),
            "contacts_over_half_second": self._long_ones,
            "distance_m": round(self._distance / 1000, 6),
            "objects_moved": len(moved),
            "objects_moved_m": round(sum(moved) / 1000, 6),
            "object_moved_most_m": round(max(moved, default=0.0) / 1000, 6),
            "fires_lit": self._fires,
            "fires_put_out": len(self._burned),
            "fire_burned_longest_s": _rounded(max(self._burned, default=None)),
            "movers_entered": self._entered,
            "movers_seen": len(self._seen),
            "movers_in_view_s": round(self._in_view, 6),
            "alarms": self._alarms,
            "alarms_false": self._false_alarms,
            "energy_mah": round(used_mah, 6),
        } | self._about_robots()

    def _about_robots(self) -> dict[str, float | int | None]:
        if not self._company:
            return {}
        return {"robots_met": self._meetings, "robots_met_s": round(self._met_for, 6)}

    def _reach(self, now: float) -> None:
        if self._base is not None:
            x, y = self._place
            left, low, right, high = self._base
            self.inside = left <= x <= right and low <= y <= high
            if self.inside and self._base_reached is None:
                self._base_reached = now
        if self._lamp is not None and self._lamp_reached is None and math.dist(self._place, self._lamp) <= _LAMP:
            self._lamp_reached = now


def _rounded(figure: float | None) -> float | None:
    return None if figure is None else round(figure, 6)
