"""Section 7: behavior combination. Home by phototaxy and avoidance, with the command variable H summed out.

Dir, Prox, Theta1, Vrot as they were; H in {avoidance, phototaxy}         [S7.1]

P(Dir Prox Theta1 H Vrot | Delta pi-home)                                 [S7.2]
= P(Dir | pi-home) P(Prox | pi-home) P(Theta1 | pi-home) P(H | Prox pi-home)
  P(Vrot | Dir Prox Theta1 H pi-home)

P(Dir | pi-home) = P(Prox | pi-home) = P(Theta1 | pi-home) = Uniform      [S7.3]

P(Vrot | Dir Prox Theta1 avoidance pi-home) = P(Vrot | Dir Prox delta-avoid pi-obstacle)           [S7.4]
P(Vrot | Dir Prox Theta1 phototaxy pi-home) = P(Vrot | Theta1 delta-phototaxy pi-phototaxy1)

P(avoidance | Prox pi-home) = Sigmoid(Prox), alpha = 9, beta = 0.25       [S7.5]
P(phototaxy | Prox pi-home) = 1 - P(avoidance | Prox pi-home)

P(Vrot | Dir Prox Theta1 pi-home)                                         [E7.1]
= 1/Sigma [ P(avoidance | Prox pi-home) P(Vrot | Dir Prox delta-avoid pi-obstacle)
          + P(phototaxy | Prox pi-home) P(Vrot | Theta1 delta-phototaxy pi-phototaxy1) ]
"""

from brp.description import Specification
from brp.forms import Sigmoid, Switch, Uniform
from brp.programs.obstacle import Dir, Prox, Vrot, avoid
from brp.programs.phototaxy import Theta1, phototaxy1
from brp.programs.phototaxy2 import Theta2, phototaxy2
from brp.question import Question
from brp.variables import P, Variable

__all__ = ["Dir", "H", "Prox", "Theta1", "Theta2", "Vrot", "command", "command2", "home", "home2", "homing"]
__all__ += ["homing2", "pi_home"]

# [S7.1]
H = Variable("H", ("avoidance", "phototaxy"))


def pi_home(Theta: Variable, phototaxy: Question) -> Specification:
    """The preliminary knowledge. The page has Theta1 and phototaxy1; the watchman has Theta2 and phototaxy2."""
    # [S7.2] at the left; [S7.3], [S7.4] and [S7.5] at the right.
    return Specification(
        {
            P(Dir): Uniform(),
            P(Prox): Uniform(),
            P(Theta): Uniform(),
            P(H | Prox): Sigmoid("avoidance", alpha=9, beta=0.25),
            P(Vrot | Dir, Prox, Theta, H): Switch(H, {"avoidance": avoid, "phototaxy": phototaxy}),
        },
        name="pi-home",
    )


# "There are no free parameters in preliminary knowledge pi-home" (section 7.3).
homing = pi_home(Theta1, phototaxy1).identify()
homing2 = pi_home(Theta2, phototaxy2).identify()

home = homing.ask(P(Vrot | Dir, Prox, Theta1))  # [E7.1]
command = homing.ask(P(H | Prox))  # the bottom left of figures 9 and 10

# What the watchman asks of pi-home.
home2 = homing2.ask(P(Vrot | Dir, Prox, Theta2, H))
command2 = homing2.ask(P(H | Prox))
