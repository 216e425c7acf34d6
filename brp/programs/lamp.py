"""A variant of section 6.3 for a lamp at any distance, and for E6.4 asked all the time: pi-lamp.

    P(Theta2 Level L1 ... L8 | Delta pi-lamp)
    = P(Theta2 | pi-lamp) P(Level | pi-lamp) Product_i P(Li | Theta2 Level Delta pi-lamp)

    P(Theta2 | pi-lamp) = P(Level | pi-lamp) = Uniform
    P(Li | Theta2 Level Delta pi-lamp) = .98 G(dark_i - swing_i s, sigma_i(s)) + .02 Uniform,
        s = min(1, gain_i Level (K(Theta2, theta_i) + .03))

Not in the paper. `brp.programs.level` lets a sensor in front of the lamp fall by any amount; here the light may
have any strength and the sensor saturates, as a real one does: a lamp that is near, or bright, lights sensors far
off its axis as fully as the one that faces it, and by .03 those that look away. Level is the light's strength at
the robot, 1 being what saturates a sensor on its axis; it is summed out.

alpha and beta of K, and the levels in the dark and in full light, can be calibrated for each sensor (section 6.2);
the usual ones are those of a measured Khepera. The deviation is the noise in the dark, a share of the swing for how
little K is a real lobe, and what half a step of Theta2 makes on K's flank. The uniform share makes the fusion
"robust to a malfunction of one of the sensors" (lesson 5).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brp.description import Description, Specification
from brp.forms import Table, Uniform
from brp.programs.fusion import L
from brp.programs.sensor import BEARINGS, Theta2
from brp.variables import P, Variable

__all__ = ["USUAL", "L", "Level", "LightSensor", "Theta2", "lamp", "model", "pi_lamp"]

LEAK = 0.03  # of the light reaches a sensor that looks away
SHARE = 0.08  # of the swing in the deviation
UNIFORM = 0.02
STEP = 4.5  # degrees: half a step of Theta2, and as much for how a sensor is mounted
STRENGTHS = 0.08 * 1.42 ** np.arange(14)  # from what is just seen to a bright lamp at hand

Level = Variable("Level", range(len(STRENGTHS)))


@dataclass(frozen=True)
class LightSensor:
    """What calibration says of a sensor: S6.4's alpha (degrees) and beta, its readings in the dark and in full
    light, its readings' standard deviation, by how many degrees it looks beside theta_i, and how much more of the
    light it sees than the others.
    """

    alpha: float = 50.0
    beta: float = 0.022
    dark: float = 497.0
    bright: float = 72.0
    deviation: float = 4.4
    beside: float = 0.0
    gain: float = 1.0

    def K(self, apart: NDArray[np.float64]) -> NDArray[np.float64]:
        """S6.4: the brightness seen of a light so many degrees off the axis."""
        off = np.abs((apart + 180) % 360 - 180)
        seen: NDArray[np.float64] = 1 - 1 / (1 + np.exp(-4 * self.beta * (off - self.alpha)))
        return seen


USUAL = (LightSensor(),) * 8


def model(sensor: LightSensor, theta: int) -> NDArray[np.float64]:
    """P(Li | Theta2 Level) of the sensor that looks to ``theta``, shape (512, 36, 14)."""

    def share(apart: NDArray[np.float64]) -> NDArray[np.float64]:
        lit: NDArray[np.float64] = np.minimum(1, sensor.gain * STRENGTHS * (sensor.K(apart)[:, None] + LEAK))
        return lit

    apart = Theta2.numbers - theta - sensor.beside
    swing = sensor.dark - sensor.bright
    seen = share(apart)
    flank = np.abs(share(apart + 3) - share(apart - 3)) / 6 * STEP
    deviation = np.sqrt(
        sensor.deviation**2 + (swing * np.where(seen < 1, SHARE * seen, SHARE / 4)) ** 2 + (swing * flank) ** 2
    )
    bell = np.exp(-0.5 * ((np.arange(512)[:, None, None] - (sensor.dark - swing * seen)) / deviation) ** 2)
    shares: NDArray[np.float64] = (1 - UNIFORM) * bell / bell.sum(axis=0) + UNIFORM / 512
    return shares


def pi_lamp(sensors: Sequence[LightSensor] = USUAL) -> Specification:
    """The preliminary knowledge, with these eight sensors."""
    return Specification(
        {
            P(Theta2): Uniform(),
            P(Level): Uniform(),
            **{
                P(R | Theta2, Level): Table(model(sensor, theta))
                for R, sensor, theta in zip(L, sensors, BEARINGS, strict=True)
            },
        },
        name="pi-lamp",
    )


def lamp(sensors: Sequence[LightSensor] = USUAL) -> Description:
    """The description that asks where the light is, and what each sensor should read."""
    return pi_lamp(sensors).identify()
