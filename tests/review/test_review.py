"""Opening a run: what is missing or damaged is made anew from the log, with the distributions asked again."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from khepera_hil.reading import Run
from khepera_hil.recording import MANIFEST
from khepera_hil.viewer import FILE
from khepera_hil.viewer.check import damage
from tests.recording.rrd import entities, heights, rows


def test_a_whole_run_is_shown_as_it_is(
    home: Run, monkeypatch: pytest.MonkeyPatch, say: Callable[..., Any], tmp_path: Path
) -> None:
    program = tmp_path / "rerun"
    program.write_text(f'#!/bin/sh\necho "$1" > {tmp_path}/shown\n')
    program.chmod(0o755)
    monkeypatch.setattr("khepera_hil.viewer.program.program", lambda: str(program))
    monkeypatch.setenv("DISPLAY", ":0")
    before = (home.folder / FILE).stat().st_mtime_ns
    said = say("review", home.folder)
    assert (said.code, said.err) == (0, "")
    assert (tmp_path / "shown").read_text() == f"{home.folder / FILE}\n"
    assert (home.folder / FILE).stat().st_mtime_ns == before


@pytest.mark.parametrize(
    "content", [None, b"", b"RRF2", b"rubbish" * 100], ids=["missing", "empty", "cut", "foreign"]
)
def test_what_is_missing_or_damaged_is_made_anew_as_it_was(
    home: Run,
    copy: Path,
    content: bytes | None,
    monkeypatch: pytest.MonkeyPatch,
    say: Callable[..., Any],
) -> None:
    if content is not None:
        (copy / FILE).write_bytes(content)
    monkeypatch.setattr("khepera_hil.viewer.program.program", lambda: "/bin/true")
    monkeypatch.setenv("DISPLAY", ":0")
    said = say("review", copy)
    assert said.code == 0
    assert "making it anew from the log" in said.err
    assert damage(copy / FILE) is None
    assert entities(copy / FILE) == entities(home.folder / FILE)
    for entity in ("/distributions/pi-home/Vrot/p", "/distributions/pi-home/Vrot/drawn"):
        made = rows(copy / FILE, entity, "BarChart:values")
        recorded = rows(home.folder / FILE, entity, "BarChart:values")
        assert made.keys() == recorded.keys()
        assert all((heights(made[tick][1]) == heights(recorded[tick][1])).all() for tick in made)


def test_a_run_that_was_killed_is_made_anew_and_one_of_an_unknown_program_without_distributions(
    copy: Path, monkeypatch: pytest.MonkeyPatch, say: Callable[..., Any]
) -> None:
    monkeypatch.setattr("khepera_hil.viewer.program.program", lambda: "/bin/true")
    monkeypatch.setenv("DISPLAY", ":0")
    manifest = json.loads((copy / MANIFEST).read_bytes())
    del manifest["ending"]
    (copy / MANIFEST).write_text(json.dumps(manifest | {"program": "sleep"}))
    (copy / FILE).write_bytes(b"RRF2")
    said = say("review", copy)
    assert said.code == 0
    assert "the run was killed" in said.err
    assert "its distributions are left out" in said.err
    assert len(rows(copy / FILE, "/motors", "Scalars:scalars")) == 120


def test_a_viewer_that_fails_is_told(home: Run, monkeypatch: pytest.MonkeyPatch, say: Callable[..., Any]) -> None:
    monkeypatch.setattr("khepera_hil.viewer.program.program", lambda: "/bin/false")
    monkeypatch.setenv("DISPLAY", ":0")
    said = say("review", home.folder)
    assert said.code == 1
    assert "the viewer ended with code 1" in said.err


def test_without_a_screen_it_says_what_to_do_instead(
    copy: Path, monkeypatch: pytest.MonkeyPatch, say: Callable[..., Any]
) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    said = say("review", copy)
    assert said.code == 2
    assert "--serve" in said.err
    assert "--picture" in said.err
    assert say("--view", "--fast", "--duration", "1").code == 2


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--at", "3"], "--at goes with --picture"),
        (["--picture", "x.png", "--size", "big"], "1600x900"),
        (["--picture", "x.png", "--at", "soon"], "seconds"),
        (["--serve", "999.1.1.1"], "no address"),
        (["--serve", "127.0.0.1:http"], "HOST:PORT"),
        (["--serve", "198.51.100.7"], "cannot serve at 198.51.100.7"),
    ],
)
def test_what_cannot_be_shown_is_refused(
    copy: Path, words: list[str], sentence: str, say: Callable[..., Any]
) -> None:
    said = say("review", copy, *words)
    assert said.code == 2
    assert sentence in said.err
