"""Sensor fusion, live (section 6): where the light is, which sensor is out of order, and on without that one.

Each tick draws Theta2 from P(Theta2 | L1 ... L8) [E6.1]. Section 6 moves nothing; here the robot wanders by
avoidance (E5.2), so that it sees the light from all sides. The description is `brp.programs.lamp`, which knows of
the light's strength, since only so can E6.4 be asked at any distance of the lamp (`controllers.diagnosis`);
pi-fusion itself is asked beside, of the scaled readings. A sensor that was named out of order is left out of the
question from then on [E6.3].
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from brp import Distribution, P, Question, Value
from brp.programs.fusion import locate_scaled
from brp.programs.lamp import USUAL as USUAL_SENSORS
from brp.programs.lamp import L, LightSensor, Theta2, lamp
from brp.programs.obstacle import avoid
from khepera_hil.controllers.base import USUAL, Decision, Setting, wheels
from khepera_hil.controllers.diagnosis import Diagnosis
from khepera_hil.perception import Obstacle, Readings, ScaledLight

__all__ = ["Fusion", "controller"]

_DARK = 25  # counts by which the readings must differ to show a light


class Fusion:
    """Says where the light is by what the eight sensors say together, and watches them.

    Its questions are all that it may ask: ``Theta2`` and ``Theta2 without L3``; one of these is asked in a tick.
    """

    name = "fusion"
    decides = "Vrot"
    needs = ("N", "O")

    def __init__(self, sensors: Sequence[LightSensor] = USUAL_SENSORS) -> None:
        description = lamp(sensors)
        self._obstacle, self._scaled = Obstacle(), ScaledLight(_DARK)
        self.diagnosis = Diagnosis(description)
        self.questions: dict[str, Question] = {
            "Vrot": avoid,
            "Theta2": description.ask(P(Theta2 | L)),
            **{
                f"Theta2 without {Li.name}": description.ask(P(Theta2 | [other for other in L if other is not Li]))
                for Li in L
            },
            "Theta2 scaled": locate_scaled,
        }

    def step(self, readings: Readings, rng: np.random.Generator) -> Decision:
        """Wander on, and locate the light where there is one."""
        light = {v.name: min(value, 511) for v, value in zip(L, readings.light, strict=True)}
        near, scaled = self._obstacle.step(readings), self._scaled.step(readings)
        evidence: dict[str, Value] = {**near.values, **light, **scaled.values}
        answers: dict[str, Distribution] = {"Vrot": self.questions["Vrot"](**near.values)}
        us, events = {"Vrot": float(rng.random())}, list[tuple[str, str]]()
        draws: dict[str, Value] = {"Vrot": answers["Vrot"].at(us["Vrot"])}
        if not self._dark(light):
            events = self.diagnosis.step(light)
            broken = self.diagnosis.broken
            # More than one broken sensor is left to the model's own uniform share, which bears them.
            key = f"Theta2 without L{next(iter(broken))}" if len(broken) == 1 else "Theta2"
            question = self.questions[key]
            answers[key] = question(**{v.keyword: light[v.name] for v in question.known})
            us[key] = float(rng.random())
            draws[key] = answers[key].at(us[key])
            if scaled.values:
                answers["Theta2 scaled"] = self.questions["Theta2 scaled"](**scaled.values)
        left, right = wheels(int(draws["Vrot"]))
        return Decision(evidence, answers, us, draws, left, right, scaled.clipped, events)

    def _dark(self, light: Mapping[str, int]) -> bool:
        sound = [value for i, value in enumerate(light.values(), 1) if i not in self.diagnosis.broken]
        return max(sound, default=0) - min(sound, default=0) < _DARK


def controller(setting: Setting = USUAL) -> Fusion:
    """E6.1 with the running diagnosis E6.4, with the sensors as calibrated."""
    return Fusion(setting.sensors or USUAL_SENSORS)
