"""A teacher for the emulated robot: sees the arena from above and drives as a person does, a little clumsily.

It knows what a person knows who stands beside the arena, and nothing of Dir, Prox, Theta1 or any table. What it
wants is one rule for each behavior; what its hand does is late, shaky and no faster than a hand.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np

from khepera_hil.errors import UsageError
from khepera_hil.teaching.hand import MOST
from khepera_hil.teaching.view import Eyes, View

__all__ = ["LATE", "RULES", "SHAKE", "STEADY", "Scripted"]

LATE = 1
"""Ticks between what is seen and what the hand does."""

SHAKE = {"push": 3.5, "phototaxy": 3.5}
STEADY = 0.7
"""Standard deviation of the hand's wandering about where it is meant to be, in units of Vrot; it comes and goes
within some ticks. Who pushes or heads for a lamp is allowed more than others (`SHAKE`): a hand that never lets the
goal slip to a side never shows what to do then, and what is taught so is worse (30 of 30 discs pushed and 71 of 72
lamps reached, against 22 of 30 and 56 of 67 with a steady hand).
"""

_KEEPS = 0.6  # share of the hand's error that is still there a tick later
_SWIFT = 12.0  # units of Vrot that the hand moves in a tick at most

Rule = Callable[[View], float]


def push(view: View) -> float:
    """Towards the middle of the nearest thing that can be pushed; things far away are driven up to."""
    things = [seen for seen in view.look() if "wall" not in seen.name and "post" not in seen.name]
    if not things:
        raise UsageError("there is nothing to push in this arena: choose one with a block or a disc")
    near = things[0]
    return near.centre / 6 if near.gap < 60 else near.centre / 12


def avoid(view: View) -> float:
    """Straight on while there is room; hard away from what is near, and to the right when it is ahead."""
    near = min((seen for seen in view.look() if abs(seen.bearing) < 100), key=lambda seen: seen.gap, default=None)
    if near is None or near.gap > 40:
        return 0.0
    side = -1.0 if near.bearing > 6 else 1.0
    # What is beside the robot needs less than what is in front of it.
    front = 1.0 if abs(near.bearing) < 60 else max(0.0, 1 - (abs(near.bearing) - 60) / 40)
    return side * MOST * min(1.0, (45 - near.gap) / 15) * front


def follow(view: View) -> float:
    """Along the nearest thing, which is kept at the right, two centimetres and a half away."""
    near = view.look()[0]
    if near.gap > 80:
        return near.bearing / 9
    # Square to the right is 90 degrees; too near, and it should lie further behind.
    return (near.bearing - 90) / 6 + (near.gap - 22) / 3


def follow_left(view: View) -> float:
    """The mirror image."""
    near = view.look()[0]
    if near.gap > 80:
        return near.bearing / 9
    return (near.bearing + 90) / 6 - (near.gap - 22) / 3


def phototaxy(view: View) -> float:
    """Towards the lamp, also when it has been passed under."""
    lamp = view.lamp()
    if lamp is None:
        raise UsageError("there is no lamp in this arena: choose one with a lamp")
    return lamp.centre / 9


def home(view: View) -> float:
    """Towards the lamp, unless something is close: then away from that."""
    near = view.look()[0]
    return avoid(view) if near.gap < 24 and abs(near.bearing) < 100 else phototaxy(view)


RULES: Mapping[str, Rule] = MappingProxyType(
    {
        "push": push,
        "avoid": avoid,
        "follow": follow,
        "follow-left": follow_left,
        "phototaxy": phototaxy,
        "home": home,
    }
)
"""What is wanted, by the behavior's name."""


class Scripted:
    """The hand of somebody who follows a rule. ``chance`` is the teacher's own."""

    done = False

    def __init__(
        self,
        behavior: str,
        eyes: Eyes,
        chance: np.random.Generator,
        *,
        late: int = LATE,
        shake: float | None = None,
    ) -> None:
        self._rule = RULES[behavior]
        self._view = View(eyes)
        self._chance = chance
        self._meant: deque[float] = deque([0.0] * late, maxlen=late + 1)
        self._shake = SHAKE.get(behavior, STEADY) if shake is None else shake
        self._error = self._stick = 0.0

    def vrot(self) -> int:
        """Look, and move the hand."""
        self._meant.append(max(-MOST, min(MOST, self._rule(self._view))))
        fresh = self._shake * (1 - _KEEPS**2) ** 0.5
        self._error = _KEEPS * self._error + fresh * float(self._chance.standard_normal())
        way = self._meant[0] + self._error - self._stick
        self._stick = max(-MOST, min(MOST, self._stick + max(-_SWIFT, min(_SWIFT, way))))
        return round(self._stick)

    def close(self) -> None:
        """There is nothing to give back."""
