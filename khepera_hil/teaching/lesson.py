"""A lesson: the robot is driven by hand, and every tick is a datum (section 5.3)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np

from brp import Question, Specification, Variable
from brp.programs.base import Px
from brp.programs.fusion import L
from brp.programs.home import homing
from brp.programs.obstacle import Dir, Prox, Vrot, obstacle
from brp.programs.phototaxy import Theta1, pi_phototaxy1
from khepera_hil.controllers import Decision
from khepera_hil.controllers.base import wheels
from khepera_hil.perception import LightBearing, Obstacle, Readings
from khepera_hil.teaching.hand import Hand

__all__ = ["BEHAVIORS", "WORLDS", "Behavior", "Lesson", "Tick"]

Tick = Variable("Tick", range(10_000_000))
"""When a datum was taken: the number of the tick, ten a second at the usual period."""


@dataclass(frozen=True)
class Behavior:
    """What is taught: of which specification a datum is, and which variables it sees and sets."""

    specification: Specification
    sees: tuple[Variable, ...]

    @property
    def variables(self) -> tuple[Variable, ...]:
        """A datum's variables: what the specification learns from."""
        return (Vrot, *self.sees)


_NEAR = Behavior(obstacle, (Dir, Prox))

BEHAVIORS: Mapping[str, Behavior] = MappingProxyType(
    {
        "push": _NEAR,
        "avoid": _NEAR,
        "follow": _NEAR,
        "follow-left": _NEAR,
        "phototaxy": Behavior(pi_phototaxy1, (Theta1,)),
        # What is learnt of it is P(H | Prox), and H is in no datum: see khepera_hil.teaching.hidden.
        "home": Behavior(homing.specification, (Dir, Prox, Theta1)),
    }
)
"""What can be taught, by name."""

WORLDS: Mapping[str, str] = MappingProxyType(
    {
        "push": "push",
        "avoid": "pen",
        "follow": "post",
        "follow-left": "post",
        "phototaxy": "lamp",
        "home": "furnished",
    }
)
"""Where each is taught on the emulator, unless told otherwise."""


@dataclass
class Lesson:
    """A controller whose Vrot is the teacher's; it asks nothing and remembers every datum.

    All variables that any behavior sees are computed, and all raw readings kept, so that a lesson can serve another
    specification too.
    """

    name: str
    hand: Hand
    rows: list[dict[str, Any]] = field(default_factory=list)
    cells: set[tuple[int, ...]] = field(default_factory=set)
    """The situations met so far: values of what the behavior sees."""

    needs = ("N", "O")
    decides = "Vrot"
    questions: Mapping[str, Question] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.behavior = BEHAVIORS[self.name]
        self._senses = (Obstacle(), LightBearing())

    @property
    def possible(self) -> int:
        """How many situations there are."""
        count = 1
        for variable in self.behavior.sees:
            count *= len(variable)
        return count

    def step(self, readings: Readings, rng: np.random.Generator) -> Decision:
        """What is sensed now, and where the stick is now."""
        evidence: dict[str, Any] = {}
        clipped: dict[str, int] = {}
        for sense in self._senses:
            percept = sense.step(readings)
            evidence |= percept.values
            clipped |= percept.clipped
        vrot = self.hand.vrot()
        raw = {v.name: value for v, value in zip(Px, readings.proximity, strict=True)}
        raw |= {v.name: min(value, 511) for v, value in zip(L, readings.light, strict=True)}
        self.rows.append({"Vrot": vrot, **evidence, **raw})
        self.cells.add(tuple(evidence[v.name] for v in self.behavior.sees))
        left, right = wheels(vrot)
        return Decision(evidence, {}, {}, {"Vrot": vrot}, left, right, clipped)
