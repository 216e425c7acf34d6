"""Readings of real Kheperas' sensors, to hold the emulator's closed forms against.

Averages of published recordings, over the eight sensors and both sides. Rows are the thing's distance from
the body's edge in mm (the recorded robot's radius is 27.5 mm); columns are degrees.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from khepera_hil.world.lights import Lamp
from khepera_hil.world.scene import Scene
from khepera_hil.world.sensors import GAIN_SPREAD, POINTINGS, SENSOR_HEIGHT, Sensors
from khepera_hil.world.shapes import Shape, box, disc

__all__ = ["CYLINDER", "LIGHT", "WALL", "light", "light_rms", "printed", "proximity", "proximity_rms", "rms"]

_BODY = 27.5
_BACKGROUND = 2.6
"""What a sensor that sees nothing answers on average."""

# Evorobot's khepera-wall.sample and khepera-cylinder.sample (in snolfi/evorobotpy2): columns are the bearing
# of the thing less the bearing at which that sensor sees most. The cylinder's radius fits 26 mm.
WALL = {
    5: (1023, 1023, 1023, 1023, 1010, 720, 188, 19),
    9: (1023, 1023, 1023, 1011, 847, 406, 83, 3),
    13: (1023, 1023, 1023, 929, 585, 180, 24, 2),
    15: (1023, 1017, 995, 821, 415, 125, 18, 4),
    17: (988, 978, 897, 615, 278, 68, 6, 3),
    19: (908, 877, 735, 446, 185, 40, 8, 3),
    21: (806, 737, 584, 338, 128, 29, 2, 3),
    23: (654, 586, 438, 244, 66, 5, 4, 3),
    25: (449, 383, 264, 130, 39, 8, 2, 3),
    27: (295, 260, 174, 75, 16, 3, 2, 2),
    31: (166, 140, 80, 36, 4, 3, 1, 2),
    35: (69, 50, 23, 12, 3, 3, 3, 3),
    39: (20, 16, 6, 4, 2, 3, 4, 2),
    43: (2, 2, 3, 2, 3, 4, 2, 3),
}
CYLINDER = {
    5: (1023, 1023, 1023, 722, 57, 4),
    9: (1023, 1023, 999, 397, 30, 3),
    13: (1007, 981, 666, 103, 5, 3),
    17: (806, 645, 300, 30, 3, 2),
    21: (394, 285, 84, 3, 3, 3),
    25: (104, 68, 20, 4, 2, 4),
    29: (37, 24, 9, 4, 2, 3),
    33: (6, 3, 3, 2, 3, 2),
}
_CYLINDER_RADIUS = 26.0

# MISC/light.sam (in lekanlanihun/PhD_Active_Vision_System_Simulator): columns are the lamp's bearing less the
# sensor's direction. Converted to the robot's counts by 511 (1 - v / 1023).
LIGHT = {
    13: (79, 88, 163, 275, 370, 433, 465, 489, 489),
    33: (65, 66, 74, 216, 398, 443, 464, 487, 492),
    73: (72, 75, 91, 227, 410, 470, 480, 491, 494),
    93: (86, 95, 163, 290, 414, 475, 483, 492, 494),
    113: (163, 188, 250, 342, 431, 478, 485, 493, 491),
    133: (272, 285, 320, 379, 439, 485, 488, 494, 496),
    173: (350, 358, 380, 417, 458, 485, 490, 494, 495),
    213: (396, 398, 417, 441, 468, 489, 493, 494, 496),
    253: (429, 431, 443, 458, 475, 493, 493, 497, 496),
    313: (450, 455, 461, 470, 485, 492, 497, 496, 496),
    393: (471, 469, 475, 482, 488, 495, 497, 496, 493),
    513: (482, 485, 485, 489, 491, 495, 497, 496, 500),
}
_LIGHT_BEARINGS = (0, 15, 30, 45, 60, 75, 90, 135, 180)
_LAMP = Lamp("bulb", 0.0, 0.0, height=45.9, intensity=1.13)  # as fitted

_QUANTILES = [NormalDist().inv_cdf((place + 0.5) / 8) for place in range(8)]
_HERE = [(0.0, 0.0, 0.0)]


Cells = dict[int, list[tuple[float, float]]]
"""By distance (mm): measured and emulated value of each column, in counts."""


def proximity() -> dict[str, Cells]:
    """Proximity at the wall and at the cylinder, counts of 1023.

    A cell is the mean over eight sensors and both sides, without noise. The gains are spread as a robot's
    are (quantiles of the distribution that they are drawn from); a sensor's own peak is where it looks
    strongest at a wall 21 mm away.
    """
    sensors = Sensors(np.exp(GAIN_SPREAD * np.array(_QUANTILES)), np.zeros(8))
    degrees = np.arange(-180.0, 180.0)
    near = np.array([_reflected(sensors, _wall(21, bearing)) for bearing in degrees])
    peaks = degrees[near.argmax(0)]
    return {
        name: {
            distance: [
                (measured, _proximity(sensors, peaks, make, distance, 10.0 * column))
                for column, measured in enumerate(row)
            ]
            for distance, row in table.items()
        }
        for name, table, make in (("wall", WALL, _wall), ("cylinder", CYLINDER, _cylinder))
    }


def light() -> dict[str, Cells]:
    """The same for ambient light, counts of 511."""
    cells = {
        distance: [
            (float(measured), _light(distance, bearing))
            for bearing, measured in zip(_LIGHT_BEARINGS, row, strict=True)
        ]
        for distance, row in LIGHT.items()
    }
    return {"lamp": cells}


def rms(tables: dict[str, Cells]) -> float:
    """Root of the mean squared error over all cells of the tables, counts."""
    pairs = np.array([pair for cells in tables.values() for row in cells.values() for pair in row])
    return math.sqrt(np.square(pairs[:, 1] - pairs[:, 0]).mean())


def proximity_rms() -> float:
    """:func:`rms` of :func:`proximity`."""
    return rms(proximity())


def light_rms() -> float:
    """:func:`rms` of :func:`light`."""
    return rms(light())


def printed(tables: dict[str, Cells]) -> str:
    """Cell by cell: emulated less measured, then the root of the mean squared error."""
    lines = []
    for name, cells in tables.items():
        lines.append(f"{name}: emulated less measured; rows mm, columns degrees as in benchmarks/measured.py")
        for distance, row in cells.items():
            lines.append(f"{distance:>6} " + " ".join(f"{emulated - told:+7.1f}" for told, emulated in row))
    return "\n".join([*lines, f"root mean square {rms(tables):.2f}"])


def _proximity(
    sensors: Sensors, peaks: NDArray[np.float64], make: Callable[[float, float], Shape], distance: float, off: float
) -> float:
    values = [
        _reflected(sensors, make(distance, peaks[sensor] + side * off))[sensor]
        for sensor in range(8)
        for side in (-1, 1)
    ]
    return float(np.clip(values, _BACKGROUND, 1023).mean())


def _light(distance: float, off: float) -> float:
    values = []
    for sensor, pointing in enumerate(POINTINGS):
        for side in (-1, 1):
            x, y = _place(_BODY + distance, math.degrees(pointing) + side * off)
            lamp = replace(_LAMP, x=x, y=y)
            sensors = Sensors(np.ones(8), np.zeros(8))
            values.append(sensors.light(_seen(), _HERE, [(lamp, [lamp.intensity] * 8)])[sensor])
    return float(np.mean(values))


def _reflected(sensors: Sensors, shape: Shape) -> NDArray[np.float64]:
    seen = sensors.proximity(_seen(shape), _HERE)
    return np.full(8, _BACKGROUND) if seen is None else seen


def _seen(*shapes: Shape) -> Scene:
    return Scene(shapes, SENSOR_HEIGHT)


def _place(distance: float, bearing: float) -> tuple[float, float]:
    return distance * math.cos(math.radians(bearing)), distance * math.sin(math.radians(bearing))


def _wall(distance: float, bearing: float) -> Shape:
    x, y = _place(_BODY + distance + 10, bearing)
    return box("wall", "wall", 20, 4000, (x, y, math.radians(bearing)), 100)


def _cylinder(distance: float, bearing: float) -> Shape:
    x, y = _place(_BODY + distance + _CYLINDER_RADIUS, bearing)
    return disc("cylinder", "fixed", _CYLINDER_RADIUS, (x, y, 0.0), 100)
