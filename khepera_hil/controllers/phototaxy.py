"""Phototaxy (section 5.5): Draw(P(Vrot | Theta1 delta-phototaxy pi-phototaxy1)), every tenth of a second."""

from brp.programs.phototaxy import phototaxy1
from khepera_hil.controllers.base import Reactive
from khepera_hil.perception import LightBearing

__all__ = ["controller"]


def controller() -> Reactive:
    """Moves towards the light; it does not see obstacles."""
    return Reactive("phototaxy", [LightBearing()], phototaxy1)
