"""From what the robot said to the paper's variables (section 4.1).

Towards a program angles are the paper's: degrees, clockwise positive, 0 ahead. This is the only place where
readings are clipped, and every clipping is counted, so that an odd reading of a real robot neither stops the
loop nor passes unseen.
"""

from khepera_hil.perception.ahead import LightAhead
from khepera_hil.perception.light import LightBearing
from khepera_hil.perception.obstacle import Obstacle
from khepera_hil.perception.odometry import Odometry
from khepera_hil.perception.readings import Need, Percept, Readings, Sense
from khepera_hil.perception.scaled import ScaledLight
from khepera_hil.perception.tour import Tour

__all__ = [
    "LightAhead",
    "LightBearing",
    "Need",
    "Obstacle",
    "Odometry",
    "Percept",
    "Readings",
    "ScaledLight",
    "Sense",
    "Tour",
]
