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


def streams(seed: int) -> dict[Owner, np.random.SeedSequence]:
    """One seed sequence for each owner, spawned from ``seed`` (a non-negative integer)."""
    owners: tuple[Owner, ...] = get_args(Owner)
    return dict(zip(owners, np.random.SeedSequence(seed).spawn(len(owners)), strict=True))


def generator(seed: int, owner: Owner) -> np.random.Generator:
    """The generator (PCG64) of one owner."""
    return np.random.Generator(np.random.PCG64(streams(seed)[owner]))
