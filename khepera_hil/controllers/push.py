"""Pushing objects (section 5): Draw(P(Vrot | Dir Prox delta-push pi-obstacle)), every tenth of a second."""

from brp.data import shipped
from brp.programs.obstacle import obstacle
from khepera_hil.controllers.base import USUAL, Reactive, Setting
from khepera_hil.controllers.nearby import reactive

__all__ = ["controller"]


def controller(setting: Setting = USUAL) -> Reactive:
    """E5.2 with delta-push, which was taught: half a minute of driving."""
    return reactive("push", setting.taught or shipped("delta-push", obstacle), setting)
