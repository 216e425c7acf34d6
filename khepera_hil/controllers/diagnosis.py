"""Which light sensor is out of order: E6.4, asked tick after tick.

E6.4 says how probable a sensor's reading is, given the others. "If its reading persists in being inconsistent with
the readings of the others for some period, it is a good indication of a malfunction." So the logarithm of how much
better a sensor that may say anything would explain the reading is summed up over the ticks. The sum never falls
below zero, a tick adds at most 2 and takes off at most 1, and at 130 the sensor is named: that takes six and a half
seconds without a break. A sensor that agrees for as long is taken back.

A tick in which three sensors or more disagree accuses the model and not a sensor (the robot is under the lamp), and
where two do, only the one that is harder to believe counts. A sensor that was named is no longer among the others.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from brp import Description, P, Question
from brp.programs.lamp import L

__all__ = ["NAMED", "Diagnosis"]

NAMED = 130.0
"""The sum at which a sensor counts as out of order, in natural logarithms."""

_UP, _DOWN = 2.0, 1.0
_MOST = 195.0  # no more is summed up, so that a sensor that was mended is believed again
_ACCUSED = 2  # sensors that a tick may speak against


class Diagnosis:
    """Watches the eight sensors of a description of them."""

    def __init__(self, description: Description) -> None:
        self._description = description
        self._questions: dict[tuple[int, frozenset[int]], Question] = {}
        self.sums = [0.0] * 8
        """How much speaks against each sensor."""
        self.broken: frozenset[int] = frozenset()
        """The sensors, 1..8, that are out of order."""

    def against(self, light: Mapping[str, int]) -> list[float]:
        """How much better a sensor that may say anything explains each reading (L1..L8), in logarithms."""
        found = []
        for i in range(8):
            question = self._question(i, self.broken - {i + 1})
            p = question(**{v.keyword: light[v.name] for v in question.known})[light[L[i].name]]
            found.append(-float(np.log(max(float(p), 1e-300) * len(L[i]))))
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
            if i in sound and self.sums[i] >= NAMED:
                self.broken |= {i + 1}
                self.sums[i] = _MOST
                events.append(("warning", f"{name} is out of order: it reads {light[name]}; on without it"))
            elif i not in sound and self.sums[i] == 0.0:
                self.broken -= {i + 1}
                events.append(("info", f"{name} agrees with the others again"))
        return events

    def _question(self, i: int, without: frozenset[int]) -> Question:
        """E6.4 for sensor ``i`` of 0..7, given all others but those."""
        if (i, without) not in self._questions:
            others = [v for place, v in enumerate(L) if place != i and place + 1 not in without]
            self._questions[i, without] = self._description.ask(P(L[i] | others))
        return self._questions[i, without]
