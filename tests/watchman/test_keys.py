"""Keys at the terminal, on a real pseudo-terminal."""

from __future__ import annotations

import contextlib
import os
import pty
import termios
from collections.abc import Iterator

import pytest

from brp.programs.behavior import Behavior
from khepera_hil.keys import KEYS, Keys, foreground
from khepera_hil.orders import Order


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[int, int]]:
    ours, theirs = pty.openpty()
    # Whose keys they are is the shell's business; here the terminal is nobody's.
    monkeypatch.setattr(os, "tcgetpgrp", lambda descriptor: os.getpgrp())
    yield ours, theirs
    for descriptor in (ours, theirs):
        with contextlib.suppress(OSError):
            os.close(descriptor)


def test_each_key_is_an_order_and_others_are_none(terminal: tuple[int, int]) -> None:
    ours, theirs = terminal
    said: list[tuple[str, str]] = []
    keys = Keys(theirs, lambda level, text: said.append((level, text)))
    assert keys.take() == []
    os.write(ours, b"vxI\x1b[Aq")
    orders: list[Order] = []
    while len(orders) < 3:
        orders += keys.take()
    assert [order.words for order in orders] == ["vigil", "identify", "stop"]
    orders[0].obeyed("vigil is on")
    orders[1].refused("no")
    assert said == [("info", "vigil is on"), ("warning", "no")]
    assert set(KEYS) == {"v", "i", "q", *"0123456"}


def test_digits_say_the_behavior_but_not_inside_a_function_key(terminal: tuple[int, int]) -> None:
    ours, theirs = terminal
    keys = Keys(theirs, lambda level, text: None)
    os.write(ours, b"2\x1b[15~6\x1b[1;2A\x1bOP\x1b[")
    orders: list[Order] = []
    while len(orders) < 2:
        orders += keys.take()
    os.write(ours, b"3~0")
    while len(orders) < 3:
        orders += keys.take()
    os.write(ours, b"\x1b")  # the escape key, which swallows nothing
    os.write(ours, b"q\x1bq")
    while len(orders) < 5:
        orders += keys.take()
    words = [order.words for order in orders]
    assert words == ["behavior patrol", "behavior recharge", "behavior free", "stop", "stop"]
    digits = [KEYS[str(place)].removeprefix("behavior ") for place in range(1, 7)]
    assert digits == list(Behavior.values)


def test_the_terminal_is_left_as_it_was(terminal: tuple[int, int]) -> None:
    _, theirs = terminal
    before = termios.tcgetattr(theirs)
    keys = Keys(theirs, lambda level, text: None)
    assert termios.tcgetattr(theirs) != before
    keys.close()
    keys.close()
    assert termios.tcgetattr(theirs) == before
    assert keys.take() == []


def test_a_terminal_that_is_closed_gives_no_orders(terminal: tuple[int, int]) -> None:
    ours, theirs = terminal
    keys = Keys(theirs, lambda level, text: None)
    os.close(ours)
    assert keys.take() == []
    assert keys.take() == []
    keys.close()


def test_what_is_no_terminal_has_no_keys() -> None:
    with open(os.devnull) as nothing:
        assert not foreground(nothing)
    assert not foreground(nothing)  # closed
