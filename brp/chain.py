"""What a variable does in the long run that is drawn again and again, given its own last value: a Markov chain.

A question P(X | X_t-1 ...) whose other known variables stay as they are is a matrix of transitions. Here are the
chain's long run, how often it changes and how long it dwells, and the derivatives of all three when those of the
transitions are known (`brp.derivative`). Times are in draws.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["changes", "changes_slopes", "dwell", "dwell_slopes", "limit", "limit_slopes"]

Array = NDArray[np.float64]

_SQUARINGS = 64
"""2 ** 64 draws are the long run: what is left of anything that decays by more than 1e-18 a draw is nothing."""


def limit(kernel: Array) -> Array:
    """Where the chain is in the long run, on average over time: a row for each first value.

    ``kernel`` has the shape (n, n), ``kernel[i, j]`` the probability of j after i; so has the limit. Rows differ
    where what the chain ends in depends on where it begins.
    """
    # The lazy chain, which stays where it is every other time, has the same long run and never beats time.
    power = (kernel + np.eye(len(kernel))) / 2
    for _ in range(_SQUARINGS):
        power = power @ power
        power /= power.sum(axis=1, keepdims=True)
    return power


def limit_slopes(kernel: Array, slopes: Array) -> Array:
    """The limit's derivatives for transitions with these: ``slopes`` and the answer have the shape (..., n, n).

    Exact as long as no zero of the kernel opens, so that the classes that the chain can end in stay apart: then the
    limit is an analytic projection of the kernel, whose derivative is P K' S + S K' P with the reduced resolvent S.
    """
    end = limit(kernel)
    n = len(kernel)
    resolvent = np.linalg.inv(np.eye(n) - kernel + end) - end
    made: Array = end @ slopes @ resolvent + resolvent @ slopes @ end
    return made


def changes(kernel: Array, start: Array) -> float:
    """How many of the draws change the value, in the long run; ``start`` is the first value's distribution (n)."""
    return float(start @ limit(kernel) @ (1 - np.diag(kernel)))


def changes_slopes(kernel: Array, slopes: Array, start: Array) -> Array:
    """Their derivatives, shape (...)."""
    end = start @ limit(kernel)
    leaving = 1 - np.diag(kernel)
    made: Array = start @ limit_slopes(kernel, slopes) @ leaving - np.einsum("i,...ii->...", end, slopes)
    return made


def dwell(kernel: Array) -> Array:
    """How many draws each value lasts on average once it is there, shape (n); infinite where it is never left."""
    with np.errstate(divide="ignore"):
        lasts: Array = 1 / (1 - np.diag(kernel))
    return lasts


def dwell_slopes(kernel: Array, slopes: Array) -> Array:
    """Their derivatives, shape (..., n); nan where a value lasts for ever."""
    leaving = 1 - np.diag(kernel)
    with np.errstate(divide="ignore", invalid="ignore"):
        made: Array = np.where(leaving > 0, np.einsum("...ii->...i", slopes) / leaving**2, np.nan)
    return made
