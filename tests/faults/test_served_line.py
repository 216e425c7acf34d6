"""Faults in wall time: on the line of the robot that is served behind a pseudo-terminal or TCP."""

from __future__ import annotations

import contextlib
import json
import signal
import time
from pathlib import Path

import pytest

from khepera_hil.errors import LinkLost, PortError, RobotError
from khepera_hil.faults import Faults
from khepera_hil.opening import open_port
from tests.client_end.robots import connected
from tests.robot_end.serving import PATIENCE, served
from tests.runs.cli import khepera_hil, start

KINDS = ["pty", "tcp"]


@pytest.mark.parametrize("kind", KINDS)
def test_a_served_line_that_is_unplugged_is_lost_and_comes_back_to_the_same_robot(
    kind: str, tmp_path: Path
) -> None:
    with served(kind, tmp_path, faults=Faults("disconnect@3+0.5/3600")) as robot:
        with connected(open_port(robot.url, 38400)) as khepera:
            khepera.handshake()
            khepera.link.ask("G", 4711, 0)
            with pytest.raises(LinkLost):  # noqa: PT012 - a socket's end may show as silence once
                while True:
                    with contextlib.suppress(RobotError):
                        khepera.version()
        give_up = time.monotonic() + PATIENCE
        attempts = 0
        while True:
            try:
                port = open_port(robot.url, 38400)
                break
            except PortError:
                attempts += 1
                assert time.monotonic() < give_up
        with connected(port) as again:
            again.handshake()
            assert again.positions()[0] == 4711
        assert attempts > 0
    assert not (tmp_path / "khepera").is_symlink()


def test_what_was_done_to_the_line_stands_in_the_emulators_own_log(tmp_path: Path) -> None:
    log = tmp_path / "log"
    robot = start(
        "emulate", "--pty", "khepera", "--seed", "3", "--faults", "repeat=0.2", "--log", log, cwd=tmp_path
    )
    assert robot.stdout is not None
    assert "seed 3" in robot.stdout.readline()
    with connected(open_port(str(tmp_path / "khepera"), 38400)) as khepera:
        khepera.handshake()
        for _ in range(40):
            with contextlib.suppress(RobotError):
                khepera.proximity()
    robot.send_signal(signal.SIGTERM)
    out, _ = robot.communicate(timeout=PATIENCE)
    assert robot.returncode == 0
    lines = [json.loads(line) for line in log.read_text().splitlines()]
    faults = [fault for line in lines for fault in line.get("faults", [])]
    assert lines[0]["start"]["faults"] == "repeat=0.2"
    assert {kind for _, _, kind, _ in faults} == {"repeat"}
    assert {way for _, way, _, _ in faults} == {"robot", "host"}
    assert f"faults: repeat {len(faults)}" in out


def test_a_mistake_is_told(tmp_path: Path) -> None:
    done = khepera_hil("emulate", "--pty", "khepera", "--faults", "flop=1", cwd=tmp_path)
    assert done.code == 2
    assert "there is no fault 'flop'" in done.err
    done = khepera_hil("--port", "/dev/ttyS0", "--faults", "flip=1", cwd=tmp_path)
    assert done.code == 2
    assert "--faults goes with --port emulator only" in done.err
