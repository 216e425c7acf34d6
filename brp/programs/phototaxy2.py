"""The twin of pi-phototaxy1 over Theta2, the bearing that the fusion of section 6 answers; the watchman's.

    P(Theta2 Vrot | Delta pi-phototaxy2) = P(Theta2 | pi-phototaxy2) P(Vrot | Theta2 Delta pi-phototaxy2)

    P(Theta2 | pi-phototaxy2)            = Uniform
    P(Vrot | Theta2 Delta pi-phototaxy2) = G(mu(Theta2), sigma(Theta2))

Theta1 is not among the variables of section 10, and homing is.
"""

from brp.description import Specification
from brp.forms import Uniform
from brp.gaussian import Gaussian
from brp.programs.obstacle import Vrot
from brp.programs.phototaxy import phototaxy_mean
from brp.programs.sensor import Theta2
from brp.variables import P

__all__ = ["Theta2", "Vrot", "phototaxy2", "pi_phototaxy2", "seeking2"]

pi_phototaxy2 = Specification(
    {
        P(Theta2): Uniform(),
        P(Vrot | Theta2): Gaussian(),
    },
    name="pi-phototaxy2",
)

# The table delta-phototaxy of `brp.programs.phototaxy`.
seeking2 = pi_phototaxy2.identify(
    name="delta-phototaxy",
    parameters={P(Vrot | Theta2): Gaussian(lambda Theta2: phototaxy_mean(Theta2), deviation=2)},
)

phototaxy2 = seeking2.ask(P(Vrot | Theta2))
