"""The science fair of section 10.5: long nights without interruption, and short ones in arenas by chance.

"This experiment ran without interruption, 10 hours a day for three days as a demonstration during a public science
fair." Here the three days are simulated, one after the other or side by side, with all that can happen in a night
(`khepera_hil.experiments.nights`); every tick goes through the bytes of the serial line. The last day is decided
early (section 10.4), which is the same law and draws from one description after the other, so that the draws of
each can be held against its distributions.
"""

from __future__ import annotations

import resource
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import Any

from khepera_hil.controllers.base import Setting
from khepera_hil.controllers.watchman import Watchman
from khepera_hil.controllers.watchman_mind import EARLY, LATE
from khepera_hil.errors import KheperaHilError
from khepera_hil.experiments import weathercock
from khepera_hil.experiments.cases import Case, Result
from khepera_hil.experiments.experiment import Experiment, Report
from khepera_hil.experiments.figures import Figure, counted, rate, share
from khepera_hil.experiments.nights import SHORT, night, short_night
from khepera_hil.experiments.tally import Tally
from khepera_hil.experiments.trial import PERIOD, Trial, drive
from khepera_hil.recording import Tick

__all__ = ["DAYS", "experiment"]

DAYS = 3
"""Of the science fair."""

_FAIR, _RANDOM = "watchman", "furnished"  # arenas
_BASE = (0.18, 0.18)
_AT_LEAST = 120.0  # s of a short night, so that there are stops in it
_HOURS = 30.0  # of which it is told how long they take


def experiment(
    hours: float = 0.0, nights: int | None = None, record: Path | None = None, days: int = DAYS
) -> Experiment:
    """``hours`` of the fair in all, in so many days, and so many short nights (None: one for each seed).

    ``record`` is where the days of the fair are recorded.
    """
    kept = {} if record is None else {"record": str(record)}

    def cases(seeds: Sequence[int]) -> list[Case]:
        fair: list[Case] = []
        if hours > 0:
            seconds = hours / days * 3600
            fair = [
                {"world": _FAIR, "seed": seeds[0] + day, "seconds": seconds, "early": 0 < day == days - 1, **kept}
                for day in range(days)
            ]
        short = range(seeds[0], seeds[0] + nights) if nights is not None else seeds
        return [*fair, *({"world": _RANDOM, "seed": 1000 + seed, "seconds": SHORT} for seed in short)]

    return Experiment("watchman", "the night watchman's nights", "10", cases, trial, report)


def trial(case: Case) -> Result:
    """One night."""
    seed, seconds, world = int(case["seed"]), float(case["seconds"]), str(case["world"])
    plan = night(seed, seconds, world) if world == _FAIR else short_night(seed, world)
    tallies: list[Tally] = []

    def make(witness: Any) -> Watchman:
        watchman = Watchman(Setting(early=EARLY if case.get("early") else LATE))
        tallies.append(Tally(witness, watchman, plan, _BASE))
        return watchman

    def watch(tick: Tick, trial: Trial) -> bool:
        trial.ticks.clear()  # ten hours of them would not fit anywhere
        tallies[0].hear(tick)
        return world == _RANDOM and tallies[0].settled and tick.t >= _AT_LEAST

    began, stopped, over = (time.perf_counter(), time.process_time()), "", False
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "night.toml"
        path.write_text(plan.text)
        try:
            over = drive(
                make,
                world=world,
                seed=seed,
                duration=seconds,
                watch=watch,
                record=Path(str(case["record"])) if "record" in case else None,
                options={"scenario": str(path)},
            ).stopped
        except KheperaHilError as error:
            if not tallies:
                raise  # it did not even begin
            stopped = str(error)
    ticks = tallies[0].ticks
    return {
        **tallies[0].figures(),
        "score": dict(tallies[0].witness.score()),
        "hours": ticks * PERIOD / 3600,
        "lost": 0 if over else round(seconds / PERIOD) - ticks,
        "stopped": stopped,
        "wall_s": round(time.perf_counter() - began[0], 1),
        "processor_s": round(time.process_time() - began[1], 1),
        "memory_mb": round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024),
    }


def report(cases: Sequence[Case], results: Sequence[Result]) -> Report:
    """The figures of the proof, the days of the fair and the short nights apart."""
    figures: list[Figure] = []
    lines: list[str] = []
    for what, world in (("fair", _FAIR), ("short nights", _RANDOM)):
        some = [result for case, result in zip(cases, results, strict=True) if case["world"] == world]
        if some:
            figures += _figures(what, some)
            lines += [f"{what}:", *_lines(some)]
    return Report(figures, [*lines, *weathercock.table()])


def _figures(what: str, nights: Sequence[Result]) -> list[Figure]:
    n = len(nights)
    hours = sum(float(one["hours"]) for one in nights)
    fires = [seconds for one in nights for seconds in one["burned"]]
    fought = [True] * len(fires) + [False] * sum(int(one["let_burn"]) for one in nights)
    seen, glimpsed, answered = ([bool(hit) for one in nights for hit in one[key]] for key in _HITS)
    lost = sum(int(one["lost"]) for one in nights)
    return [
        counted(f"{what}: hours", hours),
        counted(
            f"{what}: nights that stopped before their end", sum(bool(one["stopped"]) for one in nights), "<= 0"
        ),
        counted(f"{what}: ticks without a decision", lost + sum(int(one["blind"]) for one in nights), "<= 0"),
        counted(f"{what}: longest contact, s", max(_scored(nights, "contact_longest_s")), "<= 3"),
        counted(f"{what}: least charge of battery", min(float(one["least_charge"]) for one in nights), ">= 0.01"),
        share(f"{what}: fires put out", fought, ">= 0.95"),
        *([counted(f"{what}: seconds until a fire was out, median", median(fires))] if fires else []),
        share(f"{what}: movers in view of a stop alarmed", seen, ">= 0.9"),
        share(f"{what}: the same, with those at the picture's rim or straight ahead", glimpsed),
        rate(f"{what}: false alarms an hour", int(sum(_scored(nights, "alarms_false"))), hours, n, "<= 1"),
        share(f"{what}: in its base within 180 s of a call", answered, ">= 0.98"),
        *_agreements(what, nights),
        counted(f"{what}: minutes of a processor for 30 h", _taken(nights, "processor_s"), "<= 45"),
        counted(f"{what}: minutes of the clock for 30 h, on one", _taken(nights, "wall_s")),
        counted(f"{what}: most memory, MB", max(float(one["memory_mb"]) for one in nights)),
    ]


_HITS = ("seen", "glimpsed", "answered")


def _taken(nights: Sequence[Result], of: str) -> float:
    return sum(float(one[of]) for one in nights) / sum(float(one["hours"]) for one in nights) * _HOURS / 60


def _agreements(what: str, nights: Sequence[Result]) -> list[Figure]:
    """Of each description and variable that was drawn; the statistics of several nights add up."""
    from scipy.stats import chi2

    found = []
    for name in sorted({name for one in nights for name in one["chi2"]}):
        statistics = [one["chi2"].get(name, (0, 0)) for one in nights]
        statistic, freedom = sum(float(s) for s, _ in statistics), sum(int(f) for _, f in statistics)
        if freedom:
            p = float(chi2.sf(statistic, freedom))
            found.append(counted(f"{what}: draws as recorded, p of chi-square: {name}", p, ">= 0.001"))
    return found


def _lines(nights: Sequence[Result]) -> list[str]:
    lines = []
    for key, title in (("behaviors", "ticks by Behavior"), ("moves", "by Move"), ("energy", "by Energy")):
        sums = _sums(nights, key)
        total = sum(sums.values()) or 1
        lines.append(f"  {title}: " + ", ".join(f"{name} {often / total:.1%}" for name, often in sums.items()))
    lines.append("  changes of Behavior a minute, out with Vigil (measured), by Energy: " + _changes(nights))
    lines.append("  events: " + ", ".join(f"{text} {often}" for text, often in _sums(nights, "events").items()))
    lines += [f"  stopped: {one['stopped']}" for one in nights if one["stopped"]]
    return lines


def _changes(nights: Sequence[Result]) -> str:
    ticks, changes = _sums(nights, "out"), _sums(nights, "changes")
    rates = (
        f"{level} {600 * changes.get(level, 0) / often:.2f} in {often / 600:.0f} min"
        for level, often in ticks.items()
    )
    return ", ".join(rates)


def _sums(nights: Sequence[Mapping[str, Any]], key: str) -> dict[str, int]:
    sums: dict[str, int] = {}
    for one in nights:
        for name, often in one[key].items():
            sums[name] = sums.get(name, 0) + int(often)
    return dict(sorted(sums.items(), key=lambda item: -item[1]))


def _scored(nights: Sequence[Result], name: str) -> list[float]:
    return [float(one["score"][name] or 0) for one in nights]
