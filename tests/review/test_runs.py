"""The list of runs, and what a run may be called."""

from __future__ import annotations

import fcntl
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from khepera_hil.__main__ import outcome
from khepera_hil.commands import COMMANDS
from khepera_hil.errors import RecordingError
from khepera_hil.reading import Run, find, recorded
from khepera_hil.recording import LOG, MANIFEST


def test_every_run_is_listed_with_how_it_ended_and_what_it_scored(runs: Path, say: Callable[..., Any]) -> None:
    said = say("runs", "--runs", runs)
    assert said.code == 0
    lines = said.out.splitlines()
    assert lines[0].split() == ["run", "program", "seed", "length", "ended", "score"]
    assert len(lines) == 5
    assert lines[1].split()[:6] == ["home-8-1", "home", "8", "12.0", "s", "duration"]
    assert "distance_m" in lines[1]
    assert lines[4].startswith("avoid-4-4"), "the latest is the last"


def test_the_list_as_json_has_one_object_a_line(runs: Path, say: Callable[..., Any]) -> None:
    listed = [json.loads(line) for line in say("runs", "--json", "--runs", runs).out.splitlines()]
    assert [run["seed"] for run in listed] == [8, 8, 9, 4]
    for run in listed:
        assert run["length_s"] == 12.0
        assert run["ended"] == "duration"
        assert run["score"]["contact_longest_s"] >= 0


def test_one_that_was_killed_one_that_goes_on_and_one_that_is_damaged_are_told_as_such(
    copy: Path, say: Callable[..., Any]
) -> None:
    manifest = json.loads((copy / MANIFEST).read_bytes())
    del manifest["ending"]
    (copy / MANIFEST).write_text(json.dumps(manifest))
    log = copy / LOG
    log.write_bytes(log.read_bytes()[:-20])  # the last line without its end
    assert " 11.9 s  killed" in say("runs", "--runs", copy.parent).out
    with log.open("ab") as writer:
        fcntl.flock(writer, fcntl.LOCK_EX)
        assert " going on" in say("runs", "--runs", copy.parent).out
    (copy / MANIFEST).write_bytes(b"{")
    said = say("runs", "--runs", copy.parent)
    assert said.code == 0
    assert said.out.startswith("damaged: ")
    assert MANIFEST in said.out


def test_no_runs_is_no_mistake(tmp_path: Path, say: Callable[..., Any]) -> None:
    (tmp_path / "notes").mkdir()
    said = say("runs", "--runs", tmp_path)
    assert (said.code, said.out) == (0, f"no runs in {tmp_path}\n")
    assert say("runs", "--runs", tmp_path / "nowhere").code == 0


def test_a_run_is_found_by_its_path_its_name_or_as_the_last(runs: Path) -> None:
    assert find(runs / "home-9-3", Path("elsewhere")).folder == runs / "home-9-3"
    assert find("home-9-3", runs).manifest["seed"] == 9
    assert find("last", runs).name == "avoid-4-4"
    assert [run.name for run in recorded(runs) if isinstance(run, Run)] == [
        "home-8-1",
        "home-8-2",
        "home-9-3",
        "avoid-4-4",
    ]


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("nowhere", "there is no run nowhere"),
        ("file", "is a file"),
        ("empty", r"is not a run's folder"),
        ("long" * 100, "cannot be read: File name too long"),
    ],
)
def test_what_is_no_run_is_refused_in_a_sentence(
    tmp_path: Path, name: str, sentence: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("x")
    (tmp_path / "empty").mkdir()
    monkeypatch.chdir(tmp_path)
    with pytest.raises(RecordingError, match=sentence):
        find(name, tmp_path)


def test_the_last_of_none_is_refused_in_a_sentence(tmp_path: Path, say: Callable[..., Any]) -> None:
    said = say("replay", "last", "--runs", tmp_path)
    assert said.code == 6
    assert "no recorded run" in said.err


@pytest.mark.parametrize("command", ["runs", "review", "replay", "compare", "explain", "export"])
def test_each_command_has_a_page_of_help_with_an_example(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert command in COMMANDS
    with pytest.raises(SystemExit) as end:
        outcome([command, "--help"])
    assert end.value.code == 0
    page = capsys.readouterr().out
    assert "example" in page
    assert f"khepera-hil {command} " in page.replace(f"khepera-hil {command}\n", "")
