"""Phototaxy (section 5.5): Draw(P(Vrot | Theta1 delta-phototaxy pi-phototaxy1)), every tenth of a second."""

from brp import P
from brp.programs.phototaxy import Theta1, Vrot, seeking
from khepera_hil.controllers.base import USUAL, Reactive, Setting, without
from khepera_hil.perception import LightBearing

__all__ = ["controller"]


def controller(setting: Setting = USUAL) -> Reactive:
    """Moves towards the light; it does not see obstacles."""
    question = (setting.taught or seeking).ask(without(P(Vrot | Theta1), setting.unknown))
    return Reactive("phototaxy", [LightBearing()], question)
