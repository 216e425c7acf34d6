"""Section 6.3: sensor fusion. The bearing of the light from eight light sensors.

    L1, ..., L8 in {0, ..., 511}, 512 values                                  [S6.5]
    Theta2 in {-170, ..., 180}, 36 values

    P(Theta2 L1 ... L8 | Delta pi-fusion)                                     [S6.6]
    = P(Theta2 | pi-fusion) Product_i P(Li | Theta2 Delta pi-fusion)

    P(Theta2 | pi-fusion)          = Uniform                                  [S6.7]
    P(Li | Theta2 Delta pi-fusion) = P(Li | Theta2 pi-sensor)                 [S6.8]

    P(Theta2 | l1 ... l8 pi-fusion) = 1/Sigma Product_i P(li | Theta2 pi-sensor)                   [E6.2]
    P(Theta2 | l1 l2 pi-fusion)     = 1/Sigma P(l1 | Theta2 pi-sensor) P(l2 | Theta2 pi-sensor)    [E6.3]
    P(l1 | l2 ... l8 pi-fusion)     = 1/Sigma Sum_Theta2 Product_i P(li | Theta2 pi-sensor)        [E6.4]

L1..L8 are what the robot sent. The sensor model knows no distance: it expects the full swing of a sensor that a
near lamp lights. On a measured Khepera the answer is 8 degrees off with the lamp at 13 to 73 mm, 16 at 133 mm and
54 to 72 degrees from 193 mm on. `locate_scaled` asks the same of N1..N8, the readings of one frame stretched so
that the brightest is 0 and the darkest 511: 7 to 21 degrees off to 493 mm. Whoever computes them does not ask when
the eight differ by less than 25: there is no light then. N1..N8 are no longer independent given Theta2 (a broken
sensor stretches all others), so E6.4 is for L1..L8; or for the model in `brp.programs.level`.
"""

from collections.abc import Sequence

from brp.description import Specification
from brp.forms import Uniform
from brp.programs.sensor import BEARINGS, Li, Theta2, sensor
from brp.question import Question
from brp.variables import P, Variable

__all__ = ["L", "N", "Theta2", "fusing", "fusing_scaled", "locate", "locate_scaled", "out_of_order", "pi_fusion"]

# [S6.5]
L = tuple(Variable(f"L{i}", range(512)) for i in range(1, 9))
N = tuple(Variable(f"N{i}", range(512)) for i in range(1, 9))

SENSORS = tuple(sensor(theta).ask(P(Li | Theta2)) for theta in BEARINGS)


def pi_fusion(readings: Sequence[Variable]) -> Specification:
    """The preliminary knowledge, over L1..L8 or N1..N8."""
    # [S6.6] at the left; [S6.7] and [S6.8] at the right.
    return Specification(
        {
            P(Theta2): Uniform(),
            **{P(R | Theta2): model.renamed({Li: R}) for R, model in zip(readings, SENSORS, strict=True)},
        },
        name="pi-fusion",
    )


fusing = pi_fusion(L).identify()  # "As there are no free parameters in pi-fusion, no identification is required."
fusing_scaled = pi_fusion(N).identify()

locate = fusing.ask(P(Theta2 | L))  # [E6.2]
locate_scaled = fusing_scaled.ask(P(Theta2 | N))


def out_of_order(i: int) -> Question:
    """[E6.4] for sensor ``i`` of 1..8: a reading that stays improbable is that of a sensor out of order."""
    return fusing.ask(P(L[i - 1] | L[: i - 1], L[i:]))
