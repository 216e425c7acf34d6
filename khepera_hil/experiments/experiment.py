"""What an experiment is: cases to try, what the results come to, and what there is to look at."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from khepera_hil.experiments.cases import Case, Result
from khepera_hil.experiments.figures import Figure

__all__ = ["Experiment", "Report", "no_cases", "no_trial", "nothing_to_show"]


@dataclass
class Report:
    """What the results come to: figures, and lines of text (tables) beside them."""

    figures: list[Figure]
    lines: list[str] = field(default_factory=list)


def nothing_to_show(folder: Path) -> list[Path]:
    """For an experiment that is only figures."""
    return []


def no_cases(seeds: Sequence[int]) -> list[Case]:
    """For an experiment that is computed, and drawn from nothing."""
    return []


def no_trial(case: Case) -> Result:
    """Its trial, which is never run."""
    raise AssertionError("there are no cases")


@dataclass(frozen=True)
class Experiment:
    """``trial`` is a function of its module's own: other processes run it."""

    name: str
    about: str
    section: str
    cases: Callable[[Sequence[int]], list[Case]]
    """The cases for these seeds."""
    trial: Callable[[Case], Result]
    report: Callable[[Sequence[Case], Sequence[Result]], Report]
    show: Callable[[Path], list[Path]] = nothing_to_show
    """Makes pictures and recordings in a folder; where they are."""
