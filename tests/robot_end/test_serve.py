"""The pseudo-terminal, with pyserial at its other end."""

import os
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import pytest
import serial

from khepera_hil.errors import PortError
from khepera_hil.serve import serve_pty
from khepera_hil.world import World


@contextmanager
def served(link: Path, baud: int = 38400) -> Iterator[SimpleQueue[Any]]:
    """A server in a thread; its score comes out of the queue when it has ended."""
    ready, score = SimpleQueue[str](), SimpleQueue[Any]()
    stop, ender = os.pipe()
    world = World("empty")

    def run() -> None:
        score.put(serve_pty(link, world, baud=baud, stop=stop, on_ready=ready.put))

    thread = threading.Thread(target=run)
    thread.start()
    try:
        assert ready.get(timeout=20).startswith("/dev/")
        yield score
    finally:
        os.write(ender, b"x")
        thread.join(timeout=20)
        os.close(stop)
        os.close(ender)
        assert not thread.is_alive()


def ask(port: serial.Serial, request: bytes) -> bytes:
    """Resynchronise, then ask: the boot text may still be under way."""
    port.write(b"\n" + request)
    return port.read_until(request[:1].lower() + b",5.01,5.00\r\n")


def test_clients_come_and_go_and_the_end_is_clean(tmp_path: Path) -> None:
    link = tmp_path / "khepera"
    with served(link) as score:
        assert link.is_symlink()
        for _ in range(3):
            with serial.Serial(str(link), 38400, timeout=5, stopbits=2) as port:
                assert ask(port, b"B\n").endswith(b"b,5.01,5.00\r\n")
    assert not link.is_symlink()
    assert score.get(timeout=5)["distance_m"] == 0


def test_a_wrong_rate_garbles_and_the_right_one_mends(tmp_path: Path) -> None:
    link = tmp_path / "khepera"
    with served(link, 9600):
        with serial.Serial(str(link), 38400, timeout=0.3) as port:
            assert b"b,5" not in ask(port, b"B\n")
        with serial.Serial(str(link), 9600, timeout=5) as port:
            assert ask(port, b"B\n").endswith(b"b,5.01,5.00\r\n")


def test_nothing_is_echoed_before_the_first_client_sets_its_terminal(tmp_path: Path) -> None:
    link = tmp_path / "khepera"
    with served(link):
        plain = os.open(link, os.O_RDWR | os.O_NOCTTY)
        try:
            os.write(plain, b"B\n")
            seen = b""
            while not seen.endswith(b"b,5.01,5.00\r\n"):
                seen += os.read(plain, 100)
            assert seen.startswith(b"ROM of minirobot")
            assert b"B\n" not in seen
        finally:
            os.close(plain)


def test_a_client_that_never_reads_does_not_stop_the_robot(tmp_path: Path) -> None:
    link = tmp_path / "khepera"
    with served(link, 115200) as score, serial.Serial(str(link), 115200, timeout=5, write_timeout=20) as port:
        port.write(b"D,5,5\n")
        # 20 kB of answers: more than the kernel keeps for a client that does not fetch them.
        port.write(b"N\n" * 1200)
        world_moves = time.monotonic() + 0.5
        while time.monotonic() < world_moves:
            time.sleep(0.05)
    assert score.get(timeout=5)["distance_m"] > 0


def test_a_link_that_somebody_needs_is_refused_and_a_dead_one_replaced(tmp_path: Path) -> None:
    plain = tmp_path / "file"
    plain.write_text("mine")
    dead = tmp_path / "dead"
    dead.symlink_to("/dev/pts/99999")
    with served(dead):
        assert dead.exists()
        for link, complaint in ((plain, "is there already"), (dead, "which is alive")):
            with pytest.raises(PortError, match=complaint + "; choose another name"):
                serve_pty(link, World("empty"), baud=38400, stop=0)
        with pytest.raises(PortError, match="cannot be made: No such file or directory"):
            serve_pty(tmp_path / "no" / "where", World("empty"), baud=38400, stop=0)
    assert plain.read_text() == "mine"
