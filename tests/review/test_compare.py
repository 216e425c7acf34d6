"""Two runs apart."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from khepera_hil.compare import compare
from khepera_hil.reading import Run, find
from khepera_hil.recording import LOG


def test_the_same_run_twice_is_the_same(runs: Path, home: Run, say: Callable[..., Any]) -> None:
    """Host, run and start differ; the log does not."""
    said = say("compare", "home-8-1", "home-8-2", "--runs", runs)
    assert said.code == 0
    assert said.out.splitlines()[-1] == "the same 120 ticks"
    assert not compare(home, home).set_up


def test_another_seed_is_another_run_and_what_differs_is_named(runs: Path, say: Callable[..., Any]) -> None:
    said = say("compare", "home-8-1", "home-9-3", "--runs", runs)
    assert said.code == 1
    assert "  seed: 8 | 9" in said.out
    assert "score.distance_m" in said.out
    assert "raw differs in" in said.out
    result = json.loads(say("compare", "home-8-1", "home-9-3", "--runs", runs, "--json").out)
    assert result["columns"]["u"]["ticks"] == 120
    assert result["columns"]["u"]["first"]["tick"] == 0


def test_the_first_tick_that_differs_is_found_and_a_shorter_run_is_told(copy: Path, home: Run) -> None:
    rows = [json.loads(line) for line in (copy / LOG).read_text().splitlines()]
    for row in rows[70:]:
        row["command"] = [1, 2]
    rows[3]["late_ms"] = 77.0
    del rows[20]  # missed
    (copy / LOG).write_text("".join(json.dumps(row) + "\n" for row in rows[:100]))
    found = compare(home, find(copy, copy))
    assert found.ticks == (120, 100)
    assert set(found.columns) == {"command"}
    count, tick, t, _, other = found.columns["command"]
    assert (count, tick, t, other) == (31, 70, 7.0, [1, 2])
