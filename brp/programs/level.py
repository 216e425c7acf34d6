"""A variant of section 6.3 for a light whose distance is not known: pi-fusion with a hidden variable, Level.

    P(Theta2 Level L1 ... L8 | pi-level)
    = P(Theta2 | pi-level) P(Level | pi-level) Product_i P(Li | Theta2 Level pi-level)

    P(Theta2 | pi-level) = P(Level | pi-level) = Uniform
    P(Li | Theta2 Level pi-level) = .95 G(dark - Level K(Theta2, theta_i), 4.4 + .05 Level) + .05 Uniform

Not in the paper. Level is how far the sensor that faces the light falls below its reading in the dark; it is summed
out. The deviation is that of a reading in the dark, and a share of Level for how little K is the lobe of a real
sensor. The uniform share makes true of the fusion what lesson 5 claims of it, "robust to a malfunction of one of
the sensors": a Gaussian alone is certain of the wrong thing. On the light table of a measured Khepera, mean error
in degrees (the last row: one sensor stuck bright):

    lamp at mm            13   33   73  133  213  253  313  393  513
    L1..L8, plain          6    3    3   16   54   56   56   60   67
    N1..N8, scaled         3    4    4    3    4    6    7   20   71
    L1..L8, Level          5    7    5    4    5    6    8   11   43
    L1..L8, Level, stuck   6   10    8    5    6    9   12   14   54

`out_of_order` then names the broken sensor in every frame from 133 mm on, and in 86 of 100 nearer.
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
NOISE = 4.4
SHARE = 0.05  # of Level in the deviation
UNIFORM = 0.05

Level = Variable("Level", range(36, 433, 33))  # 13 values, to the 425 of a sensor in the full light


def model(theta: int) -> NDArray[np.float64]:
    """P(Li | Theta2 Level) of the sensor that looks to ``theta``, shape (512, 36, 13)."""
    seen = np.array([K(int(bearing), theta) for bearing in Theta2.numbers])
    mean = DARK - Level.numbers * seen[:, None]
    deviation = NOISE + SHARE * Level.numbers
    bell = np.exp(-0.5 * ((np.arange(512)[:, None, None] - mean) / deviation) ** 2)
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
