"""``khepera-hil emulate`` as a process: from its command line to its last line."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path

import pytest

from khepera_hil.__main__ import outcome
from tests.robot_end.serving import PATIENCE, ManualClient

EMULATE = [sys.executable, "-m", "khepera_hil", "emulate"]


@contextmanager
def emulating(*arguments: str | Path) -> Iterator[subprocess.Popen[str]]:
    process = subprocess.Popen(
        [*EMULATE, *map(str, arguments)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def first_line(process: subprocess.Popen[str]) -> str:
    assert process.stdout is not None
    return process.stdout.readline()


def ended(process: subprocess.Popen[str], how: int = signal.SIGTERM) -> str:
    process.send_signal(how)
    told, complaints = process.communicate(timeout=PATIENCE)
    assert (process.returncode, complaints) == (0, "")
    return told


def test_behind_a_terminal_with_a_log_of_the_truth(tmp_path: Path) -> None:
    link, log = tmp_path / "khepera", tmp_path / "truth.jsonl"
    with emulating("--pty", link, "--log", log, "--seed", "3", "--world", "empty") as process:
        device = os.readlink(link) if first_line(process) else ""
        assert device.startswith("/dev/")
        with ManualClient(str(link)) as client:
            client.settle()
            assert client.ask("D,10,10") == "d"
            while int(client.ask("H").split(",")[1]) < 4711 + 200:
                pass
        told = ended(process, signal.SIGINT)
    assert not link.is_symlink()
    lines = [json.loads(line) for line in log.read_text().splitlines()]
    start, end = lines[0]["start"], lines[-1]
    assert (start["robot"], start["seed"], start["arena"], start["size"]) == ("khepera", 3, "empty", [1, 1])
    assert {shape["name"] for shape in start["shapes"]} >= {"robot", "south wall"}
    requests = [request for line in lines[1:-1] for request in line.get("requests", ())]
    assert requests[:3] == ["G,4711,-4711", "H", "D,10,10"]
    times = [line["t"] for line in lines[1:-1]]
    assert times == sorted(times)
    way = sum(
        ((b["pose"][0] - a["pose"][0]) ** 2 + (b["pose"][1] - a["pose"][1]) ** 2) ** 0.5
        for a, b in pairwise(lines[1:-1])
    )
    assert way == pytest.approx(end["score"]["distance_m"], abs=1e-3)
    assert f"distance_m {end['score']['distance_m']}" in told


def test_behind_a_port_of_its_own_choice_with_robot_and_turrets() -> None:
    chosen = "--robot", "khepera2", "--baud", "115200", "--turrets", "gripper"
    with emulating("--tcp", ":0", *chosen) as process:
        url, _, about = first_line(process).partition(": a Khepera II at 115200 baud in furnished")
        assert about
        with ManualClient(url) as client:
            client.settle()
            assert client.ask("B") == "b,6.01,6.01"
            assert client.ask("T,1,B") == "t,1,b,1,0"
            assert client.ask("T,2,B") == "z,Turret order not supported"
        assert ended(process, signal.SIGHUP).startswith("score: ")


def test_a_log_into_a_pipe_that_nobody_reads_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    os.mkfifo(tmp_path / "pipe")
    assert outcome(["emulate", "--tcp", ":0", "--log", str(tmp_path / "pipe")]) == 6
    assert "cannot be written: No such device or address" in capsys.readouterr().err


def test_a_scenario_brings_its_own_world() -> None:
    with emulating("--tcp", "127.0.0.1:0", "--scenario", "visitors") as process:
        assert " in watchman with visitors, seed " in first_line(process)


def test_a_full_disk_ends_the_log_and_not_the_robot() -> None:
    if not Path("/dev/full").exists():
        pytest.skip("no full disk here")
    with emulating("--tcp", ":0", "--log", "/dev/full") as process:
        url = first_line(process).partition(": ")[0]
        with ManualClient(url) as client:
            client.settle()
            assert client.ask("B") == "b,5.01,5.00"
        process.terminate()
        _, complaints = process.communicate(timeout=PATIENCE)
    assert complaints == "khepera-hil: the log /dev/full ends here: No space left on device\n"
    assert process.returncode == 6


@pytest.mark.parametrize(
    ("arguments", "code", "sentence"),
    [
        ([], 2, "one of the arguments --pty --tcp is required"),
        (["--pty", "a", "--tcp", ":0"], 2, "--tcp: not allowed with argument --pty"),
        (["--tcp", "4000"], 2, "'4000' is no HOST:PORT, such as :4000"),
        (["--tcp", "::1:4000"], 2, "is no HOST:PORT"),
        (["--tcp", ":65536"], 2, "is no HOST:PORT"),
        (["--tcp", "192.0.2.1:0"], 3, "'192.0.2.1' is no address of this machine"),
        (
            ["--tcp", ":0", "--turrets", "k213,radar"],
            2,
            "there is no turret 'radar'; there are gripper, k213, genio",
        ),
        (["--tcp", ":0", "--robot", "koala"], 2, "invalid choice: 'koala'"),
        (["--tcp", ":0", "--robot", "khepera", "--baud", "57600"], 2, "a Khepera does not talk at 57600 baud"),
        (["--tcp", ":0", "--baud", "31250"], 2, "no Khepera talks at 31250 baud"),
        (["--tcp", ":0", "--world", "moon"], 2, "no arena 'moon'"),
        (["--tcp", ":0", "--scenario", "moon"], 2, "no scenario 'moon'"),
        (
            ["--tcp", ":0", "--log", "/no/where"],
            6,
            "the log /no/where cannot be written: No such file or directory",
        ),
        (["--tcp", ":0", "--view"], 2, "there is no screen here to open the viewer on"),
        (["--pty", "/no/where"], 3, "the link /no/where cannot be made"),
    ],
)
def test_a_mistake_is_one_sentence_and_an_exit_code(
    arguments: list[str],
    code: int,
    sentence: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    assert outcome(["emulate", *arguments]) == code
    told, complaint = capsys.readouterr()
    assert told == ""
    assert sentence in complaint
    assert complaint.count("\n") == 1
