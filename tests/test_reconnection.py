from __future__ import annotations

import threading
import time
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from khepera_hil.clock import SimulatedClock, WallClock
from khepera_hil.errors import PortError
from khepera_hil.reconnection import LONGEST_PAUSE, Reconnection, stable_name

LONG = 30.0


class Found:
    """A robot on a line that was opened; all that matters here is whether it was closed."""

    def __init__(self) -> None:
        self.closed = False
        self.link = self

    def close(self) -> None:
        self.closed = True


def polled(search: Reconnection) -> Any:
    end = time.monotonic() + LONG
    while (found := search.poll()) is None:
        assert time.monotonic() < end
        time.sleep(0.001)
    return found


def test_it_tries_until_it_is_there_and_nobody_waits_for_it() -> None:
    tried: list[float] = []
    found = Found()

    def reopen() -> Any:
        tried.append(time.monotonic())
        if len(tried) < 4:
            raise PortError("not yet")
        return found

    search = Reconnection(reopen, WallClock())
    assert search.poll() is None
    assert polled(search) is found
    search.close()
    assert not found.closed, "it was taken"
    assert len(tried) == 4
    assert tried[-1] - tried[0] >= 0.1 + LONGEST_PAUSE + LONGEST_PAUSE - 0.01


def test_an_opening_that_takes_its_time_holds_nobody_up_and_is_closed_when_it_comes_too_late() -> None:
    free, opened = threading.Event(), threading.Event()
    found = Found()

    def reopen() -> Any:
        opened.set()
        free.wait(LONG)
        return found

    search = Reconnection(reopen, WallClock())
    assert opened.wait(LONG)
    assert search.poll() is None
    search.close()
    free.set()
    assert search._thread is not None
    search._thread.join(LONG)
    assert found.closed


def test_one_that_came_and_was_not_taken_is_closed() -> None:
    found = Found()
    search = Reconnection(lambda: found, WallClock())  # type: ignore[arg-type, return-value] # it only closes it
    assert search._thread is not None
    search._thread.join(LONG)
    search.close()
    assert found.closed


def test_a_mistake_of_ours_is_not_swallowed() -> None:
    def reopen() -> Any:
        raise ZeroDivisionError

    search = Reconnection(reopen, WallClock())
    with pytest.raises(ZeroDivisionError):
        polled(search)
    search.close()


def test_in_simulated_time_it_happens_in_the_loop_when_the_clock_says_so() -> None:
    clock = SimulatedClock()
    tried: list[float] = []

    def reopen() -> Any:
        tried.append(round(clock.now(), 6))
        raise PortError("not yet")

    threads = threading.active_count()
    search = Reconnection(reopen, clock)
    for tick in range(1000):
        clock.sleep_until(tick * 0.01)
        assert search.poll() is None
    assert threading.active_count() == threads
    assert tried[:4] == [0.05, 0.1, 0.2, 0.4]
    assert max(after - before for before, after in pairwise(tried)) < LONGEST_PAUSE + 0.02


def test_a_device_is_known_by_its_adapters_own_name(tmp_path: Path) -> None:
    device, other, by_id = tmp_path / "ttyUSB0", tmp_path / "ttyUSB1", tmp_path / "by-id"
    device.touch()
    other.touch()
    by_id.mkdir()
    assert stable_name(str(device), by_id) == str(device)
    (by_id / "usb-FTDI_A1").symlink_to(other)
    (by_id / "usb-FTDI_B2").symlink_to(device)
    assert stable_name(str(device), by_id) == str(by_id / "usb-FTDI_B2")
    # It comes back as ttyUSB1, which was somebody else's.
    (by_id / "usb-FTDI_B2").unlink()
    (by_id / "usb-FTDI_B2").symlink_to(other)
    assert Path(stable_name(str(other), by_id)).resolve() == other


def test_a_link_of_the_users_an_address_and_a_device_without_such_a_name_keep_theirs(tmp_path: Path) -> None:
    device, link = tmp_path / "pts", tmp_path / "khepera"
    device.touch()
    link.symlink_to(device)
    by_id = tmp_path / "by-id"
    for name in (str(link), str(device), "socket://robot:7000", "/dev/no-such-device"):
        assert stable_name(name, by_id) == name
