"""``khepera-hil emulate --robots``: several robots in one arena, each behind a port of its own."""

from __future__ import annotations

import contextlib
import json
import math
import os
import signal
import time
from itertools import combinations
from pathlib import Path
from typing import Any

import pytest

from khepera_hil.__main__ import outcome
from khepera_hil.opening import open_port
from tests.client_end.robots import connected
from tests.robot_end.serving import PATIENCE, ManualClient
from tests.runs.cli import start
from tests.runs.test_emulate import emulating, ended, first_line

BODY = 0.057


def read(log: Path) -> tuple[dict[str, Any], list[dict[str, Any]], dict[str, Any]]:
    """Start, lines and end of the emulator's log."""
    first, *lines, last = [json.loads(line) for line in log.read_text().splitlines()]
    return first["start"], lines, last


def test_two_programs_at_once_do_not_sink_into_each_other(tmp_path: Path) -> None:
    log = tmp_path / "truth.jsonl"
    arena = tmp_path / "small.toml"  # in which they look at each other
    arena.write_text(
        "title = 'small'\nsize_mm = [320, 320]\n[start]\nat_mm = [100, 160]\n"
        "[[robot]]\nnumber = 2\nat_mm = [220, 160]\nheading_deg = 180\n"
    )
    with emulating(
        "--robots", "2", "--pty", tmp_path / "k", "--world", arena, "--seed", "4", "--log", log
    ) as process:
        lines = [first_line(process) for _ in range(2)]
        assert [line.partition(" -> ")[0] for line in lines] == [str(tmp_path / f"k-{number}") for number in (1, 2)]
        assert "robot 1, a Khepera" in lines[0]
        assert "robot 2, a Khepera" in lines[1]
        programs = [
            start(
                "--port", f"k-{number}", "--program", name, "--duration", "5", "--seed", "1", "--json", cwd=tmp_path
            )
            for number, name in ((1, "avoid"), (2, "push"))
        ]
        results = []
        for program in programs:
            told, complaint = program.communicate(timeout=6 * PATIENCE)
            assert program.returncode == 0, complaint
            results.append(json.loads(told.splitlines()[-1]))
        told = ended(process)
    assert [result["ticks"] + result["missed"] for result in results] == [50, 50]
    assert told.count("score: ") == 2
    begin, truth, end = read(log)
    assert {shape["name"] for shape in begin["shapes"] if shape["kind"] == "robot"} == {"robot", "robot 2"}
    places: dict[str, list[float]] = {}
    nearest = math.inf
    for line in truth:
        places |= {name: told["pose"][:2] for name, told in line["robots"].items()}
        nearest = min(nearest, *(math.dist(a, b) for a, b in combinations(places.values(), 2)))
    assert BODY - 0.0005 < nearest < 0.09
    requests = {
        name: {r[0] for line in truth for r in line["robots"].get(name, {}).get("requests", ())} for name in places
    }
    assert requests["robot"] >= {"N", "D"}
    assert requests["robot 2"] >= {"N", "D"}
    assert all(score["distance_m"] > 0.05 for score in end["scores"].values())
    assert not list(tmp_path.glob("k-*"))


def test_one_client_that_goes_comes_back_or_floods_disturbs_no_other(tmp_path: Path) -> None:
    with emulating("--robots", "3", "--pty", tmp_path / "k", "--world", "empty", "--seed", "1") as process:
        for _ in range(3):
            first_line(process)
        with ManualClient(str(tmp_path / "k-2")) as steady:
            steady.settle()
            assert steady.ask("D,3,-3") == "d"
            for _ in range(3):
                with ManualClient(str(tmp_path / "k-1")) as other:
                    other.settle()
                    assert other.ask("E").startswith("e,")
                    other.send("D,5,5", *["N"] * 40)  # and goes without reading a word
                assert steady.ask("B") == "b,5.01,5.00"
                assert steady.ask("D,3,-3") == "d"
            with ManualClient(str(tmp_path / "k-1")) as again:  # the robot went on, and is the same
                again.settle()
                assert again.ask("E") != "e,0,0"
            with ManualClient(str(tmp_path / "k-3")) as third:
                third.settle()
                assert third.ask("E") == "e,0,0"
            assert steady.ask("B") == "b,5.01,5.00"
        ended(process)


def test_a_program_that_is_killed_can_be_followed_by_another(tmp_path: Path) -> None:
    with emulating("--robots", "2", "--pty", tmp_path / "k", "--seed", "2", "--world", "empty") as process:
        for _ in range(2):
            first_line(process)
        steady = start("--port", "k-2", "--program", "avoid", "--duration", "4", "--json", cwd=tmp_path)
        doomed = start("--port", "k-1", "--program", "avoid", cwd=tmp_path)
        deadline = time.monotonic() + 3 * PATIENCE
        while not list(tmp_path.glob("runs/*/ticks.jsonl")) and time.monotonic() < deadline:
            time.sleep(0.05)
        doomed.send_signal(signal.SIGKILL)
        doomed.communicate(timeout=PATIENCE)
        after = start("--port", "k-1", "--program", "home", "--duration", "1", "--json", cwd=tmp_path)
        for program, ticks in ((after, 10), (steady, 40)):
            told, complaint = program.communicate(timeout=6 * PATIENCE)
            assert program.returncode == 0, complaint
            result = json.loads(told.splitlines()[-1])
            assert result["ticks"] + result["missed"] == ticks
            assert result["robot_resets"] == 0
        ended(process)


def test_each_line_has_faults_of_its_own_and_the_log_says_whose(tmp_path: Path) -> None:
    log = tmp_path / "truth.jsonl"
    with emulating(
        "--robots", "2", "--tcp", ":0", "--seed", "3", "--faults", "repeat=0.3", "--log", log
    ) as process:
        urls = [first_line(process).partition(": ")[0] for _ in range(2)]
        assert urls[0] != urls[1]
        with connected(open_port(urls[1], 38400)) as khepera:
            khepera.handshake()
            for _ in range(30):
                with contextlib.suppress(Exception):
                    khepera.version()
        told = ended(process)
    assert "robot 2: faults: repeat " in told
    begin, lines, _ = read(log)
    assert begin["name"] == ", ".join(urls)
    assert any("faults" in line["robots"].get("robot 2", {}) for line in lines)
    assert not any("requests" in line["robots"].get("robot", {}) for line in lines)


def test_ports_follow_each_other(tmp_path: Path) -> None:
    with emulating("--tcp", ":0") as process:  # one that was free a moment ago
        port = int(first_line(process).partition(": ")[0].rpartition(":")[2])
        ended(process)
    if port + 1 > 65535:
        pytest.skip("the last port of all")
    with emulating("--robots", "2", "--tcp", f":{port}", "--world", "empty") as process:
        urls = [first_line(process).partition(": ")[0] for _ in range(2)]
        if not urls[0]:
            pytest.skip("somebody took the port meanwhile")
        assert [int(url.rpartition(":")[2]) for url in urls] == [port, port + 1]
        for url in urls:
            with ManualClient(url) as client:
                client.settle()
        ended(process)


def test_one_robot_alone_keeps_the_very_name(tmp_path: Path) -> None:
    with emulating("--robots", "1", "--pty", tmp_path / "k") as process:
        line = first_line(process)
        assert line.startswith(f"{tmp_path / 'k'} -> ")
        assert "robot 1" not in line
        assert os.readlink(tmp_path / "k").startswith("/dev/")
        assert ended(process).startswith("score: ")


def test_a_name_that_is_taken_leaves_none_of_the_others_behind(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "k-2").write_text("mine")
    assert outcome(["emulate", "--robots", "3", "--pty", str(tmp_path / "k")]) == 3
    assert "k-2 is there already; choose another name" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["k-2"]


@pytest.mark.parametrize(
    ("arguments", "code", "sentence"),
    [
        (["--robots", "0"], 2, "'0' is no number of robots from 1 to 32"),
        (["--robots", "-1"], 2, "'-1' is no number of robots from 1 to 32"),
        (["--robots", "1000"], 2, "'1000' is no number of robots from 1 to 32"),
        (["--robots", "1e9"], 2, "'1e9' is no number of robots"),
        (["--robots", "9" * 400], 2, "is no number of robots from 1 to 32"),
        (["--robots", "32", "--world", "pen"], 2, "the arena pen has no room for robot"),
        (["--robots", "3", "--tcp", ":65534"], 2, "3 robots from port 65534 on need ports beyond 65535"),
    ],
)
def test_a_mistake_is_one_sentence_and_an_exit_code(
    arguments: list[str], code: int, sentence: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    where = [] if "--tcp" in arguments else ["--pty", str(tmp_path / "k")]
    assert outcome(["emulate", *where, *arguments]) == code
    told, complaint = capsys.readouterr()
    assert told == ""
    assert sentence in complaint
    assert complaint.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_programs_that_meet_from_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = [
        "meet",
        "avoid",
        "home",
        "--world",
        "lamp",
        "--seed",
        "3",
        "--duration",
        "3",
        "--runs",
        str(tmp_path),
        "--json",
    ]
    results = []
    for _ in range(2):
        assert outcome(words) == 0
        results.append(json.loads(capsys.readouterr().out.splitlines()[-1]))
    assert [run["program"] for run in results[0]["runs"]] == ["avoid", "home"]
    assert [run["score"] for run in results[0]["runs"]] == [run["score"] for run in results[1]["runs"]]
    for one, other in zip(results[0]["runs"], results[1]["runs"], strict=True):
        assert outcome(["compare", one["run"], other["run"]]) == 0
    capsys.readouterr()
    for words, sentence in (
        (["meet", "avoid"], "name from 2 to 32 programs"),
        (["meet", "avoid", "dance"], "there is no program 'dance'"),
        (["meet", "avoid", "home", "--world", "moon"], "no arena 'moon'"),
    ):
        assert outcome(words) == 2
        assert sentence in capsys.readouterr().err
