"""Chains and grids in numpy, written for the one question each; as `benchmarks.engine` has them."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from brp import P, Term, Variable

__all__ = ["of_chain", "of_grid"]

Array = NDArray[np.float64]
Engine = Callable[..., Array]


def of_chain(X: list[Variable], tables: Mapping[Term, Array]) -> Engine:
    """The middle given both ends: two matrices multiplied beforehand, two rows of them when asked."""
    middle = len(X) // 2

    def between(first: int, last: int) -> Array:
        """P(X[last] | X[first]), a row for each value of X[first]."""
        whole = np.eye(len(X[first]))
        for t in range(first + 1, last + 1):
            whole = whole @ tables[P(X[t] | X[t - 1])].T
        return whole

    before = between(0, middle)
    after = np.ascontiguousarray(between(middle, len(X) - 1).T)
    first, last = X[0].keyword, X[-1].keyword

    def ask(**told: int) -> Array:
        p = before[told[first]] * after[told[last]]
        answer: Array = p / p.sum()
        return answer

    return ask


def of_grid(X: list[list[Variable]], tables: Mapping[Term, Array]) -> Engine:
    """The middle given two corners: row by row from above and from below, one product of matrices a variable.

    The array that is carried has an axis for each column: of the variables of one row, and left of where the sweep
    is of the row that it goes to (coming from below: right of it).
    """
    height, width, n = len(X), len(X[0]), len(X[0][0])
    middle = height // 2, width // 2
    laid: dict[tuple[int, int], tuple[Array, Array]] = {}
    for r in range(1, height):
        for c in range(width):
            # Axes (left, above, own); in the first column nothing is left of it.
            table = tables[P(X[r][c] | X[r - 1][c], X[r][c - 1])] if c else tables[P(X[r][c] | X[r - 1][c])]
            down = np.ascontiguousarray(table.transpose(*reversed(range(table.ndim))))
            laid[r, c] = down, np.ascontiguousarray(np.swapaxes(down, -1, -2))
    top = [tables[P(X[0][c] | X[0][c - 1])].T for c in range(1, width)]

    def stepped(carried: Array, c: int, table: Array) -> Array:
        """Column ``c`` replaced, summed over what it was: by what the table makes of it and its left neighbour."""
        if not c:
            return np.tensordot(table, carried, axes=(0, 0))
        turned = np.moveaxis(carried, (c - 1, c), (0, -1))
        made = np.matmul(np.ascontiguousarray(turned).reshape(n, -1, n), table).reshape(turned.shape)
        return np.moveaxis(made, (0, -1), (c - 1, c))

    first, last = X[0][0].keyword, X[-1][-1].keyword
    others = tuple(c for c in range(width) if c != middle[1])

    def ask(**told: int) -> Array:
        above: Array = np.zeros(n)
        above[told[first]] = 1
        for table in top:
            above = above[..., None] * table
        for r in range(1, middle[0] + 1):
            for c in range(width):
                above = stepped(above, c, laid[r, c][0])
            above = above / above.max()
        below: Array = np.zeros((n,) * width)
        below[..., told[last]] = 1
        for r in range(height - 1, middle[0], -1):
            for c in reversed(range(width)):
                below = stepped(below, c, laid[r, c][1])
            below = below / below.max()
        p = (above * below).sum(axis=others)
        answer: Array = p / p.sum()
        return answer

    return ask
