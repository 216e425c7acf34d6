"""What push, avoid and follow have in common: one specification, one question; their data differ (lesson 2)."""

from brp import Description, P
from brp.programs.obstacle import Dir, Prox, Vrot
from khepera_hil.controllers.base import Reactive, Setting, without
from khepera_hil.perception import Obstacle

__all__ = ["reactive"]


def reactive(name: str, usual: Description, setting: Setting) -> Reactive:
    """Draw(P(Vrot | Dir Prox delta pi-obstacle)) [E5.2], or with fewer sensors known [E5.3]."""
    description = setting.taught or usual
    return Reactive(name, [Obstacle()], description.ask(without(P(Vrot | Prox, Dir), setting.unknown)))
