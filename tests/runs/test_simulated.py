"""Whole runs in simulated time, with a seed."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.runs.cli import khepera_hil


def log(folder: Path) -> list[dict[str, Any]]:
    host = json.loads((folder / "manifest.json").read_text())["host_columns"]
    ticks = [json.loads(line) for line in (folder / "ticks.jsonl").read_text().splitlines()]
    for tick in ticks:
        for column in host:
            tick.pop(column)
    return ticks


@pytest.mark.parametrize("program", ["avoid", "phototaxy", "home"])
def test_the_same_command_twice_gives_the_same_bytes_and_the_same_log(tmp_path: Path, program: str) -> None:
    arguments = ["--program", program, "--fast", "--duration", "20", "--seed", "11", "--json"]
    first = khepera_hil(*arguments, cwd=tmp_path, PYTHONHASHSEED="1")
    again = khepera_hil(*arguments, cwd=tmp_path, PYTHONHASHSEED="2")
    assert first.code == again.code == 0, first.err + again.err
    assert first.result["ticks"] == 200
    assert first.result["stop"] == "duration"
    one, two = log(tmp_path / first.result["run"]), log(tmp_path / again.result["run"])
    assert one == two
    # The log holds the wire: raw answers as they came, commands as they were sent.
    assert all(tick["raw"] and tick["command"] for tick in one)
    other = khepera_hil(*arguments[:-2], "12", "--json", cwd=tmp_path)
    assert log(tmp_path / other.result["run"]) != one


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_home_reaches_the_base(tmp_path: Path, seed: int) -> None:
    done = khepera_hil("--fast", "--duration", "120", "--seed", str(seed), "--json", cwd=tmp_path)
    assert done.code == 0, done.err
    assert done.result["program"] == "home"
    assert done.result["score"]["base_reached_s"] is not None


def test_avoid_wanders_far_and_touches_nothing_for_long(tmp_path: Path) -> None:
    done = khepera_hil("--program", "avoid", "--fast", "--duration", "120", "--seed", "4", "--json", cwd=tmp_path)
    score = done.result["score"]
    assert score["contact_longest_s"] <= 0.5
    assert score["distance_m"] > 2.0


def test_the_result_says_all_that_it_should(tmp_path: Path) -> None:
    done = khepera_hil("--fast", "--duration", "2", "--seed", "5", "--json", cwd=tmp_path)
    result = done.result
    assert set(result) >= {"run", "program", "seed", "ticks", "missed", "work_ms", "late_ms", "stop", "score"}
    assert set(result["work_ms"]) == set(result["late_ms"]) == {"p50", "p99"}
    assert result["seed"] == 5
    folder = tmp_path / result["run"]
    assert {path.name for path in folder.iterdir()} == {"manifest.json", "ticks.jsonl", "run.rrd"}
    ending = json.loads((folder / "manifest.json").read_text())
    assert ending["ending"]["stop"] == "duration"


def test_no_duration_at_all_is_a_run_of_no_ticks(tmp_path: Path) -> None:
    done = khepera_hil("--fast", "--duration", "0", "--json", cwd=tmp_path)
    assert done.code == 0
    assert done.result["ticks"] == 0
    assert done.result["work_ms"] == {"p50": None, "p99": None}
