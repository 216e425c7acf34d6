"""Which light sensor is out of order: E6.4, asked tick after tick.

E6.4 says how probable a sensor's reading is, given the others. "If its reading persists in being inconsistent with
the readings of the others for some period, it is a good indication of a malfunction." So the logarithm of how much
better a sensor that may say anything would explain the reading is summed up over the ticks. The sum never falls
below zero, a tick adds at most 4 and takes off at most 1, and at 100 the sensor is named: that takes two seconds
and a half without a break. Two out of order at a time are rarer than one, so that the second one takes half as
much again. A sensor that agrees for long enough afterwards is taken back. The figures are a choice between two
errors: over 35 robots with calibrated sensors, five minutes each about a lamp, none was named while all were sound
at 100, and one at 90; two minutes each with a broken one, one sound sensor was named beside it.

A tick in which three sensors or more disagree accuses the model and not a sensor (the robot is under the lamp), and
where two do, only the one that is harder to believe counts. A sensor that was named is no longer among the others.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from brp import Description, Form, P, Question, Table
from brp.programs.lamp import L, Level, Theta2, lamp

__all__ = ["NAMED", "Diagnosis"]

NAMED = 100.0
"""The sum at which a sensor counts as out of order, in natural logarithms."""

_UP, _DOWN = 4.0, 1.0
_SECOND = 1.5 * NAMED
"""The same where another one is out of order already."""
_MOST = 150.0  # no more is summed up, so that a sensor that was mended is believed again
_ACCUSED = 2  # sensors that a tick may speak against


class Diagnosis:
    """Watches eight sensors, as a description of pi-lamp has them; as they usually are, if none is given."""

    def __init__(self, description: Description | None = None) -> None:
        self._description = description or lamp()
        # P(Li = value | Theta2 Level), a row of 504 numbers for each value.
        self._expected = [_model(self._description[P(Li | Theta2, Level)]).reshape(len(Li), -1) for Li in L]
        self._where: dict[frozenset[int], Question] = {}
        self.sums = [0.0] * 8
        """How much speaks against each sensor."""
        self.broken: frozenset[int] = frozenset()
        """The sensors, 1..8, that are out of order."""

    def against(self, light: Mapping[str, int]) -> list[float]:
        """How much better a sensor that may say anything explains each reading (L1..L8), in logarithms.

        That is -log 512 P(Li | the others sound) [E6.4]. One question serves for all eight:
        1 / P(Li | others) = Sum_Theta2_Level P(Theta2 Level | all) / P(Li | Theta2 Level).
        """
        question = self._question()
        where = question(**{v.keyword: light[v.name] for v in question.known}).p.reshape(-1)
        found = []
        for i in range(8):
            expected = self._expected[i][light[L[i].name]]
            p = float(where @ expected) if i + 1 in self.broken else 1 / float((where / expected).sum())
            found.append(-math.log(p * len(L[i])))
        return found

    def step(self, light: Mapping[str, int]) -> list[tuple[str, str]]:
        """Weigh one tick's readings (L1..L8); what the user should know of it."""
        against = self.against(light)
        sound = [i for i in range(8) if i + 1 not in self.broken]
        accused = [i for i in sound if against[i] > 0]
        worst = max(accused, key=lambda i: against[i], default=None)
        events: list[tuple[str, str]] = []
        for i in range(8):
            if i in sound and (len(accused) > _ACCUSED or (i in accused and i != worst)):
                continue
            self.sums[i] = min(_MOST, max(0.0, self.sums[i] + min(_UP, max(-_DOWN, against[i]))))
            name = L[i].name
            if i in sound and self.sums[i] >= (_SECOND if self.broken else NAMED):
                self.broken |= {i + 1}
                self.sums[i] = _MOST
                events.append(("warning", f"{name} is out of order: it reads {light[name]}; on without it"))
            elif i not in sound and self.sums[i] == 0.0:
                self.broken -= {i + 1}
                events.append(("info", f"{name} agrees with the others again"))
        return events

    def _question(self) -> Question:
        """Where the light is and how strong, by all sensors that are in order."""
        if self.broken not in self._where:
            sound = [v for place, v in enumerate(L) if place + 1 not in self.broken]
            self._where[self.broken] = self._description.ask(P(Theta2, Level | sound))
        return self._where[self.broken]


def _model(form: Form) -> NDArray[np.float64]:
    assert isinstance(form, Table)
    return np.asarray(form.table)
