"""Every mistake of a user: one sentence on standard error, the right exit code, never a traceback."""

from __future__ import annotations

import os
import pty
import tty
from pathlib import Path

import pytest

from tests.runs.cli import Done, khepera_hil


def sentence(done: Done, code: int, *words: str) -> None:
    assert done.code == code, done.err
    assert done.err.count("\n") == 1, done.err
    assert done.err.startswith("khepera-hil: ")
    for word in words:
        assert word in done.err, done.err


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["--program", "fly"], 2, ["no program 'fly'", "avoid", "home"]),
        (["--world", "moon"], 2, ["moon", "furnished"]),
        (["--port", "emulator://furnished", "--world", "empty"], 2, ["two different worlds"]),
        (["--port", "emulator://?seed=3"], 2, ["--seed"]),
        (["--port", "emulator://?colour=3"], 2, ["colour"]),
        (["--port", "emulator://[x"], 2, ["emulator://ARENA"]),
        (["--port", ""], 2, ["--port"]),
        (["--world", ""], 2, ["--world"]),
        (["--port", "/dev/khepera-that-is-not-there"], 3, ["/dev/khepera-that-is-not-there"]),
        (["--port", "telepathy://x"], 3, ["telepathy"]),
        (["--port", "socket://127.0.0.1:9"], 3, ["127.0.0.1:9"]),
        (["--port", "/dev/ttyS0", "--fast"], 2, ["--fast"]),
        (["--port", "/dev/ttyS0", "--world", "empty"], 2, ["--world"]),
        (["--period", "0.03", "--baud", "9600", "--fast"], 5, ["9600", "--period"]),
        (["--period", "nan"], 2, ["nan"]),
        (["--duration", "-1"], 2, ["-1"]),
        (["--baud", "fast"], 2, ["fast"]),
        (["--seed", "-3"], 2, ["-3"]),
        (["--fly"], 2, ["--fly"]),
        (["--port", "emulator://?baud=9600", "--fast", "--duration", "1"], 4, ["--baud"]),
        (["--runs", "/dev/null/runs", "--fast", "--duration", "1"], 6, ["/dev/null/runs"]),
        (["emulate"], 2, ["--pty"]),
        (["emulate", "--pty", "/no/such/folder/link"], 3, ["/no/such/folder"]),
        (["emulate", "--pty", "x", "--world", "moon"], 2, ["moon", "furnished"]),
    ],
)
def test_a_mistake_ends_in_one_sentence(tmp_path: Path, arguments: list[str], code: int, words: list[str]) -> None:
    done = khepera_hil(*arguments, cwd=tmp_path)
    sentence(done, code, *words)
    assert not list(tmp_path.glob("runs/*")), "nothing ran, so nothing may look like a run"


def test_a_port_behind_which_nobody_answers_is_told_as_such(tmp_path: Path) -> None:
    master, slave = pty.openpty()
    tty.setraw(slave)
    try:
        sentence(khepera_hil("--port", os.ttyname(slave), cwd=tmp_path), 4, os.ttyname(slave), "--baud")
    finally:
        os.close(master)
        os.close(slave)


def test_list_names_programs_and_arenas_a_line_each(tmp_path: Path) -> None:
    done = khepera_hil("--list", cwd=tmp_path)
    assert done.code == 0
    words = [line.split()[0] for line in done.out.splitlines()]
    assert {"avoid", "phototaxy", "home", "empty", "furnished"} <= set(words)
