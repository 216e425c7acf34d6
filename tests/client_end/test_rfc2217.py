"""A robot behind an RFC 2217 port server: pyserial's own, in front of a pseudo-terminal."""

from __future__ import annotations

import contextlib
import os
import select
import socket
import threading
from collections.abc import Iterator

import pytest
import serial
from serial import rfc2217

from khepera_hil.errors import LinkLost, NoAnswer, PortError
from khepera_hil.opening import WRITE_TIMEOUT, close_port, open_port
from tests.client_end.robots import BAUD, Cable, Robot, connected

# pyserial 3.5 starts its reader thread in an old way; by default Python does not show that.
pytestmark = pytest.mark.filterwarnings("ignore:set(Daemon|Name):DeprecationWarning")


class Terminal(serial.Serial):
    """A pseudo-terminal as the server's line: it has none of the wires that a server switches and reports."""

    cts = dsr = ri = cd = False

    def _update_rts_state(self) -> None:
        pass

    def _update_dtr_state(self) -> None:
        pass


class SlowTerminal(Terminal):
    """A line that knows one rate."""

    def _reconfigure_port(self, force_update: bool = False) -> None:
        if self.baudrate != 9600:
            raise ValueError("9600 only")
        super()._reconfigure_port(force_update)  # type: ignore[misc]  # not in the stubs


class Manager(rfc2217.PortManager):
    """Counts what is negotiated. ``silent`` ones do not confirm the state of control wires."""

    silent = False
    negotiations = 0

    def _telnet_process_subnegotiation(self, suboption: bytes) -> None:
        self.negotiations += 1
        super()._telnet_process_subnegotiation(suboption)  # type: ignore[misc]  # not in the stubs

    def rfc2217_send_subnegotiation(self, option: bytes, value: bytes = b"") -> None:
        if not (self.silent and option == rfc2217.SERVER_SET_CONTROL):
            super().rfc2217_send_subnegotiation(option, value)


class Connection:
    """What pyserial's manager writes to."""

    def __init__(self, peer: socket.socket) -> None:
        self.write = peer.sendall


class PortServer:
    """Serves one client after the other on 127.0.0.1, in a thread, until it dies or freezes."""

    def __init__(self, line: serial.Serial, *, silent: bool = False) -> None:
        self.line = line
        self.manager: Manager | None = None
        self._silent = silent
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._peer: socket.socket | None = None
        self._woken, self._wake = os.pipe()
        self._thread = threading.Thread(target=self._serve)
        self.url = f"rfc2217://127.0.0.1:{self._listener.getsockname()[1]}"
        self._thread.start()

    def _serve(self) -> None:
        while self._ready(self._listener):
            self._peer, _ = self._listener.accept()
            with contextlib.suppress(ConnectionError):  # a client that breaks off
                if not self._serve_one(self._peer):
                    return
            self._peer.close()

    def _ready(self, *ends: socket.socket | int) -> list[socket.socket | int]:
        """What of these can be read; nothing once the server shall end."""
        ready, _, _ = select.select([*ends, self._woken], [], [])
        return [] if self._woken in ready else ready

    def _serve_one(self, peer: socket.socket) -> bool:
        """Whether it was the client that ended it."""
        manager = Manager(self.line, Connection(peer))  # type: ignore[arg-type]  # it needs no more than write
        manager.silent = self._silent
        self.manager = manager
        while ready := self._ready(peer, self.line.fileno()):
            if peer in ready:
                data = peer.recv(1024)
                if not data:
                    return True
                self.line.write(b"".join(manager.filter(data)))
            else:
                peer.sendall(b"".join(manager.escape(self.line.read(self.line.in_waiting))))
        return False

    def freeze(self) -> None:
        """Read and say no more, and leave the connection open."""
        os.write(self._wake, b".")
        self._thread.join(10)
        assert not self._thread.is_alive()

    def die(self) -> None:
        if self._thread.is_alive():
            self.freeze()
        if self._peer is not None:
            self._peer.close()
        self._listener.close()

    def clear_away(self) -> None:
        self.die()
        self.line.close()
        os.close(self._woken)
        os.close(self._wake)


@contextlib.contextmanager
def serving(line: serial.Serial, *, silent: bool = False) -> Iterator[PortServer]:
    server = PortServer(line, silent=silent)
    try:
        yield server
    finally:
        server.clear_away()


def test_a_robot_behind_a_port_server_is_found_read_and_driven(cable: Cable) -> None:
    robot = Robot(cable.end)
    try:
        with serving(Terminal(cable.name)) as server, connected(open_port(server.url, BAUD)) as khepera:
            line = server.line
            assert (line.baudrate, line.bytesize, line.parity, line.stopbits) == (BAUD, 8, "N", 2)
            assert not line.xonxoff
            assert not line.rtscts
            assert server.manager is not None
            negotiated = server.manager.negotiations
            assert negotiated > 0
            assert khepera.handshake() == ("5.01", "5.00")
            for _ in range(50):
                assert khepera.proximity() == (1, 2, 3, 4, 5, 6, 7, 1023)
                assert khepera.set_speed(3.2, -200) == (3, -127)
            assert khepera.stop()
            assert khepera.link.counters.accepted == 102
            # A read's deadline is the client's affair: the server hears of none of them.
            assert server.manager.negotiations == negotiated
    finally:
        robot.off()
    assert robot.heard.endswith(b"D,0,0\n")


def test_a_port_server_that_dies_loses_the_link(cable: Cable) -> None:
    robot = Robot(cable.end)
    try:
        with serving(Terminal(cable.name)) as server, connected(open_port(server.url, BAUD)) as khepera:
            khepera.handshake()
            server.die()
            # pyserial tells the end of the stream once as silence, and from then on as an error.
            with pytest.raises(LinkLost, match=f"{server.url} is gone"):  # noqa: PT012
                for _ in range(3):
                    with contextlib.suppress(NoAnswer):
                        khepera.proximity()
            with pytest.raises(LinkLost, match=f"{server.url} is gone"):
                khepera.stop()
    finally:
        robot.off()


def test_a_port_server_that_stops_reading_does_not_hold_the_client(cable: Cable) -> None:
    with serving(Terminal(cable.name)) as server:
        port = open_port(server.url, BAUD)
        assert vars(port)["_socket"].gettimeout() == WRITE_TIMEOUT
        server.freeze()
        with pytest.raises(OSError, match="timed out"):  # noqa: PT012 - how much the sockets hold is the host's choice
            for _ in range(10_000):
                port.write(bytes(1 << 16))
        close_port(port)


def test_what_has_come_is_read_whole_also_when_no_time_is_left(cable: Cable) -> None:
    with serving(Terminal(cable.name)) as server:
        port = open_port(server.url, BAUD)
        os.write(cable.end, b"n,1,2\r\n")
        port.timeout = 10.0
        first = port.read(1)
        rest = port.read(6)
        assert first + rest == b"n,1,2\r\n"
        os.write(cable.end, b"n,1,2\r\n")
        port.timeout = None
        first = port.read(1)
        while port.in_waiting < 6:  # they are on their way
            pass
        port.timeout = 0
        assert first + port.read(6) == b"n,1,2\r\n"
        assert port.read(1) == b""
        close_port(port)


def test_a_port_server_that_cannot_set_the_rate_is_told(cable: Cable) -> None:
    with (
        serving(SlowTerminal(cable.name, 9600)) as server,
        pytest.raises(PortError, match=r"cannot set its line to 38400 baud.*option 'baudrate'"),
    ):
        open_port(server.url, BAUD)


def test_a_port_server_that_leaves_a_setting_unconfirmed_is_told_and_the_advice_helps(cable: Cable) -> None:
    with serving(Terminal(cable.name), silent=True) as server:
        with pytest.raises(PortError, match=r"unconfirmed: try \?ign_set_control behind it"):
            open_port(server.url, BAUD)
        close_port(open_port(server.url + "?ign_set_control", BAUD))


def test_a_server_of_another_kind_is_told() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        url = f"rfc2217://127.0.0.1:{server.getsockname()[1]}?timeout=0.1"
        with pytest.raises(PortError, match="no port server of RFC 2217: try socket://HOST:PORT"):
            open_port(url, BAUD)
