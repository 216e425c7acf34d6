"""A run as columns: what pandas would read is what was recorded."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq  # type: ignore[import-untyped] # it ships no types
import pytest

from khepera_hil.reading import Run
from khepera_hil.recording import LOG

NAMES = ["tick", "t", *(f"px{i}" for i in range(1, 9)), *(f"l{i}" for i in range(1, 9)), "left", "right"]


def test_both_forms_hold_what_the_log_holds(home: Run, tmp_path: Path, say: Callable[..., Any]) -> None:
    for form in ("parquet", "csv"):
        said = say("export", home.folder, f"--{form}", tmp_path / f"run.{form}")
        assert said.code == 0
        assert said.out.startswith("120 ticks of home-8-1")
    table = pq.read_table(tmp_path / "run.parquet")
    assert table.schema.names == [*NAMES, "Dir", "Prox", "Theta1", "Vrot"]
    with (tmp_path / "run.csv").open(newline="") as file:
        text = list(csv.DictReader(file))
    for row, columns, cells in zip(home.rows(), table.to_pylist(), text, strict=True):
        assert columns["tick"] == row["tick"]
        assert columns["t"] == row["t"]
        assert [columns[f"px{i}"] for i in range(1, 9)] == list(map(int, row["raw"]["N"].split(",")[1:]))
        assert [columns[f"l{i}"] for i in range(1, 9)] == list(map(int, row["raw"]["O"].split(",")[1:]))
        assert [columns["left"], columns["right"]] == row["command"]
        assert {name: columns[name] for name in ("Dir", "Prox", "Theta1")} == row["evidence"]
        assert columns["Vrot"] == row["draws"]["Vrot"]
        assert cells == {name: str(value) for name, value in columns.items()}


def test_units_are_in_the_schema(home: Run, tmp_path: Path, say: Callable[..., Any]) -> None:
    say("export", home.folder, "--parquet", tmp_path / "x.parquet")
    schema = pq.read_schema(tmp_path / "x.parquet")
    units = {name: schema.field(name).metadata[b"unit"].decode() for name in schema.names}
    assert units["t"].startswith("s ")
    assert units["left"].startswith("pulse/10 ms")
    assert "degrees clockwise" in units["Theta1"]
    assert units["Vrot"] == "drawn; -10 .. 10"
    assert schema.metadata[b"program"] == b"home"


def test_what_was_not_had_is_empty(copy: Path, tmp_path: Path, say: Callable[..., Any]) -> None:
    rows = [json.loads(line) for line in (copy / LOG).read_text().splitlines()]
    rows[0] |= {
        "raw": {"N": "n,1,2,3"},
        "command": None,
        "draws": {},
        "u": {},
        "evidence": {"Word": "near", "Is": True},
    }
    rows[1]["evidence"]["Dir"] = 0.5
    rows[2]["draws"]["Dir"] = 3  # drawn, and a variable of that name is known
    (copy / LOG).write_text("".join(json.dumps(row) + "\n" for row in rows))
    assert say("export", copy, "--parquet", tmp_path / "x.parquet").code == 0
    table = pq.read_table(tmp_path / "x.parquet").to_pylist()
    empty = {name for name, value in table[0].items() if value is None}
    assert empty == {*NAMES[2:], "Dir", "Prox", "Theta1", "Vrot", "drawn Dir"}
    assert (table[0]["Word"], table[0]["Is"]) == ("near", True)
    assert table[1]["Dir"] == 0.5
    assert (table[2]["drawn Dir"], table[3]["drawn Dir"]) == (3, None)


def test_a_file_that_cannot_be_written_and_a_damaged_run_leave_nothing(
    copy: Path, tmp_path: Path, say: Callable[..., Any]
) -> None:
    said = say("export", copy, "--csv", tmp_path / "nowhere" / "x.csv")
    assert said.code == 6
    assert "cannot be written" in said.err
    (tmp_path / "old.csv").write_text("old")
    with (copy / LOG).open("ab") as log:
        log.write(b"rubbish\n")
    for form in ("csv", "parquet"):
        said = say("export", copy, f"--{form}", tmp_path / "old.csv")
        assert said.code == 6
        assert "line 121 is damaged" in said.err
        assert said.err.count("\n") == 1
    assert (tmp_path / "old.csv").read_text() == "old"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["old.csv", "runs"]


@pytest.mark.parametrize("words", [[], ["--csv", "a", "--parquet", "b"]])
def test_one_form_is_asked_for(copy: Path, words: list[str], say: Callable[..., Any]) -> None:
    assert say("export", copy, *words).code == 2
