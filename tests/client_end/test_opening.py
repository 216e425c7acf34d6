"""Opening a port: as the manual says, and with one sentence for everything that can be wrong."""

from __future__ import annotations

import os
import socket
from pathlib import Path

import pytest
import serial
from serial.tools.list_ports_common import ListPortInfo

from khepera_hil.errors import BadAnswer, PortError
from khepera_hil.opening import close_port, open_port
from tests.client_end.robots import BAUD, Cable, Robot, connected


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
        ("", "there is no port ''"),
        ("socket://127.0.0.1", "write it as socket://HOST:PORT$"),
        ("socket://127.0.0.1:99999", "write it as socket://HOST:PORT$"),
        ("socket://127.0.0.1:1?colour", "write it as socket://HOST:PORT$"),
        ("rfc2217://127.0.0.1", "write it as rfc2217://HOST:PORT$"),
        ("rfc2217://127.0.0.1:x", "write it as rfc2217://HOST:PORT "),
        ("rfc2217://127.0.0.1:1?logging=x", "write it as rfc2217://HOST:PORT$"),
        ("loop://?colour", "write it as loop://$"),
        ("spy:///dev/nowhere", "there is no port 'spy:///dev/nowhere'"),
        ("spy:///dev/nowhere?colour", "write it as spy://DEVICE.*unknown option: 'colour'"),
        ("spy:///dev/nowhere?file=/no/such/folder", "the file of .* cannot be written: No such file"),
        ("hwgrep://no such thing", "no port matches 'hwgrep://no such thing'; this computer"),
        ("hwgrep://[", "write it as hwgrep://PATTERN .unterminated"),
        ("hwgrep://x&n", "write it as hwgrep://PATTERN$"),
        ("hwgrep://x&colour", "write it as hwgrep://PATTERN .unknown option: 'colour'"),
        ("alt:///dev/nowhere?class=None", "check its name: unknown class"),
    ],
)
def test_what_is_no_port_is_told(url: str, sentence: str) -> None:
    with pytest.raises(PortError, match=sentence):
        open_port(url, BAUD)


def test_a_name_that_the_system_cannot_hold_is_told() -> None:
    with pytest.raises(PortError):
        open_port("\0", BAUD)


@pytest.mark.parametrize("kind", ["socket", "rfc2217"])
def test_a_machine_that_is_switched_off_is_told(monkeypatch: pytest.MonkeyPatch, kind: str) -> None:
    def wait_in_vain(*_: object, **__: object) -> None:
        raise TimeoutError("timed out")

    monkeypatch.setattr(socket, "create_connection", wait_in_vain)
    with pytest.raises(PortError, match=f"nobody answers at '{kind}://host:1'"):
        open_port(f"{kind}://host:1", BAUD)


@pytest.mark.parametrize("kind", ["socket", "rfc2217"])
def test_an_address_where_nobody_listens_is_told(kind: str) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        number = server.getsockname()[1]
    with pytest.raises(PortError, match="nobody listens at"):
        open_port(f"{kind}://127.0.0.1:{number}", BAUD)


@pytest.mark.parametrize("baud", [-3, 2**40])
def test_a_rate_that_cannot_be_is_told(cable: Cable, baud: int) -> None:
    with pytest.raises(PortError, match=f"cannot be set to {baud} baud: choose another rate"):
        open_port(cable.name, baud)


@pytest.mark.skipif(os.geteuid() == 0, reason="nothing is forbidden to root")
def test_a_port_that_is_forbidden_is_told(tmp_path: Path) -> None:
    forbidden = tmp_path / "tty"
    forbidden.touch(mode=0)
    with pytest.raises(PortError, match="dialout"):
        open_port(str(forbidden), BAUD)


@pytest.mark.parametrize(
    ("number", "sentence"),
    [(13, "may not be opened by you: join its group, mostly dialout"), (16, "in use"), (5, "no device behind it")],
)
def test_the_systems_own_words_become_a_sentence(
    monkeypatch: pytest.MonkeyPatch, number: int, sentence: str
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise serial.SerialException(number, os.strerror(number))

    monkeypatch.setattr(serial.Serial, "open", refuse)
    with pytest.raises(PortError, match=sentence):
        open_port("/dev/ttyUSB0", BAUD)


# The other kinds of ports


def test_a_robot_is_spied_on(cable: Cable, tmp_path: Path) -> None:
    robot = Robot(cable.end)
    log = tmp_path / "spied"
    port = open_port(f"spy://{cable.name}?file={log}", BAUD)
    try:
        with connected(port) as khepera:
            assert khepera.handshake() == ("5.01", "5.00")
            assert khepera.proximity() == (1, 2, 3, 4, 5, 6, 7, 1023)
            assert khepera.link.name == cable.name
    finally:
        robot.off()
        port.formatter.output.close()  # type: ignore[attr-defined]  # pyserial leaves the file to its end
    lines = log.read_text().splitlines()

    def bytes_that_went(way: str) -> bytes:  # columns: time, way, offset, bytes, characters
        return bytes.fromhex("".join(line[22:71] for line in lines if line[11:13] == way))

    assert bytes_that_went("TX").endswith(b"N\n")
    assert bytes_that_went("RX").endswith(b"n,1,2,3,4,5,6,7,1023\r\n")


def test_a_spy_that_would_fail_at_each_write_is_not_opened(cable: Cable) -> None:
    with pytest.raises(PortError, match="leave out the option raw"):
        open_port(f"spy://{cable.name}?raw", BAUD)
    close_port(open_port(cable.name, BAUD))  # nothing holds it


def test_a_robot_is_found_by_what_its_adapter_is_called(cable: Cable, monkeypatch: pytest.MonkeyPatch) -> None:
    adapter = ListPortInfo(cable.name, skip_link_detection=True)
    adapter.description = "the robot's adapter"
    monkeypatch.setattr("serial.tools.list_ports.comports", lambda include_links=False: [adapter])
    robot = Robot(cable.end)
    try:
        with connected(open_port("hwgrep://robot", BAUD)) as khepera:
            assert khepera.handshake() == ("5.01", "5.00")
            assert khepera.link.name == cable.name
    finally:
        robot.off()


def test_a_loop_of_wire_is_no_robot() -> None:
    with (
        connected(open_port("loop://", BAUD)) as khepera,
        pytest.raises(
            BadAnswer, match="what answers on loop:// at 38400 baud does not speak the Khepera's protocol"
        ),
    ):
        khepera.handshake()
