"""Scenarios: timed lists of events, as TOML files beside the arenas.

Some events act in the world (a fire, a mover, an object, a broken sensor, the battery, a lamp); the others are
handed out by :meth:`Agenda.due` to whom they concern: orders to the service, link faults and resets to the
robot's end of the protocol. Seconds since power-up, mm.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TypeVar

from khepera_hil.world.shapes import Pose, Shape
from khepera_hil.world.tables import Table, read_table, shipped
from khepera_hil.world.things import MOST_ROBOTS, read_body, read_starts

__all__ = [
    "Agenda",
    "BatterySet",
    "Broken",
    "Event",
    "Fire",
    "LampSet",
    "LinkFault",
    "Mover",
    "Order",
    "PutDown",
    "Reset",
    "Scenario",
    "TakeAway",
    "load_scenario",
    "scenarios",
]

ORDERS = ("vigil", "identify")
"""The watchman's two switches (section 10)."""

FAULTS = ("lost", "garbled", "silent")
BROKEN = ("proximity", "light", "both")

_LONGEST = 1e6  # s
_FLOOR = 5000.0  # mm, as wide as an arena may be


@dataclass(frozen=True)
class Event:
    """Something that happens ``at`` a moment, seconds since power-up; ``where`` a file says so.

    ``robot`` is the number of the robot that it concerns, if it concerns one.
    """

    at: float
    where: str = field(default="", kw_only=True, compare=False)
    robot: int = field(default=1, kw_only=True)


@dataclass(frozen=True)
class Order(Event):
    """The operator's: ``order`` is ``vigil`` or ``identify``, switched on or off."""

    order: str
    on: bool


@dataclass(frozen=True)
class LinkFault(Event):
    """Trouble on the line for ``lasts`` seconds.

    ``fault``: ``lost`` (a share of the characters vanishes), ``garbled`` (a share has a wrong bit) or ``silent``
    (nothing passes, ``share`` is 1); in both directions.
    """

    fault: str
    share: float
    lasts: float


@dataclass(frozen=True)
class Reset(Event):
    """The robot starts anew, as after a press on its reset button."""


@dataclass(frozen=True)
class Fire(Event):
    """A flame is lit, or (``real`` false) a bulb that somebody shakes: it flickers, but no wind puts it out.

    ``lasts`` seconds, or until it is put out.
    """

    name: str
    place: tuple[float, float]
    height: float
    intensity: float
    real: bool
    lasts: float


@dataclass(frozen=True)
class Mover(Event):
    """Something enters at the first point of ``path``, goes along it at ``speed`` mm/s, and leaves at its end.

    ``rounds`` times along the path, back to its first point after each but the last. It pushes no harder than it
    is heavy: what stands in its way stops it.
    """

    shape: Shape
    path: tuple[tuple[float, float], ...]
    speed: float
    rounds: int


@dataclass(frozen=True)
class PutDown(Event):
    """An object is put on the floor, as soon as its place is free.

    ``shape`` is new, or a thing of the arena that stands elsewhere or was taken away. ``place`` None:
    on the arena's stage.
    """

    name: str
    shape: Shape | None = None
    place: tuple[float, float] | None = None
    angle: float = 0.0


@dataclass(frozen=True)
class TakeAway(Event):
    """An object is taken from the floor."""

    name: str


@dataclass(frozen=True)
class Broken(Event):
    """Sensor 0..7 answers ``reads`` from now on, whatever there is; None: it is mended.

    ``of`` says which of its two: ``proximity``, ``light`` or ``both``.
    """

    sensor: int
    of: str
    reads: int | None


@dataclass(frozen=True)
class BatterySet(Event):
    """The battery's charge is set, 0..1."""

    charge: float


@dataclass(frozen=True)
class LampSet(Event):
    """A lamp of the arena shines with another intensity from now on; 0 is off."""

    name: str
    intensity: float


OF_A_ROBOT = (BatterySet, Broken, LinkFault, Order, Reset)
"""Events that concern one robot: the first, where nothing else is said."""


@dataclass(frozen=True)
class Scenario:
    """What happens, in the order of time.

    ``world`` is the arena that it was made for, if any; the battery is so many times faster by ``compression``.
    ``start`` is where the robot starts (mm, radians counter-clockwise), in place of what the arena says, and
    ``starts`` where further robots do, by number.
    """

    name: str
    title: str
    events: tuple[Event, ...]
    world: str | None = None
    compression: float = 1.0
    start: tuple[float, float, float] | None = None
    starts: tuple[tuple[int, Pose], ...] = ()


E_co = TypeVar("E_co", bound=Event)


class Agenda:
    """Hands a scenario's events out, each once, when their moment has come."""

    def __init__(self, events: Sequence[Event]) -> None:
        self._left = sorted(events, key=lambda event: event.at)

    def due(self, now: float, *kinds: type[E_co]) -> list[E_co]:
        """Events of these kinds up to ``now`` that nobody has taken yet, in their order."""
        if not self._left or self._left[0].at > now:
            return []
        taken: list[E_co] = []
        left: list[Event] = []
        for event in self._left:
            if event.at <= now and isinstance(event, kinds):
                taken.append(event)
            else:
                left.append(event)
        self._left = left
        return taken

    def next(self, *kinds: type[Event]) -> float | None:
        """When the next event of these kinds is due, if there is one."""
        return next((event.at for event in self._left if isinstance(event, kinds)), None)


def scenarios() -> dict[str, str]:
    """The scenarios that come with the package: name and one line about each."""
    return {name: load_scenario(name).title for name in shipped("scenarios")}


def load_scenario(name: str) -> Scenario:
    """A scenario by its name, or by the path of a TOML file (anything with a slash or ending in .toml).

    Raises :class:`~khepera_hil.errors.WorldError`.
    """
    label, table = read_table("scenario", "scenarios", name)
    scenario = Scenario(
        label,
        title=table.text("title"),
        world=table.text("world", "") or None,
        compression=table.number("battery_compression", 0.01, 1000, 1.0),
        start=_start(table.table("start")),
        starts=read_starts(table, _FLOOR),
        events=tuple(sorted(map(_event, table.tables("event")), key=lambda event: event.at)),
    )
    table.end()
    return scenario


def _start(table: Table | None) -> tuple[float, float, float] | None:
    if table is None:
        return None
    x, y = table.numbers("at_mm", 2, 0, _FLOOR)
    start = x, y, math.radians(table.number("heading_deg", -360, 360, 0.0))
    table.end()
    return start


def _event(table: Table) -> Event:
    at = table.number("at_s", 0, _LONGEST)
    event = _READERS[table.word("kind", tuple(_READERS))](table, at)
    robot = table.whole("robot", 1, MOST_ROBOTS, 1) if isinstance(event, OF_A_ROBOT) else 1
    table.end()
    return replace(event, where=table.where, robot=robot)


def _order(table: Table, at: float) -> Event:
    return Order(at, table.word("order", ORDERS), table.flag("on", True))


def _link_fault(table: Table, at: float) -> Event:
    fault = table.word("fault", FAULTS)
    share = 1.0 if fault == "silent" else table.number("share", 0, 1)
    return LinkFault(at, fault, share, table.number("lasts_s", 0, _LONGEST))


def _reset(table: Table, at: float) -> Event:
    return Reset(at)


def _fire(table: Table, at: float) -> Event:
    return Fire(
        at,
        name=table.text("name", "fire"),
        place=table.numbers("at_mm", 2, 0, _FLOOR),
        height=table.number("height_mm", 15, 1000, 22.0),
        intensity=table.number("intensity", 0, 100, 1.2),
        real=table.flag("real", True),
        lasts=table.number("lasts_s", 0, _LONGEST, math.inf),
    )


def _mover(table: Table, at: float) -> Event:
    path = table.points("path_mm", 2, _FLOOR)
    (x, y), (to_x, to_y) = path[:2]
    pose = (x, y, math.atan2(to_y - y, to_x - x))
    return Mover(
        at,
        shape=read_body(table, pose, kinds=("mouse", "ball")),
        path=path,
        speed=table.number("speed_mm_s", 1, 1000, 150.0),
        rounds=table.whole("rounds", 1, 1_000_000, 1),
    )


def _put_down(table: Table, at: float) -> Event:
    name = table.text("name")
    place = table.numbers("at_mm", 2, 0, _FLOOR, None)
    angle = math.radians(table.number("angle_deg", -360, 360, 0.0))
    shape = read_body(table, (0.0, 0.0, 0.0), name=name) if table.has("shape") else None
    return PutDown(at, name, shape, place, angle)


def _take_away(table: Table, at: float) -> Event:
    return TakeAway(at, table.text("name"))


def _broken(table: Table, at: float) -> Event:
    return Broken(
        at, table.whole("sensor", 0, 7), table.word("of", BROKEN, "both"), table.whole("reads", 0, 1023, 0)
    )


def _mended(table: Table, at: float) -> Event:
    return Broken(at, table.whole("sensor", 0, 7), table.word("of", BROKEN, "both"), None)


def _battery(table: Table, at: float) -> Event:
    return BatterySet(at, table.number("charge", 0, 1))


def _lamp(table: Table, at: float) -> Event:
    return LampSet(at, table.text("name"), table.number("intensity", 0, 100))


_READERS = {
    "order": _order,
    "fire": _fire,
    "mover": _mover,
    "object": _put_down,
    "take-away": _take_away,
    "broken-sensor": _broken,
    "mended-sensor": _mended,
    "lamp": _lamp,
    "battery": _battery,
    "link-fault": _link_fault,
    "reset": _reset,
}
