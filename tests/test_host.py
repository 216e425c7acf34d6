"""What the service has to do with the machine that it runs on: its manager, its scheduler, the garbage."""

from __future__ import annotations

import gc
import os
import socket
import subprocess
import sys
import weakref
from collections.abc import Iterator
from pathlib import Path

import pytest

from khepera_hil.realtime import Collector
from khepera_hil.systemd import Manager
from tests.runs.cli import environment


@pytest.fixture(params=["path", "abstract"])
def manager(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[tuple[str, socket.socket]]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as ours:
        name = str(tmp_path / "notify") if request.param == "path" else f"@khepera-hil-test-{os.getpid()}"
        ours.bind("\0" + name[1:] if name[0] == "@" else name)
        ours.settimeout(10)
        yield name, ours


def test_the_manager_is_told_what_it_asked_for(manager: tuple[str, socket.socket]) -> None:
    name, ours = manager
    told = Manager({"NOTIFY_SOCKET": name})
    told.ready("home\non /dev/ttyS0")
    told.alive()
    told.status("degraded")
    told.stopping()
    told.close()
    told.alive()  # to nobody
    assert [ours.recv(500) for _ in range(4)] == [
        b"READY=1\nSTATUS=home on /dev/ttyS0",
        b"WATCHDOG=1",
        b"STATUS=degraded",
        b"STOPPING=1",
    ]


@pytest.mark.parametrize("name", ["", "relative", "/no/such/socket", "@" + "x" * 200, "/" + "x" * 200])
def test_where_nobody_wants_to_hear_nothing_is_said(name: str) -> None:
    told = Manager({"NOTIFY_SOCKET": name} if name else {})
    told.ready("well")
    told.alive()
    told.close()


def test_a_manager_that_does_not_listen_holds_nobody_up(manager: tuple[str, socket.socket]) -> None:
    told = Manager({"NOTIFY_SOCKET": manager[0]})
    for _ in range(10_000):
        told.alive()
    told.close()


class Ring:
    """Only the collector can free it."""

    def __init__(self) -> None:
        self.me = self


@pytest.fixture
def collector() -> Iterator[Collector]:
    collector = Collector(now=lambda: 0.0)
    collector.begin()
    yield collector
    collector.end()


def test_during_a_run_nothing_is_collected_but_between_ticks(collector: Collector) -> None:
    assert not gc.isenabled()
    ring = weakref.ref(Ring())
    garbage = [Ring() for _ in range(5000)]
    del garbage
    assert ring() is not None
    for _ in range(Collector.YOUNG):
        collector.idle(0.05)
    assert ring() is None


def test_after_a_run_all_is_as_before() -> None:
    collector = Collector()
    collector.begin()
    collector.end()
    assert gc.isenabled()
    assert gc.get_freeze_count() == 0


def test_what_has_grown_old_is_collected_too(collector: Collector) -> None:
    old = Ring()
    ring = weakref.ref(old)
    for _ in range(3 * Collector.YOUNG):
        collector.idle(0.05)  # it lives through these, and is young no more
    del old
    for _ in range(Collector.ALL):
        collector.idle(0.05)
    assert ring() is None


def test_without_time_to_spare_it_waits_but_not_for_ever() -> None:
    moments = iter(range(10**6))
    collector = Collector(now=lambda: float(next(moments)))  # each collection takes a second
    collector.begin()
    try:
        for _ in range(Collector.YOUNG):
            collector.idle(0.05)
        ring = weakref.ref(Ring())
        for _ in range(Collector.YOUNG):
            collector.idle(0.05)
            if _ < Collector.YOUNG - 1:
                assert ring() is not None or _ == 0
        for _ in range(Collector.YOUNG):
            collector.idle(0.05)
        assert ring() is None
    finally:
        collector.end()


REALTIME = """
import os, resource, sys, threading
from khepera_hil.realtime import ask_for_realtime
if sys.argv[1] == "nobody":
    resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))
    resource.setrlimit(resource.RLIMIT_MEMLOCK, (65536, 65536))
    os.setuid(65534)
for line in ask_for_realtime():
    print(line)
print(os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK == os.SCHED_FIFO)
of = []
thread = threading.Thread(target=lambda: of.append(os.sched_getscheduler(0)))
thread.start()
thread.join()
print(of[0] == os.SCHED_OTHER)
"""


def asked(who: str) -> list[str]:
    done = subprocess.run(
        [sys.executable, "-c", REALTIME, who], env=environment(), capture_output=True, text=True, check=True
    )
    return done.stdout.splitlines()


@pytest.mark.skipif(os.getuid() != 0, reason="only root can become nobody")
def test_what_is_refused_is_said_in_a_line_each_and_nothing_worse() -> None:
    scheduler, memory, realtime, ordinary = asked("nobody")
    assert "SCHED_FIFO was refused" in scheduler
    assert "memory could not be locked" in memory
    assert [realtime, ordinary] == ["False", "True"]


def test_what_is_granted_holds_for_the_loops_thread_alone() -> None:
    said = asked("us")
    assert said[-1] == "True", "a thread that is started later is an ordinary one"
    assert (said[-2] == "True") == (not any("SCHED_FIFO" in line for line in said[:-2]))
