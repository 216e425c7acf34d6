"""Noise on the sensors' own schedule: the same frame has the same noise, read once, twice or never."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["FrameNoise"]

Array = NDArray[np.float64]

_FRAMES = 64  # drawn at once, since starting a generator costs more than its numbers


class FrameNoise:
    """For each frame number, 8 standard normal and 8 uniform numbers, in any order of asking.

    Philox is counter-based: the block of frames is its counter, ``seed`` its key.
    """

    def __init__(self, seed: np.random.SeedSequence) -> None:
        self._key = seed.generate_state(2, np.uint64)
        self._block = -1
        self._normal = np.empty((_FRAMES, 8))
        self._uniform = np.empty((_FRAMES, 8))

    def frame(self, number: int) -> tuple[Array, Array]:
        """Normal and uniform numbers of frame ``number``, each of shape (8,)."""
        block, row = divmod(number, _FRAMES)
        if block != self._block:
            bits = np.random.Philox(key=self._key, counter=[0, block, 0, 0])
            generator = np.random.Generator(bits)
            self._normal = generator.standard_normal((_FRAMES, 8))
            self._uniform = generator.random((_FRAMES, 8))
            self._block = block
        return self._normal[row], self._uniform[row]
