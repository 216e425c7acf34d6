"""The bounded queue: who waits, who drops, and who hears of an error."""

from __future__ import annotations

import threading

import pytest

from khepera_hil.follower import Follower


class Sink:
    """Keeps what it gets; stands still while ``gate`` is shut, and dies at the item ``fails_at``."""

    def __init__(self, fails_at: int | None = None) -> None:
        self.gate = threading.Event()
        self.gate.set()
        self.entered = threading.Event()
        self.got: list[int] = []
        self.lost: list[int] = []
        self.closed = False
        self.threads: set[str] = set()
        self._fails_at = fails_at

    def write(self, item: int, dropped: int) -> None:
        self.threads.add(threading.current_thread().name)
        self.entered.set()
        self.gate.wait()
        if item == self._fails_at:
            raise ValueError("no more")
        self.got.append(item)
        self.lost.append(dropped)

    def flush(self) -> None:
        self.threads.add(threading.current_thread().name)

    def close(self) -> None:
        self.threads.add(threading.current_thread().name)
        self.gate.wait()
        self.closed = True


@pytest.mark.parametrize("capacity", [1, 2, 64])
def test_one_that_waits_drops_nothing_and_keeps_the_order(capacity: int) -> None:
    sink = Sink()
    follower = Follower(sink, name="it", waits=True, capacity=capacity)
    for item in range(500):
        follower.offer(item)
    assert follower.close() == []
    assert sink.got == list(range(500))
    assert sink.closed
    assert sink.threads == {"follower of it"}


def test_one_that_does_not_wait_drops_what_finds_no_room_and_counts_it() -> None:
    sink = Sink()
    sink.gate.clear()
    follower = Follower(sink, name="the file", waits=False, capacity=3)
    follower.offer(0)
    sink.entered.wait()  # 0 has left the queue, which has room for three more
    for item in range(1, 10):
        follower.offer(item)
    assert follower.dropped == 6
    sink.gate.set()
    assert follower.close() == ["the file lacks 6 ticks"]
    assert sink.got == [0, 1, 2, 3]
    assert sink.lost[-1] == 6  # the sink is told, so that it can show it


@pytest.mark.parametrize("waits", [True, False])
def test_a_sinks_error_never_reaches_the_loop_and_is_told_once(waits: bool) -> None:
    sink = Sink(fails_at=3)
    follower = Follower(sink, name="the file", waits=waits, capacity=1000)
    for item in range(600):
        follower.offer(item)
    losses = follower.close()
    assert losses[0] == "the file is incomplete: ValueError: no more"
    assert losses[1] == "the file lacks 596 ticks"
    assert sink.got == [0, 1, 2]
    assert sink.closed  # what it has is worth a footer
    assert follower.close() == []


def test_nobody_waits_for_room_behind_a_dead_sink() -> None:
    follower = Follower(Sink(fails_at=0), name="it", waits=True, capacity=1)
    for item in range(2000):
        follower.offer(item)
    assert "no more" in follower.close()[0]


def test_a_sink_that_stands_still_is_given_up() -> None:
    sink = Sink()
    sink.gate.clear()
    follower = Follower(sink, name="it", waits=True, capacity=1, patience=0.02, deadline=0.02)
    for item in range(5):
        follower.offer(item)
    assert follower.error == "it took nothing for 0.02 s"
    assert follower.dropped == 3
    assert follower.close() == ["it is incomplete: it took nothing for 0.02 s", "it lacks 3 ticks"]
    sink.gate.set()


def test_closing_is_bounded_when_the_sink_never_ends() -> None:
    sink = Sink()
    sink.gate.clear()
    follower = Follower(sink, name="it", waits=False, deadline=0.02)
    assert follower.close() == ["it was not finished within 0.02 s"]
    sink.gate.set()


def test_what_comes_after_the_end_is_counted_and_not_kept() -> None:
    sink = Sink()
    follower = Follower(sink, name="it", waits=False)
    follower.close()
    follower.offer(1)
    assert (sink.got, follower.dropped) == ([], 1)
