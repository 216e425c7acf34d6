"""One body of a test for every kind of client: the manual's, pyserial, our own link, third-party habits."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any, Protocol

import pytest
import serial

from khepera_hil.clock import WallClock
from khepera_hil.link import Link
from khepera_hil.opening import open_port
from tests.robot_end.serving import PATIENCE, ManualClient, served


class Client(Protocol):
    def ask(self, command: str) -> str: ...

    def settle(self) -> None: ...


class PyserialClient(ManualClient):
    """The same by pyserial, as programs in Python do it: LF, and lines by ``readline``."""

    def __init__(self, url: str) -> None:
        self._port: Any = serial.serial_for_url(url, 38400, bytesize=8, parity="N", stopbits=2, timeout=PATIENCE)

    def __exit__(self, *_: object) -> None:
        self._port.close()

    def send(self, *commands: str) -> None:
        self._port.write("".join(command + "\n" for command in commands).encode())

    def line(self) -> str:
        line: bytes = self._port.readline()
        assert line.endswith(b"\r\n")
        return line[:-2].decode("ascii")

    def settle(self) -> None:
        self.send("", "G,4711,-4711", "H")
        while self.line() != "h,4711,-4711":
            pass


class LinkClient:
    """Our own link, which refuses by itself what is no command."""

    def __init__(self, link: Link) -> None:
        self._link = link

    def ask(self, command: str) -> str:
        letter, *words = command.split(",")
        values: list[int | str] = [int(word) for word in words if letter != "T"]
        if letter == "T":
            values = [int(words[0]), ",".join(words[1:])]
        self._link.ask(letter, *values)
        return self._link.last_answer

    def settle(self) -> None:
        self._link.resynchronise()


@contextmanager
def linked(url: str) -> Iterator[Client]:
    link = Link(open_port(url, 38400), WallClock(), baud=38400, margin=2.0)  # generous: a busy machine
    try:
        yield LinkClient(link)
    finally:
        link.close()


CLIENTS: dict[str, Callable[[str], AbstractContextManager[Client]]] = {
    "manual, CR": lambda url: ManualClient(url, end=b"\r"),
    "LF, byte by byte": lambda url: ManualClient(url, end=b"\n", bytewise=True),
    "CR LF": lambda url: ManualClient(url, end=b"\r\n"),
    "pyserial": PyserialClient,
    "our link": linked,
}


def numbers(answer: str) -> list[int]:
    return [int(word) for word in answer.split(",")[1:]]


@pytest.mark.parametrize("kind", ["pty", "tcp"])
@pytest.mark.parametrize("client", CLIENTS)
def test_a_client_drives_the_robot(kind: str, client: str, tmp_path: Path) -> None:
    with (
        served(kind, tmp_path, turrets=("gripper", "k213", "genio")) as robot,
        CLIENTS[client](robot.url) as khepera,
    ):
        khepera.settle()
        ask = khepera.ask
        assert ask("B") == "b,5.01,5.00"
        # Sensors
        for letter, most in (("N", 1023), ("O", 511)):
            answer = ask(letter)
            assert answer.startswith(letter.lower() + ",")
            assert len(numbers(answer)) == 8
            assert all(0 <= value <= most for value in numbers(answer))
        # Speed and counters
        assert ask("G,0,0") == "g"
        assert ask("D,10,-10") == "d"
        _wait(lambda: numbers(ask("E")) == [10, -10])
        assert numbers(ask("K"))[1::3] == [0, 0]
        left, right = numbers(ask("H"))
        assert left > 0 > right
        assert ask("D,0,0") == "d"
        _wait(lambda: numbers(ask("E")) == [0, 0])
        # A position
        assert ask("J,40,128,40,128") == "j"
        assert ask("G,100,100") == "g"
        assert ask("C,400,-50") == "c"
        assert numbers(ask("K"))[1::3] == [1, 1]
        _wait(lambda: numbers(ask("K"))[0::3] == [1, 1])
        assert all(abs(got - wanted) <= 1 for got, wanted in zip(numbers(ask("H")), (400, -50), strict=True))
        # PWM
        assert ask("P,40,40") == "p"
        assert numbers(ask("K"))[1::3] == [2, 2]
        _wait(lambda: numbers(ask("E")) == [20, 20])
        assert ask("D,0,0") == "d"
        # Gains, LEDs, inputs, the bus, turrets
        for order in ("A,3800,800,100", "F,3000,20,4000", "L,0,1", "L,1,2", "W,1,32"):
            assert ask(order) == order[0].lower()
        assert ask("R,32") == "r,1"
        assert ask("W,0,32") == "w"
        assert 0 < numbers(ask("I,3"))[0] < 1023
        assert ask("T,2,B") == "t,2,b,1,2"
        assert ask("T,2,U,2") == "t,2,u"
        assert ask("T,2,N").startswith("t,2,n,")
        assert ask("T,1,E,200") == "t,1,e"
        assert ask("T,1,H,1") == "t,1,h,200"


def _wait(happens: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE
    while not happens():
        assert time.monotonic() < deadline


@pytest.mark.parametrize("kind", ["pty", "tcp"])
def test_commands_sent_ahead_are_answered_in_their_order(kind: str, tmp_path: Path) -> None:
    with served(kind, tmp_path) as robot, ManualClient(robot.url, end=b"\r\n") as khepera:
        khepera.settle()
        khepera.send("G,1,2", "H", "  B\t", "", "huh", "D,1", "L,7,1", "T,1,B", "D,0,0", "G,3,4", "H")
        expected = [
            "g",
            "h,1,2",
            "b,5.01,5.00",
            "Command not found",
            "z,Protocol error",
            "z,This LED does not exist.",
        ]
        expected += ["z,Turret order not supported", "d", "g", "h,3,4"]
        assert [khepera.line() for _ in expected] == expected
