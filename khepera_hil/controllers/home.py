"""Homing (section 7): Draw(P(Vrot | Dir Prox Theta1 pi-home)), avoidance or phototaxy unknown."""

from brp import P
from brp.programs.home import Dir, Prox, Theta1, Vrot, command, homing
from brp.programs.obstacle import avoid
from brp.programs.phototaxy import phototaxy1
from khepera_hil.controllers.base import USUAL, Reactive, Setting, without
from khepera_hil.perception import LightBearing, Obstacle

__all__ = ["controller"]


def controller(setting: Setting = USUAL) -> Reactive:
    """E7.1. The command variable and both of its cases are recorded beside, so that each tick is figure 9."""
    return Reactive(
        "home",
        [Obstacle(), LightBearing()],
        homing.ask(without(P(Vrot | Dir, Prox, Theta1), setting.unknown)),
        {"Vrot phototaxy": phototaxy1, "Vrot avoidance": avoid, "H": command},
    )
