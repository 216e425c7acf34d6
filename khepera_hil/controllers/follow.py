"""Contour following (section 5, figure 4): Draw(P(Vrot | Dir Prox delta-follow pi-obstacle))."""

from brp import Gaussian, P
from brp.programs.obstacle import Dir, Prox, Vrot, following, following_mean, obstacle
from khepera_hil.controllers.base import USUAL, Reactive, Setting
from khepera_hil.controllers.nearby import reactive

__all__ = ["following_left", "left", "right"]

following_left = obstacle.identify(
    name="delta-follow-left",
    parameters={P(Vrot | Prox, Dir): Gaussian(lambda Dir, Prox: -following_mean(-Dir, Prox), deviation=1)},
)
"""The table for an object at the left: the mirror image of that for one at the right."""


def right(setting: Setting = USUAL) -> Reactive:
    """E5.2 with delta-follow: the table written by hand, or what was taught."""
    return reactive("follow", following, setting)


def left(setting: Setting = USUAL) -> Reactive:
    """The same with delta-follow-left."""
    return reactive("follow-left", following_left, setting)
