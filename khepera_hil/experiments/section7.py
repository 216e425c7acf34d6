"""Section 7: homing by two behaviors and a command variable; figures 7 to 10, and what lesson 7 is worth."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from brp import Description, Form, P, Specification, Switch, Table, Uniform
from brp.programs.home import Dir, H, Prox, Theta1, Vrot, command, home
from brp.programs.obstacle import avoid
from brp.programs.phototaxy import phototaxy1
from khepera_hil.controllers import PROGRAMS, Controller
from khepera_hil.controllers.base import Reactive
from khepera_hil.experiments.arenas import pocket, written
from khepera_hil.experiments.cases import Case, Result
from khepera_hil.experiments.drives import generator, lesson
from khepera_hil.experiments.experiment import Experiment, Report, Shown, no_cases, no_trial
from khepera_hil.experiments.figures import Figure, counted, mean, share
from khepera_hil.experiments.picture import Chart, Curve, charted
from khepera_hil.experiments.show import run_shown
from khepera_hil.experiments.trial import Trial, drive
from khepera_hil.perception import LightBearing, Obstacle
from khepera_hil.recording import Tick
from khepera_hil.teaching.hidden import learnt_home, weights

__all__ = ["EXPERIMENTS", "NOW_FAR", "NOW_NEAR"]

_LIMIT = 120.0
_BASE = 0.18
"""Side of the base's square in its corner, m."""
POCKETS = {"pocket 200 x 120, low": (200, 120, 30), "pocket 300 x 150, low": (300, 150, 30)}


def _mixed(weight: Form, name: str) -> Controller:
    """Homing with another P(H | Prox)."""
    description: Description = Specification(
        {
            P(Dir): Uniform(),
            P(Prox): Uniform(),
            P(Theta1): Uniform(),
            P(H | Prox): weight,
            P(Vrot | Dir, Prox, Theta1, H): Switch(H, {"avoidance": avoid, "phototaxy": phototaxy1}),
        },
        name=name,
    ).identify()
    return Reactive(name, [Obstacle(), LightBearing()], description.ask(P(Vrot | Dir, Prox, Theta1)))


def _always(avoidance: Any) -> Table:
    p = np.array(avoidance, dtype=np.float64)
    return Table(np.stack([p, 1 - p]))


def _controller(kind: str, seed: int) -> Controller:
    if kind == "home":
        return PROGRAMS["home"].make()
    if kind == "hard threshold":
        return _mixed(_always([0.0 if int(prox) < 9 else 1.0 for prox in Prox.values]), "pi-hard")
    if kind == "avoidance alone":
        return _mixed(_always(np.ones(16)), "pi-avoidance")
    if kind == "phototaxy alone":
        return _mixed(_always(np.zeros(16)), "pi-phototaxy")
    return _mixed(_always(weights(learnt_home(_own(1000), by_hand=True))), "pi-learnt")


def _home_trial(case: Case) -> Result:
    """Whether the base was reached within two minutes, and what was touched on the way."""

    def watch(tick: Tick, trial: Trial) -> bool:
        return tick.pose is not None and tick.pose[0] <= _BASE and tick.pose[1] <= _BASE

    controller = _controller(case["kind"], case["seed"])
    if case["where"] == "furnished":
        trial = drive(controller, world="furnished", seed=case["seed"], duration=_LIMIT, watch=watch)
    else:
        text = pocket(*POCKETS[case["where"]], generator(case["seed"]))
        with written(text) as world:
            trial = drive(controller, world=world, seed=case["seed"], duration=_LIMIT, watch=watch)
    return {
        "reached": trial.score["base_reached_s"] is not None,
        "seconds": round(trial.ticks[-1].t, 2),
        "longest_s": trial.score["contact_longest_s"],
    }


def _home_cases(seeds: Sequence[int]) -> list[Case]:
    return [{"kind": "home", "seed": seed, "where": where} for seed in seeds for where in ("furnished", *POCKETS)]


def _home_report(cases: Sequence[Case], results: Sequence[Result]) -> Report:
    figures: list[Figure] = []
    for where in ("furnished", *POCKETS):
        rows = [result for case, result in zip(cases, results, strict=True) if case["where"] == where]
        here = where == "furnished"
        figures.append(
            share(f"base reached within 120 s, {where}", [r["reached"] for r in rows], ">= 0.98" if here else None)
        )
        figures.append(
            share(
                f"runs with a contact over 1 s, {where}",
                [r["longest_s"] > 1 for r in rows],
                "<= 0.01" if here else None,
            )
        )
    times = sorted(
        r["seconds"] for c, r in zip(cases, results, strict=True) if c["where"] == "furnished" and r["reached"]
    )
    lines = [f"  median time home in furnished: {times[len(times) // 2]:.1f} s"] if times else []
    places = ("furnished", *POCKETS)
    charts = [
        charted("base reached within 120 s", "where", dict(zip(places, figures[::2], strict=True))),
        charted("runs with a contact over 1 s", "where", dict(zip(places, figures[1::2], strict=True))),
    ]
    return Report(figures, lines, charts, title="Homing", columns=1)


_KINDS = ("home", "hard threshold", "avoidance alone", "phototaxy alone", "learnt P(H | Prox)")


def _lesson7_cases(seeds: Sequence[int]) -> list[Case]:
    return [{"kind": kind, "seed": seed, "where": "furnished"} for seed in seeds for kind in _KINDS]


def _lesson7_report(cases: Sequence[Case], results: Sequence[Result]) -> Report:
    figures: list[Figure] = []
    lines = ["  program               base reached   contact over 1 s   median time (s)"]
    for kind in _KINDS:
        rows = [result for case, result in zip(cases, results, strict=True) if case["kind"] == kind]
        reached, long = [r["reached"] for r in rows], [r["longest_s"] > 1 for r in rows]
        figures.append(share(f"base reached, {kind}", reached))
        figures.append(share(f"a contact over 1 s, {kind}", long))
        times = [r["seconds"] for r in rows if r["reached"]]
        median = f"{np.median(times):.1f}" if times else "-"
        lines.append(f"  {kind:20}  {np.mean(reached):12.2f}   {np.mean(long):16.2f}   {median:>15}")
    charts = [
        charted("base reached within 120 s", "P(H | Prox)", dict(zip(_KINDS, figures[::2], strict=True))),
        charted("runs with a contact over 1 s", "P(H | Prox)", dict(zip(_KINDS, figures[1::2], strict=True))),
    ]
    return Report(figures, lines, charts, title="Lesson 7: what mixing is worth", columns=1)


def _home_show(folder: Path) -> Shown:
    return run_shown(folder, PROGRAMS["home"].make(), world="furnished", seed=8, seconds=40)


def _lessons(seed: int) -> list[dict[str, Any]]:
    """Two minutes of homing by hand, from six places."""
    return [row for k in range(6) for row in lesson("home", 20, 1000 * seed + k)]


def _own(seed: int) -> list[dict[str, Any]]:
    """Two minutes of the program home, as somebody who only looks on would write them down."""
    rows: list[dict[str, Any]] = []
    for k in range(3):
        run = drive(PROGRAMS["home"].make(), world="furnished", seed=1000 * seed + k, duration=40)
        rows += [{**tick.evidence, **tick.draws} for tick in run.ticks if tick.draws]
    return rows


def _fig7_trial(case: Case) -> Result:
    """P(avoidance | Prox) learnt with H never observed: from homing by hand, and from runs of home itself."""
    taught = weights(learnt_home(_lessons(case["seed"])))
    own = weights(learnt_home(_own(case["seed"]), by_hand=True))
    return {name: [round(float(w), 6) for w in found] for name, found in (("taught", taught), ("own", own))}


def _fig7_cases(seeds: Sequence[int]) -> list[Case]:
    return [{"seed": seed} for seed in seeds]


def _specified() -> list[float]:
    return [float(command(Prox=prox)["avoidance"]) for prox in Prox.values]


def _fig7_report(cases: Sequence[Case], results: Sequence[Result]) -> Report:
    w = _specified()
    places = range(len(w))
    learnt = {
        name: [
            mean(f"P(avoidance | Prox {prox}) learnt {words}, H hidden", [r[name][prox] for r in results])
            for prox in places
        ]
        for name, words in (("own", "from runs of home"), ("taught", "from homing by hand"))
    }
    figures = [
        counted("P(avoidance | Prox 0)", w[0], "<= 0.001", "0"),
        counted("P(avoidance | Prox 9)", w[9], "== 0.5", "0.5 (alpha = 9)"),
        counted("P(avoidance | Prox 15)", w[15], ">= 0.99", "1"),
        *(line[prox] for line in learnt.values() for prox in (0, 9, 15)),
    ]
    lines = {
        "specified": [counted("", one) for one in w],
        "learnt from two minutes of home, H never observed": learnt["own"],
        "learnt from two minutes of homing by hand": learnt["taught"],
    }
    curve = Curve("P(avoidance | Prox pi-home)", "Prox", list(places), lines)
    return Report(figures, curves=[curve], title="Figure 7: P(avoidance | Prox)", columns=1)


NOW_NEAR = {"Dir": -5, "Prox": 12, "Theta1": -90}
"""Figure 9: close to an object at the left, the light at the left too."""
NOW_FAR = {"Dir": -5, "Prox": 8, "Theta1": -90}
"""Figure 10: further away. The paper prints Dir -5, Prox 8, Lum -90 between the two."""


def _combination(now: dict[str, int]) -> dict[str, Any]:
    return {
        "phototaxy": phototaxy1(Theta1=now["Theta1"]),
        "avoidance": avoid(Dir=now["Dir"], Prox=now["Prox"]),
        "H": command(Prox=now["Prox"]),
        "home": home(**now),
    }


def _turns_right(answer: Any) -> float:
    return float(sum(answer[vrot] for vrot in Vrot.values if int(vrot) > 0))


def _figure9(now: dict[str, int], target: str, said: str, title: str) -> Report:
    found = _combination(now)
    at = [float(vrot) for vrot in Vrot.values]
    h = found["H"]
    return Report(
        [
            counted("P(turns right) by phototaxy alone", _turns_right(found["phototaxy"])),
            counted("P(turns right) by avoidance alone", _turns_right(found["avoidance"])),
            counted("P(avoidance | Prox)", h["avoidance"]),
            counted("P(turns right) by the combination", _turns_right(found["home"]), target, said),
        ],
        [f"  at Dir {now['Dir']}, Prox {now['Prox']}, Theta1 {now['Theta1']}"],
        [
            Chart("P(Vrot | Theta1 phototaxy)", "Vrot", found["phototaxy"].p.tolist(), at),
            Chart("P(Vrot | Dir Prox avoidance)", "Vrot", found["avoidance"].p.tolist(), at),
            Chart(
                "P(H | Prox)",
                "the command variable",
                [h["avoidance"], h["phototaxy"]],
                None,
                ["avoidance", "phototaxy"],
            ),
            Chart("P(Vrot | Dir Prox Theta1 pi-home)", "Vrot", found["home"].p.tolist(), at),
        ],
        title=title,
    )


# Figure 8: what is seen of homing from above.


def _fig8_trial(case: Case) -> Result:
    """Homing from anywhere: how long the way is, and how much of it avoidance has the say."""

    def watch(tick: Tick, trial: Trial) -> bool:
        return tick.pose is not None and tick.pose[0] <= _BASE and tick.pose[1] <= _BASE

    trial = drive(PROGRAMS["home"].make(), world="furnished", seed=case["seed"], duration=_LIMIT, watch=watch)
    first = trial.ticks[0].pose
    assert first is not None
    straight = math.hypot(max(0.0, first[0] - _BASE), max(0.0, first[1] - _BASE))
    weights = [float(tick.answers["H"].p[0]) for tick in trial.ticks if "H" in tick.answers]
    return {
        "reached": trial.stopped,
        "ratio": round(trial.path / straight, 4) if straight > 0 else None,
        "seconds": round(trial.ticks[-1].t, 2),
        "avoids": round(float(np.mean([weight > 0.5 for weight in weights])), 4),
    }


def _fig8_cases(seeds: Sequence[int]) -> list[Case]:
    return [{"seed": seed} for seed in seeds]


def _fig8_report(cases: Sequence[Case], results: Sequence[Result]) -> Report:
    there = [r for r in results if r["reached"]]
    return Report(
        [
            share("base reached within 120 s", [r["reached"] for r in results], ">= 0.98", "efficient homing"),
            mean("way over the straight way to the base", [r["ratio"] for r in there]),
            mean("seconds to the base", [r["seconds"] for r in there]),
            mean("share of the ticks in which avoidance outweighs phototaxy", [r["avoids"] for r in there]),
        ]
    )


EXPERIMENTS = (
    Experiment(
        "home",
        "the lit base is reached, obstacles avoided; pockets before it",
        "7",
        _home_cases,
        _home_trial,
        _home_report,
        _home_show,
    ),
    Experiment(
        "fig7",
        "P(avoidance | Prox), specified and learnt",
        "7.2",
        _fig7_cases,
        _fig7_trial,
        _fig7_report,
    ),
    Experiment(
        "fig8",
        "homing from above",
        "7.5",
        _fig8_cases,
        _fig8_trial,
        _fig8_report,
        _home_show,
    ),
    Experiment(
        "fig9",
        "close to an object at the left, the light at the left: it turns right",
        "7.5",
        no_cases,
        no_trial,
        lambda cases, results: _figure9(
            NOW_NEAR, ">= 0.9", "turns right", "Figure 9: close to an object on the left"
        ),
    ),
    Experiment(
        "fig10",
        "further from the object: it may turn left, to the light",
        "7.5",
        no_cases,
        no_trial,
        lambda cases, results: _figure9(
            NOW_FAR,
            "<= 0.5",
            "may turn left despite the obstacle",
            "Figure 10: further from the object on the left",
        ),
    ),
    Experiment(
        "lesson7",
        "home against a hard threshold, each behavior alone, and a learnt P(H | Prox)",
        "7.5",
        _lesson7_cases,
        _home_trial,
        _lesson7_report,
    ),
)
