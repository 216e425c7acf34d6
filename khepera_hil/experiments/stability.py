"""How stable the watchman is "according to the values in the tables" (section 9.5).

"We do not have yet any quantified results to answer this question but we are trying to set up an experimental
protocol to evaluate it." This is one: nights with the published tables and nights, the same but for the draws that
come out otherwise, with tables whose entries were made larger and smaller (`stability_design`). Beside what the
nights say stands what is exact (`stability_exact`).
"""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from khepera_hil.experiments import stability_exact as exact
from khepera_hil.experiments.campaign import Case, Result
from khepera_hil.experiments.experiment import Experiment, Report
from khepera_hil.experiments.figures import Figure, counted, mean
from khepera_hil.experiments.stability_design import Design, signs_of
from khepera_hil.experiments.stability_effects import OUTCOMES, Effect, Nights
from khepera_hil.experiments.stability_map import Cell, maps_shown
from khepera_hil.experiments.stability_tables import ENTRIES, PUBLISHED, Entry, described, movable, perturbed
from khepera_hil.experiments.tabled_night import met, nightly

__all__ = ["experiment", "trial"]

_TINY = 0.005
"""Per cent for each per cent: what is less is not told."""


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


def trial(case: Case) -> Result:
    """One night, with the tables as printed or perturbed."""
    signs = signs_of(case)
    tables = perturbed(signs, float(case["amount"]), float(case.get("opened", 0.0))) if signs else None
    return nightly(int(case["seed"]), float(case["seconds"]), None if tables is None else described(tables))


@dataclass
class _Study:
    """Keeps what the report found for the pictures."""

    design: Design
    found: dict[str, dict[Entry, Effect]] = field(default_factory=dict)
    how: str = ""
    met: exact.Met = field(default_factory=dict)
    ticks: int = 0
    """Of a night."""

    def report(self, cases: Sequence[Case], results: Sequence[Result]) -> Report:
        nights = Nights(cases, results)
        self.found = {name: nights.effects(name) for name in OUTCOMES}
        self.how = "fitted together" if nights.together else "each by itself"
        sums: Counter[tuple[exact.Situation, str]] = Counter()
        for one in nights.published:
            sums.update(met(one))
        self.met = dict(sums)
        self.ticks = round(sum(sums.values()) / max(1, len(nights.published)))
        figures = [figure for name in OUTCOMES for figure in _levels(nights, name)]
        figures.append(counted("fires lit in a night", nights.lit))
        figures += [
            counted(
                f"{OUTCOMES[name].short}: deviation between nights that differ in the tables",
                nights.spread(name)[0],
            )
            for name in OUTCOMES
        ]
        able, useful = movable(), exact.matters()
        figures += [
            counted("entries that are neither zero nor certain", len(able)),
            counted("of these, entries that no answer depends on", sum(not useful[e] for e in able)),
        ]
        return Report(figures, [*self._exact_lines(), *self._effect_lines()])

    def _exact_lines(self) -> list[str]:
        """By the engine alone."""
        lines = ["dwell times out on patrol with Vigil, in seconds (exact), and the entries that change them most:"]
        for situation in exact.PATROL:
            lasts, relative = exact.dwelling(situation)
            for behavior in (1, 5):  # patrol and recharge
                name = str(ENTRIES[behavior].value)
                lines.append(
                    f"  Energy {situation[1]:10} {name:9} {_seconds(lasts[behavior])}{_most(relative[:, behavior])}"
                )
        return lines

    def _effect_lines(self) -> list[str]:
        """A line for each entry: exact, then simulated."""
        entries = list(self.found["changes"])
        most, average = exact.most_apart(), exact.mean_apart(self.met)
        rate, slopes = exact.changing(self.met)
        times = 1 + self.design.amount
        head = f"{'entry':44}{'p':>7}{'exact most':>11}{'a night':>9}{'chg/min':>9}  "
        lines = [
            f"effects of odds x {times:g}, {self.how} (95 % intervals; * beside zero, ** also for all "
            f"{len(entries)} at once);",
            "exact: the most that P(Behavior | ...) moves, how many decisions of a night come out otherwise, and "
            f"changes a minute ({rate:.2f} by the chain, in the situations that were met):",
            head + "".join(f"{OUTCOMES[name].short:>20}" for name in OUTCOMES),
        ]
        for entry in entries:
            place = ENTRIES.index(entry)
            p = PUBLISHED[entry.table][entry.row, entry.column]
            step = math.log(times)
            otherwise = average[place] * step * self.ticks
            sure = f"{p:7.4f}{most[place] * step:11.4f}{otherwise:9.3f}{slopes[place] * step:+9.3f}  "
            told = "".join(f"{_told(self.found[name][entry], OUTCOMES[name].digits):>20}" for name in OUTCOMES)
            lines.append(f"{entry.table}: {entry!s:41}{sure}{told}")
        return lines

    def show(self, folder: Path) -> list[Path]:
        """Maps of the tables, and all numbers as JSON."""
        if not self.found:
            return []
        folder.mkdir(parents=True, exist_ok=True)
        written = folder / "stability.json"
        written.write_text(json.dumps(self._numbers(), indent=1, allow_nan=False) + "\n", "utf-8")
        step = math.log(1 + self.design.amount)
        most, average = exact.most_apart(), exact.mean_apart(self.met)
        _, slopes = exact.changing(self.met)
        maps = {
            "exact: the most that P(Behavior | ...) moves": _sure(most * step),
            "exact: decisions of a night that come out otherwise": _sure(average * step * self.ticks),
            "exact: changes of Behavior a minute": _sure(slopes * step),
            **{
                f"simulated: {outcome.title}": {
                    entry: Cell(effect.value, effect.seen, effect.clear)
                    for entry, effect in self.found[name].items()
                }
                for name, outcome in OUTCOMES.items()
            },
        }
        title = f"What odds x {1 + self.design.amount:g} of an entry change"
        return [written, *maps_shown(folder, "stability", title, maps)]

    def _numbers(self) -> dict[str, object]:
        most, average = exact.most_apart(), exact.mean_apart(self.met)
        _, slopes = exact.changing(self.met)
        return {
            "amount": self.design.amount,
            "opened": self.design.opened,
            "by": self.design.by,
            "exact, per unit of the odds' logarithm": {
                entry.name: {"most": most[i], "a tick": average[i], "changes a minute": slopes[i]}
                for i, entry in enumerate(ENTRIES)
            },
            "effects": {
                name: {
                    entry.name: {
                        "value": effect.value,
                        "low": _finite(effect.low),
                        "high": _finite(effect.high),
                        "n": effect.n,
                        "clear": effect.clear,
                    }
                    for entry, effect in effects.items()
                }
                for name, effects in self.found.items()
            },
        }


def _levels(nights: Nights, name: str) -> list[Figure]:
    outcome = OUTCOMES[name]
    before, after = nights.levels(name)
    differences = [b - a for a, b in zip(before, after, strict=True)]
    return [
        mean(f"{outcome.title}: as published", before),
        mean(f"{outcome.title}: perturbed", after),
        mean(f"{outcome.title}: perturbed less published", differences),
    ]


def _sure(values: Sequence[float]) -> dict[Entry, Cell]:
    """Of every entry that can be moved; exact."""
    able = set(movable())
    return {
        entry: Cell(float(value), seen=value != 0, clear=False)
        for entry, value in zip(ENTRIES, values, strict=True)
        if entry in able
    }


def _seconds(lasts: float) -> str:
    return f"{lasts:9.2f}" if math.isfinite(lasts) else " for ever"


def _most(relative: Sequence[float]) -> str:
    """The entries by which a dwell time changes most, with the per cent for each per cent of odds."""
    known = [
        (abs(value), value, entry) for value, entry in zip(relative, ENTRIES, strict=True) if math.isfinite(value)
    ]
    best = sorted(known, key=lambda one: -one[0])[:4]
    said = ", ".join(f"{entry} {value:+.2f}" for size, value, entry in best if size > 0.005)
    return f"   (per cent for each per cent of odds: {said})" if said else ""


def _told(effect: Effect, digits: int) -> str:
    half = effect.high - effect.value
    mark = "**" if effect.clear else "* " if effect.seen else "  "
    return f"{effect.value:+.{digits}f} +-{half:.{digits}f}{mark}"


def _finite(number: float) -> float | None:
    return number if math.isfinite(number) else None
