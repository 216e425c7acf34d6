"""Section 7: homing by two behaviors and a command variable; figures 7 to 10, and what lesson 7 is worth."""

from __future__ import annotations

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
from khepera_hil.experiments.experiment import Experiment, Report, no_cases, no_trial
from khepera_hil.experiments.figures import counted, mean, share
from khepera_hil.experiments.picture import Chart
from khepera_hil.experiments.show import charts_shown, run_shown
from khepera_hil.experiments.trial import Trial, drive
from khepera_hil.perception import LightBearing, Obstacle
from khepera_hil.recording import Tick
from khepera_hil.teaching.hidden import learnt_home, weights

__all__ = ["EXPERIMENTS", "NOW_FAR", "NOW_NEAR"]

_LIMIT = 120.0
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
        return tick.pose is not None and tick.pose[0] <= 0.18 and tick.pose[1] <= 0.18

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
    figures = []
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
    return Report(figures, lines)


_KINDS = ("home", "hard threshold", "avoidance alone", "phototaxy alone", "learnt P(H | Prox)")


def _lesson7_cases(seeds: Sequence[int]) -> list[Case]:
    return [{"kind": kind, "seed": seed, "where": "furnished"} for seed in seeds for kind in _KINDS]


def _lesson7_report(cases: Sequence[Case], results: Sequence[Result]) -> Report:
    figures = []
    lines = ["  program               base reached   contact over 1 s   median time (s)"]
    for kind in _KINDS:
        rows = [result for case, result in zip(cases, results, strict=True) if case["kind"] == kind]
        reached, long = [r["reached"] for r in rows], [r["longest_s"] > 1 for r in rows]
        figures.append(share(f"base reached, {kind}", reached))
        figures.append(share(f"a contact over 1 s, {kind}", long))
        times = [r["seconds"] for r in rows if r["reached"]]
        median = f"{np.median(times):.1f}" if times else "-"
        lines.append(f"  {kind:20}  {np.mean(reached):12.2f}   {np.mean(long):16.2f}   {median:>15}")
    return Report(figures, lines)


def _home_show(folder: Path) -> list[Path]:
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
    figures = [
        counted("P(avoidance | Prox 0)", w[0], "<= 0.001", "0"),
        counted("P(avoidance | Prox 9)", w[9], "== 0.5", "0.5 (alpha = 9)"),
        counted("P(avoidance | Prox 15)", w[15], ">= 0.99", "1"),
        *(
            mean(f"P(avoidance | Prox {prox}) learnt {words}, H hidden", [r[name][prox] for r in results])
            for name, words in (("own", "from runs of home"), ("taught", "from homing by hand"))
            for prox in (0, 9, 15)
        ),
    ]
    return Report(figures)


def _fig7_show(folder: Path) -> list[Path]:
    at = [float(prox) for prox in Prox.values]
    own = weights(learnt_home(_own(1), by_hand=True)).tolist()
    taught = weights(learnt_home(_lessons(1))).tolist()
    charts = [
        Chart("P(avoidance | Prox pi-home)", "Prox", _specified(), at),
        Chart("learnt from two minutes of home, H never observed", "Prox", own, at),
        Chart("learnt from two minutes of homing by hand", "Prox", taught, at),
    ]
    return charts_shown(folder, "fig7", "Figure 7: P(avoidance | Prox)", charts, columns=1)


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


def _figure9(now: dict[str, int], target: str, said: str) -> Report:
    found = _combination(now)
    return Report(
        [
            counted("P(turns right) by phototaxy alone", _turns_right(found["phototaxy"])),
            counted("P(turns right) by avoidance alone", _turns_right(found["avoidance"])),
            counted("P(avoidance | Prox)", found["H"]["avoidance"]),
            counted("P(turns right) by the combination", _turns_right(found["home"]), target, said),
        ],
        [f"  at Dir {now['Dir']}, Prox {now['Prox']}, Theta1 {now['Theta1']}"],
    )


def _figure9_shown(folder: Path, name: str, now: dict[str, int], title: str) -> list[Path]:
    found = _combination(now)
    at = [float(vrot) for vrot in Vrot.values]
    h = found["H"]
    charts = [
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
    ]
    return charts_shown(folder, name, title, charts)


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
        _fig7_show,
    ),
    Experiment(
        "fig8",
        "homing from above",
        "7.5",
        no_cases,
        no_trial,
        lambda cases, results: Report([], ["  a picture and a recording; its figures are those of home"]),
        _home_show,
    ),
    Experiment(
        "fig9",
        "close to an object at the left, the light at the left: it turns right",
        "7.5",
        no_cases,
        no_trial,
        lambda cases, results: _figure9(NOW_NEAR, ">= 0.9", "turns right"),
        lambda folder: _figure9_shown(folder, "fig9", NOW_NEAR, "Figure 9: close to an object on the left"),
    ),
    Experiment(
        "fig10",
        "further from the object: it may turn left, to the light",
        "7.5",
        no_cases,
        no_trial,
        lambda cases, results: _figure9(NOW_FAR, "<= 0.5", "may turn left despite the obstacle"),
        lambda folder: _figure9_shown(folder, "fig10", NOW_FAR, "Figure 10: further from the object on the left"),
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
