"""Section 6: where the light is, by eight sensors, and which of them is out of order."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from brp import Description, P, Question
from brp.programs.fusion import L, N, Theta2, fusing_scaled
from brp.programs.lamp import LightSensor, lamp
from brp.programs.sensor import BEARINGS, K, Li, sensor
from khepera_hil.controllers.fusion import Fusion
from khepera_hil.experiments.arenas import lamp_somewhere, written
from khepera_hil.experiments.cases import Case, Result
from khepera_hil.experiments.drives import generator
from khepera_hil.experiments.experiment import Experiment, Report, no_cases, no_trial
from khepera_hil.experiments.figures import Figure, counted, mean, rate, share
from khepera_hil.experiments.picture import Chart
from khepera_hil.experiments.show import charts_shown, run_shown
from khepera_hil.experiments.trial import Trial, drive
from khepera_hil.recording import Tick
from khepera_hil.teaching.calibration import Turning, calibrated

__all__ = ["EXPERIMENTS"]

_NEAR, _FAR = 0.06, 0.5  # m from the lamp, between which the error counts
_BREAKS = 20.0  # s
_SEEN = 100  # counts by which a broken sensor's reading must differ from what it would have been to be visible
_STUCK = (0, 250, 500)


def _bearing(tick: Tick, place: tuple[float, float]) -> tuple[float, float]:
    """Of the lamp from the robot: degrees clockwise, and how far, m."""
    assert tick.pose is not None
    x, y, theta = tick.pose
    dx, dy = place[0] - x, place[1] - y
    return (math.degrees(theta - math.atan2(dy, dx)) + 180) % 360 - 180, math.hypot(dx, dy)


def _apart(one: float, other: float) -> float:
    return abs((one - other + 180) % 360 - 180)


def _sensors(seed: int) -> tuple[LightSensor, ...]:
    turning = Turning()
    drive(turning, world="calibration", seed=seed, duration=40)
    return calibrated(turning.headings, turning.light)


def _light(tick: Tick) -> list[int]:
    return [int(tick.evidence[v.name]) for v in L]


def _errors(
    trial: Trial, place: tuple[float, float], key: str, first: float = 0.0, last: float = 1e9
) -> list[float]:
    """How far the most probable bearing is off, degrees, where the lamp is 60 to 500 mm away."""
    errors = []
    for tick in trial.ticks:
        if not first <= tick.t < last:
            continue
        bearing, far = _bearing(tick, place)
        answers = [tick.answers[name] for name in tick.answers if name == key or name.startswith(f"{key} without")]
        if answers and _NEAR <= far <= _FAR:
            errors.append(_apart(float(Theta2.numbers[int(answers[0].p.argmax())]), bearing))
    return errors


def _fusion_trial(case: Case) -> Result:
    """A robot that wanders about a lamp, calibrated or not; a sensor may break on the way."""
    seed = case["seed"]
    text, place = lamp_somewhere(generator(seed), case.get("intensity", 7.0))
    controller = Fusion(_sensors(seed)) if case["calibrated"] else Fusion()
    broken, reads = case.get("broken"), case.get("reads")
    with written(text) as world:
        options: dict[str, str] = {}
        if broken is not None:
            scenario = Path(world).with_name("broken.toml")
            scenario.write_text(
                f'title = "broken"\n[[event]]\nat_s = {_BREAKS}\nkind = "broken-sensor"\nsensor = {broken - 1}\n'
                f'reads = {reads}\nof = "light"\n',
                "utf-8",
            )
            options["scenario"] = str(scenario)
        trial = drive(controller, world=world, seed=seed, duration=case["seconds"], options=options)
    named = {
        event.split()[0]: tick.t
        for tick in reversed(trial.ticks)
        for level, event in tick.events
        if level == "warning" and "out of order" in event
    }
    result: Result = {"named": named}
    if broken is None:
        for key, name in (("Theta2", "error"), ("Theta2 scaled", "scaled")):
            result[name] = _middle(_errors(trial, place, key))
        return result
    when = named.get(f"L{broken}", math.inf)
    with written(text) as world:  # driving does not depend on light: the same way with a sound sensor
        sound = drive(Fusion(), world=world, seed=seed, duration=case["seconds"])
    visible = [
        t.t
        for t in sound.ticks
        if t.t >= _BREAKS and abs(_light(t)[broken - 1] - reads) > _SEEN and _sees(t, place)
    ]
    result["visible_before_s"] = None if not visible else round(sum(t < when for t in visible) * 0.1, 1)
    result["visible_s"] = round(0.1 * len(visible), 1)
    result["named_it"] = math.isfinite(when)
    result["wrong"] = [name for name in named if name != f"L{broken}"]
    result["before"] = _middle(_errors(trial, place, "Theta2", _BREAKS, when))
    result["after"] = _middle(_errors(trial, place, "Theta2", when))
    return result


def _sees(tick: Tick, place: tuple[float, float]) -> bool:
    """Whether the lamp is where fusion is asked about: not overhead, and bright enough."""
    return _NEAR <= _bearing(tick, place)[1] <= _FAR


def _middle(values: Sequence[float]) -> float | None:
    return None if not values else round(float(np.mean(values)), 3)


def _fusion_cases(seeds: Sequence[int]) -> list[Case]:
    cases: list[Case] = []
    for seed in seeds:
        chance = generator(seed, 6)
        sensor_, reads = int(chance.integers(1, 9)), int(chance.choice(_STUCK))
        for known in (True, False):
            cases.append({"seed": seed, "calibrated": known, "seconds": 300.0, "kind": "sound"})
            cases.append(
                {
                    "seed": seed,
                    "calibrated": known,
                    "seconds": 120.0,
                    "kind": "broken",
                    "broken": sensor_,
                    "reads": reads,
                }
            )
        cases.append({"seed": seed, "calibrated": True, "seconds": 60.0, "kind": "dim", "intensity": 1.22})
    return cases


def _fusion_report(cases: Sequence[Case], results: Sequence[Result]) -> Report:
    figures: list[Figure] = []

    def of(kind: str, known: bool) -> list[Result]:
        return [
            result
            for case, result in zip(cases, results, strict=True)
            if case["kind"] == kind and case["calibrated"] == known
        ]

    for known, words in ((True, "calibrated"), (False, "not calibrated")):
        sound, broken = of("sound", known), of("broken", known)
        seen = [r for r in broken if r["visible_s"] >= 5]
        limit = ">= 0.95" if known else None
        figures += [
            mean(f"mean error, degrees, I = 7, {words}", [r["error"] for r in sound], "<= 12"),
            mean(f"one sensor broken, before it is named, {words}", [r["before"] for r in broken]),
            mean(f"one sensor broken, once it is named, {words}", [r["after"] for r in broken], "<= 15"),
            share(f"named within 5 s of being visible, {words}", [_in_time(r) for r in seen], limit),
            rate(
                f"healthy sensors named in an hour, {words}",
                sum(len(r["named"]) for r in sound) + sum(len(r["wrong"]) for r in broken),
                len(sound) * 300 / 3600 + len(broken) * 120 / 3600,
                len(sound) + len(broken),
                "<= 0" if known else None,
            ),
        ]
    figures.append(mean("scaled readings (E6.2 as printed), I = 7", [r["scaled"] for r in of("sound", False)]))
    figures.append(mean("mean error, degrees, I = 1.22", [r["error"] for r in of("dim", True)]))
    return Report(figures)


def _in_time(result: Result) -> bool:
    return bool(result["named_it"]) and result["visible_before_s"] <= 5.0


def _fusion_show(folder: Path) -> list[Path]:
    return run_shown(folder, Fusion(), world="lamp", seed=1, seconds=90, options={"scenario": "broken-sensor"})


# Figures 5 and 6, lessons 3 and 5.


def _fig5_report(cases: Sequence[Case], results: Sequence[Result]) -> Report:
    return Report(
        [
            counted("K(0, 0)", K(0, 0), paper="about 1"),
            counted("K(45, 0)", K(45, 0), paper="0.5 (alpha = 45)"),
            counted("K(90, 0)", K(90, 0), paper="about 0"),
        ]
    )


def _fig5_show(folder: Path) -> list[Path]:
    values = [K(int(theta), 0) for theta in Theta2.numbers]
    chart = Chart("K(Theta2, 0)", "Theta2, degrees", values, list(Theta2.numbers))
    return charts_shown(folder, "fig5", "Figure 5: K(Theta2, 0), alpha 45, beta 0.03", [chart], columns=1)


def _fig6_light() -> dict[str, int]:
    """What the eight sensors of pi-sensor expect of a light at 10 degrees."""
    return {v.name: round(511 * (1 - K(10, theta))) for v, theta in zip(N, BEARINGS, strict=True)}


def _fig6_parts() -> tuple[list[Any], Any, Any]:
    light = _fig6_light()
    single = [sensor(theta).ask(P(Theta2 | Li))(Li=light[v.name]) for v, theta in zip(N, BEARINGS, strict=True)]
    fused = fusing_scaled.ask(P(Theta2 | N))(**light)
    half = sensor(0).ask(P(Theta2 | Li))(Li=256)
    return single, fused, half


def _fig6_report(cases: Sequence[Case], results: Sequence[Result]) -> Report:
    single, fused, half = _fig6_parts()
    p = half.p
    peaks = [int(Theta2.numbers[k]) for k in range(36) if p[k] > p[k - 1] and p[k] > p[(k + 1) % 36]]
    return Report(
        [
            counted("most probable bearing of a light at 10 degrees", fused.best(), "== 10", "10"),
            counted("its probability in the fusion", float(fused.p.max())),
            counted("its probability by the best single sensor", max(float(one[10]) for one in single)),
            counted("entropy of the fusion, bits", fused.entropy()),
            counted("entropy of the most certain sensor, bits", min(one.entropy() for one in single)),
            counted("peaks of one sensor read at half brightness (lesson 6)", len(peaks), "== 2", "several peaks"),
        ],
        [f"  the two peaks are at {' and '.join(map(str, peaks))} degrees"],
    )


def _fig6_show(folder: Path) -> list[Path]:
    single, fused, half = _fig6_parts()
    at = list(Theta2.numbers)
    charts = [
        Chart(f"P(Theta2 | {v.name}), sensor at {theta}", "Theta2, degrees", one.p.tolist(), at)
        for v, theta, one in zip(N, BEARINGS, single, strict=True)
    ]
    charts.append(Chart("P(Theta2 | N1 ... N8)", "the fusion", fused.p.tolist(), at))
    charts.append(Chart("one sensor at half brightness", "two peaks (lesson 6)", half.p.tolist(), at))
    return charts_shown(folder, "fig6", "Figure 6: a light at 10 degrees", charts, columns=3)


def _lesson3_report(cases: Sequence[Case], results: Sequence[Result]) -> Report:
    joint = math.log2(36) + 8 * math.log2(512)
    product = math.log2(36 * (512 * 36) * 8)
    stored = math.log2(36 + 8 * 512 * 36)
    return Report(
        [
            counted("log2 of the joint's size, 36 x 512^8", joint, paper="79"),
            counted("log2 of 36 x (512 x 36) x 8", product, paper="22"),
            counted("log2 of the numbers in the decomposition's terms", stored),
        ],
        ["  36 x 512^8 is 2^77.2 and not 2^79; the paper's product counts 36 twice: the terms hold 2^17.2 numbers"],
    )


_SETS = {1: (3,), 2: (2, 3), 4: (1, 2, 3, 4), 8: tuple(range(8))}
"""Which sensors, from the front outwards."""


def _lesson5_trial(case: Case) -> Result:
    """Frames of one robot at all distances and bearings, and what 1, 2, 4 and 8 sensors make of them."""
    text, place = lamp_somewhere(generator(case["seed"]))
    frames: list[tuple[list[int], float]] = []

    def keep(tick: Tick, trial: Trial) -> bool:
        bearing, far = _bearing(tick, place)
        if tick.tick % 20 == 0 and _NEAR <= far <= _FAR:
            frames.append((_light(tick), bearing))
        return False

    with written(text) as world:
        drive(Fusion(), world=world, seed=case["seed"], duration=200, watch=keep)
    description = lamp()
    found: Result = {}
    for count, chosen in _SETS.items():
        question = description.ask(P(Theta2 | [L[i] for i in chosen]))
        errors, entropies, micros = _asked(question, description, frames, chosen)
        found[str(count)] = {"error": errors, "entropy": entropies, "us": micros}
    return found


def _asked(
    question: Question, description: Description, frames: Sequence[tuple[list[int], float]], chosen: Sequence[int]
) -> tuple[float | None, float | None, float | None]:
    errors, entropies, took = [], [], []
    for light, bearing in frames:
        known = {L[i].keyword: light[i] for i in chosen}
        began = time.perf_counter()
        answer = question(**known)
        took.append(time.perf_counter() - began)
        errors.append(_apart(float(answer.best()), bearing))
        entropies.append(answer.entropy())
    return _middle(errors), _middle(entropies), None if not took else round(1e6 * float(np.median(took)), 1)


def _lesson5_cases(seeds: Sequence[int]) -> list[Case]:
    return [{"seed": seed} for seed in seeds]


def _lesson5_report(cases: Sequence[Case], results: Sequence[Result]) -> Report:
    figures = []
    lines = ["  sensors   error (degrees)   entropy (bits)   microseconds a question"]
    for count in _SETS:
        rows = [result[str(count)] for result in results if result[str(count)]["error"] is not None]
        figures.append(mean(f"mean error by {count} of 8 sensors, degrees", [row["error"] for row in rows]))
        figures.append(mean(f"entropy by {count} of 8 sensors, bits", [row["entropy"] for row in rows]))
        if rows:
            values = [float(np.mean([row[name] for row in rows])) for name in ("error", "entropy", "us")]
            lines.append(f"  {count:7d}   {values[0]:15.1f}   {values[1]:14.2f}   {values[2]:23.0f}")
    return Report(figures, lines)


EXPERIMENTS = (
    Experiment("fig5", "the sensor model K(Theta2, 0)", "6.2", no_cases, no_trial, _fig5_report, _fig5_show),
    Experiment(
        "fusion",
        "where a lamp is, with sound and broken sensors, which are named",
        "6.3",
        _fusion_cases,
        _fusion_trial,
        _fusion_report,
        _fusion_show,
    ),
    Experiment("fig6", "eight poor sensors and their fusion", "6.4", no_cases, no_trial, _fig6_report, _fig6_show),
    Experiment("lesson3", "the sizes of the joint and of its terms", "6.4", no_cases, no_trial, _lesson3_report),
    Experiment(
        "lesson5", "fusion by 1, 2, 4 and 8 sensors", "6.4", _lesson5_cases, _lesson5_trial, _lesson5_report
    ),
)
