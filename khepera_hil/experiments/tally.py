"""What a watchman's night came to, counted tick by tick: nothing of it is kept but counts."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from math import atan2, cos, degrees, pi, sin
from typing import Any

from khepera_hil.experiments.agreement import Agreements
from khepera_hil.experiments.nights import CALL, FIRE_LASTS, Night
from khepera_hil.recording import Pose, Tick

__all__ = ["LOOKING", "Tally", "resolved"]

LOOKING = 7
"""Ticks of a stop after which the watchman looks: the wheels stand still from the fifth on, and it has settled."""

_SEEN = 3  # ticks in view and moving, while it looks, of a mover that should be noticed
_HALF_FIELD = 18.0  # degrees to each side
_CELL = 2.25  # degrees from one cell that is read to the next
_AHEAD = 0.013  # m that the camera is before the robot's middle
_PATIENCE = 180.0  # s that a watchman may take to be in its base when it was called in


def resolved(bearings: list[float]) -> bool:
    """Whether a mover that was in view at these bearings (degrees, 0 ahead), a tick each, can be told to move.

    Its middle is in the field for three ticks, and goes from one cell that is read to the next or farther. What
    comes straight on, or shows an edge at the picture's rim, does not move in the picture.
    """
    inside = [bearing for bearing in bearings if abs(bearing) <= _HALF_FIELD]
    return len(inside) >= _SEEN and max(inside) - min(inside) >= _CELL


@dataclass
class Tally:
    """Hears of each tick of a night."""

    witness: Any
    controller: Any
    plan: Night
    base: tuple[float, float]
    """The base is a square from the origin to this corner, m."""
    ticks: int = 0
    blind: int = 0
    behaviors: Counter[str] = field(default_factory=Counter)
    moves: Counter[str] = field(default_factory=Counter)
    energy: Counter[str] = field(default_factory=Counter)
    out: Counter[str] = field(default_factory=Counter)
    """Ticks out of the base with Vigil, no Fire and no order to identify, by the level of Energy."""
    changes: Counter[str] = field(default_factory=Counter)
    """Of Behavior, in those ticks."""
    events: Counter[str] = field(default_factory=Counter)
    least_charge: float = 1.0
    burned: list[float] = field(default_factory=list)
    """Seconds that the fires burned that were put out, of those that count."""
    let_burn: int = 0
    """Fires that count and were not put out."""
    looked: int = 0
    """Stops in which it looked."""
    glimpsed: list[bool] = field(default_factory=list)
    """Whether there was an alarm, of each stop with a mover in view, be it at the rim of the picture."""
    seen: list[bool] = field(default_factory=list)
    """The same, of those in which the camera can tell that it moves."""
    answered: list[bool] = field(default_factory=list)
    """Whether it was in its base in time, of each call that found it outside."""
    agreements: Agreements = field(default_factory=Agreements)
    _behavior: str | None = None
    _lit: dict[str, float] = field(default_factory=dict)
    _stop: int = 0
    _bearings: dict[str, list[float]] = field(default_factory=dict)
    _alarmed: bool = False
    _call: float | None = None
    _next_call: int = 0

    def hear(self, tick: Tick) -> None:
        """One more tick."""
        self.ticks += 1
        self._fires(tick)
        self._called(tick)
        for level, text in tick.events:
            self.events[text if level in ("info", "alarm") and len(text) < 50 else level] += 1
        if not tick.draws:
            self.blind += 1
            self._behavior = None
            return
        behavior, energy = str(tick.draws["Behavior"]), str(tick.evidence["Energy"])
        self.behaviors[behavior] += 1
        self.moves[str(tick.draws["Move"])] += 1
        self.energy[energy] += 1
        self._turns(tick, behavior, energy)
        if self.controller.energy.charge is not None:
            self.least_charge = min(self.least_charge, self.controller.energy.charge)
        self._look(tick)
        self.agreements.hear(tick)

    @property
    def settled(self) -> bool:
        """Whether a fire or a call that counts has had its end."""
        return bool(self.burned or self.let_burn or self.answered)

    def figures(self) -> dict[str, Any]:
        """Everything, as JSON has it."""
        burning = sum(self._counts(lit) for lit in self._lit.values())
        return {
            "ticks": self.ticks,
            "blind": self.blind,
            "behaviors": dict(self.behaviors),
            "moves": dict(self.moves),
            "energy": dict(self.energy),
            "out": dict(self.out),
            "changes": dict(self.changes),
            "events": dict(self.events.most_common(40)),
            "least_charge": self.least_charge,
            "burned": self.burned,
            "let_burn": self.let_burn + burning,
            "looked": self.looked,
            "glimpsed": self.glimpsed,
            "seen": self.seen,
            "answered": self.answered,
            "chi2": self.agreements.figures(),
        }

    def _turns(self, tick: Tick, behavior: str, energy: str) -> None:
        """Changes of mind without a reason: the evidence of `weathercock.changes`."""
        told = tick.evidence
        if told["Vigil"] and not told["Fire"] and not told["Identify"] and not self._inside(tick.pose):
            self.out[energy] += 1
            self.changes[energy] += self._behavior not in (None, behavior)
            self._behavior = behavior
        else:
            self._behavior = None

    def _counts(self, lit: float) -> bool:
        return self.plan.seconds - lit >= self.plan.given

    def _fires(self, tick: Tick) -> None:
        for name, pose in tick.moved.items():
            if not name.startswith("fire"):
                continue
            if pose[0] >= 0:  # what is not there lies beside the floor
                self._lit[name] = tick.t
            elif name in self._lit:
                lit = self._lit.pop(name)
                lasted = tick.t - lit
                if self._counts(lit):
                    if lasted < FIRE_LASTS - 1:
                        self.burned.append(round(lasted, 1))
                    else:
                        self.let_burn += 1

    def _inside(self, pose: Pose | None) -> bool:
        return pose is not None and 0 <= pose[0] <= self.base[0] and 0 <= pose[1] <= self.base[1]

    def _called(self, tick: Tick) -> None:
        inside = self._inside(tick.pose)
        if self._next_call < len(self.plan.calls) and tick.t >= self.plan.calls[self._next_call]:
            self._call = None if inside else self.plan.calls[self._next_call]
            self._next_call += 1
        if self._call is None:
            return
        if inside or tick.t - self._call >= min(_PATIENCE, CALL):
            self.answered.append(inside)
            self._call = None

    def _look(self, tick: Tick) -> None:
        if tick.draws["Behavior"] == "patrol" and tick.draws["Move"] == "stop":
            self._stop += 1
            if self._stop > LOOKING and tick.pose is not None:
                for name in self.witness.in_view():
                    if name in tick.moved:  # one that is stuck before something stands as still as all the rest
                        self._bearings.setdefault(name, []).append(_bearing(tick.pose, tick.moved[name]))
            self._alarmed |= any(level == "alarm" for level, _ in tick.events)
            return
        if self._stop > LOOKING:
            self.looked += 1
            if any(len(bearings) >= _SEEN for bearings in self._bearings.values()):
                self.glimpsed.append(self._alarmed)
            if any(map(resolved, self._bearings.values())):
                self.seen.append(self._alarmed)
        self._stop, self._alarmed = 0, False
        self._bearings.clear()


def _bearing(robot: Pose, mover: Pose) -> float:
    """Of its middle, from the camera, degrees, 0 ahead."""
    x, y, heading = robot
    way = atan2(mover[1] - y - _AHEAD * sin(heading), mover[0] - x - _AHEAD * cos(heading))
    return degrees((way - heading + pi) % (2 * pi) - pi)
