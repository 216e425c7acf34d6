"""Obstacle avoidance (section 5): Draw(P(Vrot | Dir Prox delta-avoid pi-obstacle)), every tenth of a second."""

from brp.programs.obstacle import avoiding
from khepera_hil.controllers.base import USUAL, Reactive, Setting
from khepera_hil.controllers.nearby import reactive

__all__ = ["controller"]


def controller(setting: Setting = USUAL) -> Reactive:
    """E5.2 with delta-avoid: the table written by hand, or what was taught."""
    return reactive("avoid", avoiding, setting)
