"""Chance is owned: one seed for a run, one stream of random numbers for each owner (a leaf).

The names stand in a fixed order and new ones are added at the end, so that a stream does not change when
another one is added or not used.
"""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np

__all__ = ["Owner", "generator", "streams"]

Owner = Literal["robot", "start", "world", "scenario", "line", "program", "teacher"]
"""Who owns a stream: the robot's gains and mountings, the starting pose, the arena's furniture and the noise
in it, the scenario's events, faults of the line, the program's draws, the scripted teacher."""


_ROBOTS = 2**31
"""Beyond the number of any owner, so that no robot's streams are another owner's."""


def streams(seed: int, robot: int = 1) -> dict[Owner, np.random.SeedSequence]:
    """One seed sequence for each owner, spawned from ``seed`` (a non-negative integer).

    Several robots share one world; each but the first has streams of its own besides, by its number (from 1).
    """
    owners: tuple[Owner, ...] = get_args(Owner)
    root = np.random.SeedSequence(seed, spawn_key=() if robot == 1 else (_ROBOTS, robot))
    return dict(zip(owners, root.spawn(len(owners)), strict=True))


def generator(seed: int, owner: Owner, robot: int = 1) -> np.random.Generator:
    """The generator (PCG64) of one owner."""
    return np.random.Generator(np.random.PCG64(streams(seed, robot)[owner]))
