"""Ask a recorded run again: every question from the evidence in its log, every draw from its uniform numbers.

The answers are computed by batch, question by question, over so many ticks at a time; each different evidence once.
They are compared with the log by the hash of their float64 values. Where a hash differs the evidence is asked
again by itself, since a batch may differ from a call in the last bits. Other versions of numpy, or another
processor, may do so too: their answers are told apart from wrong ones by the log's sketch (see ``recording``),
which may differ by ``TOLERANCE``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brp import BrpError, Distribution, Question
from khepera_hil.errors import RecordingError
from khepera_hil.reading import Run, tick_of
from khepera_hil.recording import Answer, Tick, Value

__all__ = ["TOLERANCE", "Asked", "Learning", "Replay", "answered", "evidence_of", "redrawn", "replay"]

TOLERANCE = 1e-9
"""Of a sketch between versions: 1e-9 of probability in all, where a float64 has 1e-16."""

BLOCK = 4096
"""Ticks that are asked at a time."""

_Key = tuple[Value, ...]

Learning = Mapping[str, Callable[[Mapping[str, Value]], Question]]
"""The questions that change with what a run meets (``controllers.base.Learner``): they are asked tick by tick."""

_NOTHING: Learning = {}


@dataclass
class Asked:
    """One question of a run, asked again."""

    key: str
    name: str
    answers: int = 0
    """In the log."""
    same: int = 0
    """To the bit."""
    near: int = 0
    """Not to the bit, and within the tolerance."""
    draws: int = 0
    """From it, in the log."""
    worst: float = 0.0
    """Largest difference of the sketches."""
    differs: tuple[int, float, str] | None = None
    """Tick, time (s) and what is wrong there, of the first answer or draw that differs."""
    different: int = 0
    """Answers and draws that do."""

    def wrong(self, tick: Tick, why: str) -> None:
        """Count one that differs; the first is named."""
        self.different += 1
        self.differs = self.differs or (tick.tick, tick.t, why)


@dataclass
class Replay:
    """What a run's questions answer now, beside what they answered then."""

    ticks: int = 0
    asked: dict[str, Asked] = field(default_factory=dict)

    @property
    def same(self) -> bool:
        """Whether every answer is the recorded one (to the bit or within the tolerance), and every draw."""
        return all(asked.differs is None for asked in self.asked.values())

    @property
    def first(self) -> tuple[int, float, str, str] | None:
        """Tick, time (s), question and reason of the first that differs."""
        found = [(*asked.differs, asked.name) for asked in self.asked.values() if asked.differs is not None]
        if not found:
            return None
        tick, t, why, name = min(found)
        return tick, t, name, why


def evidence_of(question: Question, evidence: Mapping[str, Value]) -> dict[str, Value] | None:
    """What the question knows, by keyword, from a tick's evidence; None where some of it is not there."""
    try:
        return {variable.keyword: evidence[variable.name] for variable in question.known}
    except KeyError:
        return None


def _told(tick: Tick) -> Mapping[str, Value]:
    """What a question may know in a tick: the evidence, and what was drawn before it was asked."""
    return {**tick.draws, **tick.evidence}


def answered(run: Run, questions: Mapping[str, Question], learning: Learning = _NOTHING) -> Iterator[Tick]:
    """The run's ticks with the answers that ``questions`` give to the recorded evidence; a question is asked in
    the ticks in which the log has an answer to it. Where there is none any more the tick has none.
    """
    for ticks, _, found in _blocks(run, questions, learning):
        for place, tick in enumerate(ticks):
            mine = {key: answers[place] for key, answers in found.items()}
            tick.answers = {key: answer for key, answer in mine.items() if isinstance(answer, Answer)}
            yield tick


def replay(run: Run, questions: Mapping[str, Question], learning: Learning = _NOTHING) -> Replay:
    """Ask all over again and compare, learning on the way what was learnt then.

    Raises RecordingError when the log is damaged.
    """
    found = Replay()
    for said in run.questions:
        asked = found.asked[said["key"]] = Asked(said["key"], said["name"])
        question = questions.get(said["key"])
        if question is None:
            asked.differs = (0, 0.0, "the program asks no such question any more")
        elif (why := _changed(said, question)) is not None:
            asked.differs = (0, 0.0, why)
    for ticks, rows, answers in _blocks(run, questions, learning):
        found.ticks += len(ticks)
        for key, column in answers.items():
            asked = found.asked.setdefault(key, Asked(key, questions[key].name))
            for tick, row, answer in zip(ticks, rows, column, strict=True):
                if answer is not None:
                    _compare(asked, tick, row, answer, questions[key], batched=key not in learning)
    return found


def redrawn(question: Question, p: NDArray[np.float64], u: float) -> dict[str, Value]:
    """The values that ``u`` draws, by variable."""
    drawn = Distribution(question.searched, p).at(u)
    values = (drawn,) if len(question.searched) == 1 else drawn
    return {variable.name: value for variable, value in zip(question.searched, values, strict=True)}


def _changed(said: Mapping[str, Any], question: Question) -> str | None:
    """What of the question is not as the manifest has it."""
    variables = [variable.name for variable in question.searched]
    if variables != list(said["variables"]):
        return f"it is asked for {' '.join(variables)} now, and was for {' '.join(said['variables'])}"
    for variable, values in zip(question.searched, said["values"], strict=True):
        if list(variable.values) != list(values):
            return f"{variable.name} has other values now"
    return None


def _compare(
    asked: Asked, tick: Tick, row: Mapping[str, Any], answer: Answer | str, question: Question, *, batched: bool
) -> None:
    asked.answers += 1
    if isinstance(answer, str):
        asked.wrong(tick, answer)
        return
    if batched and answer.digest() != row["answers"][asked.key]:
        answer = _by_itself(question, tick, answer)
    if answer.digest() == row["answers"][asked.key]:
        asked.same += 1
    else:
        sketch = (row.get("sketch") or {}).get(asked.key)
        if not isinstance(sketch, (int, float)):
            asked.wrong(tick, "another distribution; the log does not say by how much")
        else:
            off = abs(answer.sketch() - sketch)
            asked.worst = max(asked.worst, off)
            if off <= TOLERANCE:
                asked.near += 1
            else:
                asked.wrong(tick, f"another distribution: the sketches differ by {off:.2g}")
    if asked.key in tick.u:
        asked.draws += 1
        for name, value in redrawn(question, answer.p, tick.u[asked.key]).items():
            # By the variable's name, or by the question's key where that is another (P(Move | ...) of a watchman's
            # memory, when Behavior was drawn before, stands under the key of both).
            recorded = tick.draws.get(name, tick.draws.get(asked.key))
            if recorded != value:
                asked.wrong(tick, f"{name} = {value} is drawn, and {recorded} was")


def _by_itself(question: Question, tick: Tick, otherwise: Answer) -> Answer:
    """The call's answer in place of the batch's."""
    known = evidence_of(question, _told(tick))
    assert known is not None  # the batch asked it
    try:
        return replace(otherwise, p=question(**known).p)
    except BrpError:
        return otherwise


def _blocks(
    run: Run, questions: Mapping[str, Question], learning: Learning
) -> Iterator[tuple[list[Tick], list[dict[str, Any]], dict[str, list[Answer | str | None]]]]:
    """The log in pieces: ticks, rows, and for each question an answer, a reason why there is none, or None where
    it was not asked."""
    rows = run.rows()
    asked = dict(questions)
    while block := list(islice(rows, BLOCK)):
        for row in block:
            if not isinstance(row.get("answers"), dict):
                raise RecordingError(f"tick {row['tick']} of {run.folder} is damaged: its answers are no object")
        ticks = [tick_of(row) for row in block]
        found: dict[str, list[Answer | str | None]] = {}
        for key in questions:
            found[key] = [] if key in learning else _column(key, asked[key], ticks, block)
        for tick, row in zip(ticks, block, strict=True) if learning else ():
            for key in learning.keys() & asked.keys():
                found[key] += _column(key, asked[key], [tick], [row])
                if isinstance(found[key][-1], Answer):
                    asked[key] = learning[key](tick.evidence)
        yield ticks, block, found


def _column(
    key: str, question: Question, ticks: Iterable[Tick], rows: Iterable[Mapping[str, Any]]
) -> list[Answer | str | None]:
    keywords = [variable.keyword for variable in question.known]
    asked: list[_Key | str | None] = []
    for tick, row in zip(ticks, rows, strict=True):
        if key not in row["answers"]:
            asked.append(None)
        elif question.soft:
            asked.append("it knows something softly, which the log does not have")
        elif (known := evidence_of(question, _told(tick))) is None:
            missing = [v.name for v in question.known if v.name not in _told(tick)]
            asked.append(f"the log has no {' '.join(missing)} to ask it with")
        else:
            asked.append(tuple(known.values()))
    different = list(dict.fromkeys(known for known in asked if isinstance(known, tuple)))
    answers = dict(zip(different, _answers(question, keywords, different), strict=True))
    return [answers[known] if isinstance(known, tuple) else known for known in asked]


def _answers(question: Question, keywords: list[str], different: list[_Key]) -> list[Answer | str]:
    """The answer to each evidence, by one batch; where that is refused, one by one."""
    if not different:
        return []
    variables = tuple(variable.name for variable in question.searched)
    values = tuple(tuple(variable.values) for variable in question.searched)
    try:
        if len(different) == 1:  # as it was asked then, to the bit
            table = question(**dict(zip(keywords, different[0], strict=True))).p[np.newaxis]
        else:
            table = question.batch(dict(zip(keywords, map(list, zip(*different, strict=True)), strict=True)))
        return [Answer(question.name, variables, values, p) for p in table]
    except BrpError:
        pass
    found: list[Answer | str] = []
    for known in different:
        try:
            p = question(**dict(zip(keywords, known, strict=True))).p
            found.append(Answer(question.name, variables, values, p))
        except BrpError as error:
            found.append(f"it has no answer now: {error}")
    return found
