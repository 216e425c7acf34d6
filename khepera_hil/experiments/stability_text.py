"""What was found of the tables' stability, in words and numbers: as lines for a terminal, as Markdown, as JSON."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from brp.programs.behavior import Base, Behavior, Energy
from khepera_hil.experiments import stability_exact as exact
from khepera_hil.experiments.figures import Figure, mean
from khepera_hil.experiments.stability_design import Design
from khepera_hil.experiments.stability_effects import OUTCOMES, Effect, Nights
from khepera_hil.experiments.stability_tables import ENTRIES, PUBLISHED, Entry

__all__ = ["Found", "dwell_lines", "entry_lines", "levels", "markdown", "numbers"]

_TINY = 0.005
"""Per cent for each per cent: what is less is not told."""

_BRIEF = 0.15
"""Seconds: a behavior that lasts no longer is only passed through."""


class Found(NamedTuple):
    """All that is told, of the amount that was asked for."""

    design: Design
    nights: Nights
    effects: Mapping[str, Mapping[Entry, Effect]]
    """By outcome, then by entry."""
    most: Sequence[float]
    """For each of the 108 entries the most that P(Behavior | ...) moves, exact to the first order."""
    changes: Sequence[float]
    """Changes of Behavior a minute by the chain, likewise."""
    rate: float
    """How many the chain has."""

    @classmethod
    def of(cls, design: Design, nights: Nights) -> Found:
        """What nights came to."""
        step = math.log(1 + design.amount)
        rate, slopes = exact.changing(nights.met)
        effects = {name: nights.effects(name) for name in OUTCOMES}
        return cls(design, nights, effects, (exact.most_apart() * step).tolist(), (slopes * step).tolist(), rate)

    @property
    def times(self) -> float:
        """What odds are multiplied by."""
        return 1 + self.design.amount


def levels(nights: Nights, name: str) -> list[Figure]:
    """An outcome as published, perturbed, and the difference over the same nights."""
    outcome = OUTCOMES[name]
    before, after = nights.levels(name)
    return [
        mean(f"{outcome.title}: as published", before),
        mean(f"{outcome.title}: perturbed", after),
        mean(f"{outcome.title}: perturbed less published", [b - a for a, b in zip(before, after, strict=True)]),
    ]


def dwell_lines() -> list[str]:
    """Of the behaviors that last longer than a tick or two."""
    lines = [
        "how long Behavior lasts with Vigil (exact), and what changes it most, in % for each % of an entry's odds:"
    ]
    for base in Base.values:
        for level in Energy.values:
            lasts, relative = exact.dwelling((True, str(level), bool(base), False, False))
            for place, behavior in enumerate(Behavior.values):
                if lasts[place] > _BRIEF:
                    where = "in the base" if base else "out"
                    how_long = f"{lasts[place]:7.2f} s" if math.isfinite(lasts[place]) else " for ever"
                    lines.append(
                        f"  {where:11} Energy {level:10} {behavior:9}{how_long}{_most(relative[:, place].tolist())}"
                    )
    return lines


def entry_lines(found: Found) -> list[str]:
    """A line for each entry that was perturbed: exact, then simulated."""
    nights = found.nights
    together = "fitted together" if nights.together else "each by itself"
    lines = [
        f"what odds x {found.times:g} do. Exact, to the first order: the most that P(Behavior | ...) moves; how",
        "many decisions of a night come out otherwise; changes of Behavior a minute by the chain (which has "
        f"{found.rate:.2f} in the situations that were met).",
        f"Simulated, {together}, with 95 % intervals: * beside zero, ** for all {len(nights.entries)} at once.",
        f"{'entry':44}{'p':>7}{'most':>8}{'a night':>9}{'chg/min':>9}  "
        + "".join(f"{outcome.short:>19}" for outcome in OUTCOMES.values()),
    ]
    for entry in nights.perturbed:
        place, p = ENTRIES.index(entry), _published(entry)
        known = f"{found.most[place]:8.4f}" if p else f"{'opened':>8}"
        chain = f"{found.changes[place]:+9.3f}" if p else " " * 9
        line = f"{entry.table}: {entry!s:41}{p:7.4f}{known}{nights.otherwise[entry]:9.3f}{chain}  "
        if entry in nights.entries:
            line += "".join(f"{_told(found.effects[name][entry], name):>19}" for name in OUTCOMES)
        lines.append(line.rstrip())
    return lines


def markdown(found: Found) -> str:
    """The same as tables of a page, of the entries whose effects were looked for."""
    nights = found.nights
    rows = [
        "| | as published | perturbed | difference over the same nights | between nights of different tables |",
        "|---|---|---|---|---|",
    ]
    for name, outcome in OUTCOMES.items():
        cells = " | ".join(_between(figure, outcome.digits) for figure in levels(nights, name))
        rows.append(f"| {outcome.title} | {cells} | sd {nights.spread(name):.{outcome.digits}f} |")
    rows += [
        "",
        "| entry | p | most | decisions a night | changes/min, exact | "
        + " | ".join(outcome.short for outcome in OUTCOMES.values())
        + " |",
        "|---" * (5 + len(OUTCOMES)) + "|",
    ]
    for entry in nights.entries:
        place = ENTRIES.index(entry)
        told = " | ".join(_told(found.effects[name][entry], name).strip().replace("*", "\\*") for name in OUTCOMES)
        sure = f"{found.most[place]:.3f} | {nights.otherwise[entry]:.1f} | {found.changes[place]:+.2f}"
        rows.append(f"| {str(entry).replace('|', 'given')} | {_published(entry):.4g} | {sure} | {told} |")
    return "\n".join(rows) + "\n"


def numbers(found: Found) -> dict[str, Any]:
    """As JSON has it, every entry by its name."""
    return {
        "amount": found.design.amount,
        "opened": found.design.opened,
        "by": found.design.by,
        "exact": {
            entry.name: {
                "most": found.most[place],
                "decisions a night": found.nights.otherwise[entry],
                "changes a minute": found.changes[place],
            }
            for place, entry in enumerate(ENTRIES)
        },
        "effects": {
            name: {entry.name: _row(effect) for entry, effect in effects.items()}
            for name, effects in found.effects.items()
        },
    }


def _row(effect: Effect) -> dict[str, Any]:
    ends = {"low": effect.low, "high": effect.high}
    known = {name: end if math.isfinite(end) else None for name, end in ends.items()}
    return {"value": effect.value, **known, "n": effect.n, "clear": effect.clear}


def _published(entry: Entry) -> float:
    return float(PUBLISHED[entry.table][entry.row, entry.column])


def _most(relative: Sequence[float]) -> str:
    """The entries by which a dwell time changes most."""
    known = [(float(v), entry) for v, entry in zip(relative, ENTRIES, strict=True) if abs(v) > _TINY]
    best = sorted(known, key=lambda one: -abs(one[0]))[:4]
    return "".join(f"{';' if place else '  '} {entry} {v:+.2f}" for place, (v, entry) in enumerate(best))


def _told(effect: Effect, name: str) -> str:
    digits = OUTCOMES[name].digits
    mark = "**" if effect.clear else "* " if effect.seen else "  "
    return f"{effect.value:+.{digits}f} +-{effect.high - effect.value:.{digits}f}{mark}"


def _between(figure: Figure, digits: int) -> str:
    if figure.value is None:
        return "-"
    ends = "" if figure.low is None else f" [{figure.low:.{digits}f}, {figure.high:.{digits}f}]"
    return f"{figure.value:.{digits}f}{ends}"
