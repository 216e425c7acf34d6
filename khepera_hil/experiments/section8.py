"""Section 8: fifteen objects, five times each, in random order (table 1, figure 11); figure 4: round one."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from brp import BrpError
from brp.programs.object import recognised, unacquainted
from khepera_hil.controllers import PROGRAMS
from khepera_hil.controllers.object import Recogniser
from khepera_hil.experiments.arenas import OBJECTS, beside, written
from khepera_hil.experiments.cases import Case, Result
from khepera_hil.experiments.drives import generator
from khepera_hil.experiments.experiment import Experiment, Report, no_cases, no_trial
from khepera_hil.experiments.figures import counted, mean, share
from khepera_hil.experiments.picture import superposed
from khepera_hil.experiments.show import run_shown
from khepera_hil.experiments.trial import Trial, drive
from khepera_hil.recording import Tick
from khepera_hil.world import World

__all__ = ["EXPERIMENTS"]

PRESENTATIONS = 5
TWINS = ("square 60", "pyramid 60")
"""The same base: "in the position of someone asked to identify the color of an object by groping it"."""

_FLOORS = {"Per": 5.0, "Lrl": 12.0}
"""The least deviations of `brp.programs.object`."""


def _tour_trial(case: Case) -> Result:
    """One presentation: the tour that the robot makes around an object, or none within two minutes."""
    controller = Recogniser()

    def watch(tick: Tick, trial: Trial) -> bool:
        return bool(controller.met)

    chance = generator(case["seed"], 8, case["presentation"], list(OBJECTS).index(case["object"]))
    with written(beside(OBJECTS[case["object"]], 1, chance)) as world:
        trial = drive(controller, world=world, seed=case["seed"], duration=120, watch=watch)
    tour = {k: v for k, v in controller.met[0].items() if k != "O"} if controller.met else None
    return {"tour": tour, "seconds": round(trial.ticks[-1].t, 1)}


def _table_cases(seeds: Sequence[int]) -> list[Case]:
    return [
        {"seed": seed, "object": name, "presentation": k}
        for seed in seeds
        for name in OBJECTS
        for k in range(PRESENTATIONS)
    ]


def _tours(cases: Sequence[Case], results: Sequence[Result]) -> dict[int, dict[str, list[dict[str, int] | None]]]:
    tours: dict[int, dict[str, list[dict[str, int] | None]]] = {}
    for case, result in zip(cases, results, strict=True):
        tours.setdefault(case["seed"], {}).setdefault(case["object"], []).append(result["tour"])
    return tours


def _order(seed: int, tours: Mapping[str, list[dict[str, int] | None]]) -> list[tuple[str, str | None]]:
    """Present all in random order; what each was taken for: an object's name, ``new``, or None without a tour."""
    queue = [name for name in tours for _ in range(PRESENTATIONS)]
    np.random.default_rng([seed, 88]).shuffle(queue)
    left = {name: list(found) for name, found in tours.items()}
    knowing, owner, said = unacquainted, dict[int, str](), list[tuple[str, str | None]]()
    for name in queue:
        tour = left[name].pop()
        if tour is None:
            said.append((name, None))
            continue
        try:
            o = recognised(knowing, tour)
        except BrpError:  # a sixteenth object: reported, not learnt
            said.append((name, "new"))
            continue
        said.append((name, owner.get(o, "new")))
        owner.setdefault(o, name)
        knowing = knowing.learn({"O": o, **tour})
    return said


def _table_report(cases: Sequence[Case], results: Sequence[Result]) -> Report:
    novelty, recognition, twins = list[bool](), list[bool](), list[bool]()
    table: dict[str, dict[str, int]] = {}
    every = _tours(cases, results)
    for seed, tours in every.items():
        met: set[str] = set()
        for name, taken in _order(seed, tours):
            same = taken is not None and (taken == name or (taken in TWINS and name in TWINS))
            if seed == min(every):
                row = table.setdefault(name, {})
                key = "F:" + str(taken) if name not in met else str(taken)
                row[key] = row.get(key, 0) + 1
            if name in TWINS:
                twins.append(taken == name or (name not in met and taken == "new"))
            elif name not in met:
                novelty.append(taken == "new")
            else:
                recognition.append(same)
            met.add(name)
    flat = [result["tour"] for result in results]
    spread = _spread(every)
    figures = [
        share("novelty right, the twins aside", novelty, ">= 0.99", "13 of 13"),
        share("recognition right, the twins aside", recognition, ">= 0.99", "51 of 52"),
        share("the twins right", twins, paper="5 of 10"),
        share("tours completed", [tour is not None for tour in flat]),
        mean("deviation of Per around one object, one robot, mm", spread["Per"]),
        mean("deviation of Lrl around one object, one robot, mm", spread["Lrl"]),
        counted("least separation of two objects, in floor deviations", _separation(every)),
        share("best achievable recognition for the measured spread", _best(every)),
    ]
    lines = ["  first order: rows are the presented objects, F: how the first presentation was taken"]
    for name, row in table.items():
        lines.append(f"  {name:20} " + ", ".join(f"{key} {count}" for key, count in sorted(row.items())))
    return Report(figures, lines)


_Every = Mapping[int, Mapping[str, list[dict[str, int] | None]]]


def _whole(tours: Sequence[dict[str, int] | None]) -> list[dict[str, int]]:
    return [tour for tour in tours if tour is not None]


def _spread(every: _Every) -> dict[str, list[float]]:
    return {
        key: [
            float(np.std([tour[key] for tour in _whole(found)], ddof=1))
            for tours in every.values()
            for found in tours.values()
            if len(_whole(found)) > 1
        ]
        for key in _FLOORS
    }


def _separation(every: _Every) -> float:
    """Of the two objects, twins aside, that are nearest to each other, on the mean over robots."""
    least = []
    for tours in every.values():
        means = {
            name: [float(np.mean([tour[key] for tour in _whole(found)])) for key in _FLOORS]
            for name, found in tours.items()
            if _whole(found)
        }
        pairs = [
            math.hypot(*((a - b) / floor for a, b, floor in zip(means[x], means[y], _FLOORS.values(), strict=True)))
            for x in means
            for y in means
            if x < y and not (x in TWINS and y in TWINS)
        ]
        least.append(min(pairs))
    return float(np.mean(least))


def _best(every: _Every) -> list[bool]:
    """Whether each tour is nearest to its own object's others: what no order and no learning could better much."""
    hits = []
    for tours in every.values():
        for name, found in tours.items():
            for k, tour in enumerate(_whole(found)):
                far: dict[str, float] = {}
                for other, others in tours.items():
                    rest = [one for j, one in enumerate(_whole(others)) if not (other == name and j == k)]
                    if rest:
                        far[other] = math.hypot(
                            *(
                                (tour[key] - float(np.mean([one[key] for one in rest]))) / _FLOORS[key]
                                for key in _FLOORS
                            )
                        )
                best = min(far, key=lambda other: far[other])
                hits.append(best == name or (best in TWINS and name in TWINS))
    return hits


def _table_show(folder: Path) -> list[Path]:
    chance = generator(1, 11)
    with written(beside(OBJECTS["L 100"], 1, chance)) as world:
        return run_shown(folder, Recogniser(), world=world, seed=1, seconds=60, every=8)


def _fig4_show(folder: Path) -> list[Path]:
    with written(beside(OBJECTS["rectangle 60 x 160"], 1, generator(1, 4))) as world:
        return run_shown(folder, PROGRAMS["follow"].make(), world=world, seed=1, seconds=30, every=8)


def _fig11_show(folder: Path) -> list[Path]:
    """The fifteen objects in rows, from above."""
    folder.mkdir(parents=True, exist_ok=True)
    shapes = {shape["name"]: shape for shape in World("objects", 1).shapes() if shape["name"] in OBJECTS}
    poses = {
        name: (0.15 + 0.25 * (place % 5), 0.65 - 0.25 * (place // 5), 0.0) for place, name in enumerate(OBJECTS)
    }
    there = [{**shapes[name], "pose": list(poses[name])} for name in OBJECTS]
    path = folder / "fig11.svg"
    path.write_text(superposed((1.3, 0.8), there, poses, [], 1), "utf-8")
    return [path]


def _pictured(cases: Sequence[Case], results: Sequence[Result]) -> Report:
    return Report([], ["  a picture; its figures are those of follow (figure 4) and table1 (figure 11)"])


def _fig11_report(cases: Sequence[Case], results: Sequence[Result]) -> Report:
    sizes: list[Any] = list(OBJECTS)
    return Report([counted("objects", len(sizes), "== 15", "15")], [f"  {', '.join(sizes)}"])


EXPERIMENTS = (
    Experiment("fig4", "contour following from above", "5.5", no_cases, no_trial, _pictured, _fig4_show),
    Experiment("fig11", "the fifteen objects", "8.5", no_cases, no_trial, _fig11_report, _fig11_show),
    Experiment(
        "table1",
        "fifteen objects five times each, in random order: new, or known",
        "8.5",
        _table_cases,
        _tour_trial,
        _table_report,
        _table_show,
    ),
)
