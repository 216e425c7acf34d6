"""What a hand-coded look-alike could not do: other data, other robots, less data, more noise, other questions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
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
from khepera_hil.experiments.picture import Chart, Curve, charted
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


_UNITS = {
    "push": "pushed 200 mm",
    "avoid": "contacts in 30 min",
    "follow": "tours completed",
    "phototaxy": "lamp reached",
}
"""What each behavior's figure is."""


def _table(title: str, rows: Mapping[str, Mapping[str, Figure]]) -> list[str]:
    """A line for each row, a column for each behavior."""
    behaviors = next(iter(rows.values()))
    lines = [f"  {title:24}" + "".join(f"{_UNITS[behavior]:>22}" for behavior in behaviors)]
    for name, figures in rows.items():
        cells = "".join(
            f"{'-' if f.value is None else f'{f.value:.2f}':>8} [{_two(f.low)}, {_two(f.high)}]".rjust(22)
            for f in figures.values()
        )
        lines.append(f"  {name:24}{cells}")
    return lines


def _two(number: float | None) -> str:
    return "-" if number is None else f"{number:.2f}"


def _crossed(
    cases: Sequence[Case],
    results: Sequence[Result],
    key: str,
    rows: Mapping[Any, str],
    behaviors: Sequence[str],
    words: str,
) -> dict[str, dict[str, Figure]]:
    """Each behavior's figure in each row: of the cases that have the row's value under ``key``.

    ``rows`` names the values; ``words`` says what a figure is of, with ``behavior`` and ``row`` filled in.
    """
    pairs = list(zip(cases, results, strict=True))
    return {
        name: {
            behavior: _figure(
                behavior,
                words.format(behavior=behavior, row=name),
                [result for case, result in pairs if case["behavior"] == behavior and case[key] == value],
            )
            for behavior in behaviors
        }
        for value, name in rows.items()
    }


def _compared(title: str, left: str, rows: Mapping[str, Mapping[str, Figure]], axis: str) -> Report:
    """A table, and a chart for each behavior with a bar for each row."""
    behaviors = list(next(iter(rows.values())))
    charts = [
        charted(f"{behavior}: {_UNITS[behavior]}", axis, {name: cells[behavior] for name, cells in rows.items()})
        for behavior in behaviors
    ]
    return Report(_flat(rows), _table(left, rows), charts, title=title)


def _flat(rows: Mapping[str, Mapping[str, Figure]]) -> list[Figure]:
    return [figure for cells in rows.values() for figure in cells.values()]


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
    names = {name: name for name in (*_DATA, "no data", "shuffled")}
    rows = _crossed(cases, results, "data", names, _BEHAVIORS, "as {behavior} with {row}")
    return _compared("Lesson 2: one specification, other data", "pi-obstacle with", rows, "the data")


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
    names = {seconds: f"{seconds} s" for seconds in _SECONDS}
    rows = _crossed(cases, results, "length", names, _TAUGHT, "{behavior} after {row} of driving")
    curves = [
        Curve(
            f"{behavior}: {_UNITS[behavior]}",
            "seconds of driving",
            _SECONDS,
            {_UNITS[behavior]: [cells[behavior] for cells in rows.values()]},
        )
        for behavior in _TAUGHT
    ]
    return Report(_flat(rows), _table("taught for", rows), curves=curves, title="What so much driving teaches")


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
    figures: list[Figure] = []
    lines = ["  noise   mean deviation of the taught Gaussians   situations visited"]
    for times in _TIMES:
        rows = [r for c, r in zip(cases, results, strict=True) if c["times"] == times]
        figures.append(mean(f"deviation of the taught Gaussians, noise x {times}", [r["deviation"] for r in rows]))
        cells = float(np.mean([r["cells"] for r in rows]))
        value = figures[-1].value
        lines.append(f"  x {times}     {'-' if value is None else f'{value:.2f}':>39}   {cells:18.0f}")
    curve = Curve("mean deviation of the taught Gaussians", "times the usual noise", _TIMES, {"deviation": figures})
    return Report(figures, lines, curves=[curve], title="What is taught is as uncertain as the sensors", columns=1)


# Other robots: taught on one, run on others (11.2).


def _robots_cases(seeds: Sequence[int]) -> list[Case]:
    cases: list[Case] = []
    for seed in seeds:
        for behavior in _TAUGHT:
            cases.append(_case(behavior, f"taught:30:{seed}", seed, robot="its own"))
            cases.append(_case(behavior, f"taught:30:{seed + 1}", seed, robot="another"))
    return cases


def _robots_report(cases: Sequence[Case], results: Sequence[Result]) -> Report:
    names = {robot: f"{robot} robot" for robot in ("its own", "another")}
    rows = _crossed(cases, results, "robot", names, _TAUGHT, "{behavior}, taught on {row}")
    return _compared("Taught on one robot, run on others", "taught on", rows, "taught on")


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
    asked = _opposite()
    turning, straight, away, towards, _ = (answer for _, answer, _ in asked)
    charts = [
        Chart(
            title,
            "asked the other way round",
            answer.p.tolist(),
            at or None,
            None if at else ["avoidance", "phototaxy"],
        )
        for title, answer, at in asked
    ]
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
        charts,
        title="Lesson 6: opposite questions on the same descriptions",
    )


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
    ),
    Experiment("learning", "5 to 60 seconds of driving", "5.5", _learning_cases, _trial, _learning_report),
    Experiment(
        "noise", "what is taught is as uncertain as the sensors", "11.1", _noise_cases, _noise_trial, _noise_report
    ),
    Experiment("robots", "taught on one robot, run on others", "11.2", _robots_cases, _trial, _robots_report),
)
