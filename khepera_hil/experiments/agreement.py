"""Whether draws agree with the distributions that they were drawn from, description by description."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from khepera_hil.recording import Tick

__all__ = ["Agreement", "Agreements"]


class Agreement:
    """Pearson's chi-square of the sums, with their covariance, since each tick has its own distribution."""

    def __init__(self) -> None:
        self.drawn: np.ndarray[Any, Any] | None = None

    def add(self, p: np.ndarray[Any, Any], place: int) -> None:
        """One draw, of value number ``place``."""
        if self.drawn is None:
            self.drawn = np.zeros(len(p))
            self.expected = np.zeros(len(p))
            self.square = np.zeros((len(p), len(p)))
        self.drawn[place] += 1
        self.expected += p
        self.square += p[:, None] * p

    def chi2(self) -> tuple[float, int]:
        """The statistic and its degrees of freedom."""
        if self.drawn is None:
            return 0.0, 0
        covariance = np.diag(self.expected) - self.square
        known = np.diag(covariance) >= 5  # of a value that is hardly ever in doubt nothing can be said
        if known.sum() < 1:
            return 0.0, 0
        some = covariance[np.ix_(known, known)]
        off = (self.drawn - self.expected)[known]
        rank = int(np.linalg.matrix_rank(some))
        return float(off @ np.linalg.pinv(some, hermitian=True) @ off), rank


class Agreements:
    """One for each description and variable that is drawn from it.

    Decided late, everything is drawn from pi-watchman. Decided early, each variable is drawn from the description
    that it is asked of, and Vrot, with Move and H known, from the one of pi-speed's subroutines that these choose.
    """

    def __init__(self) -> None:
        self.all: dict[str, Agreement] = {}

    def hear(self, tick: Tick) -> None:
        """The draws of one tick."""
        early = "H" in tick.u
        for key in tick.u:
            answer = tick.answers[key]
            for axis, (name, values) in enumerate(zip(answer.variables, answer.values, strict=True)):
                others = tuple(i for i in range(answer.p.ndim) if i != axis)
                whose = _EARLY.get(name) or _of_vrot(tick.draws) if early else f"pi-watchman, {name}"
                agreement = self.all.setdefault(whose, Agreement())
                agreement.add(answer.p.sum(axis=others) if others else answer.p, values.index(tick.draws[name]))

    def figures(self) -> dict[str, tuple[float, int]]:
        """The statistic and the degrees of freedom of each."""
        return {name: agreement.chi2() for name, agreement in self.all.items()}


_EARLY = {
    "Base": "pi-base",
    "Behavior": "pi-behavior",
    "Move": "pi-move",
    "Theta2": "pi-beacon",
    "H": "pi-home, H",
    "Vtrans": "pi-speed, Vtrans",
}


def _of_vrot(draws: Mapping[str, Any]) -> str:
    move, h = str(draws["Move"]), str(draws["H"])
    if move == "follow":
        return "pi-obstacle, delta-follow"
    if move == "approach" and h == "phototaxy":
        return "pi-speed, Vrot of an approach"
    if move == "home" and h == "phototaxy":
        return "pi-phototaxy2"
    return "pi-obstacle, delta-avoid" if move in ("wander", "home") else f"pi-speed, Vrot of {move}"
