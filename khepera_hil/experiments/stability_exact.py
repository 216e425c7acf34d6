"""What can be had of the tables' stability without running: exact derivatives, from the engine.

By each entry's odds: of P(Behavior | Vigil Energy Base Fire Identify Behavior_t-1), over all 384 combinations of
what is known, and of the chain that it makes while the evidence stays as it is: how often Behavior changes and how
long each lasts. All are per unit of the odds' logarithm: times ln(1.5) they say what raising the odds by a half
does, as far as that is linear.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from itertools import product

import numpy as np
from numpy.typing import NDArray

from brp import Description, P, chain
from brp.derivative import towards
from brp.programs.behavior import (
    TABLES,
    Base,
    Behavior,
    Behavior_t_1,
    Energy,
    Fire,
    Identify,
    Vigil,
    behaving,
    deciding,
)
from khepera_hil.experiments.stability_tables import ENTRIES, PUBLISHED, Entry

__all__ = [
    "A_MINUTE",
    "PATROL",
    "SITUATIONS",
    "Met",
    "Situation",
    "changing",
    "dwelling",
    "kernels",
    "matters",
    "most_apart",
    "openings",
    "otherwise",
    "slopes",
]

Array = NDArray[np.float64]

Situation = tuple[bool, str, bool, bool, bool]
"""Vigil, Energy, Base, Fire, Identify."""

Met = Mapping[tuple[Situation, str], float]
"""Ticks in which a situation was met with a Behavior_t-1."""

SITUATIONS: tuple[Situation, ...] = tuple(
    product(Vigil.values, Energy.values, Base.values, Fire.values, Identify.values)  # type: ignore[arg-type]  # as words
)
"""All 64 of them, with six values of Behavior_t-1 each."""

PATROL = tuple((True, str(level), False, False, False) for level in Energy.values)
"""Out on patrol with Vigil, by Energy: the situations of ``docs/watchman.md``."""

A_MINUTE = 600
"""Ticks."""

_NOTHING = 1e-12
"""Below which a derivative is what rounding leaves of zero."""

_WITH = P(Behavior | Vigil, Energy, Base, Fire, Identify, Behavior_t_1)
_WITHOUT = P(Behavior | Vigil, Energy, Base, Fire, Identify)


def kernels(description: Description = behaving) -> Array:
    """P(Behavior | situation, Behavior_t-1): shape (64, 6, 6), rows Behavior_t-1; asked as the robot asks."""
    question = deciding(description)
    rows = [
        question(Vigil=v, Energy=e, Base=b, Fire=f, Identify=i, Behavior_t_1=last).p
        for v, e, b, f, i in SITUATIONS
        for last in Behavior_t_1.values
    ]
    return np.array(rows).reshape(len(SITUATIONS), len(Behavior), len(Behavior))


@cache
def slopes() -> Array:
    """The kernels' derivatives by each entry's odds: shape (108, 64, 6, 6). Rows that are impossible under the
    published tables are those of the question without Behavior_t-1, which is what the robot asks there."""
    p = np.array([PUBLISHED[entry.table][entry.row, entry.column] for entry in ENTRIES])
    return p[:, None, None, None] * _towards()


@cache
def openings() -> Array:
    """The same by the probability that each zero is opened to; nothing for what is no zero. A row that is
    impossible becomes possible all at once, which no derivative tells."""
    zero = np.array([PUBLISHED[entry.table][entry.row, entry.column] == 0 for entry in ENTRIES])
    return zero[:, None, None, None] * _towards()


@cache
def _towards() -> Array:
    made = []
    for table in TABLES.values():
        known = towards(behaving, _WITH, table)
        both = np.where(np.isnan(known), towards(behaving, _WITHOUT, table)[..., None], known)
        # Axes: row, column, Behavior, Vigil, Energy, Base, Fire, Identify, Behavior_t-1.
        size = both.shape[0] * both.shape[1]
        columns_first = np.moveaxis(both, 1, 0).reshape(size, len(Behavior), len(SITUATIONS), len(Behavior))
        made.append(columns_first.transpose(0, 2, 3, 1))
    found: Array = np.concatenate(made)
    found[np.abs(found) < _NOTHING] = 0
    return found


def most_apart() -> Array:
    """For each entry the greatest total variation, over all 384, per unit of its odds' logarithm; shape (108)."""
    apart: Array = (np.abs(slopes()).sum(axis=3) / 2).max(axis=(1, 2))
    return apart


def otherwise(met: Met, step: float, opened: float = 0.0) -> Array:
    """How many of the decisions that were ``met`` come out otherwise, for each entry, shape (108).

    To the first order, when the logarithm of its odds is ``step`` more, or when it is a zero that is ``opened`` to
    this probability.
    Two watchmen that draw with the same numbers differ in so many draws. Where none differs no outcome can.
    """
    moved = np.abs(step * slopes() + opened * openings()).sum(axis=3) / 2
    found: Array = np.einsum("esb,sb->e", moved, _ticks(met))
    return found


def changing(met: Met) -> tuple[float, Array]:
    """Changes of Behavior a minute in the long run of each situation, averaged over the ticks that were ``met``,
    and the derivative by each entry's odds, shape (108)."""
    share = _ticks(met).sum(axis=1)
    share /= share.sum() or 1
    found, all_slopes = kernels(), slopes()
    rate = sum(w * chain.changes(kernel, _UNIFORM) for w, kernel in zip(share, found, strict=True) if w)
    derived = np.zeros(len(ENTRIES))
    for place, w in enumerate(share):
        if w:
            derived += w * chain.changes_slopes(found[place], all_slopes[:, place], _UNIFORM)
    return A_MINUTE * float(rate), A_MINUTE * derived


def dwelling(situation: Situation) -> tuple[Array, Array]:
    """How long each Behavior lasts in a situation, in seconds, shape (6), infinite where it stays for ever; and by
    each entry's odds the relative change of that, shape (108, 6), nan where there is none."""
    place = SITUATIONS.index(situation)
    lasts = chain.dwell(kernels()[place])
    with np.errstate(invalid="ignore"):
        relative = chain.dwell_slopes(kernels()[place], slopes()[:, place]) / lasts
    return lasts * 60 / A_MINUTE, relative


def matters() -> dict[Entry, bool]:
    """Whether any answer at all depends on the entry's odds."""
    return dict(zip(ENTRIES, (most_apart() > 0).tolist(), strict=True))


def _ticks(met: Met) -> Array:
    """Shape (64, 6)."""
    ticks = np.zeros((len(SITUATIONS), len(Behavior)))
    for (situation, last), often in met.items():
        ticks[SITUATIONS.index(situation), Behavior.place(last)] += often
    return ticks


_UNIFORM = np.full(len(Behavior), 1 / len(Behavior))
