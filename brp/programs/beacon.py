"""A variant of section 6.3 for a lamp that may be far, or out of sight: pi-beacon, by which the watchman homes.

    P(Theta2 Level L1 ... L8 | pi-beacon)
    = P(Level | pi-beacon) P(Theta2 | Level pi-beacon) Product_i P(Li | Theta2 Level pi-beacon)

    P(Level | pi-beacon)            = Uniform
    P(Theta2 | Level = 0 pi-beacon) = Dirac(0)
    P(Theta2 | Level > 0 pi-beacon) = Uniform
    P(Li | Theta2 Level pi-beacon)  = P(Li | Theta2 Level pi-sensor)

    P(Li | Theta2 Level pi-sensor)
    = .98 G(500 - 418 s, sigma(s)) + .02 Uniform,  s = min(1, Level (K(Theta2, theta_i) + .04))

Not in the paper, whose pi-fusion expects the full swing of a sensor that a near lamp lights: from 200 mm on its
answer is more than 50 degrees off (`brp.programs.fusion`), and a robot that asks it across its arena does not come
home. Here the light has a strength, which is summed out; sensors saturate; a uniform share keeps a broken one from
being believed.

Level = 0 is that no lamp is seen. Then there is no bearing, and straight on is where to look for one: that is what
P(Theta2 | Level = 0) says, in place of a threshold on the readings and a value for what is below it. A bearing that
is merely unknown would make the robot turn about on the spot, in a shadow for ever.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brp.description import Description, Specification
from brp.forms import Dirac, Switch, Table, Uniform
from brp.programs.fusion import L
from brp.programs.sensor import BEARINGS, Li, Theta2
from brp.variables import P, Variable

__all__ = ["L", "Level", "Theta2", "beaconing", "locate_beacon", "pi_beacon"]

DARK, SWING, NOISE = 500.0, 418.0, 4.4
"""What a measured sensor reads without light, how far it falls, and the deviation of its readings."""

LEAK = 0.04  # of the light reaches a sensor that looks away
SHARE = 0.08  # of the fall in the deviation: K is not quite a real sensor's lobe
UNIFORM = 0.02
FLANK = 4.5  # degrees: half a step of Theta2, and as much for how a sensor is mounted
STRENGTHS = np.concatenate([[0.0], 0.04 * 1.5 ** np.arange(15)])
"""The light's strength at the robot, by Level; 1 saturates a sensor that faces it."""

Level = Variable("Level", range(len(STRENGTHS)))


def lit(theta: int, bearings: NDArray[np.float64]) -> NDArray[np.float64]:
    """How far down a sensor that looks to ``theta`` is, 0..1, shape (bearings, levels)."""
    off = np.abs((bearings - theta + 180) % 360 - 180)
    K = 1 - 1 / (1 + np.exp(-4 * 0.022 * (off - 50)))
    shares: NDArray[np.float64] = np.minimum(1, STRENGTHS * (K[:, None] + LEAK))
    return shares


def sensor(theta: int) -> Description:
    """pi-sensor of a light of any strength, for the sensor that looks to ``theta`` degrees."""
    bearings = Theta2.numbers
    s = lit(theta, bearings)
    slope = np.abs(lit(theta, bearings + 3) - lit(theta, bearings - 3)) / 6 * FLANK
    deviation = np.sqrt(NOISE**2 + (SWING * SHARE * np.where(s < 1, s, 0.25)) ** 2 + (SWING * slope) ** 2)
    bell = np.exp(-0.5 * ((np.arange(512)[:, None, None] - (DARK - SWING * s)) / deviation) ** 2)
    shares = (1 - UNIFORM) * bell / bell.sum(axis=0) + UNIFORM / 512
    return Specification(
        {P(Theta2): Uniform(), P(Level): Uniform(), P(Li | Theta2, Level): Table(shares)}, name="pi-sensor"
    ).identify()


pi_beacon = Specification(
    {
        P(Level): Uniform(),
        P(Theta2 | Level): Switch(Level, {0: Dirac(0), tuple(Level.values[1:]): Uniform()}),
        **{
            P(R | Theta2, Level): sensor(theta).ask(P(Li | Theta2, Level)).renamed({Li: R})
            for R, theta in zip(L, BEARINGS, strict=True)
        },
    },
    name="pi-beacon",
)

beaconing = pi_beacon.identify()

locate_beacon = beaconing.ask(P(Theta2 | L))
