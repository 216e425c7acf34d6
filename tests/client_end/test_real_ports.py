"""Real pyserial on real pseudo-terminals and sockets, with a small robot in a thread behind them."""

from __future__ import annotations

import contextlib
import os
import pty
import select
import socket
import threading
import tty
from collections.abc import Iterator
from pathlib import Path

import pytest
import serial

from khepera_hil.clock import WallClock
from khepera_hil.errors import BadAnswer, LinkLost, NoAnswer, PortError
from khepera_hil.khepera import Khepera
from khepera_hil.link import Link, Port, open_port
from khepera_hil.protocol import RequestLines, RequestRefused, encode_answer, parse_request

BAUD = 38400
ANSWERS: dict[str, tuple[int | str, ...]] = {
    "B": ("5.01", "5.00"),
    "K": (0,) * 6,
    "E": (0, 0),
    "N": (1, 2, 3, 4, 5, 6, 7, 1023),
    "D": (),
}


class SwitchedOff(Exception):
    """A robot ends in the middle of a request."""


class Robot:
    """Serves one descriptor in a thread until it is switched off; ``mute`` robots read and say nothing."""

    def __init__(self, fd: int, mute: bool = False) -> None:
        self._fd = fd
        self._mute = mute
        self._woken, self._wake = os.pipe()
        self.heard = bytearray()
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def _serve(self) -> None:
        with contextlib.suppress(SwitchedOff):
            self._serve_until_off()

    def _serve_until_off(self) -> None:
        editor = RequestLines()
        while True:
            ready, _, _ = select.select([self._fd, self._woken], [], [])
            if self._woken in ready:
                return
            data = os.read(self._fd, 1024)
            if not data:
                return
            self.heard += data
            for line in editor.feed(data):
                if line and not self._mute:
                    os.write(self._fd, self._answer(line))

    def _answer(self, line: bytes) -> bytes:
        try:
            request = parse_request(line)
        except RequestRefused as refused:
            return refused.reply
        assert request is not None
        return encode_answer(request[0], *ANSWERS[request[0]])

    def off(self) -> None:
        os.write(self._wake, b".")
        self._thread.join(10)
        assert not self._thread.is_alive()
        os.close(self._woken)
        os.close(self._wake)


class Cable:
    """A pseudo-terminal: its name for the client, its other end for a robot."""

    def __init__(self) -> None:
        self.end, self._terminal = pty.openpty()
        tty.setraw(self._terminal)
        self.name = os.ttyname(self._terminal)

    def pull(self) -> None:
        for fd in (self.end, self._terminal):
            with contextlib.suppress(OSError):
                os.close(fd)


@pytest.fixture
def cable() -> Iterator[Cable]:
    cable = Cable()
    yield cable
    cable.pull()


@contextlib.contextmanager
def connected(port: Port) -> Iterator[Khepera]:
    link = Link(
        port, WallClock(), baud=BAUD, margin=1.0
    )  # generous: this machine may be busy, and nothing is timed
    try:
        yield Khepera(link)
    finally:
        link.close()


def test_a_robot_behind_a_terminal_is_found_read_and_driven(cable: Cable) -> None:
    robot = Robot(cable.end)
    try:
        with connected(open_port(cable.name, BAUD)) as khepera:
            assert khepera.handshake() == ("5.01", "5.00")
            for _ in range(50):
                assert khepera.proximity() == (1, 2, 3, 4, 5, 6, 7, 1023)
                assert khepera.set_speed(3.2, -200) == (3, -127)
            assert khepera.stop()
            assert khepera.link.counters.accepted == 102
    finally:
        robot.off()
    assert robot.heard.endswith(b"D,0,0\n")


def test_a_robot_behind_a_socket_is_found_and_lost() -> None:
    server = socket.create_server(("127.0.0.1", 0))
    port = open_port(f"socket://127.0.0.1:{server.getsockname()[1]}", BAUD)
    peer, _ = server.accept()
    robot = Robot(peer.fileno())
    try:
        with connected(port) as khepera:
            assert khepera.handshake() == ("5.01", "5.00")
            assert khepera.proximity() == (1, 2, 3, 4, 5, 6, 7, 1023)
            robot.off()
            peer.close()
            with pytest.raises(LinkLost):
                khepera.proximity()
    finally:
        peer.close()
        server.close()


def test_a_mute_robot_is_told_as_a_sentence(cable: Cable) -> None:
    robot = Robot(cable.end, mute=True)
    try:
        with connected(open_port(cable.name, BAUD)) as khepera, pytest.raises(NoAnswer) as failure:
            khepera.handshake()
    finally:
        robot.off()
    assert f"no Khepera answers on {cable.name} at 38400 baud" in str(failure.value)
    assert b"B\n" in robot.heard


def test_a_loop_of_wire_is_no_robot() -> None:
    with connected(open_port("loop://", BAUD)) as khepera, pytest.raises(BadAnswer):
        khepera.handshake()


def test_pulling_the_cable_loses_the_link_whatever_is_done_next(cable: Cable) -> None:
    robot = Robot(cable.end)
    with connected(open_port(cable.name, BAUD)) as khepera:
        khepera.handshake()
        robot.off()
        cable.pull()
        with pytest.raises(LinkLost, match=f"{cable.name} is gone"):
            khepera.proximity()
        with pytest.raises(LinkLost, match=f"{cable.name} is gone"):
            khepera.stop()


def test_pulling_the_cable_during_a_request_loses_the_link(cable: Cable) -> None:
    class Pulled(Robot):
        def _answer(self, line: bytes) -> bytes:
            if line == b"N":
                cable.pull()
                raise SwitchedOff
            return super()._answer(line)

    robot = Pulled(cable.end)
    with connected(open_port(cable.name, BAUD)) as khepera:
        khepera.handshake()
        with pytest.raises(LinkLost):
            khepera.proximity()
    robot.off()


def test_a_peer_that_stops_reading_loses_the_link(cable: Cable) -> None:
    def talk(link: Link) -> None:
        for _ in range(100_000):
            link.send_unanswered("D", 0, 0)

    with connected(open_port(cable.name, BAUD)) as khepera, pytest.raises(LinkLost):
        talk(khepera.link)


# Opening


def test_a_port_is_opened_as_the_manual_says(cable: Cable) -> None:
    port = open_port(cable.name, 19200)
    assert isinstance(port, serial.Serial)
    with port:
        assert (port.baudrate, port.bytesize, port.parity, port.stopbits) == (19200, 8, "N", 2)
        assert not port.xonxoff
        assert not port.rtscts
        assert port.exclusive
        assert port.write_timeout is not None


def test_a_port_in_use_is_told(cable: Cable) -> None:
    first = open_port(cable.name, BAUD)
    with pytest.raises(PortError, match="is in use by another program"):
        open_port(cable.name, BAUD)
    first.close()
    open_port(cable.name, BAUD).close()


def test_a_port_that_is_not_there_is_told_with_those_that_are(monkeypatch: pytest.MonkeyPatch) -> None:
    class Seen:
        device = "/dev/ttyUSB7"

    monkeypatch.setattr("serial.tools.list_ports.comports", lambda: [Seen()])
    with pytest.raises(PortError, match=r"there is no port '/dev/nowhere'; this computer has /dev/ttyUSB7"):
        open_port("/dev/nowhere", BAUD)
    monkeypatch.setattr("serial.tools.list_ports.comports", list)
    with pytest.raises(PortError, match="is the adapter plugged in"):
        open_port("/dev/nowhere", BAUD)


@pytest.mark.parametrize(
    ("url", "sentence"),
    [
        ("nonsense://x", "is no kind of port"),
        ("/dev/null", "is no serial port"),
        ("/tmp", "is no serial port"),
        ("socket://127.0.0.1", "cannot be opened, check its name"),
        ("hwgrep://no such thing", "cannot be opened, check its name"),
        ("", "there is no port ''"),
    ],
)
def test_what_is_no_port_is_told(url: str, sentence: str) -> None:
    with pytest.raises(PortError, match=sentence):
        open_port(url, BAUD)


def test_an_address_where_nobody_listens_is_told() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        number = server.getsockname()[1]
    with pytest.raises(PortError, match="nobody listens at"):
        open_port(f"socket://127.0.0.1:{number}", BAUD)


@pytest.mark.parametrize("baud", [-3, 2**40])
def test_a_rate_that_cannot_be_is_told(cable: Cable, baud: int) -> None:
    with pytest.raises(PortError, match=f"cannot be set to {baud} baud: use one of 9600, 19200"):
        open_port(cable.name, baud)


@pytest.mark.skipif(os.geteuid() == 0, reason="nothing is forbidden to root")
def test_a_port_that_is_forbidden_is_told(tmp_path: Path) -> None:
    forbidden = tmp_path / "tty"
    forbidden.touch(mode=0)
    with pytest.raises(PortError, match="dialout"):
        open_port(str(forbidden), BAUD)


def test_a_kind_of_port_without_deadlines_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise NotImplementedError("write_timeout is currently not supported")

    monkeypatch.setattr(serial, "serial_for_url", refuse)
    with pytest.raises(PortError, match="without deadlines"):
        open_port("rfc2217://host:1", BAUD)


@pytest.mark.parametrize(
    ("number", "sentence"),
    [(13, "may not be opened by you: join its group, mostly dialout"), (16, "in use"), (5, "no device behind it")],
)
def test_the_systems_own_words_become_a_sentence(
    monkeypatch: pytest.MonkeyPatch, number: int, sentence: str
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise serial.SerialException(number, os.strerror(number))

    monkeypatch.setattr(serial, "serial_for_url", refuse)
    with pytest.raises(PortError, match=sentence):
        open_port("/dev/ttyUSB0", BAUD)
