"""What somebody outside sees and orders, tick by tick; on a robot of flesh and bone there is nobody."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

from khepera_hil.orders import Order
from khepera_hil.recording import Pose, Tick

__all__ = ["Sight", "Staged", "Witness"]


class Witness(Protocol):
    """Somebody who sees the robot from outside: the emulator's world, or nobody (metres, radians)."""

    def pose(self) -> Pose:
        """The robot's true pose."""

    def poses(self) -> Mapping[str, Pose]:
        """The true poses of everything that moves or can be moved, the robot (``robot``) among it."""

    def heard_alarm(self) -> None:
        """The program sounded its alarm."""

    def orders(self) -> Sequence[tuple[str, bool]]:
        """The operator's orders since the last time, and whether each is switched on."""


class Sight:
    """Notes the robot's pose in each tick, and those of other things when they have changed."""

    def __init__(self, witness: Witness | None) -> None:
        self._witness = witness
        self._told: dict[str, Pose] = {}
        self._seen: dict[str, Pose] = {}  # the same, not rounded

    def note(self, tick: Tick) -> None:
        """Fill ``tick.pose`` and ``tick.moved``."""
        if self._witness is None:
            return
        tick.pose = _rounded(self._witness.pose())
        for name, pose in self._witness.poses().items():
            if name == "robot" or self._seen.get(name) == pose:
                continue
            self._seen[name] = pose
            seen = _rounded(pose)
            if self._told.get(name) != seen:
                self._told[name] = tick.moved[name] = seen

    def tell(self, tick: Tick) -> None:
        """What can be heard outside of what happened in the tick."""
        if self._witness is not None and any(level == "alarm" for level, _ in tick.events):
            self._witness.heard_alarm()


class Staged:
    """The orders of a scenario's operator, who belongs to the world."""

    def __init__(self, witness: Witness) -> None:
        self._witness = witness

    def take(self) -> list[Order]:
        """Those that came since the last call."""
        return [Order(f"{order} {'on' if on else 'off'}") for order, on in self._witness.orders()]


def _rounded(pose: Pose) -> Pose:
    """To a hundredth of a millimetre, and as much of an angle: what is below would only fill the log."""
    return round(pose[0], 5), round(pose[1], 5), round(pose[2], 5)
