"""What an experiment is: cases to try, what the results come to, and what there is to look at."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from khepera_hil.experiments.cases import Case, Result
from khepera_hil.experiments.figures import Figure
from khepera_hil.experiments.picture import Chart, Curve, FromAbove

__all__ = ["Experiment", "Report", "Shown", "no_cases", "no_trial", "nothing_to_show"]


@dataclass
class Report:
    """What the results come to: figures, lines of text (tables) beside them, and what is drawn of them."""

    figures: list[Figure]
    lines: list[str] = field(default_factory=list)
    charts: list[Chart] = field(default_factory=list)
    curves: list[Curve] = field(default_factory=list)
    title: str = ""
    """Over the picture; empty: what the experiment is about."""
    columns: int = 2
    """Charts and curves beside each other."""


@dataclass
class Shown:
    """What a run leaves to look at: its files, and where everything was."""

    files: list[Path] = field(default_factory=list)
    pictures: list[FromAbove] = field(default_factory=list)


def nothing_to_show(folder: Path) -> Shown:
    """For an experiment of which no run is recorded."""
    return Shown()


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
    show: Callable[[Path], Shown] = nothing_to_show
    """Records a run in a folder, which is looked at beside the figures."""
