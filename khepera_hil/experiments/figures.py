"""A figure that was measured: its value, a 95 % interval, over how many, and what was to be reached."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

__all__ = ["Figure", "counted", "mean", "rate", "share", "table"]

_TAIL = 0.025


@dataclass(frozen=True)
class Figure:
    """``target`` is what was to be reached, in words (``>= 0.98``), if anything was."""

    name: str
    value: float | None
    low: float | None
    high: float | None
    n: int
    target: str | None = None
    paper: str | None = None
    """What the paper says, if it says anything."""

    @property
    def met(self) -> bool | None:
        """Whether the value reaches the target; None where there is none, or nothing was measured."""
        if self.target is None or self.value is None:
            return None
        sign, number = self.target.split()
        reach = float(number)
        if sign == ">=":
            return self.value >= reach
        return self.value <= reach if sign == "<=" else self.value == reach

    def row(self) -> dict[str, Any]:
        """As JSON."""
        return {
            "value": _rounded(self.value),
            "low": _rounded(self.low),
            "high": _rounded(self.high),
            "n": self.n,
            "target": self.target,
            "met": self.met,
        }

    def cells(self) -> list[str]:
        """As a table's cells in Markdown: name, value, interval, n, what is to be reached or the paper says."""
        between = "" if self.low is None or self.high is None else f"[{_short(self.low)}, {_short(self.high)}]"
        verdict = {True: " (reached)", False: " (**missed**)", None: ""}[self.met]
        wanted = "" if self.target is None else f"{self.target}{verdict}"
        said = "" if self.paper is None else f"paper: {self.paper}"
        # A bar would end the cell.
        name = self.name.replace(" | ", " given ")
        return [name, _short(self.value), between, str(self.n), "; ".join(part for part in (wanted, said) if part)]

    def line(self) -> str:
        """As a line of a table."""
        between = "" if self.low is None or self.high is None else f" [{_short(self.low)}, {_short(self.high)}]"
        verdict = {True: "reached", False: "NOT reached", None: ""}[self.met]
        wanted = "" if self.target is None else f"to reach {self.target}: {verdict}"
        said = "" if self.paper is None else f"the paper: {self.paper}"
        more = "; ".join(part for part in (wanted, said) if part)
        return f"  {self.name:58} {_short(self.value):>9}{between:21} n = {self.n}{'   ' if more else ''}{more}"


def share(name: str, hits: Sequence[bool], target: str | None = None, paper: str | None = None) -> Figure:
    """The share of hits, with Wilson's interval."""
    n = len(hits)
    if not n:
        return Figure(name, None, None, None, 0, target, paper)
    from scipy.stats import binomtest

    k = sum(map(bool, hits))
    interval = binomtest(k, n).proportion_ci(1 - 2 * _TAIL, method="wilson")
    return Figure(name, k / n, float(interval.low), float(interval.high), n, target, paper)


def rate(
    name: str, events: int, exposure: float, n: int, target: str | None = None, paper: str | None = None
) -> Figure:
    """Events for one unit of exposure, with the exact interval of a Poisson count."""
    if exposure <= 0:
        return Figure(name, None, None, None, n, target, paper)
    from scipy.stats import chi2

    low = chi2.ppf(_TAIL, 2 * events) / 2 if events else 0.0
    high = chi2.ppf(1 - _TAIL, 2 * events + 2) / 2
    return Figure(name, events / exposure, float(low) / exposure, float(high) / exposure, n, target, paper)


def mean(name: str, values: Sequence[float | None], target: str | None = None, paper: str | None = None) -> Figure:
    """The mean, with Student's interval."""
    known = [float(value) for value in values if value is not None and math.isfinite(value)]
    if not known:
        return Figure(name, None, None, None, 0, target, paper)
    middle = float(np.mean(known))
    if len(known) == 1:
        return Figure(name, middle, None, None, 1, target, paper)
    from scipy.stats import t

    half = float(t.ppf(1 - _TAIL, len(known) - 1) * np.std(known, ddof=1) / math.sqrt(len(known)))
    return Figure(name, middle, middle - half, middle + half, len(known), target, paper)


def counted(name: str, value: float, target: str | None = None, paper: str | None = None) -> Figure:
    """A number that is computed, and not drawn: it has no interval."""
    return Figure(name, float(value), None, None, 1, target, paper)


def table(figures: Sequence[Figure]) -> list[str]:
    """The figures as a table's lines in Markdown."""
    return [
        "| figure | measured | 95 % | n | to reach |",
        "|---|---|---|---|---|",
        *(f"| {' | '.join(figure.cells())} |".replace("|  |", "| |") for figure in figures),
    ]


def _rounded(number: float | None) -> float | None:
    return None if number is None else float(f"{number:.6g}")


def _short(number: float | None) -> str:
    return "-" if number is None else f"{number:.4g}"
