"""The paper's programs on a robot, by the name that the command line knows them by."""

from collections.abc import Mapping
from types import MappingProxyType

from brp.programs.behavior import pi_behavior_taught
from brp.programs.obstacle import obstacle
from brp.programs.phototaxy import pi_phototaxy1
from khepera_hil.controllers import avoid, follow, fusion, home, object, phototaxy, push, watchman
from khepera_hil.controllers.base import Commanded, Controller, Decision, Learner, Program, Setting

__all__ = ["PROGRAMS", "Commanded", "Controller", "Decision", "Learner", "Program", "Setting"]

_OBSTACLE = ("Prox", "Dir")

PROGRAMS: Mapping[str, Program] = MappingProxyType(
    {
        "push": Program("push what is in front (section 5)", push.controller, _OBSTACLE, obstacle),
        "avoid": Program("wander and avoid obstacles (section 5)", avoid.controller, _OBSTACLE, obstacle),
        "follow": Program(
            "follow a contour with the object at the right (section 5)", follow.right, _OBSTACLE, obstacle
        ),
        "follow-left": Program("the same with the object at the left", follow.left, _OBSTACLE, obstacle),
        "phototaxy": Program(
            "drive towards the light, blind to obstacles (section 5.5)",
            phototaxy.controller,
            ("Theta1",),
            pi_phototaxy1,
        ),
        "fusion": Program(
            "where the light is by eight sensors, and which is broken (section 6)", fusion.controller
        ),
        "home": Program(
            "go back to the lit base, avoiding obstacles (section 7)", home.controller, ("Dir", "Prox", "Theta1")
        ),
        "object": Program(
            "go around objects and recognise them (section 8)", object.controller, _OBSTACLE, obstacle
        ),
        "watchman": Program(
            "keep watch at night (sections 9 and 10)", watchman.controller, specification=pi_behavior_taught
        ),
    }
)
"""In the order of the paper."""
