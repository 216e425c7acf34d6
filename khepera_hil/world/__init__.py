"""What is physical: the arena, the robot's body and its sensors, on pymunk; knows no protocol."""

from khepera_hil.world.arena import Arena, arenas, load_arena
from khepera_hil.world.robot import Robot, name_of
from khepera_hil.world.scenario import LinkFault, Order, Reset, Scenario, load_scenario, scenarios
from khepera_hil.world.things import MOST_ROBOTS
from khepera_hil.world.world import World

__all__ = [
    "MOST_ROBOTS",
    "Arena",
    "LinkFault",
    "Order",
    "Reset",
    "Robot",
    "Scenario",
    "World",
    "arenas",
    "load_arena",
    "load_scenario",
    "name_of",
    "scenarios",
]
