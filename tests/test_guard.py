"""The guard at work on a real pseudo-terminal; the robot's end reads what it sends, to the byte."""

from __future__ import annotations

import json
import os
import pty
import select
import signal
import socket
import subprocess
import sys
import time
import tty
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import pytest

from khepera_hil import guard
from khepera_hil.errors import GuardLost, PortError
from khepera_hil.guarding import SPARING, Process, Unguarded, limit
from khepera_hil.opening import close_port, descriptor, open_port
from tests.runs.cli import environment

ROOT = Path(__file__).parents[1]
LIMIT = 0.4
BOTH = guard.STOP * 2
LONG = 30.0  # seconds in which what must happen happens on the busiest machine


@dataclass
class Line:
    """A serial line: the service's end as a descriptor, the robot's to be read."""

    master: int
    slave: int

    def heard(self, size: int, seconds: float = LONG) -> bytes:
        """What has come at the robot's end: ``size`` bytes, or those that came in time."""
        data = b""
        end = time.monotonic() + seconds
        while len(data) < size and select.select([self.master], [], [], max(0.0, end - time.monotonic()))[0]:
            data += os.read(self.master, size - len(data))
        return data


@pytest.fixture
def line() -> Iterator[Line]:
    master, slave = pty.openpty()
    tty.setraw(slave)
    yield Line(master, slave)
    os.close(master)
    os.close(slave)


@pytest.fixture
def process() -> Iterator[Process]:
    """One that no busy machine makes trip, for what is not about being silent for too long."""
    process = Process(LONG)
    yield process
    process.close()


@pytest.fixture
def impatient() -> Iterator[Process]:
    process = Process(LIMIT)
    yield process
    process.close()


def die(process: Process) -> None:
    """What the kernel does with the pipe of a process that is killed."""
    process._pipe.close()


def answered(process: Process) -> None:
    """It has said something that nobody has read."""
    assert select.select([process._pipe], [], [], LONG)[0]


def held_up(process: Process) -> None:
    """It is stopped, and has been."""
    os.kill(process.pid, signal.SIGSTOP)
    os.waitid(os.P_PID, process.pid, os.WSTOPPED | os.WNOWAIT)


def test_it_stops_the_wheels_of_a_service_that_died(process: Process, line: Line, tmp_path: Path) -> None:
    process.record_in(tmp_path)
    process.watch(line.slave)
    process.moving()
    die(process)
    assert line.heard(len(BOTH)) == BOTH
    process._process.wait(LONG)
    [said] = [json.loads(row) for row in (tmp_path / guard.LOG).read_text().splitlines()]
    assert said["why"] == "the service is gone"
    assert said["sent"] is True
    assert said["error"] is None


def test_it_stops_the_wheels_of_a_service_that_hangs(impatient: Process, line: Line, tmp_path: Path) -> None:
    impatient.record_in(tmp_path)
    impatient.watch(line.slave)
    began = time.monotonic()
    impatient.moving()
    assert line.heard(len(BOTH)) == BOTH
    assert time.monotonic() - began >= LIMIT  # never before
    with pytest.raises(GuardLost, match="gave no sign"):
        impatient.check()
    impatient.check()  # it was said
    with pytest.raises(GuardLost):  # and it stays so
        impatient.moving()
    impatient.beat()
    impatient.resting()
    assert "gave no sign for" in (tmp_path / guard.LOG).read_text()


def test_from_its_first_byte_on_a_service_that_wakes_finds_it_gone(impatient: Process, line: Line) -> None:
    """Not only once it has exited: in between the service could set the robot in motion again."""
    impatient.watch(line.slave)
    impatient.moving()
    assert line.heard(1)
    with pytest.raises(GuardLost):
        impatient.moving()


@pytest.mark.parametrize("armed", [True, False])
def test_as_long_as_the_service_is_well_it_says_nothing(line: Line, armed: bool) -> None:
    process = Process(2.0)  # a busy machine may hold a test up for longer than a tick
    process.watch(line.slave)
    if armed:
        process.moving()
    else:
        process.resting()
    for _ in range(25):
        time.sleep(0.1)
        process.beat()
    process.close()
    assert process._process.returncode == 0
    assert line.heard(1, 0.0) == b""


def test_a_goodbye_counts_also_when_its_answers_were_never_read(process: Process, line: Line) -> None:
    process.watch(line.slave)
    answered(process)
    process.close()
    assert process._process.returncode == 0
    assert line.heard(1, 0.0) == b""


def test_a_death_counts_also_when_its_answers_were_never_read(process: Process, line: Line) -> None:
    process.watch(line.slave)
    answered(process)
    die(process)
    assert line.heard(len(BOTH)) == BOTH


def test_wheels_at_rest_need_no_beat_and_a_death_no_order(line: Line) -> None:
    process = Process(1.5)
    process.watch(line.slave)
    process.resting()
    time.sleep(2.0)
    process.beat()
    die(process)
    process._process.wait(LONG)
    assert line.heard(1, 0.0) == b""


def test_a_port_that_was_just_opened_counts_as_one_whose_wheels_move(process: Process, line: Line) -> None:
    process.watch(line.slave)
    die(process)
    assert line.heard(len(BOTH)) == BOTH


def test_each_reconnection_hands_it_the_new_descriptor_and_the_old_one_is_closed(
    process: Process, line: Line
) -> None:
    old_master, old_slave = pty.openpty()
    tty.setraw(old_slave)
    process.watch(old_slave)
    process.moving()
    os.close(old_slave)
    process.watch(None)
    process.watch(line.slave)
    process.moving()
    # When nobody holds the old line any more its other end reads an error. It takes the guard a moment.
    end = time.monotonic() + LONG
    while time.monotonic() < end:
        poll = select.poll()
        poll.register(old_master, select.POLLHUP)
        if any(event & select.POLLHUP for _, event in poll.poll(50)):
            break
        process.beat()
    else:
        raise AssertionError("the guard kept the old line open")
    os.close(old_master)
    die(process)
    assert line.heard(len(BOTH)) == BOTH


def test_half_a_command_and_what_only_waits_is_not_sent_before_the_order(process: Process, line: Line) -> None:
    process.watch(line.slave)
    process.moving()
    os.write(line.slave, b"D,12,1")  # and the rest never comes
    die(process)
    heard = line.heard(len(b"D,12,1" + BOTH), 5.0)
    # Either it was thrown away in time, or the line end makes a line of its own of it, before the order.
    assert heard in (BOTH, b"D,12,1" + BOTH)


def test_a_line_that_is_full_of_earlier_bytes_takes_the_order_all_the_same(process: Process, line: Line) -> None:
    process.watch(line.slave)
    process.moving()
    os.set_blocking(line.slave, False)
    with suppress(BlockingIOError):
        while True:
            os.write(line.slave, b"D,12,12\n" * 100)
    die(process)
    process._process.wait(LONG)
    assert line.heard(1 << 20, 0.5).endswith(BOTH)


def test_a_port_that_is_gone_is_told_and_nothing_worse(process: Process, tmp_path: Path) -> None:
    master, slave = pty.openpty()
    tty.setraw(slave)
    process.record_in(tmp_path)
    process.watch(slave)
    process.moving()
    os.close(master)
    os.close(slave)
    die(process)
    assert process._process.wait(LONG) == 0
    said = json.loads((tmp_path / guard.LOG).read_text())
    assert said["sent"] is False
    assert said["error"]


@pytest.mark.parametrize("number", ["SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT", "SIGTSTP", "SIGABRT"])
def test_no_signal_of_a_terminal_or_a_manager_takes_it_down(process: Process, line: Line, number: str) -> None:
    process.watch(line.slave)
    process.moving()
    os.kill(process.pid, signal.Signals[number])
    process.beat()
    die(process)
    assert line.heard(len(BOTH)) == BOTH


def test_it_is_in_a_session_of_its_own(process: Process) -> None:
    assert os.getsid(process.pid) == process.pid != os.getsid(0)


def test_a_guard_that_is_killed_is_missed_with_the_next_beat(process: Process, line: Line) -> None:
    process.watch(line.slave)
    process.moving()
    os.kill(process.pid, signal.SIGKILL)
    process._process.wait(LONG)
    with pytest.raises(GuardLost, match="was it killed"):
        process.moving()


def test_a_guard_that_takes_no_beats_is_as_good_as_gone(process: Process, line: Line) -> None:
    process.watch(line.slave)
    os.kill(process.pid, signal.SIGSTOP)
    said = ""
    while not said:
        try:
            process._send(guard.MOVING)
        except GuardLost as error:
            said = str(error)
    assert "takes no beats" in said


def test_a_guard_that_is_held_up_is_missed_long_before_the_pipe_is_full(line: Line) -> None:
    process = Process(1.0)
    process.watch(line.slave)
    held_up(process)
    sent = process._unanswered
    said, end = "", time.monotonic() + LONG
    while not said:
        assert time.monotonic() < end
        try:
            process.beat()
            process.moving()
        except GuardLost as error:
            said = str(error)
        time.sleep(0.01)
    assert "does not answer" in said
    assert process._unanswered - sent <= process._patience / SPARING + 1
    with pytest.raises(GuardLost):
        process.moving()
    process.close()


def test_what_the_service_sleeps_through_itself_is_not_held_against_the_guard(process: Process, line: Line) -> None:
    process.watch(line.slave)
    held_up(process)
    process._send(guard.MOVING)
    process._listened -= 1000 * LONG  # the whole machine stood still, the two of us with it
    process.check()
    assert 0 < process._silent <= process._patience / 8
    os.kill(process.pid, signal.SIGCONT)
    end = time.monotonic() + LONG
    while process._unanswered:
        assert time.monotonic() < end
        process.check()
        time.sleep(0.001)
    assert process._silent == 0.0


def test_a_guard_that_does_not_start_is_told_as_such(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "guard.py").write_text("")
    monkeypatch.setattr(guard, "__file__", str(tmp_path / "guard.py"))
    with pytest.raises(GuardLost, match="ended as it started"):
        Process(LIMIT)
    monkeypatch.setattr(sys, "executable", "/no/such/python")
    with pytest.raises(GuardLost, match="does not start"):
        Process(LIMIT)


def test_a_socket_is_guarded_as_a_device_is(process: Process) -> None:
    ours, robots = socket.socketpair()
    with ours, robots:
        process.watch(ours.fileno())
        process.moving()
        die(process)
        robots.settimeout(LONG)
        heard = b""
        while len(heard) < len(BOTH):
            heard += robots.recv(100)
        assert heard == BOTH


def test_the_limit_is_three_tenths_more_than_a_period_and_never_less_than_four() -> None:
    assert [round(limit(period), 6) for period in (0.01, 0.1, 0.5, 2.0)] == [0.4, 0.4, 0.8, 2.3]


def test_without_a_guard_nothing_happens(tmp_path: Path) -> None:
    nobody = Unguarded()
    nobody.watch(None)
    nobody.moving()
    nobody.resting()
    nobody.beat()
    nobody.record_in(tmp_path)
    nobody.close()
    assert not list(tmp_path.iterdir())


SERVICE = """
import os, sys, time
from pathlib import Path
from khepera_hil.errors import GuardLost
from khepera_hil.guarding import Process
process = Process(2.0)
fd = os.open(sys.argv[1], os.O_RDWR | os.O_NOCTTY)
process.record_in(Path(sys.argv[2]))
process.watch(fd)
try:
    while True:
        process.beat()
        process.moving()
        os.write(fd, b"D,5,5\\n")
        process.check()
        time.sleep(0.1)
except GuardLost as error:
    print(error)
"""


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP, signal.SIGABRT])
def test_a_process_that_is_killed_or_held_up_is_spoken_for(line: Line, tmp_path: Path, number: int) -> None:
    service = subprocess.Popen(
        [sys.executable, "-c", SERVICE, os.ttyname(line.slave), str(tmp_path)],
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    try:
        moving = b"D,5,5\n"
        heard = line.heard(5 * len(moving))
        assert heard == 5 * moving
        service.send_signal(number)
        while not heard.endswith(BOTH):
            more = line.heard(1)
            assert more, heard[-50:]
            heard += more
        assert heard.replace(moving, b"") in (BOTH, b"D,5,5" + BOTH)
        if number == signal.SIGSTOP:
            # Awake again, it must not go on: whatever it has been about to write, it finds out before the next.
            service.send_signal(signal.SIGCONT)
            out, _ = service.communicate(timeout=LONG)
            assert "gave no sign" in out
            assert line.heard(2 * len(moving), 0.0) in (b"", moving)
    finally:
        service.kill()
        service.communicate()
    end = time.monotonic() + LONG
    while not (tmp_path / guard.LOG).exists():  # the wheels come first, the line after the second order
        assert time.monotonic() < end
        time.sleep(0.01)


def test_devices_and_sockets_can_be_written_to_by_another_process_and_a_loop_cannot(line: Line) -> None:
    port = open_port(os.ttyname(line.slave), 38400)
    try:
        number = descriptor(port)
        assert number is not None
        os.write(number, b"D,0,0\n")
        assert line.heard(6) == b"D,0,0\n"
    finally:
        close_port(port)
    assert descriptor(port) is None, "it is closed"
    loop = open_port("loop://", 38400)
    assert descriptor(loop) is None
    close_port(loop)
    with socket.create_server(("127.0.0.1", 0)) as server:
        remote = open_port(f"socket://127.0.0.1:{server.getsockname()[1]}", 38400)
        peer, _ = server.accept()
        with peer:
            number = descriptor(remote)
            assert number is not None
            os.write(number, b"D,0,0\n")
            assert peer.recv(10) == b"D,0,0\n"
        close_port(remote)


def test_a_port_that_the_guard_holds_too_can_be_opened_again_once_it_let_go(process: Process, line: Line) -> None:
    """The lock goes with the open file, which the two share: it lasts as long as either holds it."""
    name = os.ttyname(line.slave)
    port = open_port(name, 38400)
    process.watch(descriptor(port))
    close_port(port)
    process.watch(None)
    end = time.monotonic() + LONG
    again = None
    while again is None:
        assert time.monotonic() < end
        process.beat()
        with suppress(PortError):  # for a moment it is in use
            again = open_port(name, 38400)
    close_port(again)
