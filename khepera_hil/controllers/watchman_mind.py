"""What the watchman asks in a tick and draws: late (E10.4), early (section 10.4), or anything between.

Late, one question is drawn from: the five internal variables are summed out of P(Vrot Vtrans | Sensory-variables).
Early, each of them is drawn before the motors are, and known from then on. Every question here is asked of
pi-watchman with what was drawn before among the known, so that by P(A) P(B | A) = P(A B) the motors have the same
law whichever variables are drawn, and in whatever order; what differs is the cost, what there is to be seen, and
what is left to remember.

O is independent of the motors given the sensory variables: it leaves the sum of E10.4 as a factor. So E10.3 is
asked as its two factors, the motors in each tick and O when there is a tour to recognise an object by.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from brp import Description, Distribution, P, Question, Term, Value, Variable
from brp.programs.base import Base
from brp.programs.behavior import Behavior, Behavior_t_1, Energy, Fire, Identify, Vigil, behaving
from brp.programs.fusion import Theta2
from brp.programs.home import H
from brp.programs.move import Move
from brp.programs.watchman import Sensory_variables, Vrot, Vtrans

__all__ = ["EARLY", "FILLED", "INTERNAL", "LATE", "MOTORS", "REMEMBERED"]
__all__ += ["Mind", "Thought", "expecting", "filled"]

INTERNAL = (Base, Behavior, Move, Theta2, H)
"""The five internal variables of section 10.2, causes before their effects."""

LATE: tuple[str, ...] = ()
EARLY = tuple(v.name for v in INTERNAL)

MOTORS = "Vrot Vtrans"
REMEMBERED = "Behavior Move"
"""Keys of the two questions that are drawn from in each tick."""

FILLED = 0.01
"""How much the rows may weigh that pi-behavior excludes and that were filled without Behavior_t-1, unreported."""


_NOTHING: Mapping[str, Value] = MappingProxyType({})


@dataclass
class Thought:
    """What was asked and drawn in a tick; by key, and by variable."""

    answers: dict[str, Distribution] = field(default_factory=dict)
    u: dict[str, float] = field(default_factory=dict)
    draws: dict[str, Value] = field(default_factory=dict)
    behavior: str = ""
    """What the turbine, the alarm and the memory go by."""
    move: str = ""

    def draw(self, key: str, answer: Distribution, rng: np.random.Generator) -> None:
        """Draw from an answer: one uniform number, a value for each of its variables that has none yet."""
        self.answers[key] = answer
        u = self.u[key] = float(rng.random())
        drawn = answer.at(u)
        values = (drawn,) if len(answer.variables) == 1 else drawn
        self.draws.update((v.name, value) for v, value in zip(answer.variables, values, strict=True))


class Mind:
    """The questions of a way to decide. ``early`` names the internal variables that are drawn before the motors.

    ``obeying`` is who watches once somebody has said what Behavior is: pi-watchman with a Behavior that depends on
    nothing. It has the same answers, and has them also where pi-behavior would never have decided so. With it
    Behavior is drawn first of all.
    """

    def __init__(
        self, watching: Description, early: Sequence[str] = LATE, *, obeying: Description | None = None
    ) -> None:
        self._early = tuple(v for v in INTERNAL if v.name in early)
        if obeying is not None:
            self._early = (Behavior, *(v for v in self._early if v not in (Behavior, Base)))
        self.questions: dict[str, Question] = {}
        """All that is asked in a tick, by key, in the order of asking."""
        drawn: tuple[Variable, ...] = ()
        for v in self._early:
            self._ask(watching, (v,), drawn)
            drawn = (*drawn, v)
            if v == Behavior and obeying is not None:
                watching = obeying
        for v in INTERNAL:
            if v not in self._early:
                self._ask(watching, (v,), drawn)
        self._ask(watching, (Vrot, Vtrans), drawn)
        self._forgotten = tuple(v for v in (Behavior, Move) if v not in self._early)
        if self._forgotten:
            self._ask(watching, self._forgotten, (*drawn, Vrot, Vtrans), key=REMEMBERED)
        self._known = {
            key: tuple((v.keyword, v.name) for v in question.known) for key, question in self.questions.items()
        }

    def think(
        self, evidence: Mapping[str, Value], rng: np.random.Generator, said: Mapping[str, Value] = _NOTHING
    ) -> Thought:
        """Ask, draw, and draw what is to be remembered given the drawn motors.

        ``evidence`` has the sensory variables by name, ``said`` the values of what is not to be drawn because
        somebody has said them. Raises brp's errors when some of the evidence is refused.
        """
        known = dict(evidence)
        thought = Thought()
        for v in self._early:
            answer = self._answer(v.name, known)
            if v.name in said:
                thought.answers[v.name], thought.draws[v.name] = answer, said[v.name]
            else:
                thought.draw(v.name, answer, rng)
            known[v.name] = thought.draws[v.name]
        for v in INTERNAL:
            if v not in self._early:
                thought.answers[v.name] = self._answer(v.name, known)
        thought.draw(MOTORS, self._answer(MOTORS, known), rng)
        if self._forgotten:
            known |= thought.draws
            thought.draw(REMEMBERED, self._answer(REMEMBERED, known), rng)
        thought.behavior, thought.move = str(thought.draws["Behavior"]), str(thought.draws["Move"])
        return thought

    def _answer(self, key: str, known: Mapping[str, Value]) -> Distribution:
        return self.questions[key](**{keyword: known[name] for keyword, name in self._known[key]})

    def _ask(
        self, watching: Description, of: tuple[Variable, ...], drawn: tuple[Variable, ...], key: str = ""
    ) -> None:
        self.questions[key or " ".join(v.name for v in of)] = watching.ask(Term(of, (*Sensory_variables, *drawn)))


def expecting(description: Description) -> Question:
    """What pi-behavior lets one expect after each Behavior_t-1; what has probability zero is an impossible row."""
    return description.ask(P(Vigil, Energy, Fire, Identify, Base | Behavior_t_1))


_EXPECTED = expecting(behaving)


def filled(evidence: Mapping[str, Value], base: Distribution, expects: Question = _EXPECTED) -> float:
    """How much of P(Base) lies on rows of pi-behavior that are impossible and were asked without Behavior_t-1.

    ``expects`` is `expecting` of its tables.
    """
    told = {v: evidence[v.name] for v in (Vigil, Energy, Fire, Identify)}
    expected = expects(Behavior_t_1=evidence[Behavior_t_1.name])
    return sum(base[at] for at in Base.values if expected[(*told.values(), at)] == 0)
