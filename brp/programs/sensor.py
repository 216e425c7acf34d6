"""Section 6.2: the model of one light sensor.

    Li in {0, ..., 511}, 512 values                                           [S6.1]
    Theta2 in {-170, ..., 180}, 36 values

    P(Theta2 Li | Delta pi-sensor)                                            [S6.2]
    = P(Theta2 | pi-sensor) P(Li | Theta2 Delta pi-sensor)

    P(Theta2 | pi-sensor)    = Uniform                                        [S6.3]
    P(Li | Theta2 pi-sensor) = G(K(Theta2, theta_i), sigma)                   [S6.4]

    K(Theta2, theta_i) = 1 - 1 / (1 + exp(-4 beta (|Theta2 - theta_i| - alpha)))     alpha = 45, beta = 0.03

Theta2 is the bearing of the light source, in degrees, 0 ahead and positive to the right; theta_i is where the
sensor looks, and turns the model for each of the eight.

Read so: K is in [0, 1], near 1 on the sensor's axis (figure 5), and a reading falls as light rises (section 4.1),
so the mean is 511 (1 - K). The difference of the two bearings is that of a circle. The paper gives no sigma; 40 is
equivalent to anything from 20 to 60 on a measured sensor.
"""

from math import exp

from brp.description import Description, Specification
from brp.forms import Uniform
from brp.gaussian import Gaussian
from brp.variables import P, Variable

__all__ = ["BEARINGS", "SIGMA", "K", "Li", "Theta2", "sensor"]

# [S6.1]
Li = Variable("Li", range(512))
Theta2 = Variable("Theta2", range(-170, 181, 10))

BEARINGS = (-90, -45, -10, 10, 45, 90, 175, -175)
"""theta_1 to theta_8: where the sensors of figure 3 look. The two behind are told apart by five degrees."""

SIGMA = 40


def K(Theta2: int, theta: int) -> float:
    """The brightness, in [0, 1], that a sensor looking to ``theta`` sees of a light at Theta2 [S6.4]."""
    apart = abs((Theta2 - theta + 180) % 360 - 180)
    return 1 - 1 / (1 + exp(-4 * 0.03 * (apart - 45)))


def sensor(theta: int) -> Description:
    """The description of the sensor that looks to ``theta``."""
    # [S6.2] at the left; [S6.3] and [S6.4] at the right.
    pi_sensor = Specification(
        {
            P(Theta2): Uniform(),
            P(Li | Theta2): Gaussian(lambda Theta2: 511 * (1 - K(Theta2, theta)), SIGMA),
        },
        name="pi-sensor",
    )
    return pi_sensor.identify()  # "No identification is required as there are no free parameters in pi-sensor."
