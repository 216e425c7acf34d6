"""Section 10.1: the two speeds of each movement. The paper names the variables and prints no more.

    Vrot, Dir, Prox, H as in section 7; Move as in `brp.programs.move`; Theta2 as in section 6
    Vtrans, Vtrans_c in {0, ..., 10}
    DirL in {-10, ..., 10}, ProxL in {0, ..., 15}

    P(Vrot Vtrans Move H Dir Prox DirL ProxL Vtrans_c Theta2 | pi-speed)
    = P(Move | pi-speed) P(Dir | pi-speed) P(Prox | pi-speed) P(DirL | pi-speed) P(ProxL | pi-speed)
      P(Vtrans_c | pi-speed) P(Theta2 | pi-speed) P(H | Prox pi-speed)
      P(Vtrans | Move Prox ProxL Vtrans_c pi-speed) P(Vrot | Move H Dir Prox DirL ProxL Theta2 pi-speed)

    P(Move | pi-speed) = ... = P(Theta2 | pi-speed) = Uniform
    P(H | Prox pi-speed) = P(H | Prox pi-home)

    P(Vtrans | stop ... pi-speed) = P(Vtrans | blow ... pi-speed) = Dirac(0)
    P(Vtrans | Move ... pi-speed) = G(s(Move, Prox, ProxL) Vtrans_c, 0.7)

    P(Vrot | stop ... pi-speed)   = P(Vrot | blow ... pi-speed) = Dirac(0)
    P(Vrot | wander ... pi-speed) = P(Vrot | Dir Prox delta-avoid pi-obstacle), or away from a light that glares
    P(Vrot | follow ... pi-speed) = P(Vrot | Dir Prox delta-follow pi-obstacle)
    P(Vrot | home ... pi-speed)   = P(Vrot | Dir Prox Theta2 H pi-home)
    P(Vrot | approach ... pi-speed): towards DirL, near it past what stands beside, or
                                     P(Vrot | Dir Prox delta-avoid pi-obstacle)

    P(Vrot Vtrans | Move H Dir Prox DirL ProxL Vtrans_c Theta2 pi-speed)
    = P(Vtrans | Move Prox ProxL Vtrans_c pi-speed) P(Vrot | Move H Dir Prox DirL ProxL Theta2 pi-speed)

The decomposition and the forms are ours. Vtrans_c is the speed that the operator has set. DirL and ProxL are to the
brightness that the six sensors in front see what Dir and Prox are to obstacles; they aim at a flame in front, while
Theta2 sees all round. H is known in this question: the watchman's sum over H makes the mixture.
"""

from brp.description import Specification
from brp.forms import Dirac, Switch, Uniform
from brp.gaussian import Gaussian
from brp.programs.home import H, command2, home2
from brp.programs.move import Move
from brp.programs.obstacle import Dir, Prox, Vrot, avoid, avoidance_mean, follow
from brp.programs.sensor import Theta2
from brp.variables import P, Variable

__all__ = ["Dir", "DirL", "H", "Move", "Prox", "ProxL", "Theta2", "Vrot", "Vtrans", "Vtrans_c"]
__all__ += ["pi_speed", "speed", "speeding"]

Vtrans = Variable("Vtrans", range(11))
Vtrans_c = Variable("Vtrans_c", range(11))
DirL = Variable("DirL", range(-10, 11))
ProxL = Variable("ProxL", range(16))

FAR = tuple(range(12))
NEAR = tuple(range(12, 16))
"""Values of ProxL: from 12 on, some 120 mm from a flame, what is ahead is taken for it and not for an obstacle: its
light shows in the proximity sensors. From 8 on, as was first proposed, the base's lamp shines over what stands
before the robot, which then pushes."""


def past_what_is_beside(Dir: int, DirL: int) -> float:
    """Near a flame: towards it, unless something stands elsewhere at the side; then a little away from that."""
    return DirL if abs(Dir) <= 2 or abs(Dir - DirL) <= 5 else -3 if Dir > 0 else 3


def slower_near_walls(Prox: int, Vtrans_c: int) -> float:
    """Homing slows down near what it may have to avoid."""
    return max(0.3, 1 - 0.06 * Prox) * Vtrans_c


def up_to_the_flame(ProxL: int, Vtrans_c: int) -> float:
    """The approach slows down before the flame, and stops at it.

    12 is near saturation, some 120 mm from a flame, and the turbine reaches 60: to stop there, as was first
    proposed, is to blow in vain. 15 is more than light alone ever makes of ProxL; who computes it says by it that
    the rest of the way was driven.
    """
    return (1 if ProxL < 12 else 0.5 if ProxL < 15 else 0) * Vtrans_c


GLARE = (12, 13)
"""Values of ProxL some 280 mm before the base's lamp, or 120 mm before a flame."""
IN_THE_LIGHT = (14, 15)


def away_from_the_light(Dir: int, Prox: int, DirL: int) -> float:
    """Wandering turns away from a light that glares as from an obstacle: by tables 3 and 5 a patrol that strays
    into its base soon idles there, and then does so over and over, for minutes, however much its vigil is wanted.
    """
    if Prox >= 4:
        return avoidance_mean(Dir, Prox)
    side = 1 if DirL > 0 else -1
    return -side * (10.0 if abs(DirL) <= 5 else 4.0)


def out_of_the_light(ProxL: int, Vtrans_c: int) -> float:
    """In its base a patrol makes haste: there it idles again after a second or so."""
    return (2 if ProxL in IN_THE_LIGHT else 1) * Vtrans_c


towards_the_light = Gaussian(lambda DirL: DirL, deviation=2)
past_it = Gaussian(past_what_is_beside, deviation=2)
from_the_light = Gaussian(away_from_the_light, deviation=1)

pi_speed = Specification(
    {
        P(Move): Uniform(),
        P(Dir): Uniform(),
        P(Prox): Uniform(),
        P(DirL): Uniform(),
        P(ProxL): Uniform(),
        P(Vtrans_c): Uniform(),
        P(Theta2): Uniform(),
        P(H | Prox): command2,
        P(Vtrans | Move, Prox, ProxL, Vtrans_c): Switch(
            Move,
            {
                ("stop", "blow"): Dirac(0),
                "wander": Gaussian(out_of_the_light, 0.7),
                "follow": Gaussian(lambda Vtrans_c: 0.6 * Vtrans_c, 0.7),
                "home": Gaussian(slower_near_walls, 0.7),
                "approach": Gaussian(up_to_the_flame, 0.7),
            },
        ),
        P(Vrot | Move, H, Dir, Prox, DirL, ProxL, Theta2): Switch(
            Move,
            {
                ("stop", "blow"): Dirac(0),
                "wander": Switch(ProxL, {FAR: avoid, GLARE: from_the_light, IN_THE_LIGHT: avoid}),
                "follow": follow,
                "home": home2,
                "approach": Switch(
                    H,
                    {
                        "phototaxy": towards_the_light,
                        "avoidance": Switch(ProxL, {FAR: avoid, NEAR: past_it}),
                    },
                ),
            },
        ),
    },
    name="pi-speed",
)

speeding = pi_speed.identify()

speed = speeding.ask(P(Vrot, Vtrans | Move, H, Dir, Prox, DirL, ProxL, Vtrans_c, Theta2))
