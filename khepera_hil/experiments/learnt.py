"""A watchman whose tables 2 to 7 were learnt, beside the published one, over the same nights (section 9.5).

"The a priori specification of the probability distributions of the observed variables knowing the behavior may be a
difficulty. However it is possible to learn these distributions."
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import starmap

import numpy as np

from brp import Description
from brp.derivative import numbers
from brp.programs.behavior import TABLES, Behavior
from khepera_hil.experiments.cases import Case, Result
from khepera_hil.experiments.experiment import Experiment, Report
from khepera_hil.experiments.figures import Figure, counted, mean, share
from khepera_hil.experiments.stability_effects import OUTCOMES
from khepera_hil.experiments.stability_tables import PUBLISHED, Entry, described
from khepera_hil.experiments.tabled_night import nightly

__all__ = ["experiment", "trial"]


def experiment(description: Description, seconds: float) -> Experiment:
    """Nights of so many seconds, each with both tables. The learnt ones go with the case, so that what was measured
    with others is never taken for theirs."""
    tables = {str(number): numbers(description, term).tolist() for number, term in TABLES.items()}

    def cases(seeds: Sequence[int]) -> list[Case]:
        both: list[Case] = []
        for seed in seeds:
            night: Case = {"seed": seed, "seconds": seconds}
            both += [{**night, "tables": None}, {**night, "tables": tables}]
        return both

    def report(cases: Sequence[Case], results: Sequence[Result]) -> Report:
        return Report(_figures(cases, results), _apart(tables))

    about = f"a watchman with the tables of {description} beside the published one"
    return Experiment("learnt", about, "9.5", cases, trial, report)


def trial(case: Case) -> Result:
    """One night with one of the two."""
    told = case["tables"]
    description = None
    if told is not None:
        description = described({int(number): np.array(p) for number, p in told.items()})
    return nightly(int(case["seed"]), float(case["seconds"]), description)


def _figures(cases: Sequence[Case], results: Sequence[Result]) -> list[Figure]:
    published = [one for case, one in zip(cases, results, strict=True) if case["tables"] is None]
    learnt = [one for case, one in zip(cases, results, strict=True) if case["tables"] is not None]
    lit = float(np.mean([one["score"]["fires_lit"] for one in published])) or 1.0
    figures: list[Figure] = []
    for outcome in OUTCOMES.values():
        before, after = ([outcome.value(one, lit) for one in nights] for nights in (published, learnt))
        figures += [
            mean(f"{outcome.title}: published", before),
            mean(f"{outcome.title}: learnt", after),
            mean(f"{outcome.title}: learnt less published", [b - a for a, b in zip(before, after, strict=True)]),
        ]
    for name, nights in (("published", published), ("learnt", learnt)):
        answered = [bool(one) for night in nights for one in night["answered"]]
        figures += [
            share(f"in its base within 180 s of a call: {name}", answered),
            counted(f"ticks without a decision: {name}", sum(int(one["blind"]) for one in nights)),
        ]
    return figures


def _apart(tables: dict[str, list[list[float]]]) -> list[str]:
    """How far the learnt columns are from the published ones, and the entries that differ most."""
    lines = ["total variation between learnt and published columns (0 the same, 1 nothing in common):"]
    lines.append(f"  {'':10}" + "".join(f"{value:>18}" for value in Behavior.values))
    for number in TABLES:
        apart = np.abs(np.array(tables[str(number)]) - PUBLISHED[number]).sum(axis=0) / 2
        lines.append(f"  table {number:<4}" + "".join(f"{value:18.3f}" for value in apart))
    differences = [
        (abs(tables[str(number)][row][column] - p[row, column]), Entry(number, row, column))
        for number, p in PUBLISHED.items()
        for row, column in np.ndindex(*p.shape)
    ]
    lines.append("  the entries that differ most:")

    def told(_: float, entry: Entry) -> str:
        was = PUBLISHED[entry.table][entry.row, entry.column]
        return (
            f"    {entry!s:44} published {was:.4f}, learnt {tables[str(entry.table)][entry.row][entry.column]:.4f}"
        )

    return [*lines, *starmap(told, sorted(differences, reverse=True)[:10])]
