"""A variant of section 6.3 for a light whose distance is not known: pi-fusion with a hidden variable, Level.

    P(Theta2 Level L1 ... L8 | pi-level)
    = P(Theta2 | pi-level) P(Level | pi-level) Product_i P(Li | Theta2 Level pi-level)

    P(Theta2 | pi-level) = P(Level | pi-level) = Uniform
    P(Li | Theta2 Level pi-level) = .95 G(dark - Level K(Theta2, theta_i), 8) + .05 Uniform

Not in the paper. Level is how far the sensor that faces the light falls below its reading in the dark; it is summed
out. The uniform share makes true of the fusion what lesson 5 claims of it, "robust to a malfunction of one of the
sensors": a Gaussian alone is certain of the wrong thing. On a measured Khepera from 13 to 493 mm it is 19 degrees
off on average, 24 with one sensor stuck bright, where the scaled readings of `brp.programs.fusion` are 80 off; and
E6.4 then names the broken one in every frame.
"""

import numpy as np
from numpy.typing import NDArray

from brp.description import Specification
from brp.forms import Table, Uniform
from brp.programs.fusion import L
from brp.programs.sensor import BEARINGS, K, Theta2
from brp.question import Question
from brp.variables import P, Variable

__all__ = ["DARK", "L", "Level", "Theta2", "leveling", "locate", "out_of_order", "pi_level"]

DARK = 497  # what a measured sensor reads without light
SIGMA = 8
UNIFORM = 0.05

Level = Variable("Level", range(36, 433, 33))  # 13 values, to the 425 of a sensor in the full light


def model(theta: int) -> NDArray[np.float64]:
    """P(Li | Theta2 Level) of the sensor that looks to ``theta``, shape (512, 36, 13)."""
    seen = np.array([K(int(bearing), theta) for bearing in Theta2.numbers])
    mean = DARK - Level.numbers * seen[:, None]
    bell = np.exp(-0.5 * ((np.arange(512)[:, None, None] - mean) / SIGMA) ** 2)
    shares: NDArray[np.float64] = (1 - UNIFORM) * bell / bell.sum(axis=0) + UNIFORM / 512
    return shares


pi_level = Specification(
    {
        P(Theta2): Uniform(),
        P(Level): Uniform(),
        **{P(R | Theta2, Level): Table(model(theta)) for R, theta in zip(L, BEARINGS, strict=True)},
    },
    name="pi-level",
)

leveling = pi_level.identify()

locate = leveling.ask(P(Theta2 | L))


def out_of_order(i: int) -> Question:
    """[E6.4] for sensor ``i`` of 1..8, whatever the Level."""
    return leveling.ask(P(L[i - 1] | L[: i - 1], L[i:]))
