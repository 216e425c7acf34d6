"""Fusion and recognition as programs: on the emulator, and on readings made by hand."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from brp import P
from brp.programs.lamp import L, LightSensor, lamp
from khepera_hil.controllers import PROGRAMS, Setting
from khepera_hil.controllers.diagnosis import Diagnosis
from khepera_hil.controllers.object import Recogniser
from khepera_hil.errors import UsageError
from khepera_hil.experiments.trial import drive
from khepera_hil.perception.readings import BEARINGS
from khepera_hil.teaching.calibration import Turning, calibrated, read_calibration, write_calibration
from tests.runs.cli import khepera_hil


def frame(bearing: float, strength: float, rng: np.random.Generator) -> dict[str, int]:
    """Eight readings of a lamp at a bearing, by the usual sensors."""
    sensor = LightSensor()
    seen = np.minimum(1, strength * (sensor.K(np.array(BEARINGS) - bearing) + 0.03))
    light = sensor.dark - (sensor.dark - sensor.bright) * seen + 4.4 * rng.standard_normal(8)
    return {v.name: round(float(min(511, max(0, value)))) for v, value in zip(L, light, strict=True)}


def test_a_sound_robot_is_not_accused_and_a_broken_sensor_is_named_alone() -> None:
    rng = np.random.default_rng(1)
    for stuck in (0, 300, 500):
        diagnosis = Diagnosis()
        named = []
        for tick in range(400):
            light = frame(tick * 3.7, 0.5, rng)
            if tick >= 200:
                light["L3"] = stuck
            named += [(tick, event) for _, event in diagnosis.step(light)]
        assert named, stuck
        tick, event = named[0]
        assert tick >= 200
        assert event.startswith("L3 is out of order")
        assert len(named) == 1
        assert diagnosis.broken == {3}


def test_what_speaks_against_a_sensor_is_e6_4() -> None:
    rng = np.random.default_rng(3)
    diagnosis, description = Diagnosis(), lamp()
    for broken in (frozenset[int](), frozenset({2}), frozenset({1, 8})):
        diagnosis.broken = broken
        for bearing in (0.0, 77.0, 180.0):
            light = frame(bearing, 0.4, rng) | {"L4": 200}
            for i, against in enumerate(diagnosis.against(light)):
                others = [v for k, v in enumerate(L) if k != i and k + 1 not in broken]
                question = description.ask(P(L[i] | others))
                p = question(**{v.name: light[v.name] for v in others})[light[L[i].name]]
                assert against == pytest.approx(-np.log(512 * p), rel=1e-6, abs=1e-9)


def test_a_mended_sensor_is_believed_again() -> None:
    rng = np.random.default_rng(2)
    diagnosis = Diagnosis()
    events = []
    for tick in range(600):
        light = frame(tick * 3.7, 0.5, rng)
        if 50 <= tick < 200:
            light["L6"] = 0
        events += [event for _, event in diagnosis.step(light)]
    assert [event.split()[0] for event in events] == ["L6", "L6"]
    assert "agrees with the others again" in events[1]
    assert not diagnosis.broken


def test_fusion_names_the_sensor_that_a_scenario_breaks_and_goes_on_without_it(tmp_path: Path) -> None:
    scenario = tmp_path / "broken.toml"
    scenario.write_text('title = "one breaks"\n[[event]]\nat_s = 10\nkind = "broken-sensor"\nsensor = 6\n')
    words = ["--program", "fusion", "--world", "lamp", "--scenario", str(scenario), "--fast", "--duration", "60"]
    done = khepera_hil(*words, "--seed", "2", "--json", cwd=tmp_path)
    assert done.code == 0, done.err
    rows = [json.loads(row) for row in (tmp_path / done.result["run"] / "ticks.jsonl").read_text().splitlines()]
    named = [(row["t"], text) for row in rows for _, text in row["events"] if "out of order" in text]
    assert named
    assert named[0][1].startswith("L7 is out of order")
    assert named[0][0] > 10
    last = rows[-1]["answers"]
    assert "Theta2 without L7" in last or len(named) > 1 or "Theta2" not in " ".join(last)


def test_calibration_finds_what_the_emulated_sensors_are_like() -> None:
    for seed in (1, 2):
        turning = Turning()
        drive(turning, world="calibration", seed=seed, duration=40)
        sensors = calibrated(turning.headings, turning.light)
        for sensor in sensors:
            assert 35 <= sensor.alpha <= 60
            assert 490 <= sensor.dark <= 505
            assert abs(sensor.beside) < 12
            assert 0.9 < sensor.gain < 1.1


def test_calibration_finds_each_sensors_own_alpha_beta_and_axis() -> None:
    rng = np.random.default_rng(4)
    true = [
        LightSensor(alpha=45 + 2 * i, beta=0.02 + 0.001 * i, dark=495 + i, beside=float(3 - i) + 0.5)
        for i in range(8)
    ]
    headings = np.arange(0, 1080, 4.0)
    lamp_at = 40.0
    light = [
        [
            round(
                s.dark
                - (s.dark - s.bright) * min(1, 0.8 * (float(s.K(np.array([lamp_at - h - b - s.beside]))[0]) + 0.03))
                + 4.4 * rng.standard_normal()
            )
            for s, b in zip(true, BEARINGS, strict=True)
        ]
        for h in headings
    ]
    off = float(np.mean([s.beside for s in true]))
    for found, s in zip(calibrated(headings.tolist(), light), true, strict=True):
        assert found.alpha == pytest.approx(s.alpha, abs=2.5)
        assert found.beta == pytest.approx(s.beta, rel=0.15)
        assert found.beside == pytest.approx(s.beside - off, abs=1.5)
        assert found.deviation == pytest.approx(4.4, abs=1.5)


def test_a_calibration_is_kept_and_anything_else_refused(tmp_path: Path) -> None:
    path = tmp_path / "sensors.json"
    sensors = tuple(LightSensor(alpha=40.0 + i) for i in range(8))
    write_calibration(sensors, path)
    assert read_calibration(path) == sensors
    for text in ("", "[]", "{}", '{"format": "light sensors", "version": 1, "sensors": [1]}', "\x00"):
        path.write_text(text)
        with pytest.raises(UsageError, match="no calibration"):
            read_calibration(path)
    content = {"format": "light sensors", "version": 1, "sensors": [{**vars(s), "alpha": -1.0} for s in sensors]}
    path.write_text(json.dumps(content))
    with pytest.raises(UsageError, match="alpha is"):
        read_calibration(path)


def test_too_little_light_or_turning_is_told() -> None:
    dark = [[497] * 8] * 200
    with pytest.raises(UsageError, match="sees too little of a lamp"):
        calibrated(list(np.arange(0.0, 800, 4)), dark)
    with pytest.raises(UsageError, match="has not turned"):
        calibrated([0.0] * 200, dark)


def row(o: int, per: int) -> dict[str, int]:
    return {"O": o, "Nlt": 0, "Nrt": 4, "Per": per, "Lrl": 50}


def test_what_was_met_is_known_in_the_next_run_and_a_sixteenth_object_is_reported() -> None:
    met = tuple(row(o, 300 + 50 * o) for o in range(1, 16))
    robot = PROGRAMS["object"].make(Setting(met=met))
    assert isinstance(robot, Recogniser)
    answer, (level, text) = robot.objects.meet({"Nlt": 0, "Nrt": 4, "Per": 452, "Lrl": 52})
    assert answer.best() == 3
    assert "this is object 3" in text
    answer, (level, text) = robot.objects.meet({"Nlt": 3, "Nrt": 9, "Per": 5000, "Lrl": 400})
    assert answer.best() == 0  # the class of all objects not yet presented
    assert level == "warning"
    assert "all 15 classes" in text
    assert len(robot.objects.met) == 16  # the known one was learnt, the sixteenth merged with nothing


def test_a_robot_goes_round_an_object_knows_it_again_and_keeps_what_it_knows(tmp_path: Path) -> None:
    words = [
        "--program",
        "object",
        "--world",
        "post",
        "--fast",
        "--seed",
        "3",
        "--knowledge",
        "known.json",
        "--json",
    ]
    first = khepera_hil(*words, "--duration", "60", cwd=tmp_path)
    assert first.code == 0, first.err
    rows = [json.loads(r) for r in (tmp_path / first.result["run"] / "ticks.jsonl").read_text().splitlines()]
    said = [text for r in rows for _, text in r["events"] if "object" in text and "runs" not in text]
    assert said[0].startswith("a new object, from now on 1")
    assert said[1].startswith("this is object 1")
    again = khepera_hil(*words, "--duration", "30", cwd=tmp_path)
    rows = [json.loads(r) for r in (tmp_path / again.result["run"] / "ticks.jsonl").read_text().splitlines()]
    said = [text for r in rows for _, text in r["events"] if "object" in text and "runs" not in text]
    assert said[0].startswith("this is object 1")
    # Either run is asked again with what was known then, and learns the same on the way, to the bit.
    for run in (first, again):
        asked = khepera_hil("replay", run.result["run"], "--json", cwd=tmp_path)
        assert asked.code == 0, asked.out
        recognised = asked.result["questions"]["O"]
        assert recognised["answers"] == recognised["same"] > 0
    # Without that knowledge the second run would have met a new object.
    manifest = tmp_path / again.result["run"] / "manifest.json"
    told = json.loads(manifest.read_text())
    assert len(told["setting"]["met"]) == 2
    told["setting"]["met"] = []
    manifest.write_text(json.dumps(told))
    assert khepera_hil("replay", again.result["run"], cwd=tmp_path).code == 1
    told["setting"]["met"] = [{"O": 99}]
    manifest.write_text(json.dumps(told))
    damaged = khepera_hil("replay", again.result["run"], cwd=tmp_path)
    assert damaged.code == 2
    assert "setting is damaged" in damaged.err
