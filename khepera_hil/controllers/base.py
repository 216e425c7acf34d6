"""What a program on a robot is: sense, ask, draw, act, each tick anew (section 3.4, the control loop)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np

from brp import Description, Distribution, Question, Specification, Term, Value
from brp.programs.lamp import LightSensor
from khepera_hil.perception import Need, Readings, Sense

__all__ = [
    "USUAL",
    "VTRANS",
    "Commanded",
    "Controller",
    "Decision",
    "Learner",
    "Program",
    "Reactive",
    "Setting",
    "wheels",
    "without",
]

VTRANS = 5
"""The fixed translation speed of section 4.1, on the scale of the watchman's Vtrans (0..10)."""

AHEAD = 0.8
"""Units of command D for one unit of Vtrans, so that Vtrans 5 is 33 mm/s."""

TURN = 1.0
"""Units of command D for one unit of Vrot, so that Vrot 10 is 3.1 rad/s. The paper names none. At 0.8 a robot with
weak sensors that meets something head-on needs 0.6 s to turn along it: six contacts over half a second in 20 x 10
minutes of avoidance, against one at 1.0."""


@dataclass(frozen=True)
class Decision:
    """What one tick came to."""

    evidence: Mapping[str, Value]
    answers: Mapping[str, Distribution]
    """Every distribution that was asked, by key; the keys of ``draws`` are among them."""
    u: Mapping[str, float]
    """The one uniform number behind each draw."""
    draws: Mapping[str, Value]
    left: int
    right: int
    """Speeds to send, in units of the manual's command D."""
    clipped: Mapping[str, int] = field(default_factory=dict)
    events: Sequence[tuple[str, str]] = ()
    """What the user should know of this tick: level (info, warning) and a sentence."""
    commands: Sequence[tuple[int | str, ...]] = ()
    """Requests beside D that are sent after it, letter and values: ``("W", 1, 32)``. One that is not confirmed is
    an event and nothing more, so a controller says again what matters."""


class Controller(Protocol):
    """A program on a robot. It knows neither port nor clock, and not whether the robot is a real one."""

    @property
    def name(self) -> str:
        """As the command line knows it."""

    @property
    def needs(self) -> Sequence[str | Need]:
        """The readings that it takes, in the order in which they are asked; a bare letter is due in each tick."""

    @property
    def questions(self) -> Mapping[str, Question]:
        """What it asks each tick, by key."""

    @property
    def decides(self) -> str:
        """Key of the question whose draw moves the robot."""

    def step(self, readings: Readings, rng: np.random.Generator) -> Decision:
        """One tick's decision. Raises brp's errors when the evidence is impossible."""


@runtime_checkable
class Commanded(Protocol):
    """A controller that takes orders of the operator. Ask a program that knows none, and it is refused for it."""

    def order(self, words: str) -> str:
        """Take an order such as ``vigil on``, which holds from the next step on; what to tell whoever gave it.

        Raises :class:`~khepera_hil.errors.OrderRefused`, with nothing changed, for one that it does not know or
        that makes no sense now.
        """


@runtime_checkable
class Learner(Protocol):
    """A controller of which a question changes with what it meets: a recorded run is asked again in its order."""

    @property
    def learning(self) -> Mapping[str, Callable[[Mapping[str, Value]], Question]]:
        """For each such question, by key, what takes the evidence of a tick in which it was asked, learns of that
        what the step learnt then, and returns the question as it is asked the next time.
        """


@dataclass(frozen=True)
class Setting:
    """What may be chosen of a program when it is made."""

    unknown: tuple[str, ...] = ()
    """Variables that the question is not told, because a sensor failed (E5.3); they are summed out."""
    taught: Description | None = None
    """What to go by in place of the program's own description: the same specification, other data (lesson 2)."""
    sensors: tuple[LightSensor, ...] | None = None
    """The light sensors as they were calibrated (section 6.2)."""
    met: tuple[Mapping[str, int], ...] = ()
    """The objects met in earlier runs: rows of O, Nlt, Nrt, Per, Lrl (section 8)."""
    early: tuple[str, ...] = ()
    """The internal variables that are drawn before the motors are (section 10.4); none: late."""
    memory: str = "drawn"
    """What the watchman carries from tick to tick: what was ``drawn``, or the ``whole`` distribution."""
    stay: float = 0.9
    """The watchman's: what stands on the diagonal of table 2 for the paper's .90."""
    labels: bool = False
    """Whether the operator may say what Behavior is, so that it can be learnt from him; it is then drawn before the
    motors."""


USUAL = Setting()
"""Everything known, and the program's own description."""


class Program(NamedTuple):
    """A program as the command line knows it. ``make`` takes a :class:`Setting`, or nothing for the usual one."""

    about: str
    make: Callable[..., Controller]
    known: tuple[str, ...] = ()
    """The variables that its question is told: each but one may be named unknown."""
    specification: Specification | None = None
    """What can be taught, if anything can."""


def without(term: Term, unknown: Sequence[str]) -> Term:
    """The term with these of its known variables left out."""
    return Term(term.of, tuple(v for v in term.given if v.name not in unknown))


def wheels(vrot: int, vtrans: int = VTRANS) -> tuple[int, int]:
    """Left and right speed for a rotation (positive to the right) and a translation (section 4.1)."""
    return round(AHEAD * vtrans + TURN * vrot), round(AHEAD * vtrans - TURN * vrot)


class Reactive:
    """A program without memory: each tick it computes its variables, asks P(Vrot | ...), draws and turns.

    ``main`` is the question that Vrot is drawn from. ``beside`` are questions that decide nothing: they are
    asked of the same evidence and recorded, because they show how the answer came about.
    """

    decides = "Vrot"

    def __init__(
        self, name: str, senses: Sequence[Sense], main: Question, beside: Mapping[str, Question] | None = None
    ) -> None:
        self.name = name
        self.needs = tuple(dict.fromkeys(sense.needs for sense in senses))
        self.questions: dict[str, Question] = {self.decides: main, **(beside or {})}
        self._senses = tuple(senses)
        self._known = {
            key: [(variable.keyword, variable.name) for variable in question.known]
            for key, question in self.questions.items()
        }

    def step(self, readings: Readings, rng: np.random.Generator) -> Decision:
        """Sense, ask, draw, act."""
        evidence: dict[str, Value] = {}
        clipped: dict[str, int] = {}
        for sense in self._senses:
            percept = sense.step(readings)
            evidence.update(percept.values)
            clipped.update(percept.clipped)
        answers = {
            key: question(**{keyword: evidence[name] for keyword, name in self._known[key]})
            for key, question in self.questions.items()
        }
        u = float(rng.random())
        vrot = answers[self.decides].at(u)
        left, right = wheels(vrot)
        return Decision(evidence, answers, {"Vrot": u}, {"Vrot": vrot}, left, right, clipped)
