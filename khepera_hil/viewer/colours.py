"""One colour for one thing, in every panel. 0xRRGGBBAA."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "DRAWN",
    "FLAME",
    "GROUND",
    "INK",
    "LAMP",
    "LATE",
    "LEFT",
    "MAIN",
    "MOVER",
    "PALETTE",
    "RIGHT",
    "ROBOT",
    "SENSORS",
    "WALL",
    "WORK",
    "faded",
    "many",
    "mixed",
    "other",
    "packed",
    "ramp",
    "shape",
]

MAIN = 0x4FC3A1FF
"""The distribution that is drawn from."""
DRAWN = 0xFF5A5FFF
"""The value that was drawn."""
INK = 0xB8C0CCFF
ROBOT = 0xE8ECF2FF
LAMP = 0xFFC940FF
LEFT = 0x6CA8FFFF
RIGHT = 0xFF9D5CFF
LATE = 0xFF7A7AFF
WORK = 0x8FD16AFF

PALETTE = (0x5AA2FFFF, 0xFFC04DFF, 0xB58CFFFF, 0xFF86B3FF, 0x76D7EAFF, 0xC5E063FF)
"""For a few-valued variable, value by value: avoidance is the first of H's, phototaxy the second."""

SENSORS = (
    0x3D6FFFFF,
    0x35B5FFFF,
    0x3DE0C8FF,
    0x7DE05AFF,
    0xE5D84CFF,
    0xFF9A3DFF,
    0xC77DFFFF,
    0x8B6BFFFF,
)
"""Clockwise from the left, as the robot answers: cold on the left, warm on the right, violet behind."""

WALL = 0x8C95A3FF
BASE = 0x3E9D6EFF
MOVABLE = 0xC98F5AFF
FLAME = 0xFF6B2BFF
MOVER = 0xD98CE0FF

GROUND = 0x0D1011FF
_GROUND = tuple((shift, GROUND >> shift & 255) for shift in (24, 16, 8))


def many(count: int) -> NDArray[np.uint32]:
    """A colour for each of ``count`` values: the palette, and beyond it darker and darker."""
    n = len(PALETTE)
    return packed(*[mixed(PALETTE[i % n], 0.75 ** (i // n)) for i in range(count)])


def shape(kind: str, movable: bool) -> int:
    """Of a thing in the arena."""
    known = {"lamp": LAMP, "base": BASE, "flame": FLAME, "mover": MOVER}
    return known.get(kind, MOVABLE if movable else WALL)


def other(number: int) -> int:
    """Of another robot, counted from 0."""
    return PALETTE[number % len(PALETTE)]


def faded(colour: int, alpha: float) -> int:
    """The same colour, more transparent."""
    return (colour & 0xFFFFFF00) | round(255 * alpha)


def packed(*colours: int) -> NDArray[np.uint32]:
    """Colours as the viewer takes them; a plain list of three or four integers would be read as channels."""
    return np.array(colours, np.uint32)


def mixed(colour: int, share: float) -> int:
    """``share`` of the colour, the rest the panels' ground; opaque, so that strokes may overlap."""
    channels = [round(share * (colour >> shift & 255) + (1 - share) * ground) for shift, ground in _GROUND]
    return channels[0] << 24 | channels[1] << 16 | channels[2] << 8 | 255


def ramp(colour: int) -> NDArray[np.uint32]:
    """256 opaque colours from the panel's ground over ``colour`` to white."""
    stops = np.array([[ground, colour >> shift & 255, 255] for shift, ground in _GROUND]).T
    at = np.linspace(0, 1, 256)
    r, g, b = (np.interp(at, [0, 0.6, 1], stops[:, i]).astype(np.uint32) for i in range(3))
    blended: NDArray[np.uint32] = (r << 24 | g << 16 | b << 8 | 255).astype(np.uint32)
    return blended
