"""The pseudo-terminal and the TCP port: what holds for both, then what is each one's own."""

import fcntl
import os
import socket
import termios
import threading
import time
from contextlib import ExitStack
from pathlib import Path

import pytest
import serial

from khepera_hil.emulator import BOOT_TEXT, Emulator
from khepera_hil.endpoints import REFUSAL, pseudo_terminal, tcp_port
from khepera_hil.errors import PortError
from khepera_hil.serve import serve
from khepera_hil.world import World
from tests.robot_end.serving import PATIENCE, ManualClient, Served, served

KINDS = ["pty", "tcp"]


def ask(port: serial.Serial, request: bytes) -> bytes:
    """Resynchronise, then ask: the boot text may still be under way."""
    port.write(b"\n" + request)
    return port.read_until(request[:1].lower() + b",5.01,5.00\r\n")


@pytest.mark.parametrize("kind", KINDS)
def test_clients_come_and_go_and_the_robot_drives_on(kind: str, tmp_path: Path) -> None:
    with served(kind, tmp_path) as robot:
        with ManualClient(robot.url) as client:
            client.settle()
            assert client.ask("D,5,5") == "d"
        for _ in range(3):
            with serial.serial_for_url(robot.url, 38400, timeout=PATIENCE) as port:
                assert ask(port, b"B\n").endswith(b"b,5.01,5.00\r\n")
        with ManualClient(robot.url) as client:
            before = int(client.ask("H").split(",")[1])
            while int(client.ask("H").split(",")[1]) < before + 50:
                pass
    assert robot.emulator.world.score()["distance_m"] > 0
    assert not (tmp_path / "khepera").is_symlink()


@pytest.mark.parametrize("kind", KINDS)
def test_a_restart_tells_the_boot_text_and_forgets(kind: str, tmp_path: Path) -> None:
    with served(kind, tmp_path) as robot, ManualClient(robot.url) as client:
        client.settle()
        assert client.ask("D,5,5") == "d"
        client.send("restart")
        assert client.line() + "\r\n" + client.line() + "\r\n" == BOOT_TEXT.decode()
        while client.ask("E") != "e,0,0":
            pass
        assert client.ask("K") == "k,1,0,0,1,0,0"


@pytest.mark.parametrize("kind", KINDS)
def test_a_client_that_never_reads_does_not_stop_the_robot(kind: str, tmp_path: Path) -> None:
    with served(kind, tmp_path, 115200) as robot:
        with ManualClient(robot.url) as client:
            client.send("D,5,5", *["N"] * 1200)  # 20 kB of answers: more than the kernel keeps for a terminal
            deadline = time.monotonic() + PATIENCE
            while (gone := robot.emulator.world.score()["distance_m"]) < 0.1 and time.monotonic() < deadline:
                time.sleep(0.02)
            assert gone >= 0.1  # after 2.4 s, in which most of the answers have left
        with ManualClient(robot.url) as client:
            client.settle()
            assert client.ask("B") == "b,6.01,6.01"


def test_a_wrong_rate_garbles_and_the_right_one_mends(tmp_path: Path) -> None:
    with served("pty", tmp_path, 9600) as robot:
        with serial.Serial(robot.url, 38400, timeout=0.3) as port:
            assert b"b,5" not in ask(port, b"B\n")
        with serial.Serial(robot.url, 9600, timeout=PATIENCE) as port:
            assert ask(port, b"B\n").endswith(b"b,5.01,5.00\r\n")


def test_a_client_on_a_terminal_follows_the_rate_that_it_has_set(tmp_path: Path) -> None:
    with served("pty", tmp_path, 9600) as robot, serial.Serial(robot.url, 9600, timeout=PATIENCE) as port:
        ask(port, b"B\n")
        port.write(b"serial 38400\n")
        while robot.emulator.baud != 38400:
            time.sleep(0.01)
        port.timeout = 0.3
        assert b"b,5" not in ask(port, b"B\n")
        port.baudrate = 38400
        port.timeout = PATIENCE
        assert ask(port, b"B\n").endswith(b"b,5.01,5.00\r\n")


def test_over_tcp_a_new_rate_changes_the_pace_alone(tmp_path: Path) -> None:
    with served("tcp", tmp_path) as robot, ManualClient(robot.url) as client:
        client.settle()
        client.send("serial 9600", "B", "serial 19200", "B")
        assert client.line() == client.line() == "b,5.01,5.00"
        assert robot.emulator.baud == 19200
        client.send("restart")
        assert [client.line(), client.line(), ""] == BOOT_TEXT.decode().split("\r\n")
        assert robot.emulator.baud == 38400


def test_nothing_is_echoed_before_the_first_client_sets_its_terminal(tmp_path: Path) -> None:
    with served("pty", tmp_path) as robot:
        plain = os.open(robot.url, os.O_RDWR | os.O_NOCTTY)
        try:
            os.write(plain, b"B\n")
            seen = b""
            while not seen.endswith(b"b,5.01,5.00\r\n"):
                seen += os.read(plain, 100)
            assert seen.startswith(b"ROM of minirobot")
            assert b"B\n" not in seen
        finally:
            os.close(plain)


@pytest.mark.skipif(os.geteuid() != 0, reason="only root opens a terminal that is locked")
def test_a_lock_that_a_client_left_behind_is_taken_off_and_one_that_is_held_is_not(tmp_path: Path) -> None:
    def locked(fd: int) -> bool:
        return any(fcntl.ioctl(fd, 0x80045440, bytes(4)))  # TIOCGEXCL

    with served("pty", tmp_path) as robot:
        first = os.open(robot.url, os.O_RDWR | os.O_NOCTTY)
        fcntl.ioctl(first, termios.TIOCEXCL)
        with ManualClient(robot.url) as client:  # root may, in spite of the lock
            client.settle()
            began = time.monotonic()
            while time.monotonic() < began + 1.5:
                assert client.ask("B") == "b,5.01,5.00"
            assert locked(first)
        os.close(first)
        deadline = time.monotonic() + PATIENCE
        while time.monotonic() < deadline:
            time.sleep(0.3)
            look = os.open(robot.url, os.O_RDWR | os.O_NOCTTY)
            try:
                if not locked(look):
                    break
            finally:
                os.close(look)
        else:
            pytest.fail("the lock stays")


def test_a_link_that_somebody_needs_is_refused_and_a_dead_one_replaced(tmp_path: Path) -> None:
    plain = tmp_path / "file"
    plain.write_text("mine")
    dead = tmp_path / "khepera"
    dead.symlink_to("/dev/pts/99999")
    with served("pty", tmp_path):
        assert dead.exists()
        for link, complaint in ((plain, "is there already"), (dead, "which is alive")):
            with pytest.raises(PortError, match=complaint + "; choose another name"), pseudo_terminal(link, 38400):
                pass
        nowhere = tmp_path / "no" / "where"
        with pytest.raises(PortError, match="cannot be made: No such file"), pseudo_terminal(nowhere, 38400):
            pass
    assert plain.read_text() == "mine"


def rest(connection: socket.socket) -> bytes:
    connection.settimeout(PATIENCE)
    told = b""
    while piece := connection.recv(4096):
        told += piece
    return told


def connected(robot: Served) -> socket.socket:
    host, _, port = robot.url.removeprefix("socket://").rpartition(":")
    return socket.create_connection((host, int(port)), PATIENCE)


def test_a_second_client_is_told_that_there_is_one_and_the_first_is_not_disturbed(tmp_path: Path) -> None:
    with served("tcp", tmp_path) as robot, ManualClient(robot.url) as first:
        first.settle()
        for talkative in (False, True, True):
            with connected(robot) as second:
                if talkative:
                    second.sendall(b"D,20,20\n")
                assert rest(second) == REFUSAL
        assert first.ask("E") == "e,0,0"
        with ExitStack() as crowd:
            for _ in range(20):  # more than are waited for
                crowd.enter_context(connected(robot))
            assert first.ask("B") == "b,5.01,5.00"
        assert first.ask("B") == "b,5.01,5.00"


def test_a_client_that_has_ended_its_sending_gets_its_answers_and_is_let_go(tmp_path: Path) -> None:
    with served("tcp", tmp_path) as robot:
        for _ in range(3):  # as in: printf 'G,1,2\nH\n' | nc HOST PORT
            with connected(robot) as client:
                client.sendall(b"\nG,1,2\nH\nB\n")
                client.shutdown(socket.SHUT_WR)
                assert rest(client).endswith(b"g\r\nh,1,2\r\nb,5.01,5.00\r\n")


def test_a_client_that_is_torn_away_leaves_its_place(tmp_path: Path) -> None:
    with served("tcp", tmp_path) as robot:
        for _ in range(3):
            client = connected(robot)
            client.sendall(b"N\n" * 50)
            client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")  # a reset, no goodbye
            client.close()
            while True:
                with connected(robot) as next_one:
                    next_one.sendall(b"\nB\n")
                    if next_one.recv(10) != REFUSAL[:10]:
                        break


def test_a_port_that_cannot_be_had_is_a_sentence() -> None:
    with tcp_port("", 0) as one, socket.socket() as probe:
        assert one.device.startswith("127.0.0.1:")
        number = int(one.device.rpartition(":")[2])
        with pytest.raises(PortError, match=f"somebody listens on port {number} already"), tcp_port("", number):
            pass
        with (
            pytest.raises(PortError, match=r"'192\.0\.2\.1' is no address of this machine"),
            tcp_port("192.0.2.1", 0),
        ):
            pass
        with pytest.raises(PortError, match="is no address of this machine"), tcp_port("no such host", 0):
            pass
        probe.connect(("127.0.0.1", number))


class Jumping:
    """A clock as a process sees it that was stopped for an hour."""

    simulated = False

    def __init__(self) -> None:
        self._began = time.monotonic()
        self.jump = 0.0

    def now(self) -> float:
        return time.monotonic() - self._began + self.jump

    def sleep_until(self, moment: float) -> None:
        raise AssertionError("the server waits for descriptors")


def test_a_server_that_was_stopped_for_an_hour_has_no_hour_to_catch_up_with(tmp_path: Path) -> None:
    clock = Jumping()
    stop, ender = os.pipe()
    robot = Emulator(World("empty"), 38400)
    ended: list[float] = []
    with pseudo_terminal(tmp_path / "khepera", 38400) as endpoint:
        thread = threading.Thread(target=lambda: ended.append(serve([(endpoint, robot)], stop=stop, clock=clock)))
        thread.start()
        with ManualClient(endpoint.name) as client:
            client.settle()
            clock.jump = 3600.0
            assert client.ask("B") == "b,5.01,5.00"
        os.write(ender, b"x")
        thread.join(PATIENCE)
    os.close(stop)
    os.close(ender)
    assert 0 < ended[0] < 3 * PATIENCE
