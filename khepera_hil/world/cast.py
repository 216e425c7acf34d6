"""Who and what a scenario brings in: its events checked against the arena, and acted out at their moments."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from khepera_hil.errors import WorldError
from khepera_hil.world.furnish import Layout
from khepera_hil.world.lights import Fires, Flame, Flicker, Lamp, Light
from khepera_hil.world.movers import Walk
from khepera_hil.world.physics import Physics
from khepera_hil.world.robot import Robot
from khepera_hil.world.scenario import (
    Agenda,
    BatterySet,
    Broken,
    Event,
    Fire,
    LampSet,
    Mover,
    PutDown,
    TakeAway,
)
from khepera_hil.world.shapes import BODY_RADIUS, Pose, Shape, disc, overlap

__all__ = ["CANDLE", "PHYSICAL", "Cast", "Director"]

PHYSICAL = (BatterySet, Broken, Fire, LampSet, Mover, PutDown, TakeAway)
"""Events that act in the world; the others are handed out."""

CANDLE = 10.0
"""mm: the radius of what a real fire burns on (proposed: a household candle)."""

_WICK = 3.0  # mm from its top to the flame
_FIRM = 1e6  # g: it stands where it was put, whatever runs against it
_SHELF = 60.0  # mm from the arena's west wall to where the things lie that are not on the floor


class Cast:
    """Everything that can ever be on the floor: the arena's things first, then what the scenario brings.

    Raises :class:`~khepera_hil.errors.WorldError`, which names the scenario's file and key, for an event that makes
    no sense in this arena.
    """

    def __init__(self, layout: Layout, events: Sequence[Event]) -> None:
        self._layout = layout
        self._robots = len(layout.starts)
        self._lamps = {lamp.name for lamp in layout.lamps}
        robots = {"robot", *(f"robot {number + 1}" for number in range(self._robots))}
        self._taken = self._lamps | {shape.name for shape in layout.shapes} | robots | {"base"}
        self._objects = {shape.name: shape for shape in layout.shapes if shape.movable}
        brought: dict[str, Shape] = {}
        self.flames: dict[str, Fire] = {}
        self.events = tuple(self._checked(event, brought) for event in events)
        """The scenario's, with every place filled in."""
        self.shapes: tuple[Shape, ...] = (*layout.shapes, *brought.values())
        self.movables = [place for place, shape in enumerate(self.shapes) if shape.movable]
        self.numbers = {self.shapes[place].name: number for number, place in enumerate(self.movables)}
        """Of the movable things, by name."""
        self.absent = {
            place
            for place, shape in enumerate(self.shapes)
            if place >= len(layout.shapes) or shape.name in layout.shelved
        }
        self.shelf = self._shelved()

    def _checked(self, event: Event, brought: dict[str, Shape]) -> Event:
        if event.robot > self._robots:
            there = "the only one here is 1" if self._robots == 1 else f"there are {self._robots} here"
            raise _wrong(event, "robot", f"must be the number of a robot, and {there}")
        if isinstance(event, Fire):
            self._on_floor(event, "at_mm", [event.place])
            if event.name in self._taken or (event.name in brought and event.name not in self.flames):
                raise _wrong(event, "name", f"must be new; there is a {event.name!r} already")
            if event.real:
                self._on_free_floor(event, "at_mm", _candle(event))
                self._bring(event, _candle(event), brought)
            self.flames[event.name] = event
        elif isinstance(event, Mover):
            self._on_floor(event, "path_mm", event.path, event.shape.radius)
            self._on_free_floor(event, "path_mm", event.shape)
            self._bring(event, event.shape, brought)
        elif isinstance(event, PutDown):
            if event.place is None:
                if self._layout.arena.stage is None:
                    raise _wrong(event, "at_mm", "is missing, and the arena has no stage")
                event = replace(event, place=self._layout.arena.stage)
            if event.shape is not None:
                self._bring(event, event.shape, brought)
                self._objects[event.name] = event.shape
            shape = self._object(event).at(_pose(event))
            self._on_floor(event, "at_mm", shape.points().tolist(), shape.radius)
            self._on_free_floor(event, "at_mm", shape)
        elif isinstance(event, TakeAway):
            self._object(event)
        elif isinstance(event, LampSet) and event.name not in self._lamps:
            raise _wrong(event, "name", f"must be a lamp of the arena ({_listed(self._lamps)}), not {event.name!r}")
        return event

    def _bring(self, event: Event, shape: Shape, brought: dict[str, Shape]) -> None:
        known = brought.get(shape.name, shape)
        flame = shape.name in self.flames and shape.kind != "flame"
        if shape.name in self._taken or flame or known.at(shape.pose) != shape:
            raise _wrong(event, "name", f"must be new; there is another {shape.name!r} already")
        brought[shape.name] = shape

    def _object(self, event: PutDown | TakeAway) -> Shape:
        if event.name not in self._objects:
            there = _listed(self._objects)
            raise _wrong(event, "name", f"must be a thing that can be moved ({there}), not {event.name!r}")
        return self._objects[event.name]

    def _on_floor(self, event: Event, key: str, places: Sequence[Sequence[float]], radius: float = 0.0) -> None:
        width, depth = self._layout.arena.size
        for x, y in places:
            if not (radius <= x <= width - radius and radius <= y <= depth - radius):
                raise _wrong(event, key, f"must be on the floor of {width:g} x {depth:g} mm, and all of it")

    def _on_free_floor(self, event: Event, key: str, shape: Shape) -> None:
        """What stands there for ever would keep it waiting for ever."""
        for other in self._layout.shapes:
            if not other.movable and overlap(shape, other):
                raise _wrong(event, key, f"must be free for {shape.name!r}, but {other.name!r} stands there")

    def _shelved(self) -> dict[str, Pose]:
        """Where things lie that are not on the floor, by name: in a row beyond the west wall, flames too."""
        shelf: dict[str, Pose] = {}
        along = 0.0
        wide = {self.shapes[place].name: self.shapes[place].reach for place in self.movables}
        wide |= dict.fromkeys(self.flames, CANDLE)
        for name, reach in wide.items():
            shelf[name] = (-_SHELF - reach, along + reach, 0.0)
            along += 2 * reach + 10
        return shelf


class Director:
    """Acts the physical events out, each at the first step that is not before its moment."""

    def __init__(
        self,
        cast: Cast,
        lamps: Sequence[Lamp],
        chance: np.random.SeedSequence,
        step: float,
        *,
        physics: Physics,
        robots: Sequence[Robot],
    ) -> None:
        self.lights = tuple(Light(lamp) for lamp in lamps)
        """All that shines now; another tuple when something has changed."""
        self._fires = Fires()
        self._cast, self._agenda, self._step = cast, Agenda(cast.events), step
        self._physics, self._robots = physics, robots
        self._flickers = chance
        self._lamps = {lamp.name: lamp for lamp in lamps}
        self._waiting: list[PutDown | Mover | Fire] = []
        self._walks: dict[int, Walk] = {}
        self.walking: dict[str, int] = {}
        """Movers on the floor: their numbers by name."""
        self.acts = True
        """Whether there is something to do at every step; otherwise from :attr:`next` on."""
        self.next: float = 0.0
        self._look_ahead()

    def step(self, now: float, step: int, poses: Sequence[Pose]) -> None:
        """All that happens at the end of step ``step``, at ``now`` s, where the robots are at ``poses``."""
        for event in self._agenda.due(now + 1e-9, *PHYSICAL):
            self._happen(event, now, step)
        if self._waiting:
            self._waiting = [event for event in self._waiting if not self._enters(event, now, step)]
        for name, number in list(self.walking.items()):
            self._walk(name, number)
        if self._fires.burning:
            self._burn(now, poses)
        self._look_ahead()

    def flames(self) -> dict[str, Pose]:
        """Where every flame of the scenario is, by name, mm: it burns, or lies on the shelf."""
        burning = {flame.light.lamp.name: flame.light.lamp for flame in self._fires.burning}
        return {
            name: (burning[name].x, burning[name].y, 0.0) if name in burning else self._cast.shelf[name]
            for name in self._cast.flames
        }

    def _look_ahead(self) -> None:
        self.acts = bool(self._waiting or self.walking or self._fires.burning)
        due = self._agenda.next(*PHYSICAL)
        self.next = math.inf if due is None else due

    def _happen(self, event: Event, now: float, step: int) -> None:
        if isinstance(event, BatterySet):
            self._robots[event.robot - 1].battery.charge = event.charge
        elif isinstance(event, Broken):
            self._robots[event.robot - 1].scanner.break_sensor(event.sensor, event.of, event.reads)
        elif isinstance(event, LampSet):
            lamp = self._lamps[event.name] = replace(self._lamps[event.name], intensity=event.intensity)
            self._shine({event.name}, Light(lamp))
        elif isinstance(event, Fire):
            self._wait_no_more(event.name)
            self._extinguish({event.name})
            if event.real:
                self._waiting.append(event)
            else:
                self._light(event, now, step)
        elif isinstance(event, TakeAway):
            self._wait_no_more(event.name)
            self._remove(event.name)
        elif isinstance(event, (PutDown, Mover)):
            self._wait_no_more(_name(event))
            self._remove(_name(event))
            self._waiting.append(event)

    def _wait_no_more(self, name: str) -> None:
        self._waiting = [waits for waits in self._waiting if _name(waits) != name]

    def _light(self, event: Fire, now: float, step: int) -> None:
        lamp = Lamp(event.name, *event.place, event.height, event.intensity)
        chance = np.random.default_rng(self._flickers.spawn(1)[0])
        light = Light(lamp, Flicker(chance, self._step, step))
        self._fires.burning.append(Flame(light, event.real, now, event.at + event.lasts))
        self._shine({event.name}, light)
        if event.real:
            for robot in self._robots:
                robot.score.lit(event.name, now)

    def _burn(self, now: float, poses: Sequence[Pose]) -> None:
        gone = {flame.light.lamp.name for flame in self._fires.burning if flame.ends <= now + 1e-9}
        self._extinguish(gone)
        for robot, pose in zip(self._robots, poses, strict=True):
            if robot.turbine:
                for flame in self._fires.blow(self._step, pose, BODY_RADIUS):
                    robot.score.put_out(flame.light.lamp.name, now)
                    self._extinguish({flame.light.lamp.name})

    def _extinguish(self, names: set[str]) -> None:
        self._fires.burning = [flame for flame in self._fires.burning if flame.light.lamp.name not in names]
        for name in names:
            if name in self._cast.numbers:
                self._remove(name)
            for robot in self._robots:
                robot.score.burned_down(name)
        self._shine(names)

    def _shine(self, names: set[str], *lights: Light) -> None:
        """Instead of what bears these names."""
        if names or lights:
            self.lights = (*(light for light in self.lights if light.lamp.name not in names), *lights)

    def _enters(self, event: PutDown | Mover | Fire, now: float, step: int) -> bool:
        """Put it on the floor if its place is free, or say that it need not come any more."""
        if isinstance(event, Fire) and event.at + event.lasts <= now + 1e-9:
            return True
        number = self._cast.numbers[_name(event)]
        pose = event.shape.pose if isinstance(event, Mover) else _pose(event)
        if not self._physics.is_free(number, pose):
            return False
        self._physics.put(number, pose)
        if isinstance(event, Mover):
            self._walks[number] = Walk(event.path, event.speed, event.rounds)
            self.walking[event.shape.name] = number
            for robot in self._robots:
                robot.score.entered()
        elif isinstance(event, Fire):
            self._light(event, now, step)
        else:
            for robot in self._robots:
                robot.score.put(event.name, pose[:2])
        return True

    def _walk(self, name: str, number: int) -> None:
        place = self._physics.place(number)
        velocity = None if place is None else self._walks[number].velocity(place[:2], self._step)
        if velocity is None:
            self._remove(name)
        else:
            self._physics.steer(number, velocity)

    def _remove(self, name: str) -> None:
        number = self._cast.numbers[name]
        place = self._physics.place(number)
        if place is not None:
            self._physics.take(number)
            for robot in self._robots:
                robot.score.taken(name, place[:2])
        self.walking.pop(name, None)


def _candle(event: Fire) -> Shape:
    """What a real fire burns on; it is lower than the flame, and there while it burns."""
    return disc(event.name, "flame", CANDLE, (*event.place, 0.0), event.height - _WICK, mass=_FIRM)


def _name(event: PutDown | Mover | Fire) -> str:
    return event.shape.name if isinstance(event, Mover) else event.name


def _wrong(event: Event, key: str, what: str) -> WorldError:
    return WorldError(f"{event.where}{key} {what}")


def _pose(event: PutDown | Fire) -> Pose:
    x, y = event.place or (math.inf, math.inf)
    return x, y, event.angle if isinstance(event, PutDown) else 0.0


def _listed(names: Iterable[str]) -> str:
    return ", ".join(sorted(names)) or "there is none"
