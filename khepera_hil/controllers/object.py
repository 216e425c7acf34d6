"""Situation recognition (section 8): after a tour around an object, P(O | Nlt Nrt Per Lrl), and learn.

The robot follows the contour; when it has gone round, the four variables of the tour are the question's evidence
[E8.1]. The class that wins is learnt, right or wrong: there is no teacher. A new object begins a class, and when
there is none left it is reported, never merged.
"""

from __future__ import annotations

import numpy as np

from brp import P, Question, Value
from brp.programs.obstacle import Dir, Prox, Vrot, following
from khepera_hil.controllers.acquaintance import Acquaintance
from khepera_hil.controllers.base import USUAL, Decision, Setting, wheels, without
from khepera_hil.perception import Obstacle, Readings, Tour

__all__ = ["Recogniser", "controller"]

_LOST = 40
"""Ticks without anything near, after which the robot drives straight on instead of turning to what it has lost."""


class Recogniser:
    """Goes around what it meets, and says each time what that was.

    ``objects.met`` is what the robot knows of objects, to be kept from one run to the next.
    """

    name = "object"
    decides = "Vrot"
    needs = ("N", "H")

    def __init__(self, setting: Setting = USUAL) -> None:
        self.objects = Acquaintance(setting.met)
        self.learning = {"O": self.objects.again}
        self._obstacle, self._tour = Obstacle(), Tour()
        self._alone = 0
        follow = (setting.taught or following).ask(without(P(Vrot | Prox, Dir), setting.unknown))
        self._known = [(variable.keyword, variable.name) for variable in follow.known]
        self.questions: dict[str, Question] = {"Vrot": follow, "O": self.objects.question}

    def step(self, readings: Readings, rng: np.random.Generator) -> Decision:
        """Follow the contour; recognise and learn when the tour is done."""
        percept = self._obstacle.step(readings)
        evidence: dict[str, Value] = dict(percept.values)
        near = percept.values["Prox"] > 0
        self._alone = 0 if near else self._alone + 1
        if self._alone > _LOST:
            self._tour.step(readings, near=False)
            left, right = wheels(0)  # on to whatever there is to be met
            return Decision(evidence, {}, {}, {}, left, right)
        follow = self.questions["Vrot"](**{keyword: percept.values[name] for keyword, name in self._known})
        answers = {"Vrot": follow}
        events: list[tuple[str, str]] = []
        tour = self._tour.step(readings, near=near)
        if tour.values:
            evidence |= tour.values
            answers["O"], event = self.objects.meet(tour.values)
            events.append(event)
            self.questions["O"] = self.objects.question
        u = float(rng.random())
        vrot = follow.at(u)
        left, right = wheels(vrot)
        return Decision(evidence, answers, {"Vrot": u}, {"Vrot": vrot}, left, right, tour.clipped, events)


def controller(setting: Setting = USUAL) -> Recogniser:
    """E8.1 after each tour; nothing is known at first but what was met in earlier runs."""
    return Recogniser(setting)
