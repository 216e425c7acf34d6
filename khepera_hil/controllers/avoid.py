"""Obstacle avoidance (section 5): Draw(P(Vrot | Dir Prox delta-avoid pi-obstacle)), every tenth of a second."""

from brp.programs.obstacle import avoid
from khepera_hil.controllers.base import Reactive
from khepera_hil.perception import Obstacle

__all__ = ["controller"]


def controller() -> Reactive:
    """E5.2 with the data set delta-avoid."""
    return Reactive("avoid", [Obstacle()], avoid)
