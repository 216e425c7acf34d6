"""What a watchman's night came to, counted tick by tick: nothing of it is kept but counts."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from khepera_hil.experiments.nights import CALL
from khepera_hil.perception.movement import CALIBRATE, SETTLE
from khepera_hil.recording import Tick

__all__ = ["LOOKING", "Agreement", "Tally"]

LOOKING = SETTLE + CALIBRATE
"""Ticks of a stop after which the watchman looks: it has settled, and knows what a still picture is."""

_SEEN = 3  # ticks in view and moving, while it looks, of a mover that should be noticed
_PATIENCE = 180.0  # s that a watchman may take to be in its base when it was called in
_PERIOD = 0.1


class Agreement:
    """Whether draws agree with the distributions that they were drawn from: Pearson's chi-square of the sums.

    With the covariance of the sums, since each tick has its own distribution.
    """

    def __init__(self) -> None:
        self.drawn: np.ndarray[Any, Any] | None = None

    def add(self, p: np.ndarray[Any, Any], place: int) -> None:
        """One draw, of value number ``place``."""
        if self.drawn is None:
            self.drawn = np.zeros(len(p))
            self.expected = np.zeros(len(p))
            self.square = np.zeros((len(p), len(p)))
        self.drawn[place] += 1
        self.expected += p
        self.square += np.outer(p, p)

    def chi2(self) -> tuple[float, int]:
        """The statistic and its degrees of freedom."""
        if self.drawn is None:
            return 0.0, 0
        covariance = np.diag(self.expected) - self.square
        known = np.diag(covariance) >= 5  # of a value that is hardly ever in doubt nothing can be said
        if known.sum() < 1:
            return 0.0, 0
        some = covariance[np.ix_(known, known)]
        off = (self.drawn - self.expected)[known]
        rank = int(np.linalg.matrix_rank(some))
        return float(off @ np.linalg.pinv(some, hermitian=True) @ off), rank


@dataclass
class Tally:
    """Hears of each tick. ``calls`` are the moments at which the watchman was called in."""

    witness: Any
    controller: Any
    calls: tuple[float, ...]
    base: tuple[float, float]
    """The base is a square from the origin to this corner, m."""
    ticks: int = 0
    blind: int = 0
    behaviors: Counter[str] = field(default_factory=Counter)
    moves: Counter[str] = field(default_factory=Counter)
    energy: Counter[str] = field(default_factory=Counter)
    changes: Counter[str] = field(default_factory=Counter)
    """Of Behavior, by the level of Energy."""
    events: Counter[str] = field(default_factory=Counter)
    least_charge: float = 1.0
    burned: list[float] = field(default_factory=list)
    """Seconds that the fires burned that were put out."""
    let_burn: int = 0
    """Fires that burned down."""
    looked: int = 0
    """Stops in which it looked."""
    with_mover: int = 0
    noticed: int = 0
    answered: list[bool] = field(default_factory=list)
    """Whether it was in its base in time, for each call."""
    agreements: dict[str, Agreement] = field(default_factory=dict)
    _behavior: str | None = None
    _lit: dict[str, float] = field(default_factory=dict)
    _stop: int = 0
    _in_view: Counter[str] = field(default_factory=Counter)
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
            return
        behavior, energy = str(tick.draws["Behavior"]), str(tick.evidence["Energy"])
        self.behaviors[behavior] += 1
        self.moves[str(tick.draws["Move"])] += 1
        self.energy[energy] += 1
        self.changes[energy] += self._behavior not in (None, behavior)
        self._behavior = behavior
        if self.controller.energy.charge is not None:
            self.least_charge = min(self.least_charge, self.controller.energy.charge)
        self._look(tick)
        self._agree(tick)

    def figures(self) -> dict[str, Any]:
        """Everything, as JSON has it."""
        return {
            "ticks": self.ticks,
            "blind": self.blind,
            "behaviors": dict(self.behaviors),
            "moves": dict(self.moves),
            "energy": dict(self.energy),
            "changes": dict(self.changes),
            "events": dict(self.events.most_common(40)),
            "least_charge": self.least_charge,
            "burned": self.burned,
            "let_burn": self.let_burn,
            "still_burning": len(self._lit),
            "looked": self.looked,
            "with_mover": self.with_mover,
            "noticed": self.noticed,
            "answered": self.answered,
            "chi2": {name: agreement.chi2() for name, agreement in self.agreements.items()},
        }

    def _fires(self, tick: Tick) -> None:
        for name, pose in tick.moved.items():
            if not name.startswith("fire"):
                continue
            if pose[0] >= 0:  # what is not there lies beside the floor
                self._lit[name] = tick.t
            elif name in self._lit:
                lasted = tick.t - self._lit.pop(name)
                if lasted < 899:
                    self.burned.append(round(lasted, 1))
                else:
                    self.let_burn += 1

    def _called(self, tick: Tick) -> None:
        if self._next_call < len(self.calls) and tick.t >= self.calls[self._next_call]:
            self._call = self.calls[self._next_call]
            self._next_call += 1
        if self._call is None or tick.pose is None:
            return
        if 0 <= tick.pose[0] <= self.base[0] and 0 <= tick.pose[1] <= self.base[1]:
            self.answered.append(True)
            self._call = None
        elif tick.t - self._call >= min(_PATIENCE, CALL):
            self.answered.append(False)
            self._call = None

    def _look(self, tick: Tick) -> None:
        if tick.draws["Behavior"] == "patrol" and tick.draws["Move"] == "stop":
            self._stop += 1
            if self._stop > LOOKING:
                # One that is stuck before something stands as still as all the rest.
                self._in_view.update(name for name in self.witness.in_view() if name in tick.moved)
            self._alarmed |= any(level == "alarm" for level, _ in tick.events)
            return
        if self._stop > LOOKING:
            self.looked += 1
            if any(often >= _SEEN for often in self._in_view.values()):
                self.with_mover += 1
                self.noticed += self._alarmed
        self._stop, self._alarmed = 0, False
        self._in_view.clear()

    def _agree(self, tick: Tick) -> None:
        for key in tick.u:
            answer = tick.answers[key]
            for axis, (name, values) in enumerate(zip(answer.variables, answer.values, strict=True)):
                others = tuple(i for i in range(answer.p.ndim) if i != axis)
                agreement = self.agreements.setdefault(name, Agreement())
                agreement.add(answer.p.sum(axis=others), values.index(tick.draws[name]))
