"""How stable the watchman is "according to the values in the tables" (section 9.5).

"We do not have yet any quantified results to answer this question but we are trying to set up an experimental
protocol to evaluate it." This is one: nights with the published tables and nights, the same but for the draws that
come out otherwise, with tables whose entries were made larger and smaller (`stability_design`). Beside what the
nights say stands what is exact (`stability_exact`).
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from brp.programs.behavior import Behavior
from khepera_hil.experiments import stability_exact as exact
from khepera_hil.experiments.campaign import Case, Result
from khepera_hil.experiments.experiment import Experiment, Report
from khepera_hil.experiments.figures import Figure, counted, mean
from khepera_hil.experiments.stability_design import Design, signs_of
from khepera_hil.experiments.stability_effects import OUTCOMES, RARELY, Effect, Nights
from khepera_hil.experiments.stability_map import Cell, maps_shown
from khepera_hil.experiments.stability_tables import ENTRIES, PUBLISHED, Entry, described, movable, perturbed
from khepera_hil.experiments.tabled_night import nightly

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
    nights: Nights | None = None
    found: dict[str, dict[Entry, Effect]] = field(default_factory=dict)

    def report(self, cases: Sequence[Case], results: Sequence[Result]) -> Report:
        nights = self.nights = Nights(cases, results)
        self.found = {name: nights.effects(name) for name in OUTCOMES}
        figures = [figure for name in OUTCOMES for figure in _levels(nights, name)]
        figures.append(counted("fires lit in a night", nights.lit))
        figures += [
            counted(f"{outcome.short}: deviation between nights that differ in the tables", nights.spread(name))
            for name, outcome in OUTCOMES.items()
        ]
        able, useful = movable(), exact.matters()
        figures += [
            counted("entries that are neither zero nor certain", len(able)),
            counted("of these, entries that no answer depends on", sum(not useful[e] for e in able)),
            counted("entries perturbed", len(nights.perturbed)),
            counted(f"of these, entries by which {RARELY:g} decisions of a night change", len(nights.entries)),
        ]
        return Report(figures, [*_dwell_lines(), *self._entry_lines(nights)])

    def _entry_lines(self, nights: Nights) -> list[str]:
        """A line for each entry: exact, then simulated."""
        times, sure = 1 + self.design.amount, _Exact.of(nights, self.design)
        together = "fitted together" if nights.together else "each by itself"
        head = f"{'entry':44}{'p':>7}{'most':>8}{'a night':>9}{'chg/min':>9}  "
        lines = [
            f"what odds x {times:g} do. Exact, to the first order: the most that P(Behavior | ...) moves; how many",
            "decisions of a night come out otherwise; changes of Behavior a minute by the chain (which has "
            f"{sure.rate:.2f} in the situations that were met).",
            f"Simulated, {together}, with 95 % intervals: * beside zero, ** for all {len(nights.entries)} at once.",
            head + "".join(f"{OUTCOMES[name].short:>19}" for name in OUTCOMES),
        ]
        for entry in nights.perturbed:
            place = ENTRIES.index(entry)
            p = PUBLISHED[entry.table][entry.row, entry.column]
            known = f"{sure.most[place]:8.4f}" if p else f"{'opened':>8}"
            chain = f"{sure.changes[place]:+9.3f}" if p else " " * 9
            line = f"{entry.table}: {entry!s:41}{p:7.4f}{known}{nights.otherwise[entry]:9.3f}{chain}  "
            if entry in self.found["changes"]:
                line += "".join(f"{_told(self.found[name][entry], OUTCOMES[name].digits):>19}" for name in OUTCOMES)
            lines.append(line.rstrip())
        return lines

    def show(self, folder: Path) -> list[Path]:
        """Maps of the tables, and all numbers as JSON."""
        if self.nights is None:
            return []
        folder.mkdir(parents=True, exist_ok=True)
        sure = _Exact.of(self.nights, self.design)
        written = folder / "stability.json"
        written.write_text(json.dumps(self._numbers(sure), indent=1, allow_nan=False) + "\n", "utf-8")
        maps = {
            "exact: the most that P(Behavior | ...) moves": _sure(sure.most),
            "exact: decisions of a night that change": _sure([self.nights.otherwise[entry] for entry in ENTRIES]),
            "exact: changes of Behavior a minute": _sure(sure.changes),
        }
        for name, outcome in OUTCOMES.items():
            cells = dict(_sure([0.0] * len(ENTRIES)))
            cells |= {entry: Cell(one.value, one.seen, one.clear) for entry, one in self.found[name].items()}
            maps[f"simulated: {outcome.title}"] = cells
        title = f"What odds x {1 + self.design.amount:g} of an entry change"
        return [written, *maps_shown(folder, "stability", title, maps)]

    def _numbers(self, sure: _Exact) -> dict[str, object]:
        assert self.nights is not None
        return {
            "amount": self.design.amount,
            "opened": self.design.opened,
            "by": self.design.by,
            "exact": {
                entry.name: {
                    "most": sure.most[place],
                    "decisions a night": self.nights.otherwise[entry],
                    "changes a minute": sure.changes[place],
                }
                for place, entry in enumerate(ENTRIES)
            },
            "effects": {
                name: {entry.name: _row(effect) for entry, effect in effects.items()}
                for name, effects in self.found.items()
            },
        }


class _Exact(NamedTuple):
    """What the engine says of each entry, by place; of the amount that was asked for."""

    most: Sequence[float]
    changes: Sequence[float]
    rate: float
    """Changes a minute by the chain."""

    @classmethod
    def of(cls, nights: Nights, design: Design) -> _Exact:
        step = math.log(1 + design.amount)
        rate, slopes = exact.changing(nights.met)
        return cls((exact.most_apart() * step).tolist(), (slopes * step).tolist(), rate)


def _dwell_lines() -> list[str]:
    lines = ["dwell times out on patrol with Vigil (exact), and the entries that change them most:"]
    for situation in exact.PATROL:
        lasts, relative = exact.dwelling(situation)
        for behavior in ("patrol", "recharge"):
            place = Behavior.place(behavior)
            said = f"{_seconds(lasts[place])}{_most(relative[:, place])}"
            lines.append(f"  Energy {situation[1]:10} {behavior:9} {said}")
    return lines


def _levels(nights: Nights, name: str) -> list[Figure]:
    outcome = OUTCOMES[name]
    before, after = nights.levels(name)
    differences = [b - a for a, b in zip(before, after, strict=True)]
    return [
        mean(f"{outcome.title}: as published", before),
        mean(f"{outcome.title}: perturbed", after),
        mean(f"{outcome.title}: perturbed less published", differences),
    ]


def _row(effect: Effect) -> dict[str, object]:
    """As JSON."""
    return {
        "value": effect.value,
        "low": _finite(effect.low),
        "high": _finite(effect.high),
        "n": effect.n,
        "clear": effect.clear,
    }


def _sure(values: Sequence[float]) -> dict[Entry, Cell]:
    """Of every entry that can be moved; exact."""
    able = set(movable())
    return {
        entry: Cell(float(value), seen=value != 0, clear=False)
        for entry, value in zip(ENTRIES, values, strict=True)
        if entry in able
    }


def _seconds(lasts: float) -> str:
    return f"{lasts:7.2f} s" if math.isfinite(lasts) else " for ever"


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
