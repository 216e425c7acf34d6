"""What another program, or the same one with other data, would have done on a run's readings.

Another program meets the recorded answers of the robot, tick by tick, and draws with the recorded uniform numbers;
where it needs more of them than were recorded they come from the run's seed. Other data leave the evidence as it
was recorded. In neither case does the robot move otherwise: each tick is asked what it would have done *there*.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import cast

import numpy as np

from brp import BrpError, Description, Form, Question, Specification, Switch
from brp.store import load, load_data
from brp.subroutine import Renamed
from khepera_hil import chance, transcript
from khepera_hil.controllers import Controller
from khepera_hil.errors import UsageError
from khepera_hil.reading import Run
from khepera_hil.recording import Answer, Tick, Value
from khepera_hil.replay import Learning, answered, redrawn

__all__ = ["Beside", "beside", "with_data", "with_program", "with_questions"]


@dataclass
class Beside:
    """A run beside what would have been done otherwise."""

    ticks: int = 0
    """In which both had readings."""
    agree: dict[str, int] = field(default_factory=dict)
    """For each drawn variable that both have: in how many ticks both drew the same value."""
    apart: dict[str, list[float]] = field(default_factory=dict)
    """For each question that both answer over the same values: the total variation distance, tick by tick."""
    commands: int = 0
    """Ticks with the same speeds."""
    first: tuple[int, float] | None = None
    """Tick and time (s) of the first that draws or drives otherwise."""


def beside(recorded: Iterable[Tick], otherwise: Iterable[Tick], sums: Beside) -> Iterator[tuple[Tick, Tick]]:
    """Both tick by tick; ``sums`` is added to."""
    for here, there in zip(recorded, otherwise, strict=True):
        if here.draws and there.draws:
            _add(sums, here, there)
        yield here, there


def _add(sums: Beside, here: Tick, there: Tick) -> None:
    sums.ticks += 1
    same = True
    for name in here.draws.keys() & there.draws.keys():
        alike = here.draws[name] == there.draws[name]
        sums.agree[name] = sums.agree.get(name, 0) + alike
        same &= alike
    for key in here.answers.keys() & there.answers.keys():
        p, q = here.answers[key], there.answers[key]
        if p.values == q.values:
            sums.apart.setdefault(key, []).append(float(np.abs(p.p - q.p).sum() / 2))
    if there.command is not None:
        alike = here.command == there.command
        sums.commands += alike
        same &= alike
    if not same and sums.first is None:
        sums.first = (here.tick, here.t)


class _Uniforms:
    """The recorded numbers of a tick in their order, then others."""

    def __init__(self, seed: int) -> None:
        self._more = chance.generator(seed, "program")
        self.left: list[float] = []

    def random(self) -> float:
        """The next one."""
        return self.left.pop(0) if self.left else float(self._more.random())


def with_program(run: Run, controller: Controller) -> Iterator[Tick]:
    """The run's ticks as ``controller`` would have had them; a tick whose readings it lacks has nothing."""
    uniforms = _Uniforms(int(run.manifest.get("seed", 0)))
    shapes = {key: _shape(question) for key, question in controller.questions.items()}
    for tick in run.ticks():
        other = Tick(tick.tick, tick.t, raw=tick.raw, wall=tick.wall, pose=tick.pose, moved=tick.moved)
        readings = transcript.readings(tick.raw, controller.needs)
        if readings is not None:
            uniforms.left = list(tick.u.values())
            try:
                decision = controller.step(readings, cast("np.random.Generator", uniforms))
            except BrpError as error:
                other.events.append(("warning", f"no data: {error}"))
            else:
                other.evidence, other.u, other.draws = (
                    dict(decision.evidence),
                    dict(decision.u),
                    dict(decision.draws),
                )
                other.answers = {key: Answer(*shapes[key], given.p) for key, given in decision.answers.items()}
                other.command = (decision.left, decision.right)
        yield other


def with_questions(run: Run, questions: Mapping[str, Question], learning: Learning) -> Iterator[Tick]:
    """The run's ticks as other data would have had them: recorded evidence and numbers, other answers and draws."""
    for tick in answered(run, questions, learning):
        other = Tick(tick.tick, tick.t, evidence=tick.evidence, u=tick.u, answers=tick.answers)
        for key, u in tick.u.items():
            if key in questions and key in tick.answers:
                question = questions[key]
                drawn = redrawn(question, tick.answers[key].p, u)
                alone = len(drawn) == 1 and key in tick.draws
                other.draws |= {key: drawn[question.searched[0].name]} if alone else drawn
        yield other


def with_data(questions: Mapping[str, Question], path: Path) -> dict[str, Question]:
    """The questions, every description in them (or below) that the file of data fits identified from it.

    The file is one of brp's, a data set or a description. Raises UsageError when it is none, or fits nothing.
    """
    taught = _Taught(path)
    found = {key: taught.question(question) for key, question in questions.items()}
    if not taught.used:
        known = sorted({s.name for s in taught.met if s.free})
        raise UsageError(
            f"{path} fits none of what the program has learnt ({', '.join(known) or 'nothing'}): {taught.why}"
        )
    return found


class _Taught:
    def __init__(self, path: Path) -> None:
        self._path = path
        self._data = _is_data(path)
        self.used = False
        self.why = "no data are needed"
        self.met: set[Specification] = set()
        self._made: dict[Question, Question] = {}

    def question(self, question: Question) -> Question:
        if question not in self._made:
            self._made[question] = self._again(question)
        return self._made[question]

    def _again(self, question: Question) -> Question:
        old = question.description
        specification = old.specification
        self.met.add(specification)
        new = self._identified(specification)
        if new is None:
            forms = {term: self._form(old[term]) for term in specification.terms}
            if all(forms[term] is old[term] for term in forms):
                return question
            new = Specification(forms, name=specification.name).identify(name=old.name)
        return Question(new, question.term, question.largest, soft=question.soft, rules=question.rules)

    def _identified(self, specification: Specification) -> Description | None:
        if not specification.free:
            return None
        needed = [v for v in specification.variables if any(v in t.variables for t in specification.free)]
        try:
            if self._data:
                name, columns = load_data(self._path, needed)
                found = specification.identify(columns, name=name)
            else:
                found = load(self._path, specification)
        except OSError as error:
            raise UsageError(f"{self._path} cannot be read: {error.strerror or error}") from None
        except BrpError as error:
            self.why = str(error)
            return None
        self.used = True
        return found

    def _form(self, form: Form) -> Form:
        if isinstance(form, Question):
            return self.question(form)
        if isinstance(form, Renamed):
            question = self.question(form.question)
            return form if question is form.question else Renamed(question, form.new)
        if isinstance(form, Switch):
            cases = {value: self._form(case) for value, case in form.cases.items()}
            same = all(cases[value] is case for value, case in form.cases.items())
            return form if same else Switch(form.variable, cases)
        return form


def _is_data(path: Path) -> bool:
    """Whether the file is a data set; else it is a description, or somebody else's, which its reader says."""
    try:
        with path.open("rb") as file:
            return b'"brp data"' in file.read(200)
    except OSError as error:
        raise UsageError(f"{path} cannot be read: {error.strerror or error}") from None


def _shape(question: Question) -> tuple[str, tuple[str, ...], tuple[tuple[Value, ...], ...]]:
    searched = question.searched
    return question.name, tuple(v.name for v in searched), tuple(tuple(v.values) for v in searched)
