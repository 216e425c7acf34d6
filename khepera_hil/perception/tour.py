"""Nlt, Nrt, Per and Lrl: what a tour around an object was like (section 8.2), by the wheels' counters.

The paper gives no formulas. A tour is taken for a closed loop: where it was begun makes no difference. Along the
loop the heading is compared with that of 50 mm before: a turn begins when it differs by more than 28 degrees and
ends when it differs by less than 12 or to the other side; it counts as one for each right angle, and at least one.
Per is the loop's length, Lrl its longest stretch without a turn less these 50 mm, both in mm.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import accumulate, pairwise
from math import hypot, pi, radians
from statistics import median

from khepera_hil.perception.odometry import Odometry
from khepera_hil.perception.readings import Percept, Readings

__all__ = ["Point", "Tour", "measured"]

_WINDOW = 50.0  # mm between the two headings that are compared
_BEGINS, _ENDS = radians(28), radians(12)
_FRESH = 0.25  # share of a new heading in the smoothed one
_CALM = 6
"""Ticks before and after a heading over which it is averaged when a whole loop's turns are counted."""
_SETTLED = 50  # ticks of contact before the tour begins: the first seconds are still the way to the object
_LOST = 30  # ticks without an object until the tour is given up
_SHORTEST = 150.0  # mm
_NEAR = 60.0  # mm: so far from its beginning the loop may be closed
_TURNED = 2 * pi - 0.9  # radians: as much must have been turned; what the wheels' counters miss is allowed for
_STARTS = 7  # beginnings, a tick apart, over which medians are taken


@dataclass(frozen=True)
class Point:
    """Where the robot was at a tick of its tour: mm, radians, and whether something was near."""

    way: float
    heading: float
    x: float
    y: float


class Tour:
    """Watches the robot go around an object. ``near`` says each tick whether there is one (Prox above 0).

    The values are there in the one tick in which the tour is done; then the next tour begins at once.
    """

    needs = "H"

    def __init__(self) -> None:
        self._odometry = Odometry()
        self._smooth: float | None = None
        self._contact = self._alone = 0
        self._points: list[Point] = []

    @property
    def going(self) -> bool:
        """Whether a tour has begun."""
        return bool(self._points)

    def step(self, readings: Readings, near: bool) -> Percept:
        """Nlt, Nrt, Per and Lrl when the loop was closed in this tick, else nothing."""
        odometry = self._odometry
        odometry.step(readings)
        if self._smooth is None:
            self._smooth = odometry.heading
        self._smooth += _FRESH * (odometry.heading - self._smooth)
        self._alone = 0 if near else self._alone + 1
        self._contact = self._contact + 1 if self._alone <= _LOST else 0
        if self._contact == 0:
            self._points.clear()
        if self._contact <= _SETTLED:
            return Percept({})
        self._points.append(Point(odometry.way, self._smooth, odometry.x, odometry.y))
        if len(self._points) <= _STARTS or _closed(self._points, _STARTS - 1) is None:
            return Percept({})
        loops = [measured(self._points, start) for start in range(_STARTS)]
        whole = [loop for loop in loops if loop is not None]
        if not whole:
            return Percept({})
        self._points.clear()
        names = ("Nlt", "Nrt", "Per", "Lrl")
        most = (24, 24, 9999, 999)
        middle = [round(median(loop[place] for loop in whole)) for place in range(4)]
        values = {name: min(value, top) for name, value, top in zip(names, middle, most, strict=True)}
        clipped = {name: 1 for name, value, top in zip(names, middle, most, strict=True) if value > top}
        return Percept(values, clipped)


def measured(points: Sequence[Point], start: int = 0) -> tuple[int, int, float, float] | None:
    """Nlt, Nrt, Per, Lrl of the loop that begins at ``start``; None when it does not close."""
    end = _closed(points, start)
    if end is None:
        return None
    way = end - points[start].way
    loop = [point for point in points[start:] if point.way < end]
    # By its own counters the robot never quite turns a full circle; the loop's last heading is its first.
    turned = next(point.heading for point in points[start:] if point.way >= end) - points[start].heading
    return _turns(_calmed(loop, turned), way, turned)


def _calmed(loop: Sequence[Point], turned: float) -> list[Point]:
    """The closed loop, each heading the mean of those some ticks before and after it: a choppy follower's zigzag is
    no turn.
    """
    count = len(loop)
    around = [
        (turned * lap) + point.heading for lap in (-1, 0, 1) for point in loop
    ]  # of the lap before, of this one, of the next
    reach = min(_CALM, count)
    sums = [0.0, *accumulate(around)]
    wide = 2 * reach + 1
    return [
        replace(point, heading=(sums[count + place + reach + 1] - sums[count + place - reach]) / wide)
        for place, point in enumerate(loop)
    ]


def _closed(points: Sequence[Point], start: int) -> float | None:
    """The way at which the loop comes past its beginning; None as long as it has not."""
    first = points[start]
    best, found = _NEAR, None
    for before, point in pairwise(points[start:]):
        if abs(point.heading - first.heading) < _TURNED or point.way - first.way < _SHORTEST:
            continue
        share = _along(before, point, first)
        x, y = before.x + share * (point.x - before.x), before.y + share * (point.y - before.y)
        far = hypot(x - first.x, y - first.y)
        if far < best:
            best, found = far, before.way + share * (point.way - before.way)
        elif found is not None and point.way - found > 15:
            return found  # it has been passed for good
    return None


def _along(before: Point, after: Point, first: Point) -> float:
    """Where between two points the loop's beginning is nearest, 0..1."""
    dx, dy = after.x - before.x, after.y - before.y
    square = dx * dx + dy * dy
    if square == 0:
        return 0.0
    return min(1.0, max(0.0, ((first.x - before.x) * dx + (first.y - before.y) * dy) / square))


def _turns(loop: Sequence[Point], length: float, turned: float) -> tuple[int, int, float, float]:
    """Turns and the longest straight stretch of a closed loop, taken up at its straightest place."""
    count = len(loop)
    way = [point.way - loop[0].way for point in loop]
    change = _changes(loop, way, length, turned)
    first = min(range(count), key=lambda place: abs(change[place]))
    counts = {1: 0, -1: 0}
    if abs(change[first]) > _ENDS:  # bent everywhere: a single turn without an end
        counts[1 if turned > 0 else -1] = max(1, round(abs(turned) / (pi / 2)))
        return counts[1], counts[-1], length, 0.0
    turns: list[tuple[float, float]] = []
    began: tuple[float, float, int] | None = None
    for step in range(count + 1):
        lap, place = divmod(first + step, count)
        s, heading = lap * length + way[place], lap * turned + loop[place].heading
        side = 1 if change[place] > 0 else -1
        if began is not None and (side != began[2] or abs(change[place]) < _ENDS):
            turns.append((began[0], s))
            counts[began[2]] += max(1, round(abs(heading - began[1]) / (pi / 2)))
            began = None
        if began is None and abs(change[place]) > _BEGINS:
            began = (s, heading - change[place], side)
    if not turns:
        return counts[1], counts[-1], length, max(0.0, length - _WINDOW)
    gaps = [after[0] - before[1] for before, after in pairwise([*turns, (turns[0][0] + length, 0.0)])]
    return counts[1], counts[-1], length, max(0.0, max(gaps) - _WINDOW)


def _changes(loop: Sequence[Point], way: Sequence[float], length: float, turned: float) -> list[float]:
    """How much the heading differs from that of 50 mm before, at each point of the loop."""
    count = len(loop)
    changes, back = [], 0  # back counts on from the lap before
    for place in range(count):
        while _at(way, back + 1, length, count) <= way[place] + length - _WINDOW:
            back += 1
        lap, behind = divmod(back, count)
        changes.append(loop[place].heading + turned - (lap * turned + loop[behind].heading))
    return changes


def _at(way: Sequence[float], place: int, length: float, count: int) -> float:
    lap, within = divmod(place, count)
    return lap * length + way[within]
