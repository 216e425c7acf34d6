"""Whole runs in wall time: over a pseudo-terminal, stopped by signals, with the line cut."""

from __future__ import annotations

import json
import signal
import subprocess
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import serial

from tests.runs.cli import khepera_hil, start


def line_with(process: subprocess.Popen[str], word: str, timeout: float = 60) -> str:
    """The next line of output that holds ``word``; the test fails when the output ends or stays away."""
    assert process.stdout is not None
    watchdog = threading.Timer(timeout, process.kill)
    watchdog.start()
    try:
        for line in process.stdout:
            if word in line:
                return line
    finally:
        watchdog.cancel()
    raise AssertionError(f"the output ended without {word!r}: {process.stderr.read() if process.stderr else ''}")


@contextmanager
def emulator(link: Path, *more: str) -> Iterator[subprocess.Popen[str]]:
    process = start("emulate", "--pty", link, *more, cwd=link.parent)
    try:
        line_with(process, str(link))
        yield process
    finally:
        if process.poll() is None:
            process.terminate()
        process.communicate(timeout=30)


def speeds(link: Path) -> bytes:
    with serial.Serial(str(link), 38400, timeout=5) as port:
        port.write(b"E\n")
        return port.read_until(b"\r\n")


def test_the_same_program_drives_the_emulator_over_a_pty(tmp_path: Path) -> None:
    with emulator(tmp_path / "khepera", "--seed", "3"):
        done = khepera_hil("--port", tmp_path / "khepera", "--duration", "3", "--json", cwd=tmp_path)
        assert done.code == 0, done.err
        result = done.result
        assert 0 < result["ticks"] + result["missed"] <= 30
        assert result["score"] == {}
        assert result["stop"] == "duration"
        ticks = [json.loads(line) for line in (tmp_path / result["run"] / "ticks.jsonl").read_text().splitlines()]
        assert len({tick["raw"]["N"] for tick in ticks if "N" in tick["raw"]}) > 1
        assert any(tick["command"] != [4, 4] for tick in ticks if tick["command"])


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGTSTP])
def test_a_signal_stops_the_wheels_closes_the_recording_and_is_no_failure(tmp_path: Path, number: int) -> None:
    link = tmp_path / "khepera"
    with emulator(link, "--world", "empty"):
        process = start("--port", link, "--program", "avoid", "--json", cwd=tmp_path)
        line_with(process, "wheels")
        process.send_signal(number)
        process.send_signal(number)  # as a wrapper does that hands a Ctrl-C on
        out, err = process.communicate(timeout=30)
        assert process.returncode == 0, err
        result = json.loads(out.splitlines()[-1])
        assert result["stop"] == "signal"
        manifest = json.loads((tmp_path / result["run"] / "manifest.json").read_text())
        assert manifest["ending"]["stop"] == "signal"
        # The wheels were told to stop; what may be left of the motion is their own inertia, and that ends.
        answers = [speeds(link) for _ in range(20)]
        assert answers[-1] == b"e,0,0\r\n", answers


def test_a_port_in_use_is_told_as_such(tmp_path: Path) -> None:
    link = tmp_path / "khepera"
    with emulator(link), serial.Serial(str(link), exclusive=True):
        done = khepera_hil("--port", link, "--duration", "1", cwd=tmp_path)
        assert done.code == 3
        assert "in use" in done.err
        assert done.err.count("\n") == 1


def test_a_wrong_baud_rate_is_told_as_such(tmp_path: Path) -> None:
    link = tmp_path / "khepera"
    with emulator(link, "--baud", "9600"):
        done = khepera_hil("--port", link, "--duration", "1", cwd=tmp_path)
        assert done.code == 4
        assert "--baud" in done.err
        assert done.err.count("\n") == 1
        # and at the right one it runs
        assert (
            khepera_hil(
                "--port", link, "--baud", "9600", "--program", "avoid", "--duration", "0.5", cwd=tmp_path
            ).code
            == 0
        )


def test_a_line_that_is_cut_ends_the_run_with_a_sentence_and_a_closed_recording(tmp_path: Path) -> None:
    link = tmp_path / "khepera"
    with emulator(link) as robot:
        process = start("--port", link, "--json", cwd=tmp_path)
        line_with(process, "wheels")
        robot.kill()
        out, err = process.communicate(timeout=30)
        assert process.returncode == 3, err
        assert err.count("\n") == 1
        result = json.loads(out.splitlines()[-1])
        assert result["stop"] == "error"
        assert json.loads((tmp_path / result["run"] / "manifest.json").read_text())["ending"]["stop"] == "error"


def test_the_emulator_in_process_runs_in_wall_time_too(tmp_path: Path) -> None:
    done = khepera_hil("--duration", "2", "--seed", "1", "--json", cwd=tmp_path)
    assert done.code == 0, done.err
    assert 0 < done.result["ticks"] + done.result["missed"] <= 20
