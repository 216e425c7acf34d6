"""The objects that a robot has met (section 8.3): recognised after a tour, and learnt; there is no teacher."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from brp import BrpError, Distribution, P, Question, Value
from brp.programs.object import Lrl, Nlt, Nrt, O, Per, recognised, unacquainted

__all__ = ["TOUR", "Acquaintance"]

TOUR = (Nlt, Nrt, Per, Lrl)


class Acquaintance:
    """Knows the objects of ``met`` (rows of O, Nlt, Nrt, Per, Lrl) and those that it meets.

    ``met`` has every tour with the class that it was taken for, as rows of a data set; ``question`` is P(O | Nlt,
    Nrt, Per, Lrl) [E8.1] as it is asked of the next tour.
    """

    def __init__(self, met: Iterable[Mapping[str, int]] = ()) -> None:
        self.met = [{variable.name: row[variable.name] for variable in (O, *TOUR)} for row in met]
        self._knowing = unacquainted
        for row in self.met:
            self._knowing = self._knowing.learn(row)
        self.question: Question = self._knowing.ask(P(O | TOUR))

    def meet(self, tour: Mapping[str, int]) -> tuple[Distribution, tuple[str, str]]:
        """What a tour was around, and an event that says so. The class that wins is learnt, right or wrong; a new
        object begins one, and when there is none left it is reported, never merged.
        """
        answer: Distribution = self.question(**tour)
        try:
            o = recognised(self._knowing, tour)
        except BrpError as error:
            return answer, ("warning", f"not learnt: {error}")
        said = " ".join(f"{name} {value}" for name, value in tour.items())
        self.met.append({"O": o, **tour})
        self._knowing = self._knowing.learn(self.met[-1])
        self.question = self._knowing.ask(P(O | TOUR))
        return answer, (
            "info",
            f"{'a new object, from now on' if answer.best() == 0 else 'this is object'} {o} ({said})",
        )

    def again(self, evidence: Mapping[str, Value]) -> Question:
        """Learn of a recorded tick what was learnt then; the next question."""
        self.meet({variable.name: int(evidence[variable.name]) for variable in TOUR})
        return self.question
