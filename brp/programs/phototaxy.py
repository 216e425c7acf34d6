"""Phototaxy, mentioned in lesson 2 of section 5 and used by section 7: turn towards the light.

    Theta1 in {-170, ..., 180}, 36 values                                     [S7.1]
    Vrot in {-10, ..., 10}, 21 values

    P(Theta1 Vrot | Delta pi-phototaxy1) = P(Theta1 | pi-phototaxy1) P(Vrot | Theta1 Delta pi-phototaxy1)

    P(Theta1 | pi-phototaxy1)            = Uniform
    P(Vrot | Theta1 Delta pi-phototaxy1) = G(mu(Theta1), sigma(Theta1))

    Draw(P(Vrot | theta1 delta-phototaxy pi-phototaxy1))

Theta1 is where the light is, in degrees, 0 ahead and positive to the right. (The scanned text reads "Thetal" and
"pi-phototaxyl": the letter is a one.) The paper prints neither the decomposition nor the table.
"""

from brp.description import Specification
from brp.forms import Uniform
from brp.gaussian import Gaussian
from brp.programs.obstacle import Vrot
from brp.variables import P, Variable

__all__ = ["Theta1", "Vrot", "phototaxy1", "pi_phototaxy1", "seeking"]

Theta1 = Variable("Theta1", range(-170, 181, 10))

pi_phototaxy1 = Specification(
    {
        P(Theta1): Uniform(),
        P(Vrot | Theta1): Gaussian(),
    },
    name="pi-phototaxy1",
)


def phototaxy_mean(Theta1: int) -> int:
    """9 degrees for each unit of Vrot; a full turn from 90 degrees on."""
    return max(-10, min(10, round(10 * Theta1 / 90)))


# The table delta-phototaxy, written by hand: the deviation is that of the authors' book, the scale is ours.
seeking = pi_phototaxy1.identify(
    name="delta-phototaxy", parameters={P(Vrot | Theta1): Gaussian(phototaxy_mean, deviation=2)}
)

phototaxy1 = seeking.ask(P(Vrot | Theta1))
