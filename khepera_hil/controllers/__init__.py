"""The paper's programs on a robot, by the name that the command line knows them by."""

from collections.abc import Callable, Mapping
from types import MappingProxyType

from khepera_hil.controllers import avoid, home, phototaxy
from khepera_hil.controllers.base import Commanded, Controller, Decision

__all__ = ["PROGRAMS", "Commanded", "Controller", "Decision"]

PROGRAMS: Mapping[str, tuple[str, Callable[[], Controller]]] = MappingProxyType(
    {
        "avoid": ("wander and avoid obstacles (section 5)", avoid.controller),
        "phototaxy": ("drive towards the light, blind to obstacles (section 5.5)", phototaxy.controller),
        "home": ("go back to the lit base, avoiding obstacles (section 7)", home.controller),
    }
)
"""What each does, in a line, and how it is made."""
