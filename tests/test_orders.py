"""Orders over a real socket: who may send them, from how deep a folder, and what becomes of what is none."""

from __future__ import annotations

import json
import os
import socket
import stat
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from khepera_hil.commands import order
from khepera_hil.errors import OrderRefused
from khepera_hil.orders import CLIENTS, PATIENCE, SOCKET, Order, OrderSocket, deliver, ordered

LONG = 30.0


class Service:
    """Takes orders as the loop does, and obeys those it knows."""

    def __init__(self, folder: Path) -> None:
        self.now = 0.0
        self.folder = folder
        self.orders = OrderSocket(folder, lambda: self.now)
        self.taken: list[str] = []

    def tick(self) -> list[Order]:
        found = self.orders.take()
        for one in found:
            self.taken.append(one.words)
            if one.words == "stop":
                one.obeyed("it ends")
            else:
                one.refused(f"no order {one.words}")
        return found

    def connect(self) -> socket.socket:
        client = socket.socket(socket.AF_UNIX)
        client.settimeout(LONG)
        folder = os.open(self.folder, os.O_RDONLY)
        client.connect(f"/proc/self/fd/{folder}/{SOCKET}")
        os.close(folder)
        return client

    def until(self, done: Callable[[], bool]) -> None:
        end = time.monotonic() + LONG
        while not done():
            assert time.monotonic() < end
            self.tick()
            time.sleep(0.001)


@pytest.fixture
def service(tmp_path: Path) -> Iterator[Service]:
    service = Service(tmp_path)
    yield service
    service.orders.close()


def delivered(service: Service, words: str) -> str | OrderRefused:
    """What a client of ours is told."""
    said: list[str | OrderRefused] = []

    def client() -> None:
        try:
            said.append(deliver(service.folder, words, LONG))
        except OrderRefused as error:
            said.append(error)

    thread = threading.Thread(target=client)
    thread.start()
    service.until(lambda: bool(said))
    thread.join(LONG)
    return said[0]


def answer(client: socket.socket) -> dict[str, str]:
    """What anybody's client is told, to the end."""
    text = b""
    while chunk := client.recv(4096):
        text += chunk
    client.close()
    found = json.loads(text)
    assert isinstance(found, dict)
    return found


def test_an_order_is_given_and_what_comes_of_it_told(service: Service) -> None:
    assert delivered(service, "stop") == "it ends"
    assert service.taken == ["stop"]


def test_one_that_is_refused_says_why(service: Service) -> None:
    said = delivered(service, "vigil on")
    assert isinstance(said, OrderRefused)
    assert str(said) == "no order vigil on"


def test_only_the_owner_may_connect(service: Service) -> None:
    mode = (service.folder / SOCKET).stat().st_mode
    assert stat.S_ISSOCK(mode)
    assert stat.S_IMODE(mode) == 0o600


def test_however_long_the_folders_path_is(tmp_path: Path) -> None:
    deep = tmp_path.joinpath(*["a long way down to the runs"] * 20)
    deep.mkdir(parents=True)
    assert len(str(deep)) > 500
    here = Path.cwd()
    service = Service(deep)
    assert delivered(service, "stop") == "it ends"
    service.orders.close()
    assert not (deep / SOCKET).exists()
    assert Path.cwd() == here


@pytest.mark.parametrize(
    ("message", "word"),
    [
        (b"stop\n", "JSON"),
        (b"\n", "JSON"),
        (b"\xff\xfe\n", "JSON"),
        (b"[" * 900 + b"\n", "JSON"),
        (b'"stop"\n', "order"),
        (b'["stop"]\n', "order"),
        (b'{"order": 3}\n', "order"),
        (b'{"order": null}\n', "order"),
        (b'{"order": ["stop"]}\n', "order"),
        (b'{"order": "stop", "and": "more"}\n', "order"),
        (b'{"order": ""}\n', "no order"),
        (b'{"order": "Stop!"}\n', "no order"),
        (b'{"order": "stop\\u0000"}\n', "no order"),
        (b'{"order": "a b c d e f g h i j"}\n', "no order"),
        (b'{"order": "' + b"x" * 2000 + b'"}\n', "1024 bytes"),
        (b"x" * 100_000, "1024 bytes"),
    ],
)
def test_what_is_no_order_gets_an_error_and_changes_nothing(service: Service, message: bytes, word: str) -> None:
    client = service.connect()
    client.sendall(message)
    for _ in range(3):
        service.tick()
    assert word in answer(client)["error"]
    assert service.taken == []
    assert delivered(service, "stop") == "it ends", "and it takes the next"


@given(st.binary(max_size=200))
def test_no_bytes_whatever_do_any_harm(data: bytes) -> None:
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        service = Service(Path(folder))
        client = service.connect()
        client.sendall(data + b"\n")
        service.tick()
        said = answer(client)
        assert set(said) in ({"error"}, {"ok"})
        assert len(service.taken) <= 1
        service.orders.close()


def test_half_a_message_is_waited_for_but_not_for_ever(service: Service) -> None:
    client = service.connect()
    client.sendall(b'{"order": ')
    service.tick()
    client.sendall(b'"stop"}')
    service.tick()
    assert service.taken == []
    service.now += PATIENCE
    service.tick()
    assert "no whole line" in answer(client)["error"]
    assert service.taken == []


def test_a_message_may_come_in_pieces(service: Service) -> None:
    client = service.connect()
    for byte in b'{"order": "stop"}\n':
        client.sendall(bytes([byte]))
        service.tick()
    assert answer(client) == {"ok": "it ends"}


def test_one_that_hangs_up_early_is_forgotten(service: Service) -> None:
    client = service.connect()
    client.sendall(b'{"order": "stop"}')
    client.shutdown(socket.SHUT_WR)
    service.tick()
    service.tick()
    assert "ended before" in answer(client)["error"]
    service.connect().close()
    service.tick()
    assert service.taken == []


def test_many_clients_that_say_nothing_keep_others_waiting_but_not_out(service: Service) -> None:
    before = len(os.listdir("/proc/self/fd"))
    dumb = [service.connect() for _ in range(CLIENTS)]
    service.tick()
    assert len(os.listdir("/proc/self/fd")) <= before + 2 * CLIENTS
    late = service.connect()
    late.sendall(b'{"order": "stop"}\n')
    service.tick()
    assert service.taken == []
    service.now += PATIENCE
    service.tick()
    service.tick()
    assert service.taken == ["stop"]
    assert answer(late) == {"ok": "it ends"}
    for client in dumb:
        client.close()


def test_a_client_that_reads_nothing_holds_nobody_up(service: Service) -> None:
    for _ in range(50):
        client = service.connect()
        client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1)
        client.sendall(b'{"order": "vigil on"}\n')
        service.until(lambda: bool(service.taken))
        service.taken.clear()
        client.close()


def test_who_comes_when_the_run_ends_is_told(service: Service) -> None:
    client = service.connect()
    service.tick()
    service.orders.close()
    assert answer(client) == {"error": "the run has ended"}
    with pytest.raises(FileNotFoundError):
        deliver(service.folder, "stop")


def test_a_run_that_hangs_is_given_up(service: Service) -> None:
    with pytest.raises(OrderRefused, match="does not answer within"):
        deliver(service.folder, "stop", 0.05)


def test_a_socket_that_was_left_behind_refuses(service: Service) -> None:
    service.orders._listener.close()
    with pytest.raises(ConnectionRefusedError):
        deliver(service.folder, "stop")


@pytest.mark.parametrize(("text", "words"), [("stop", "stop"), ("  vigil   on ", "vigil on")])
def test_words_are_told_apart_by_spaces(text: str, words: str) -> None:
    assert ordered(text) == words


@given(st.text(max_size=60))
def test_an_order_is_plain_words_or_none(text: str) -> None:
    try:
        words = ordered(text)
    except OrderRefused:
        return
    assert words == words.lower()
    assert words.isascii()
    assert words.split() == text.split()


def test_the_newest_run_that_is_there_gets_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("older", "newer", "killed", "without"):
        (tmp_path / name).mkdir()
    older = Service(tmp_path / "older")
    time.sleep(0.02)  # so that the clock of the files tells them apart
    newer = Service(tmp_path / "newer")
    time.sleep(0.02)
    killed = Service(tmp_path / "killed")
    killed.orders._listener.close()
    done = threading.Event()

    def tick() -> None:
        while not done.is_set():
            older.tick()
            newer.tick()
            time.sleep(0.001)

    loop = threading.Thread(target=tick)
    loop.start()
    try:
        assert order.main(["--runs", str(tmp_path), "stop"]) == 0
        assert capsys.readouterr().out == "newer: it ends\n"
        with pytest.raises(OrderRefused, match="no order vigil on"):
            order.main(["--runs", str(tmp_path), "vigil", "on"])
        assert order.main(["--run", str(tmp_path / "older"), "stop"]) == 0
        with pytest.raises(OrderRefused, match="takes no orders"):
            order.main(["--run", str(tmp_path / "killed"), "stop"])
    finally:
        done.set()
        loop.join(LONG)
        older.orders.close()
        newer.orders.close()
    assert (older.taken, newer.taken) == (["stop"], ["stop", "vigil on"])
    with pytest.raises(OrderRefused, match="no run in"):
        order.main(["--runs", str(tmp_path), "stop"])
