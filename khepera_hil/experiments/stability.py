"""How stable the watchman is "according to the values in the tables" (section 9.5).

"We do not have yet any quantified results to answer this question but we are trying to set up an experimental
protocol to evaluate it." This is one: nights with the published tables and nights, the same but for the draws that
come out otherwise, with tables whose entries were made larger and smaller (`stability_design`). Beside what the
nights say stands what is exact (`stability_exact`).
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from khepera_hil.experiments.cases import Case, Result
from khepera_hil.experiments.experiment import Experiment, Report, Shown
from khepera_hil.experiments.figures import counted
from khepera_hil.experiments.stability_design import Design
from khepera_hil.experiments.stability_effects import OUTCOMES, RARELY, Nights
from khepera_hil.experiments.stability_exact import matters
from khepera_hil.experiments.stability_map import Cell, Map, maps_shown
from khepera_hil.experiments.stability_tables import ENTRIES, movable
from khepera_hil.experiments.stability_text import Found, dwell_lines, entry_lines, levels, markdown, numbers
from khepera_hil.experiments.stability_trial import trial

__all__ = ["experiment"]


def experiment(design: Design | None = None) -> Experiment:
    """The one that was asked for (None: the usual one)."""
    study = _Study(design or Design())
    return Experiment(
        "stability",
        "how the watchman depends on the numbers in tables 2 to 7",
        "9.5",
        study.design.cases,
        trial,
        study.report,
        study.show,
    )


@dataclass
class _Study:
    """Keeps what the report found for the pictures."""

    design: Design
    found: Found | None = None

    def report(self, cases: Sequence[Case], results: Sequence[Result]) -> Report:
        nights = Nights(cases, results)
        self.found = Found.of(self.design, nights)
        figures = [figure for name in OUTCOMES for figure in levels(nights, name)]
        figures.append(counted("fires lit in a night", nights.lit))
        figures += [
            counted(f"{outcome.short}: deviation between nights that differ in the tables", nights.spread(name))
            for name, outcome in OUTCOMES.items()
        ]
        able, useful = movable(), matters()
        figures += [
            counted("entries that are neither zero nor certain", len(able)),
            counted("of these, entries that no answer depends on", sum(not useful[e] for e in able)),
            counted("entries perturbed", len(nights.perturbed)),
            counted(f"of these, entries by which {RARELY:g} decisions of a night change", len(nights.entries)),
        ]
        return Report(figures, [*dwell_lines(), *entry_lines(self.found)])

    def show(self, folder: Path) -> Shown:
        """Maps of the tables, and all numbers as Markdown and as JSON."""
        found = self.found
        if found is None:
            return Shown()
        folder.mkdir(parents=True, exist_ok=True)
        page, written = folder / "stability.md", folder / "stability.json"
        page.write_text(markdown(found), "utf-8")
        written.write_text(json.dumps(numbers(found), indent=1, allow_nan=False) + "\n", "utf-8")
        maps = {
            "exact: the most that P(Behavior | ...) moves": _sure(found.most),
            "exact: decisions of a night that change": _sure([found.nights.otherwise[e] for e in ENTRIES]),
            "exact: changes of Behavior a minute": _sure(found.changes),
        }
        for name, outcome in OUTCOMES.items():
            effects = {entry: Cell(one.value, one.seen, one.clear) for entry, one in found.effects[name].items()}
            maps[f"simulated: {outcome.title}"] = {**_sure([0.0] * len(ENTRIES)), **effects}
        title = f"What odds x {found.times:g} of an entry change"
        return Shown([page, written, *maps_shown(folder, "tables", title, maps)])


def _sure(values: Sequence[float]) -> Map:
    """Of every entry that can be moved; exact."""
    able = set(movable())
    return {
        entry: Cell(float(value), seen=value != 0, clear=False)
        for entry, value in zip(ENTRIES, values, strict=True)
        if entry in able
    }
