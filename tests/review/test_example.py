"""The run that is kept with the source: it can be opened, and answers as it did."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

from khepera_hil.reading import find
from khepera_hil.viewer import files
from khepera_hil.viewer.check import damage

ROOT = Path(__file__).parents[2]


def test_the_example_is_small_and_whole() -> None:
    kept = [path for path in (ROOT / "runs" / "example-home").iterdir() if path.suffix != ".rrd"]
    assert {path.name for path in kept} == {"manifest.json", "ticks.jsonl"}
    assert sum(path.stat().st_size for path in kept) < 300_000
    assert [tick.tick for tick in find("example-home", ROOT / "runs").ticks()] == list(range(330))


def test_the_example_answers_as_it_did(say: Callable[..., Any]) -> None:
    """To the bit with the numpy that recorded it, and within the tolerance with others."""
    said = say("replay", "example-home", "--runs", ROOT / "runs", "--json")
    assert said.code == 0, said.out
    for asked in json.loads(said.out)["questions"].values():
        assert asked["same"] + asked["near"] == asked["answers"] == 330


def test_the_example_is_listed_explained_and_opened(
    tmp_path: Path, say: Callable[..., Any], monkeypatch: Any
) -> None:
    shutil.copytree(
        ROOT / "runs" / "example-home", tmp_path / "example-home", ignore=shutil.ignore_patterns("*.rrd")
    )
    assert "base_reached_s 30" in say("runs", "--runs", tmp_path).out
    assert "bits" in say("explain", "last", "--runs", tmp_path, "--at", "17.3").out
    monkeypatch.setattr("khepera_hil.viewer.program.program", lambda: "/bin/true")
    monkeypatch.setenv("DISPLAY", ":0")
    assert say("review", "last", "--runs", tmp_path).code == 0
    (made,) = files(tmp_path / "example-home")
    assert damage(made) is None
