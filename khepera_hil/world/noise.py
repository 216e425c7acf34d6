"""Noise on the sensors' own schedule: the same frame has the same noise, read once, twice or never."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["FrameNoise"]

Array = NDArray[np.float64]

_FRAMES = 64  # drawn at once, since starting a generator costs more than its numbers


class FrameNoise:
    """For each frame number, ``width`` standard normal and as many uniform numbers, in any order of asking.

    Philox is counter-based: the block of frames is its counter, ``seed`` its key.
    """

    def __init__(self, seed: np.random.SeedSequence, width: int = 8) -> None:
        self._key = seed.generate_state(2, np.uint64)
        self._width = width
        # Two blocks, since what is read lies in one frame and the one before.
        self._blocks: dict[int, tuple[Array, Array]] = {}

    def frame(self, number: int) -> tuple[Array, Array]:
        """Normal and uniform numbers of frame ``number``, each of shape (width,)."""
        block, row = divmod(number, _FRAMES)
        drawn = self._blocks.get(block)
        if drawn is None:
            generator = np.random.Generator(np.random.Philox(key=self._key, counter=[0, block, 0, 0]))
            size = (_FRAMES, self._width)
            drawn = generator.standard_normal(size), generator.random(size)
            if len(self._blocks) > 1:
                del self._blocks[next(iter(self._blocks))]
            self._blocks[block] = drawn
        return drawn[0][row], drawn[1][row]

    def scanned(self, scan: int) -> tuple[list[float], list[float]]:
        """The same of eight sensors that are scanned in turn, when scan ``scan`` is done (0: sensor 0's first)."""
        turn, sensor = divmod(scan, 8)
        normal, uniform = self.frame(turn + 1)  # frame 0 stood in them at power-up
        if sensor == 7:
            return normal.tolist(), uniform.tolist()
        before, uniform_before = self.frame(turn)
        cut = sensor + 1
        return (
            normal[:cut].tolist() + before[cut:].tolist(),
            uniform[:cut].tolist() + uniform_before[cut:].tolist(),
        )
