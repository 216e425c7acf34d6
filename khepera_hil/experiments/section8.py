"""Section 8: fifteen objects, five times each, in random order (table 1, figure 11)."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from brp import BrpError
from brp.programs.object import recognised, unacquainted
from khepera_hil.controllers.object import Recogniser
from khepera_hil.errors import RecordingError
from khepera_hil.experiments.arenas import OBJECTS, beside, written
from khepera_hil.experiments.cases import Case, Result
from khepera_hil.experiments.drives import generator
from khepera_hil.experiments.experiment import Experiment, Report, Shown, no_cases, no_trial
from khepera_hil.experiments.figures import counted, mean, share
from khepera_hil.experiments.picture import Chart, FromAbove, superposed
from khepera_hil.experiments.show import run_shown
from khepera_hil.experiments.trial import Trial, drive
from khepera_hil.recording import Tick
from khepera_hil.world import World

__all__ = ["EXPERIMENTS"]

PRESENTATIONS = 5
TWINS = ("square 60", "tower 60")
"""The same base: "in the position of someone asked to identify the color of an object by groping it"."""

_FLOORS = {"Per": 5.0, "Lrl": 12.0}
"""The least deviations of `brp.programs.object`."""


def _tour_trial(case: Case) -> Result:
    """One presentation: the tour that the robot makes around an object, or none within two minutes.

    The robot of an order is one and the same; the noise that it meets is each presentation's own.
    """
    controller = Recogniser()

    def watch(tick: Tick, trial: Trial) -> bool:
        return bool(controller.objects.met)

    chance = generator(case["seed"], 8, case["presentation"], list(OBJECTS).index(case["object"]))
    with written(beside(OBJECTS[case["object"]], 1, chance)) as world:
        trial = drive(
            controller,
            world=world,
            seed=int(chance.integers(2**32)),
            duration=120,
            watch=watch,
            options={"individual": str(case["seed"])},
        )
    met = controller.objects.met
    tour = {k: v for k, v in met[0].items() if k != "O"} if met else None
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
    every = _tours(cases, results)
    for seed, tours in every.items():
        met: set[str] = set()
        for name, taken in _order(seed, tours):
            if name in TWINS:
                twins.append(taken == name or (name not in met and taken == "new"))
            elif name not in met:
                novelty.append(taken == "new")
            else:
                recognition.append(taken == name)
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
    first = min(every)
    lines = [
        f"  table 1 as the paper prints it, of the order of seed {first}:",
        *_as_printed(_order(first, every[first])),
    ]
    charts = [
        Chart(
            f"mean {key} of a tour, mm",
            "the objects",
            [means[key] for means in _means(every).values()],
            None,
            list(OBJECTS),
        )
        for key in _FLOORS
    ]
    return Report(figures, lines, charts, title="Table 1: tours around the fifteen objects", columns=1)


def _as_printed(said: Sequence[tuple[str, str | None]]) -> list[str]:
    """Columns are the presented objects in the order of their first presentation, F that first one; rows what they
    were taken for, 0 a new object."""
    names = list(dict.fromkeys(name for name, _ in said))
    count: dict[tuple[int, int], int] = {}
    met: set[str] = set()
    for name, taken in said:
        if taken is not None:
            row = 0 if taken == "new" else names.index(taken) + 1
            column = names.index(name) + 1 if name in met else 0
            count[row, column] = count.get((row, column), 0) + 1
        met.add(name)
    lines = ["        F" + "".join(f"{column:3}" for column in range(1, len(names) + 1))]
    for row in range(len(names) + 1):
        cells = "".join(f"{count.get((row, column), ''):3}" for column in range(len(names) + 1))
        lines.append(f"  {row:4}  {cells}  {names[row - 1] if row else 'new'}".rstrip())
    return lines


def _means(every: _Every) -> dict[str, dict[str, float]]:
    """Of every object's tours; 0 where there was none."""
    found: dict[str, dict[str, float]] = {}
    for name in OBJECTS:
        tours = [tour for each in every.values() for tour in _whole(each.get(name, []))]
        found[name] = {key: float(np.mean([tour[key] for tour in tours])) if tours else 0.0 for key in _FLOORS}
    return found


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


def _table_show(folder: Path) -> Shown:
    chance = generator(1, 11)
    with written(beside(OBJECTS["L 100"], 1, chance)) as world:
        return run_shown(folder, Recogniser(), world=world, seed=1, seconds=60, every=8)


# Figure 11: the objects themselves.


def _fig11_show(folder: Path) -> Shown:
    """The fifteen objects in rows, from above."""
    shapes = _outlines()
    poses = {
        name: (0.15 + 0.25 * (place % 5), 0.65 - 0.25 * (place // 5), 0.0) for place, name in enumerate(OBJECTS)
    }
    there = [{**shapes[name], "pose": list(poses[name])} for name in OBJECTS]
    picture = FromAbove("The fifteen objects, from above", (1.3, 0.8), there, poses, names=True)
    path = folder / "above.svg"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        path.write_text(superposed(picture), "utf-8")
    except OSError as error:
        raise RecordingError(f"{path} cannot be written: {error.strerror or error}") from None
    return Shown([path], [picture])


def _outlines() -> dict[str, dict[str, Any]]:
    return {shape["name"]: shape for shape in World("objects", 1).shapes() if shape["name"] in OBJECTS}


def _around(shape: Mapping[str, Any]) -> float:
    """A thing's perimeter, mm."""
    if "polygon" not in shape:
        return 2000 * math.pi * float(shape["radius"])
    corners = shape["polygon"]
    return 1000 * sum(math.dist(a, b) for a, b in zip(corners, [*corners[1:], corners[0]], strict=True))


def _fig11_report(cases: Sequence[Case], results: Sequence[Result]) -> Report:
    shapes = _outlines()
    bases = [json.dumps(shape.get("polygon", shape.get("radius"))) for shape in shapes.values()]
    around = {name: _around(shapes[name]) for name in OBJECTS}
    lines = ["  object                perimeter (mm)   height (mm)"]
    lines += [f"  {name:20}  {around[name]:14.0f}   {1000 * shapes[name]['height']:11.0f}" for name in OBJECTS]
    chart = Chart("perimeter, mm", "the objects", list(around.values()), None, list(OBJECTS))
    return Report(
        [
            counted("objects", len(shapes), "== 15", "15"),
            counted("of these, with a base that another one has too", len(bases) - len(set(bases)), "== 1", "1"),
            counted("least perimeter, mm", min(around.values())),
            counted("greatest perimeter, mm", max(around.values())),
        ],
        lines,
        [chart],
        title="Figure 11: the fifteen objects",
        columns=1,
    )


EXPERIMENTS = (
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
