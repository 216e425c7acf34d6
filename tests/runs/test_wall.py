"""Whole runs in wall time: over a pseudo-terminal, stopped by signals, with the line cut."""

from __future__ import annotations

import fcntl
import json
import os
import pty
import signal
import subprocess
import sys
import termios
import threading
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import serial

from tests.runs.cli import environment, khepera_hil, start

CALM = ("--period", "1")
"""A tick that makes the guard patient (1.3 s): the tests share two cores, on which the loop may be held up. It
beats while it waits, so nearly all of that is room."""
LONG = 60.0


def line_with(process: subprocess.Popen[str], word: str, timeout: float = LONG) -> str:
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
        process.communicate(timeout=LONG)


def speeds(link: Path) -> bytes:
    with serial.Serial(str(link), 38400, timeout=5) as port:
        port.write(b"E\n")
        return port.read_until(b"\r\n")


def test_the_same_program_drives_the_emulator_over_a_pty(tmp_path: Path) -> None:
    with emulator(tmp_path / "khepera", "--seed", "3"):
        done = khepera_hil("--port", tmp_path / "khepera", *CALM, "--duration", "6", "--json", cwd=tmp_path)
        assert done.code == 0, done.err
        result = done.result
        assert 0 < result["ticks"] + result["missed"] <= 6
        assert result["score"] == {}
        assert result["stop"] == "duration"
        ticks = [json.loads(line) for line in (tmp_path / result["run"] / "ticks.jsonl").read_text().splitlines()]
        assert len({tick["raw"]["N"] for tick in ticks if "N" in tick["raw"]}) > 1
        assert any(tick["command"] != [4, 4] for tick in ticks if tick["command"])


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGQUIT, signal.SIGTSTP])
def test_a_signal_stops_the_wheels_closes_the_recording_and_is_no_failure(tmp_path: Path, number: int) -> None:
    link = tmp_path / "khepera"
    with emulator(link, "--world", "empty"):
        process = start("--port", link, *CALM, "--program", "avoid", "--json", cwd=tmp_path)
        line_with(process, "wheels")
        process.send_signal(number)
        process.send_signal(number)  # as a wrapper does that hands a Ctrl-C on
        out, err = process.communicate(timeout=LONG)
        assert process.returncode == 0, err
        result = json.loads(out.splitlines()[-1])
        assert result["stop"] == "signal"
        manifest = json.loads((tmp_path / result["run"] / "manifest.json").read_text())
        assert manifest["ending"]["stop"] == "signal"
        # The wheels were told to stop; what may be left of the motion is their own inertia, and that ends.
        answers = [speeds(link) for _ in range(20)]
        assert answers[-1] == b"e,0,0\r\n", answers


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_while_the_robot_is_silent_is_no_failure(tmp_path: Path, number: int) -> None:
    master, slave = pty.openpty()  # a line with nobody at its other end
    tty.setraw(slave)
    try:
        process = start("--port", os.ttyname(slave), cwd=tmp_path)
        os.read(master, 1)  # it speaks, so it hears signals
        process.send_signal(number)
        out, err = process.communicate(timeout=LONG)
    finally:
        os.close(master)
        os.close(slave)
    assert process.returncode == 0, err
    assert "stopped (signal) before a robot was found" in err
    assert out == ""
    assert not (tmp_path / "runs").exists()


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
                "--port", link, "--baud", "9600", *CALM, "--program", "avoid", "--duration", "1", cwd=tmp_path
            ).code
            == 0
        )


def test_a_line_that_is_cut_ends_the_run_with_a_sentence_and_a_closed_recording(tmp_path: Path) -> None:
    link = tmp_path / "khepera"
    with emulator(link) as robot:
        process = start("--port", link, *CALM, "--patience", "1", "--json", cwd=tmp_path)
        line_with(process, "wheels")
        robot.kill()
        out, err = process.communicate(timeout=LONG)
        assert process.returncode == 3, err
        assert err.count("\n") == 1
        result = json.loads(out.splitlines()[-1])
        assert result["stop"] == "error"
        assert json.loads((tmp_path / result["run"] / "manifest.json").read_text())["ending"]["stop"] == "error"


def test_the_emulator_in_process_runs_in_wall_time_too(tmp_path: Path) -> None:
    done = khepera_hil("--duration", "2", "--seed", "1", "--json", cwd=tmp_path)
    assert done.code == 0, done.err
    assert 0 < done.result["ticks"] + done.result["missed"] <= 20


def manifest(folder: Path) -> dict[str, Any]:
    found = json.loads((folder / "manifest.json").read_text())
    assert isinstance(found, dict)
    return found


def ticks(folder: Path) -> list[dict[str, Any]]:
    text = (folder / "ticks.jsonl").read_text()
    return [json.loads(line) for line in text[: text.rfind("\n") + 1].splitlines()]


def the_run(folder: Path) -> Path:
    [run] = (folder / "runs").iterdir()
    return run


def eventually(what: Callable[[], bool], seconds: float = LONG) -> None:
    """Something that comes by itself, however busy the machine is."""
    end = time.monotonic() + seconds
    while not what():
        assert time.monotonic() < end, what
        time.sleep(0.02)


def test_a_terminal_that_goes_leaves_the_run_alone_and_an_order_ends_it(tmp_path: Path) -> None:
    link = tmp_path / "khepera"
    master, slave = pty.openpty()
    with emulator(link, "--world", "empty"):
        process = subprocess.Popen(
            [sys.executable, "-m", "khepera_hil", "--port", str(link), *CALM, "--program", "avoid"],
            stdin=slave,
            stdout=slave,
            stderr=slave,
            start_new_session=True,
            preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0),  # as a terminal's own
            cwd=tmp_path,
            env=environment(),
        )
        os.close(slave)
        shown = b""
        while b"wheels" not in shown:
            shown += os.read(master, 4096)
        os.close(master)  # the terminal is closed; the kernel sends SIGHUP
        run = the_run(tmp_path)
        eventually(lambda: any("SIGHUP" in text for tick in ticks(run) for _, text in tick["events"]))
        heard = next(n for n, tick in enumerate(ticks(run)) if any("SIGHUP" in text for _, text in tick["events"]))
        eventually(lambda: any(tick["command"] for tick in ticks(run)[heard + 1 :]))
        assert process.poll() is None
        done = khepera_hil("order", "stop", cwd=tmp_path)
        assert done.code == 0, done.err
        assert process.wait(LONG) == 0
        assert manifest(run)["ending"]["stop"] == "order"
        assert not (run / "orders.sock").exists()


def test_an_order_that_the_program_does_not_know_is_refused_in_a_sentence(tmp_path: Path) -> None:
    link = tmp_path / "khepera"
    with emulator(link, "--world", "empty"):
        process = start("--port", link, *CALM, "--program", "avoid", cwd=tmp_path)
        line_with(process, "wheels")
        done = khepera_hil("order", "vigil", "on", cwd=tmp_path)
        assert done.code == 8
        assert done.err == "khepera-hil: avoid knows no order 'vigil on'; it takes stop and resume\n"
        assert khepera_hil("order", "--run", the_run(tmp_path), "stop", cwd=tmp_path).code == 0
        process.communicate(timeout=LONG)
        assert [tick["orders"] for tick in ticks(the_run(tmp_path)) if tick["orders"]] == [["vigil on"], ["stop"]]


def test_without_a_run_an_order_says_so(tmp_path: Path) -> None:
    for words, code in ((["stop"], 8), (["--run", "runs/none", "stop"], 8), (["STOP!"], 2), ([], 2)):
        done = khepera_hil("order", *words, cwd=tmp_path)
        assert done.code == code
        assert done.err.count("\n") == 1
        assert done.err.startswith("khepera-hil: ")


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_a_run_that_is_killed_or_held_up_leaves_wheels_that_stand_still(tmp_path: Path, number: int) -> None:
    """The same as a hundred times: python -m benchmarks.guard."""
    link = tmp_path / "khepera"
    with emulator(link, "--world", "empty"):
        process = start("--port", link, *CALM, "--program", "avoid", cwd=tmp_path)
        try:
            line_with(process, "wheels")
            run = the_run(tmp_path)
            eventually(lambda: len(ticks(run)) > 2)
            process.send_signal(number)
            left = run / "guard.jsonl"
            eventually(lambda: left.exists() and left.read_text().endswith("\n"))
            acted = json.loads(left.read_text())
            assert acted["sent"] is True
            numbers = [tick["tick"] for tick in ticks(run)]
            assert numbers == list(range(len(numbers)))
            if number == signal.SIGSTOP:
                process.send_signal(signal.SIGCONT)
                _, err = process.communicate(timeout=LONG)
                assert process.returncode == 7
                assert "the guard has stopped the wheels" in err.splitlines()[-1]
                assert manifest(run)["ending"]["state"] == "stopped"
            else:
                process.communicate(timeout=LONG)
            eventually(lambda: speeds(link) == b"e,0,0\r\n")  # what is left is their own inertia, and that ends
        finally:
            process.kill()
            process.communicate(timeout=LONG)


def test_an_emulator_that_dies_and_comes_back_is_found_and_waits_for_the_order_to_resume(tmp_path: Path) -> None:
    link = tmp_path / "khepera"
    with emulator(link, "--world", "empty") as first:
        process = start("--port", link, *CALM, "--program", "avoid", cwd=tmp_path)
        try:
            line_with(process, "wheels")
            run = the_run(tmp_path)
            eventually(lambda: len(ticks(run)) > 2)
            first.terminate()
            first.wait(LONG)
            eventually(lambda: ticks(run)[-1]["state"] == "disconnected")
            with emulator(link, "--world", "empty"):
                eventually(lambda: ticks(run)[-1]["state"] == "ready")
                assert {tuple(tick["command"]) for tick in ticks(run)[-1:] if tick["command"]} <= {(0, 0)}
                done = khepera_hil("order", "resume", cwd=tmp_path)
                assert done.code == 0, done.err
                eventually(lambda: bool(ticks(run)[-1]["evidence"]))
                process.terminate()
                _, err = process.communicate(timeout=LONG)
                assert process.returncode == 0, err
            numbers = [tick["tick"] for tick in ticks(run)]
            assert numbers == list(range(len(numbers)))
            assert manifest(run)["ending"]["lines_lost"] >= 1
            assert not (run / "guard.jsonl").exists()
        finally:
            process.kill()
            process.communicate(timeout=LONG)


def test_a_port_without_a_descriptor_has_no_guard_and_says_so(tmp_path: Path) -> None:
    done = khepera_hil("--port", "loop://", cwd=tmp_path)
    assert done.code == 4
    assert "no guard" in done.err
