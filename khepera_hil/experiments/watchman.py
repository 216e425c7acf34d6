"""The science fair of section 10.5: long nights without interruption, and short ones in arenas by chance.

"This experiment ran without interruption, 10 hours a day for three days as a demonstration during a public science
fair." Here the three days are simulated, one after the other or side by side, with all that can happen in a night
(`khepera_hil.experiments.nights`); every tick goes through the bytes of the serial line.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from statistics import median
from typing import Any

from khepera_hil.controllers.base import Setting
from khepera_hil.controllers.watchman import Watchman
from khepera_hil.experiments import weathercock
from khepera_hil.experiments.cases import Case, Result
from khepera_hil.experiments.experiment import Experiment, Report
from khepera_hil.experiments.figures import Figure, counted, rate, share
from khepera_hil.experiments.nights import night
from khepera_hil.experiments.tally import Tally
from khepera_hil.experiments.trial import Trial, drive
from khepera_hil.recording import Tick

__all__ = ["DAYS", "experiment"]

DAYS = 3
"""Of the science fair."""

_SHORT = 300.0  # s
_BASE = (0.18, 0.18)


def experiment(
    hours: float = 0.0, nights: int | None = None, record: Path | None = None, days: int = DAYS
) -> Experiment:
    """``hours`` of the fair in all, in so many days, and so many short nights (None: one for each seed).

    ``record`` is where the days of the fair are recorded.
    """

    def cases(seeds: Sequence[int]) -> list[Case]:
        fair: list[Case] = []
        if hours > 0:
            fair = [_case(seeds[0] + day, hours / days * 3600, "watchman", record) for day in range(days)]
        short = range(seeds[0], seeds[0] + nights) if nights is not None else seeds
        return [*fair, *(_case(1000 + seed, _SHORT, "furnished") for seed in short)]

    return Experiment("watchman", "the night watchman's nights", "10", cases, trial, report)


def _case(seed: int, seconds: float, world: str, record: Path | None = None) -> Case:
    kept = {} if record is None else {"record": str(record)}
    return {"seed": seed, "seconds": seconds, "world": world, **kept}


def trial(case: Case) -> Result:
    """One night."""
    seed, seconds, world = int(case["seed"]), float(case["seconds"]), str(case["world"])
    plan = night(seed, seconds, world)
    tallies: list[Tally] = []

    def make(witness: Any) -> Watchman:
        watchman = Watchman(Setting())
        tallies.append(Tally(witness, watchman, plan.calls, _BASE))
        return watchman

    def watch(tick: Tick, trial: Trial) -> bool:
        trial.ticks.clear()  # ten hours of them would not fit anywhere
        tallies[0].hear(tick)
        return False

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "night.toml"
        path.write_text(plan.text)
        record = Path(str(case["record"])) if "record" in case else None
        ran = drive(
            make,
            world=world,
            seed=seed,
            duration=seconds,
            watch=watch,
            record=record,
            options={"scenario": str(path)},
        )
    return {**tallies[0].figures(), "score": dict(ran.score), "hours": seconds / 3600}


def report(cases: Sequence[Case], results: Sequence[Result]) -> Report:
    """The figures of the proof, the days of the fair and the short nights apart."""
    figures: list[Figure] = []
    lines: list[str] = []
    for what, world in (("fair", "watchman"), ("short nights", "furnished")):
        some = [result for case, result in zip(cases, results, strict=True) if case["world"] == world]
        if some:
            figures += _figures(what, some)
            lines += [f"{what}:", *_lines(some)]
    return Report(figures, [*lines, *weathercock.table()])


def _figures(what: str, nights: Sequence[Result]) -> list[Figure]:
    n = len(nights)
    hours = sum(float(one["hours"]) for one in nights)
    fires = [seconds for one in nights for seconds in one["burned"]]
    # What still burns when the night is over has had less than its time.
    fought = [True] * len(fires) + [False] * sum(int(one["let_burn"]) for one in nights)
    answered = [bool(one) for night in nights for one in night["answered"]]
    noticed = sum(int(one["noticed"]) for one in nights)
    movers = sum(int(one["with_mover"]) for one in nights)
    return [
        counted(f"{what}: hours", hours),
        counted(f"{what}: ticks without a decision", sum(int(one["blind"]) for one in nights), "<= 0"),
        counted(f"{what}: longest contact, s", max(_scored(nights, "contact_longest_s")), "<= 3"),
        counted(f"{what}: least charge of battery", min(float(one["least_charge"]) for one in nights), ">= .01"),
        share(f"{what}: fires put out", fought, ">= 0.95"),
        *([counted(f"{what}: seconds until a fire was out, median", median(fires))] if fires else []),
        share(f"{what}: movers in view of a stop noticed", [i < noticed for i in range(movers)], ">= 0.9"),
        rate(f"{what}: false alarms an hour", int(sum(_scored(nights, "alarms_false"))), hours, n, "<= 1"),
        share(f"{what}: in its base within 180 s of a call", answered, ">= 0.98"),
        *_agreements(what, nights),
    ]


def _agreements(what: str, nights: Sequence[Result]) -> list[Figure]:
    """Of each drawn variable; the statistics of several nights add up."""
    from scipy.stats import chi2

    found = []
    for name in ("Vrot", "Vtrans", "Behavior", "Move"):
        statistic = sum(float(one["chi2"].get(name, (0, 0))[0]) for one in nights)
        freedom = sum(int(one["chi2"].get(name, (0, 0))[1]) for one in nights)
        if freedom:
            p = float(chi2.sf(statistic, freedom))
            found.append(counted(f"{what}: draws of {name} as recorded, p of chi-square", p, ">= 0.001"))
    return found


def _lines(nights: Sequence[Result]) -> list[str]:
    lines = []
    for key, title in (("behaviors", "ticks by Behavior"), ("moves", "by Move"), ("energy", "by Energy")):
        sums = _sums(nights, key)
        total = sum(sums.values()) or 1
        lines.append(f"  {title}: " + ", ".join(f"{name} {often / total:.1%}" for name, often in sums.items()))
    ticks, changes = _sums(nights, "energy"), _sums(nights, "changes")
    rates = (f"{level} {600 * changes.get(level, 0) / often:.2f}" for level, often in ticks.items())
    lines.append("  changes of Behavior a minute: " + ", ".join(rates))
    lines.append("  events: " + ", ".join(f"{text} {often}" for text, often in _sums(nights, "events").items()))
    return lines


def _sums(nights: Sequence[Result], key: str) -> dict[str, int]:
    sums: dict[str, int] = {}
    for one in nights:
        for name, often in one[key].items():
            sums[name] = sums.get(name, 0) + int(often)
    return dict(sorted(sums.items(), key=lambda item: -item[1]))


def _scored(nights: Sequence[Result], name: str) -> list[float]:
    return [float(one["score"][name] or 0) for one in nights]
