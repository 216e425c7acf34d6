"""What a hand-coded look-alike could not do: other data, other robots, less data, more noise, other questions."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from brp import P
from brp.gaussian import Taught
from brp.programs.home import H, Theta1, homing
from brp.programs.home import Prox as ProxH
from brp.programs.home import Vrot as VrotH
from brp.programs.obstacle import Dir, Prox, Vrot, following, obstacle
from khepera_hil.experiments import drives
from khepera_hil.experiments.arenas import OBJECTS
from khepera_hil.experiments.cases import Case, Result
from khepera_hil.experiments.experiment import Experiment, Report, no_cases, no_trial
from khepera_hil.experiments.figures import Figure, counted, mean, rate, share
from khepera_hil.experiments.picture import Chart
from khepera_hil.experiments.show import charts_shown
from khepera_hil.teaching.lesson import BEHAVIORS
from khepera_hil.world import scanner

__all__ = ["EXPERIMENTS"]

_MINUTES = 5.0


def _case(behavior: str, by: str, seed: int, **more: Any) -> Case:
    names = list(OBJECTS)
    extra: dict[str, dict[str, Any]] = {
        "avoid": {"seconds": 60 * _MINUTES},
        "follow": {"object": names[seed % len(names)]},
    }
    return {"behavior": behavior, "by": by, "seed": seed, **extra.get(behavior, {}), **more}


def _trial(case: Case) -> Result:
    return drives.BEHAVIOR_TRIALS[case["behavior"]](case)


def _figure(behavior: str, words: str, rows: Sequence[Result]) -> Figure:
    """The behavior's own figure, as in section 5."""
    if behavior == "avoid":
        minutes = sum(row["seconds"] for row in rows) / 60
        return rate(
            f"contacts over 0.5 s in 30 min, {words}", sum(r["long"] for r in rows), minutes / 30, len(rows)
        )
    if behavior == "push":
        return share(f"pushed 200 mm, {words}", [row["moved_mm"] >= 200 for row in rows])
    if behavior == "follow":
        return share(f"tours completed, {words}", [row["round"] for row in rows])
    return share(f"lamp reached, {words}", [row["reached"] and row["ratio"] <= 1.5 for row in rows])


def _table(title: str, columns: Sequence[str], rows: Sequence[tuple[str, Sequence[Figure]]]) -> list[str]:
    lines = [f"  {title:24}" + "".join(f"{column:>22}" for column in columns)]
    for name, figures in rows:
        cells = "".join(
            f"{'-' if f.value is None else f'{f.value:.2f}':>8} [{_two(f.low)}, {_two(f.high)}]".rjust(22)
            for f in figures
        )
        lines.append(f"  {name:24}{cells}")
    return lines


def _two(number: float | None) -> str:
    return "-" if number is None else f"{number:.2f}"


# Lesson 2: one specification, five kinds of data, three behaviors.

_BEHAVIORS = ("push", "avoid", "follow")
_DATA = {"delta-push": "push", "delta-avoid": "avoid", "delta-follow": "follow"}


def _lesson2_cases(seeds: Sequence[int]) -> list[Case]:
    cases: list[Case] = []
    for seed in seeds:
        for behavior in _BEHAVIORS:
            for name, source in _DATA.items():
                cases.append(_case(behavior, "shipped", seed, data=name, data_of=source))
            cases.append(_case(behavior, "nothing", seed, data="no data"))
            cases.append(_case(behavior, "shuffled", seed, data="shuffled"))
    return cases


def _lesson2_report(cases: Sequence[Case], results: Sequence[Result]) -> Report:
    rows: list[tuple[str, list[Figure]]] = []
    for data in (*_DATA, "no data", "shuffled"):
        cells = []
        for behavior in _BEHAVIORS:
            found = [
                r for c, r in zip(cases, results, strict=True) if c["behavior"] == behavior and c["data"] == data
            ]
            cells.append(_figure(behavior, f"as {behavior} with {data}", found))
        rows.append((data, cells))
    titles = ("pushed 200 mm", "contacts in 30 min", "tours completed")
    return Report([f for _, cells in rows for f in cells], _table("pi-obstacle with", titles, rows))


# The learning curve.

_SECONDS = (5, 10, 20, 30, 60)
_TAUGHT = ("push", "avoid", "follow", "phototaxy")


def _learning_cases(seeds: Sequence[int]) -> list[Case]:
    return [
        _case(behavior, f"taught:{seconds}:{seed}", seed, length=seconds)
        for seed in seeds
        for behavior in _TAUGHT
        for seconds in _SECONDS
    ]


def _learning_report(cases: Sequence[Case], results: Sequence[Result]) -> Report:
    rows = []
    for seconds in _SECONDS:
        cells = [
            _figure(
                behavior,
                f"{behavior} after {seconds} s of driving",
                [
                    r
                    for c, r in zip(cases, results, strict=True)
                    if c["behavior"] == behavior and c["length"] == seconds
                ],
            )
            for behavior in _TAUGHT
        ]
        rows.append((f"{seconds} s", cells))
    titles = ("pushed 200 mm", "contacts in 30 min", "tours completed", "lamp reached")
    return Report([f for _, cells in rows for f in cells], _table("taught for", titles, rows))


# Noise: what is taught is as uncertain as the sensors are (11.1).

_TIMES = (0, 1, 2, 4)


def _noise_trial(case: Case) -> Result:
    """A lesson of following with the proximity sensors' noise so many times what it is."""
    usual = scanner._PROXIMITY_NOISE
    try:
        scanner._PROXIMITY_NOISE = usual * case["times"]
        rows = drives.lesson("follow", 60, case["seed"])
    finally:
        scanner._PROXIMITY_NOISE = usual
    description = obstacle.identify([{v.name: row[v.name] for v in BEHAVIORS["follow"].variables} for row in rows])
    term = P(Vrot | Prox, Dir)
    form = description[term]
    assert isinstance(form, Taught)
    count = form.count
    variance = np.maximum(0, count * form.second - form.first**2) / np.where(count > 0, count, 1) ** 2
    many = count >= 5
    weight = count[many].sum()
    return {
        "deviation": round(float(np.sqrt((variance[many] * count[many]).sum() / weight)), 4) if weight else None,
        "cells": int((count > 0).sum()),
    }


def _noise_cases(seeds: Sequence[int]) -> list[Case]:
    return [{"seed": seed, "times": times} for seed in seeds for times in _TIMES]


def _noise_report(cases: Sequence[Case], results: Sequence[Result]) -> Report:
    figures = []
    lines = ["  noise   mean deviation of the taught Gaussians   situations visited"]
    for times in _TIMES:
        rows = [r for c, r in zip(cases, results, strict=True) if c["times"] == times]
        figures.append(mean(f"deviation of the taught Gaussians, noise x {times}", [r["deviation"] for r in rows]))
        cells = float(np.mean([r["cells"] for r in rows]))
        value = figures[-1].value
        lines.append(f"  x {times}     {'-' if value is None else f'{value:.2f}':>39}   {cells:18.0f}")
    return Report(figures, lines)


# Other robots: taught on one, run on others (11.2).


def _robots_cases(seeds: Sequence[int]) -> list[Case]:
    cases: list[Case] = []
    for seed in seeds:
        for behavior in _TAUGHT:
            cases.append(_case(behavior, f"taught:30:{seed}", seed, robot="its own"))
            cases.append(_case(behavior, f"taught:30:{seed + 1}", seed, robot="another"))
    return cases


def _robots_report(cases: Sequence[Case], results: Sequence[Result]) -> Report:
    rows = []
    for robot in ("its own", "another"):
        cells = [
            _figure(
                behavior,
                f"{behavior}, taught on {robot} robot",
                [
                    r
                    for c, r in zip(cases, results, strict=True)
                    if c["behavior"] == behavior and c["robot"] == robot
                ],
            )
            for behavior in _TAUGHT
        ]
        rows.append((f"{robot} robot", cells))
    titles = ("pushed 200 mm", "contacts in 30 min", "tours completed", "lamp reached")
    return Report([f for _, cells in rows for f in cells], _table("taught on", titles, rows))


# Lesson 6: opposite questions on the same descriptions.


def _opposite() -> list[tuple[str, Any, list[float]]]:
    where = following.ask(P(Prox | Vrot, Dir))
    turning = where(Vrot=-10, Dir=9)
    straight = where(Vrot=0, Dir=9)
    why = homing.ask(P(H | VrotH, ProxH, Theta1))
    away = why(Vrot=9, Prox=9, Theta1=-90)
    towards = why(Vrot=-9, Prox=9, Theta1=-90)
    at = [float(prox) for prox in Prox.values]
    return [
        ("P(Prox | Vrot = -10, Dir = 9) of following", turning, at),
        ("P(Prox | Vrot = 0, Dir = 9) of following", straight, at),
        ("P(H | Vrot = 9, Prox = 9, Theta1 = -90) of home", away, []),
        ("P(H | Vrot = -9, Prox = 9, Theta1 = -90) of home", towards, []),
        (
            "P(Dir | Vrot = -10) of following",
            following.ask(P(Dir | Vrot))(Vrot=-10),
            [float(d) for d in Dir.values],
        ),
    ]


def _lesson6_report(cases: Sequence[Case], results: Sequence[Result]) -> Report:
    turning, straight, away, towards, _ = (answer for _, answer, _ in _opposite())
    return Report(
        [
            counted("mean Prox when following turns hard away (Vrot -10, Dir 9)", turning.mean()),
            counted("mean Prox when it goes straight on (Vrot 0, Dir 9)", straight.mean()),
            counted(
                "P(avoidance) when it turned from the light (Vrot 9, lamp at -90)", away["avoidance"], ">= 0.5"
            ),
            counted("P(avoidance) when it turned to the light (Vrot -9)", towards["avoidance"], "<= 0.5"),
        ],
        ["  the descriptions are those of follow and home: nothing was added to ask the other way round"],
    )


def _lesson6_show(folder: Path) -> list[Path]:
    charts = [
        Chart(
            title,
            "asked the other way round",
            answer.p.tolist(),
            at or None,
            None if at else ["avoidance", "phototaxy"],
        )
        for title, answer, at in _opposite()
    ]
    return charts_shown(folder, "lesson6", "Opposite questions on the same descriptions", charts)


EXPERIMENTS = (
    Experiment(
        "lesson2",
        "one specification with the data of push, avoid, follow, none, and shuffled",
        "5.5",
        _lesson2_cases,
        _trial,
        _lesson2_report,
    ),
    Experiment(
        "lesson6",
        "opposite questions on the same descriptions",
        "6.4",
        no_cases,
        no_trial,
        _lesson6_report,
        _lesson6_show,
    ),
    Experiment("learning", "5 to 60 seconds of driving", "5.5", _learning_cases, _trial, _learning_report),
    Experiment(
        "noise", "what is taught is as uncertain as the sensors", "11.1", _noise_cases, _noise_trial, _noise_report
    ),
    Experiment("robots", "taught on one robot, run on others", "11.2", _robots_cases, _trial, _robots_report),
)
