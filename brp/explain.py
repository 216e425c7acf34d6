"""Why an answer is what it is: what each term says for or against a value."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, log2
from typing import Any

__all__ = ["Contribution", "Explanation", "bits"]


@dataclass(frozen=True)
class Contribution:
    """What one term says of a value.

    ``without`` is the probability of the value when the term is left out (counts as 1 everywhere), and ``bits``
    the logarithm to base 2 of the probability with it over that without it: positive when the term speaks for
    the value. ``at`` is the term's own probability there, where all its variables are searched or known.
    """

    term: str
    without: float
    bits: float
    at: float | None

    def __str__(self) -> str:
        at = "" if self.at is None else f"   {self.term} = {self.at:.4g}"
        return f"{self.bits:+8.3f} bits   {self.without:.4g} without {self.term}{at}"


@dataclass(frozen=True)
class Explanation:
    """The probability of a value under some evidence, and every term's part in it, the weightiest first."""

    question: str
    value: Any
    probability: float
    contributions: tuple[Contribution, ...]

    def __str__(self) -> str:
        return "\n".join(
            [f"{self.question}: {self.value} has {self.probability:.4g}", *map(str, self.contributions)]
        )


def bits(probability: float, without: float) -> float:
    """The logarithm to base 2 of one over the other; 0 when both are 0."""
    if probability == without:
        return 0.0
    if probability == 0:
        return -inf
    return inf if without == 0 else log2(probability / without)
