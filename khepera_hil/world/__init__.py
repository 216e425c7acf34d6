"""What is physical: the arena, the robot's body and its sensors, on pymunk; knows no protocol."""

from khepera_hil.world.arena import Arena, arenas, load_arena
from khepera_hil.world.scenario import LinkFault, Order, Reset, Scenario, load_scenario, scenarios
from khepera_hil.world.world import World

__all__ = [
    "Arena",
    "LinkFault",
    "Order",
    "Reset",
    "Scenario",
    "World",
    "arenas",
    "load_arena",
    "load_scenario",
    "scenarios",
]
