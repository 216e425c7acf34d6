"""Section 10.1: whether the robot is at its base. The paper names the variables and prints no more.

    Px1, ..., Px8 in {0, ..., 1023}, 1024 values; L1, ..., L8 in {0, ..., 511}, 512 values
    Base in {true, false}

    P(Base Px1 ... Px8 L1 ... L8 | Delta pi-base)
    = P(Base | pi-base) Product_i P(Pxi | Base Delta pi-base) P(Li | Base Delta pi-base)

    P(Base | pi-base)            = Uniform
    P(Pxi | Base Delta pi-base)  = Laplace over 16 neighbourhoods
    P(Li | Base Delta pi-base)   = Laplace over 16 neighbourhoods

    P(Base | Px1 ... Px8 L1 ... L8 Delta pi-base)
    = 1/Sigma Product_i P(Pxi | Base Delta pi-base) P(Li | Base Delta pi-base)

A fusion as in section 6: Base is the cause of all sixteen readings. The decomposition and the forms are ours. The
counts are identified by driving the robot for half a minute inside its base and half a minute outside; `at_base`
stands on tables written by hand.
"""

import numpy as np
from numpy.typing import NDArray

from brp.counts import Laplace
from brp.description import Specification
from brp.forms import Table, Uniform
from brp.programs.behavior import Base
from brp.programs.fusion import L
from brp.variables import P, Variable

__all__ = ["BINS", "Base", "L", "Px", "at_base", "knowing_base", "pi_base"]

BINS = 16

Px = tuple(Variable(f"Px{i}", range(1024)) for i in range(1, 9))

pi_base = Specification(
    {
        P(Base): Uniform(),
        **{P(Pxi | Base): Laplace(bins=BINS) for Pxi in Px},
        **{P(Li | Base): Laplace(bins=BINS) for Li in L},
    },
    name="pi-base",
)

# The tables delta-base, written by hand and the same for all eight sensors: in the recess of the base the light
# comes from everywhere and walls are near. The uniform share is essential: without it three bright sensors in front
# of a lamp are a base.
bins = np.arange(BINS)


def share(weights: NDArray[np.float64], uniform: float) -> NDArray[np.float64]:
    """The weights, as probabilities, and a uniform share."""
    p: NDArray[np.float64] = (1 - uniform) * weights / weights.sum() + uniform / BINS
    return p


def bell(mean: float, deviation: float) -> NDArray[np.float64]:
    """A Gaussian over the middles of the neighbourhoods of L1..L8."""
    weights: NDArray[np.float64] = np.exp(-0.5 * ((32 * bins + 16 - mean) / deviation) ** 2)
    return weights


proximity = np.stack([share(np.exp(-0.5 * bins), 0.15), share(np.exp(-0.15 * bins), 0.3)], axis=1)
light = np.stack([share(bell(430, 70), 0.1), share(bell(200, 110), 0.1)], axis=1)

knowing_base = pi_base.identify(
    name="delta-base",
    parameters={
        **{P(Pxi | Base): Table(np.repeat(proximity / 64, 64, axis=0)) for Pxi in Px},
        **{P(Li | Base): Table(np.repeat(light / 32, 32, axis=0)) for Li in L},
    },
)

at_base = knowing_base.ask(P(Base | Px, L))
