"""The other memory: the whole distribution over Behavior, Move and how long it has lasted, carried from tick to
tick.

    P(Behavior Move age | Sensory-variables of all ticks)

is a Bayesian filter. The belief takes the place of P(Behavior_t-1) inside pi-behavior [S9.3], for each value of
Base, and each Move_t-1 with its Tempo goes into pi-move as a question that is normalised for every value right of
its bar. It is carried as a conjunction: from its marginals apart, Tempo would forget which Move it is about, and
Move which Behavior it serves.

The motors are drawn from the mixture of the six movements by P(Move). Nothing else is drawn; turbine and alarm
follow the most probable Move.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product

import numpy as np
from numpy.typing import NDArray

from brp import Distribution, P, Question, Specification, Term, Uniform, Value
from brp.programs.base import Base, at_base
from brp.programs.beacon import L, locate_beacon
from brp.programs.behavior import Behavior, Behavior_t_1, Energy, Fire, Identify, Vigil, behaving
from brp.programs.fusion import Theta2
from brp.programs.home import H, command2
from brp.programs.move import QUOTA, Move, Tempo, Tour, move
from brp.programs.speed import Dir, DirL, Prox, ProxL, Vrot, Vtrans, Vtrans_c, speed
from khepera_hil.controllers.watchman_mind import MOTORS, Thought

__all__ = ["WholeMind"]

Array = NDArray[np.float64]

_OBSERVED = (Vigil, Energy, Fire, Identify)

# P(Behavior Base Vigil Energy Fire Identify | Behavior_t-1): axes Behavior_t-1, Behavior, Base, then the others.
_joint = behaving.ask(P(Behavior, Base, Vigil, Energy, Fire, Identify | Behavior_t_1))
_JOINT = np.stack([_joint(Behavior_t_1=before).p for before in Behavior_t_1.values])

# P(Move | Behavior Move_t-1 Tempo Tour): axes Behavior, Move_t-1, Tempo, Tour, Move.
_MOVES = np.array(
    [
        move(Behavior=b, Move_t_1=m, Tempo=tempo, Tour=tour).p
        for b, m, tempo, tour in product(Behavior.values, Move.values, Tempo.values, Tour.values)
    ]
).reshape(len(Behavior), len(Move), len(Tempo), len(Tour), len(Move))

_RUNNING, _ELAPSED = Tempo.place("running"), Tempo.place("elapsed")
_APPROACH = Move.place("approach")

_motors = (
    Specification(
        {
            P(L, Dir, Prox, DirL, ProxL, Vtrans_c): Uniform(),
            P(Move): Uniform(),
            P(Theta2 | L): locate_beacon,
            P(H | Prox): command2,
            P(Vrot, Vtrans | Move, H, Dir, Prox, DirL, ProxL, Vtrans_c, Theta2): speed,
        },
        name="pi-watchman",
    )
    .identify()
    .ask(Term((Vrot, Vtrans), (*L, Dir, Prox, DirL, ProxL, Vtrans_c, Move)), soft=Move)
)
"""E10.4 with P(Move) told: a mixture, since Move is uniform and nothing else there depends on it."""


class WholeMind:
    """Asks and draws as `Mind` does, and remembers the belief. Its first is of a robot going home."""

    def __init__(self) -> None:
        self.questions: dict[str, Question] = {
            "Base": at_base,
            "Theta2": locate_beacon,
            "H": command2,
            "Behavior": _joint_behavior,
            "Move": move,
            MOTORS: _motors,
        }
        # For each Move a row for each Behavior over its age in ticks, from 1; the last is its quota and all beyond.
        self._belief = [np.zeros((len(Behavior), QUOTA.get(str(m), 1) + 1)) for m in Move.values]
        self._belief[Move.place("stop")][Behavior.place("homing"), 1] = 1

    def think(self, evidence: Mapping[str, Value], rng: np.random.Generator, *, arrived: bool) -> Thought:
        """The next belief, by what is sensed now, and the motors drawn from it."""
        thought = Thought()
        for key in ("Base", "Theta2", "H"):
            thought.answers[key] = self.questions[key](
                **{v.keyword: evidence[v.name] for v in self.questions[key].known}
            )
        kernel = self._behaviors(evidence, thought.answers["Base"].p)
        self._step(kernel, Tour.place(evidence["Tour"]), arrived=arrived)
        both = np.stack([belief.sum(axis=1) for belief in self._belief], axis=1)
        thought.answers["Behavior"] = Distribution((Behavior,), both.sum(axis=1))
        thought.answers["Move"] = Distribution((Move,), both.sum(axis=0))
        told = {v.keyword: evidence[v.name] for v in _motors.known if v is not Move}
        thought.draw(MOTORS, _motors(**told, Move=thought.answers["Move"]), rng)
        thought.behavior = str(thought.answers["Behavior"].best())
        thought.move = str(thought.answers["Move"].best())
        return thought

    @property
    def joint(self) -> Array:
        """P(Behavior Move), shape (6, 6)."""
        return np.stack([belief.sum(axis=1) for belief in self._belief], axis=1)

    def _behaviors(self, evidence: Mapping[str, Value], base: Array) -> Array:
        """P(Behavior_t-1 Behavior | ...) / P(Behavior_t-1), summed over Base; axes Behavior_t-1, Behavior."""
        vigil, energy, fire, identify = (v.place(evidence[v.name]) for v in _OBSERVED)
        before = sum((belief.sum(axis=1) for belief in self._belief), np.zeros(len(Behavior)))
        kernel = np.zeros((len(Behavior), len(Behavior)))
        for place, p in enumerate(base):
            row: Array = _JOINT[:, :, place, vigil, energy, fire, identify]
            mass = float(before @ row.sum(axis=1))
            if mass > 0:
                kernel += p * row / mass
            else:  # impossible after all that is believed: asked without Behavior_t-1
                kernel += p * row.sum(axis=0) / row.sum()
        return kernel

    def _step(self, kernel: Array, tour: int, *, arrived: bool) -> None:
        new = [np.zeros_like(belief) for belief in self._belief]
        for m, belief in enumerate(self._belief):
            now = kernel.T @ belief  # Behavior, age of Move_t-1
            elapsed = 0 if m == _APPROACH and arrived else -1 if Move.values[m] in QUOTA else belief.shape[1]
            running = _MOVES[:, m, _RUNNING, tour, :]
            over = _MOVES[:, m, _ELAPSED, tour, :]
            # Another Move begins with an age of 1; the same one is a tick older.
            other = now[:, :elapsed].sum(axis=1)[:, None] * running + now[:, elapsed:].sum(axis=1)[:, None] * over
            same = np.concatenate([now[:, :elapsed] * running[:, m, None], now[:, elapsed:] * over[:, m, None]], 1)
            for k in range(len(Move)):
                if k != m:
                    new[k][:, 1] += other[:, k]
            new[m][:, 1:] += same[:, :-1]
            new[m][:, -1] += same[:, -1]
        total = sum(belief.sum() for belief in new)
        self._belief = [belief / total for belief in new]


_joint_behavior = behaving.ask(P(Behavior | Vigil, Energy, Base, Fire, Identify))
