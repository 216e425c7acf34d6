"""Section 5: push, avoid, follow, phototaxy: specified, and taught by half a minute of driving."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from khepera_hil.experiments import drives
from khepera_hil.experiments.arenas import OBJECTS
from khepera_hil.experiments.cases import Case, Result
from khepera_hil.experiments.experiment import Experiment, Report
from khepera_hil.experiments.figures import mean, rate, share
from khepera_hil.experiments.show import run_shown

__all__ = ["EXPERIMENTS"]

_HALF_HOUR = 1800.0
_FREE = 1 / 30  # m/s of a robot that nothing is in the way of: Vtrans 5 is 4 units of command D

THINGS: dict[str, dict[str, Any]] = {
    "disc 40 g": drives.THING,
    **{f"disc {mass} g": {**drives.THING, "mass_g": mass} for mass in (20, 80, 120, 300)},
    "box 40 g": {"shape": "box", "size_mm": [50, 50], "height_mm": 40, "mass_g": 40},
    "plank 40 g": {"shape": "box", "size_mm": [120, 40], "height_mm": 40, "mass_g": 40},
    "triangle 40 g": {"shape": "triangle", "side_mm": 80, "height_mm": 40, "mass_g": 40},
    "hexagon 40 g": {"shape": "hexagon", "side_mm": 35, "height_mm": 40, "mass_g": 40},
}
HEAVY = "disc 300 g"


def _push_cases(seeds: Sequence[int]) -> list[Case]:
    cases: list[Case] = []
    for seed in seeds:
        for name, thing in THINGS.items():
            cases.append({"by": "shipped", "seed": seed, "what": name, "thing": thing})
        for name in ("disc 40 g", "box 40 g"):
            cases.append(
                {
                    "by": "shipped",
                    "seed": seed,
                    "what": f"{name}, Prox unknown",
                    "thing": THINGS[name],
                    "unknown": ["Prox"],
                }
            )
    return cases


def _push_report(cases: Sequence[Case], results: Sequence[Result]) -> Report:
    moved = _by(cases, results, "what")
    far = {what: [result["moved_mm"] >= 200 for result in found] for what, found in moved.items()}
    figures = [
        share(
            "a 40 g disc pushed 200 mm within 30 s of contact", far["disc 40 g"], ">= 0.98", "learns in 20 to 30 s"
        ),
        share(
            "a 300 g disc is not moved (10 mm)",
            [r["moved_mm"] < 10 for r in moved[HEAVY]],
            ">= 1",
            "not if too heavy",
        ),
        share("the same disc, Prox unknown (E5.3)", far["disc 40 g, Prox unknown"]),
        share("a 40 g box, Prox unknown (E5.3)", far["box 40 g, Prox unknown"]),
        *(share(f"pushed 200 mm: {what}", far[what]) for what in THINGS if what not in ("disc 40 g", HEAVY)),
    ]
    return Report(figures)


def _avoid_cases(seeds: Sequence[int]) -> list[Case]:
    return [
        {"by": by, "seed": seed, "seconds": _HALF_HOUR}
        for seed in seeds
        for by in ("specified", "shipped", "teacher")
    ]


def _avoid_report(cases: Sequence[Case], results: Sequence[Result]) -> Report:
    found = _by(cases, results, "by")
    figures = []
    for by, words, target in (
        ("specified", "the specified table", "<= 1"),
        ("shipped", "the shipped delta-avoid", "<= 3"),
        ("teacher", "its teacher", None),
    ):
        rows = found[by]
        contacts = sum(row["long"] for row in rows)
        figures.append(rate(f"contacts over 0.5 s in 30 min, {words}", contacts, len(rows), len(rows), target))
    for by, words in (("specified", "the specified table"), ("shipped", "the shipped delta-avoid")):
        ways = [row["way_m"] / (_FREE * row["seconds"]) for row in found[by]]
        figures.append(mean(f"way, as a share of free running, {words}", ways, ">= 0.9"))
    lines = [f"  longest contact of all: {max(row['longest_s'] for row in results):.2f} s"]
    return Report(figures, lines)


def _follow_cases(seeds: Sequence[int]) -> list[Case]:
    names = list(OBJECTS)
    return [
        # Three objects a seed, so that each of the fifteen has its turn every five seeds.
        {"by": by, "seed": seed, "behavior": behavior, "object": names[(3 * seed + k) % len(names)]}
        for seed in seeds
        for behavior in ("follow", "follow-left")
        for by in ("specified", "shipped")
        for k in range(3)
    ]


def _follow_report(cases: Sequence[Case], results: Sequence[Result]) -> Report:
    figures = []
    for by, words, target in (("specified", "specified", ">= 0.99"), ("shipped", "as taught", ">= 0.95")):
        for behavior, side in (("follow", "right"), ("follow-left", "left")):
            hits = [
                result["round"]
                for case, result in zip(cases, results, strict=True)
                if case["by"] == by and case["behavior"] == behavior
            ]
            figures.append(share(f"tours completed, {words}, object at the {side}", hits, target))
    missed: dict[str, int] = {}
    for case, result in zip(cases, results, strict=True):
        if not result["round"]:
            missed[f"{case['object']} ({case['by']})"] = missed.get(f"{case['object']} ({case['by']})", 0) + 1
    lines = [f"  not completed: {', '.join(f'{name} {count}' for name, count in missed.items()) or 'none'}"]
    figures.append(
        share(
            "tours with a contact over 0.5 s, specified",
            [r["longest_s"] > 0.5 for c, r in zip(cases, results, strict=True) if c["by"] == "specified"],
        )
    )
    return Report(figures, lines)


def _phototaxy_cases(seeds: Sequence[int]) -> list[Case]:
    return [{"by": by, "seed": seed} for seed in seeds for by in ("specified", "shipped")]


def _phototaxy_report(cases: Sequence[Case], results: Sequence[Result]) -> Report:
    found = _by(cases, results, "by")
    figures = []
    for by, words, target in (("specified", "specified", ">= 0.98"), ("shipped", "as taught", None)):
        rows = found[by]
        good = [row["reached"] and row["ratio"] <= 1.5 for row in rows]
        figures.append(share(f"lamp reached by at most 1.5 times the straight way, {words}", good, target))
        figures.append(mean(f"way over straight way, {words}", [row["ratio"] for row in rows if row["reached"]]))
    return Report(figures)


def _by(cases: Sequence[Case], results: Sequence[Result], key: str) -> dict[str, list[Result]]:
    found: dict[str, list[Result]] = {}
    for case, result in zip(cases, results, strict=True):
        found.setdefault(case[key], []).append(result)
    return found


def _shown(behavior: str, by: str, world: str, seconds: float) -> Callable[[Path], list[Path]]:
    def show(folder: Path) -> list[Path]:
        return run_shown(folder, drives.program(behavior, by), world=world, seed=1, seconds=seconds)

    return show


EXPERIMENTS = (
    Experiment(
        "push",
        "things of several weights and shapes are pushed, by half a minute of driving",
        "5",
        _push_cases,
        drives.push,
        _push_report,
        _shown("push", "shipped", "push", 40),
    ),
    Experiment(
        "avoid",
        "contacts in the furnished arena: specified, taught, and the teacher",
        "5",
        _avoid_cases,
        drives.avoid,
        _avoid_report,
        _shown("avoid", "shipped", "furnished", 120),
    ),
    Experiment(
        "follow",
        "tours around fifteen objects, right and left, specified and taught",
        "5",
        _follow_cases,
        drives.follow,
        _follow_report,
        _shown("follow", "shipped", "post", 40),
    ),
    Experiment(
        "phototaxy",
        "a lamp is reached from anywhere",
        "5",
        _phototaxy_cases,
        drives.phototaxy,
        _phototaxy_report,
        _shown("phototaxy", "shipped", "lamp", 40),
    ),
)
