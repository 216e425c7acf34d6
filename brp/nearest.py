"""What was never observed answers as the nearest that was: a rule that forms identified cell by cell share.

A cell is one combination of values of what is right of the bar.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brp.errors import SpecificationError
from brp.functions import Function
from brp.variables import Variable, text

__all__ = ["Nearest", "nearest"]

ROWS = 4_000_000
"""How many distances are held at a time."""


@dataclass(frozen=True)
class Nearest:
    """A cell that no sample visited answers as the nearest one that was visited.

    Distance is Euclidean in the values (in the places, for words), each variable stretched by its ``scale`` (by
    name; 1 unless told). ``within`` is a function of some of the given variables, by name: the nearest cell is
    looked for among those for which it returns the same, and among all of them only when none of these was
    visited. Measured on taught behaviours: nothing else that was tried works as well.
    """

    scale: Mapping[str, float] = field(default_factory=dict)
    within: Callable[..., Any] | None = None

    def __repr__(self) -> str:
        said = [f"scale={dict(self.scale)}"] if self.scale else []
        said += [f"within={self.within!r}"] if self.within is not None else []
        return f"Nearest({', '.join(said)})"


def nearest(
    visited: NDArray[np.bool_], given: tuple[Variable, ...], rule: Nearest, what: str
) -> tuple[NDArray[np.intp], ...]:
    """For every cell the visited one that answers for it, as an index array for each given variable.

    ``visited`` has an axis for each of ``given`` and is not false everywhere; ``what`` names the rule in a refusal.
    """
    if not given:
        return ()
    foreign = [name for name in rule.scale if name not in {v.name for v in given}]
    if foreign:
        raise SpecificationError(f"{what} scales {text(foreign)}, which it is not given; it has {text(given)}")
    axes = [
        (v.numbers if v.numeric else np.arange(len(v), dtype=np.float64)) * rule.scale.get(v.name, 1.0)
        for v in given
    ]
    at = np.stack([axis.ravel() for axis in np.meshgrid(*axes, indexing="ij")], axis=1)
    seen = np.flatnonzero(visited)
    region = _regions(given, rule, what)
    answer = np.arange(visited.size)
    missing = np.flatnonzero(~visited.ravel())
    step = max(1, ROWS // (len(seen) * len(given)))
    for start in range(0, len(missing), step):
        cells = missing[start : start + step]
        distance = ((at[cells, None, :] - at[None, seen, :]) ** 2).sum(axis=2)
        elsewhere = region[cells, None] != region[None, seen]
        distance[elsewhere & ~elsewhere.all(axis=1)[:, None]] = np.inf
        answer[cells] = seen[distance.argmin(axis=1)]
    return tuple(np.unravel_index(answer.reshape(visited.shape), visited.shape))


def _regions(given: tuple[Variable, ...], rule: Nearest, what: str) -> NDArray[np.intp]:
    shape = tuple(map(len, given))
    if rule.within is None:
        return np.zeros(shape, dtype=np.intp).ravel()
    function = Function(rule.within, given, what)
    numbers: dict[Any, int] = {}
    rows = np.array([numbers.setdefault(row, len(numbers)) for row in function.rows()], dtype=np.intp)
    rows = rows.reshape([len(v) if v in function.used else 1 for v in given])
    return np.broadcast_to(rows, shape).ravel()
