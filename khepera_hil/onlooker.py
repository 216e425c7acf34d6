"""A live view of the emulated world alone: ticks as a run's, but what they tell is the world's and no program's."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any

from khepera_hil.recording import Tick
from khepera_hil.world import World

__all__ = ["Onlooker", "shown"]

_PERIOD = 0.1


def shown(about: Mapping[str, Any], world: World) -> dict[str, Any]:
    """The manifest that the viewer's layout takes: ``about`` is what the log's start says."""
    width, depth = world.arena.size
    arena = {"name": about["arena"], "size": (width / 1000, depth / 1000), "shapes": world.shapes()}
    return {
        "program": about["robot"],
        "seed": about["seed"],
        "started": about["started"],
        "port": about["name"],
        "period_s": _PERIOD,
        "clock": "wall",
        "world": arena,
    }


class Onlooker:
    """Looks at the world every 0.1 s and hands what it saw to ``offer``, which never waits.

    Readings are the first robot's; of others it sees the poses.
    """

    def __init__(self, world: World, offer: Callable[[Tick], None]) -> None:
        self._world, self._offer = world, offer
        self._next = 0.0
        self._ticks = 0

    def watch(self, now: float) -> None:
        """Look, if it is time."""
        if now < self._next:
            return
        self._next = now + _PERIOD
        world = self._world
        left, right = world.motion.orders
        poses = world.poses()
        pose = poses.pop("robot")
        self._offer(
            Tick(
                self._ticks,
                now,
                raw={
                    "N": ",".join(["n", *map(str, world.proximity())]),
                    "O": ",".join(["o", *map(str, world.light())]),
                },
                command=(round(left), round(right)),
                wall=time.time(),
                pose=pose,
                moved=poses,
            )
        )
        self._ticks += 1
