"""P(H | Prox) learnt from a taught homing run in which H, what the teacher had in mind, was never observed.

A probability distribution on H "should then be specified or learned" (lesson 7, footnote 14). The two behaviors are
known; how the teacher weighs them at each Prox is not, and expectation and maximisation finds it (`brp.em`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brp import Description, Laplace, P, Specification, Switch, Uniform, identify_hidden
from brp.data import shipped
from brp.programs.home import Dir, H, Prox, Theta1, Vrot
from brp.programs.obstacle import avoid as avoid_by_hand
from brp.programs.obstacle import obstacle
from brp.programs.phototaxy import phototaxy1 as phototaxy_by_hand
from brp.programs.phototaxy import pi_phototaxy1
from brp.samples import Data

__all__ = ["learnt_home", "weights"]


def _specification(by_hand: bool) -> Specification:
    avoid, phototaxy = avoid_by_hand, phototaxy_by_hand
    if not by_hand:
        avoid = shipped("delta-avoid", obstacle).ask(P(Vrot | Prox, Dir))
        phototaxy = shipped("delta-phototaxy", pi_phototaxy1).ask(P(Vrot | Theta1))
    return Specification(
        {
            P(Dir): Uniform(),
            P(Prox): Uniform(),
            P(Theta1): Uniform(),
            P(H | Prox): Laplace(),
            P(Vrot | Dir, Prox, Theta1, H): Switch(H, {"avoidance": avoid, "phototaxy": phototaxy}),
        },
        name="pi-home",
    )


def learnt_home(samples: Data, *, by_hand: bool = False) -> Description:
    """pi-home with P(H | Prox) identified from columns or rows of Dir, Prox, Theta1 and Vrot.

    The two behaviors are those that were taught; or, ``by_hand``, the tables that `brp.programs` has.
    """
    # Whatever else the samples have (a raw reading, a tick) is no variable of pi-home and left alone.
    return identify_hidden(_specification(by_hand), samples, name="delta-home").description


def weights(description: Description) -> NDArray[np.float64]:
    """P(avoidance | Prox) at each of its sixteen values."""
    question = description.ask(P(H | Prox))
    return np.array([question(Prox=prox)["avoidance"] for prox in Prox.values])
