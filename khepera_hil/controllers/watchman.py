"""The night watchman (section 10): 41 variables, 12 descriptions, four levels, one question, ten times a second.

Each tick: the 33 sensory variables, from the readings, the operator's orders and the memory; the questions (see
`watchman_mind`); the draws; wheels, turbine and alarm; the memory. What is known here and in no description stands
in ``docs/watchman.md``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import cast

import numpy as np

from brp import Distribution, Question, Uniform, Value
from brp.programs.base import at_base
from brp.programs.beacon import locate_beacon
from brp.programs.behavior import Behavior, behaving, behavior, deciding, steadier
from brp.programs.watchman import pi_watchman
from khepera_hil.controllers.acquaintance import TOUR, Acquaintance
from khepera_hil.controllers.base import USUAL, VTRANS, Decision, Setting, wheels
from khepera_hil.controllers.watchman_body import AT_REST, Body
from khepera_hil.controllers.watchman_memory import Drawn
from khepera_hil.controllers.watchman_mind import FILLED, MOTORS, Mind, Thought, expecting, filled
from khepera_hil.controllers.watchman_whole import WholeMind
from khepera_hil.errors import OrderRefused
from khepera_hil.perception import LightAhead, Need, Obstacle, Odometry, Readings, Tour
from khepera_hil.perception.base import Surroundings
from khepera_hil.perception.energy import VOLTAGE, Energy
from khepera_hil.perception.fire import Fire
from khepera_hil.perception.movement import Movement

__all__ = ["Watchman", "controller"]

CAMERA: tuple[int | str, ...] = (2, "T")
"""Every fourth pixel: all 64 in each tick do not fit onto the wire beside the sensors."""

_ENERGY = ("I", VOLTAGE)
_FRAME = ("T", *CAMERA)
_EVERY = 10  # ticks from one reading of the battery's voltage to the next
_STILL = 1  # pulses that a wheel which stands still may creep in a tick
_SECOND = 10  # ticks
_TOUCHING = 1000  # counts of a proximity sensor: what is so near may shove the robot
_LONGEST = 900  # ticks of following after which there is no object to be gone round


class Watchman:
    """The controller. ``setting.early`` names what is drawn before the motors, ``setting.memory`` what is kept."""

    name = "watchman"
    decides = MOTORS
    at_rest = AT_REST
    """What is commanded when the run is over and the wheels stand still."""
    needs: Sequence[str | Need] = (
        Need("I", (VOLTAGE,), every=_EVERY),
        "H",
        Need(
            "T", CAMERA, without="no camera (K213) is fitted: nothing that moves will be seen, and no alarm given"
        ),
        "O",
        "N",
    )

    def __init__(self, setting: Setting = USUAL) -> None:
        self.vigil = self.identify = False
        """The operator's orders."""
        self.energy = Energy()
        self.fire = Fire()
        self.movement = Movement()
        self._surroundings, self._obstacle, self._ahead = Surroundings(), Obstacle(), LightAhead()
        self._odometry, self._tour = Odometry(), Tour()
        self._memory = Drawn()
        self._body = Body()
        self._objects = Acquaintance()
        self.learning = {"O": self._objects.again}
        if setting.taught is not None:
            temporal = deciding(setting.taught)
        else:
            temporal = behavior if setting.stay == USUAL.stay else steadier(setting.stay)
        self._expects = expecting(setting.taught or behaving)
        watching = pi_watchman(locate=locate_beacon, behavior=temporal).identify()
        self._labels = setting.labels
        self._said: dict[str, Value] = {}
        obeying = pi_watchman(locate=locate_beacon, behavior=Uniform()).identify() if setting.labels else None
        self._mind = WholeMind() if setting.memory == "whole" else Mind(watching, setting.early, obeying=obeying)
        self._last_tour = {variable.name: 0 for variable in TOUR}
        self._counters: tuple[int, int] | None = None
        self._beside: Sequence[int] = ()
        self._followed = 0
        self._unfilled, self._heaviest = _SECOND, 0.0

    @property
    def questions(self) -> Mapping[str, Question]:
        """What it asks each tick, and P(O | ...) after a tour."""
        return {**self._mind.questions, "O": self._objects.question}

    def order(self, words: str) -> str:
        """``vigil on``, ``vigil off``, ``vigil`` (the other way), and the same of ``identify``.

        With labels also ``behavior recharge``, which holds until it is another, or ``behavior free``.
        """
        name, _, how = words.partition(" ")
        if name == "behavior":
            return self._labelled(how)
        if name not in ("vigil", "identify") or how not in ("", "on", "off"):
            raise OrderRefused(f"the watchman takes vigil on|off and identify on|off, not {words!r}")
        now = self.vigil if name == "vigil" else self.identify
        # Recognition ends by itself, so that identify alone always means to begin.
        wanted = how == "on" or (how == "" and (name == "identify" or not now))
        if name == "vigil":
            self.vigil = wanted
        else:
            self.identify = wanted
            self._followed = 0
        return f"{name} is {'on' if wanted else 'off'}"

    def _labelled(self, behavior: str) -> str:
        """The operator says what Behavior is, from now on."""
        if not self._labels:
            raise OrderRefused("this watchman decides by itself what Behavior is: start it with --labels")
        if behavior == "free":
            self._said = {}
            return "Behavior is drawn"
        if behavior not in Behavior.values:
            raise OrderRefused(
                f"behavior is one of {', '.join(map(str, Behavior.values))}, or free, not {behavior!r}"
            )
        self._said = {Behavior.name: behavior}
        return f"Behavior is {behavior}, by your word"

    def step(self, readings: Readings, rng: np.random.Generator) -> Decision:
        """Sense, ask, draw, act, remember."""
        events: list[tuple[str, str]] = []
        evidence, clipped = self._sensed(readings, events)
        evidence |= self._said  # known then, as what is sensed
        thought = self._think(evidence, rng)
        self._fill(filled(evidence, thought.answers["Base"], self._expects), events)
        self._memory.keep(thought.behavior, thought.move)
        if evidence["Tour"] == "done":
            thought.answers["O"] = self._recognised(events)
        self._give_up_identifying(events)
        alarm = self._alarmed(readings, events)
        vrot, vtrans = cast(int, thought.draws["Vrot"]), cast(int, thought.draws["Vtrans"])
        left, right = wheels(vrot, vtrans)
        commands = self._body.step(blow=self._memory.move == "blow", alarm=alarm, sees=_FRAME in readings.answers)
        return Decision(evidence, thought.answers, thought.u, thought.draws, left, right, clipped, events, commands)

    def _think(self, evidence: dict[str, Value], rng: np.random.Generator) -> Thought:
        if isinstance(self._mind, WholeMind):
            return self._mind.think(evidence, rng, arrived=self.fire.arrived)
        return self._mind.think(evidence, rng, self._said)

    def _fill(self, weight: float, events: list[tuple[str, str]]) -> None:
        """An event when impossible rows weigh; at most one a second, with the most that they weighed."""
        self._unfilled += 1
        self._heaviest = max(self._heaviest, weight)
        if self._heaviest > FILLED and self._unfilled >= _SECOND:
            events.append(("info", f"pi-behavior asked without Behavior_t-1, for {self._heaviest:.0%} of P(Base)"))
            self._unfilled, self._heaviest = 0, 0.0

    def _sensed(self, readings: Readings, events: list[tuple[str, str]]) -> tuple[dict[str, Value], dict[str, int]]:
        """The 33 sensory variables."""
        around, near, ahead = (sense.step(readings) for sense in (self._surroundings, self._obstacle, self._ahead))
        evidence: dict[str, Value] = dict(around.values)
        way, heading = self._odometry.way, self._odometry.heading
        self._odometry.step(readings)
        base = at_base(**{name: evidence[name] for name in _SIXTEEN})[True]
        fire = self.fire.step(
            readings.light,
            aim=ahead.values["DirL"],
            near=ahead.values["ProxL"],
            direction=near.values["Dir"],
            prox=near.values["Prox"],
            base=base,
            way=self._odometry.way - way,
            turn=self._odometry.heading - heading,
            move=self._memory.move,
        )
        events += [("info", text) for text in self.fire.events]
        tour = self._toured(readings, near.values["Prox"])
        evidence |= {
            "Vigil": self.vigil,
            "Energy": self._charged(readings, events),
            "Fire": fire,
            "Identify": self.identify,
            **self._memory.evidence(arrived=self.fire.arrived),
            "Tour": tour,
            "Dir": near.values["Dir"],
            "Prox": near.values["Prox"],
            "DirL": self.fire.aim(ahead.values["DirL"]),
            "ProxL": self.fire.near(ahead.values["ProxL"]),
            "Vtrans_c": VTRANS,
            **self._last_tour,
        }
        return evidence, {**around.clipped, **near.clipped}

    def _charged(self, readings: Readings, events: list[tuple[str, str]]) -> str:
        """Energy."""
        volts = readings.answers.get(_ENERGY)
        measured = self.energy.measured
        energy = self.energy.step(None if volts is None else int(volts[0]))
        if measured and not self.energy.measured:
            events.append(
                (
                    "warning",
                    f"A/D input {VOLTAGE} measures no battery that could drive a robot: Energy stays {energy}",
                )
            )
        return energy

    def _toured(self, readings: Readings, prox: int) -> str:
        """Tour; it is done in one tick, and only while the robot follows a contour."""
        if self._memory.move != "follow":
            self._tour = Tour()
            return "undone"
        percept = self._tour.step(readings, near=prox > 0)
        if not percept.values:
            return "undone"
        self._last_tour = dict(percept.values)
        return "done"

    def _recognised(self, events: list[tuple[str, str]]) -> Distribution:
        """Say what was gone round, learn it, and end the order."""
        answer, event = self._objects.meet(self._last_tour)
        events.append(event)
        self.identify = False
        return answer

    def _give_up_identifying(self, events: list[tuple[str, str]]) -> None:
        if not self.identify:
            return
        self._followed += self._memory.move == "follow"
        if self._followed >= _LONGEST:
            self.identify = False
            self._followed = 0
            events.append(("info", f"no object was gone round in {_LONGEST / 10:g} s; identify is off"))

    def _alarmed(self, readings: Readings, events: list[tuple[str, str]]) -> bool:
        """Whether something moves: looked for while patrol stops."""
        left, right = (int(value) for value in readings.answers[("H",)])
        before, self._counters = self._counters, (left, right)
        standing = before is not None and max(abs(left - before[0]), abs(right - before[1])) <= _STILL
        frame = readings.answers.get(_FRAME)
        looking = self._memory.behavior == "patrol" and self._memory.move == "stop"
        pixels = None if frame is None else [int(value) for value in frame[1:]]
        if not (standing and looking):
            self._beside = readings.proximity  # what stands there does not shove
        touched = any(
            now >= _TOUCHING > before for now, before in zip(readings.proximity, self._beside, strict=False)
        )
        if not self.movement.step(pixels, standing=standing and looking, touched=touched):
            return False
        events.append(("alarm", "something moves"))
        return True


_SIXTEEN = tuple(v.name for v in at_base.known)


def controller(setting: Setting = USUAL) -> Watchman:
    """E10.3 on the robot, decided late."""
    return Watchman(setting)
