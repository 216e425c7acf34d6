"""Real pyserial on real pseudo-terminals and sockets, with a small robot in a thread behind them."""

from __future__ import annotations

import socket

import pytest

from khepera_hil.errors import LinkLost, NoAnswer
from khepera_hil.link import Link
from khepera_hil.opening import open_port
from tests.client_end.robots import BAUD, Cable, Robot, SwitchedOff, connected


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
