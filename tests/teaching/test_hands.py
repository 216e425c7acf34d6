"""The hands of people: a keyboard in a real terminal, a joystick as evdev shows one."""

from __future__ import annotations

import contextlib
import errno
import os
import pty
import subprocess
import sys
import termios
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from brp.programs.obstacle import Dir, Prox, Vrot
from brp.store import load_data
from khepera_hil.errors import LinkLost, UsageError
from khepera_hil.teaching.joystick import Joystick
from khepera_hil.teaching.keyboard import Keyboard
from tests.runs.cli import environment


@pytest.fixture
def terminal() -> Iterator[tuple[int, int]]:
    master, slave = pty.openpty()
    yield master, slave
    for end in (master, slave):
        with contextlib.suppress(OSError):  # a test may have closed it
            os.close(end)


LEFT, RIGHT, UP = b"\x1b[D", b"\x1b[C", b"\x1b[A"


def test_arrows_move_the_stick_and_it_stays_where_it_was_put(terminal: tuple[int, int]) -> None:
    keyboard = Keyboard(terminal[1])
    assert keyboard.vrot() == 0  # nothing was pressed, and nothing is waited for
    for keys, stick in (
        (RIGHT, 2),
        (RIGHT * 2, 6),
        (b"", 6),
        (RIGHT * 9, 10),
        (LEFT, 8),
        (UP, 0),
        (b"a", -2),
        (b" ", 0),
    ):
        os.write(terminal[0], keys)
        assert keyboard.vrot() == stick
    assert not keyboard.done
    os.write(terminal[0], b"q")
    keyboard.vrot()
    assert keyboard.done


def test_an_arrow_that_comes_in_two_parts_is_one_arrow(terminal: tuple[int, int]) -> None:
    keyboard = Keyboard(terminal[1])
    os.write(terminal[0], RIGHT[:1])
    assert keyboard.vrot() == 0
    os.write(terminal[0], RIGHT[1:])
    assert keyboard.vrot() == 2
    os.write(terminal[0], b"\x1bx" + LEFT + b"\x1b[Z")  # keys that mean nothing here
    assert keyboard.vrot() == 0


def test_the_terminal_is_given_back_as_it_was(terminal: tuple[int, int]) -> None:
    before = termios.tcgetattr(terminal[1])
    keyboard = Keyboard(terminal[1])
    assert termios.tcgetattr(terminal[1]) != before
    keyboard.close()
    keyboard.close()
    assert termios.tcgetattr(terminal[1]) == before


def test_a_terminal_that_is_closed_ends_the_lesson(terminal: tuple[int, int]) -> None:
    keyboard = Keyboard(terminal[1])
    os.write(terminal[0], RIGHT)
    keyboard.vrot()
    os.close(terminal[0])
    assert keyboard.vrot() == 0
    assert keyboard.done


def test_what_is_no_terminal_is_refused() -> None:
    read, write = os.pipe()
    with pytest.raises(UsageError, match="needs a terminal"):
        Keyboard(read)
    os.close(read)
    os.close(write)


@dataclass
class Axis:
    value: int
    min: int = 0
    max: int = 255


class Gamepad:
    """Answers as evdev's InputDevice does."""

    name = "a gamepad"

    def __init__(self) -> None:
        self.axis = Axis(128)
        self.pressed: list[int] = []
        self.unplugged = False

    def absinfo(self, axis_num: int, /) -> Axis:
        if self.unplugged:
            raise OSError(errno.ENODEV, "No such device")
        return self.axis

    def active_keys(self) -> list[int]:
        return self.pressed

    def close(self) -> None:
        pass


@given(low=st.integers(-40000, 0), span=st.integers(20, 80000), share=st.floats(0, 1))
def test_a_stick_covers_vrot_and_rests_in_the_middle(low: int, span: int, share: float) -> None:
    pad = Gamepad()
    stick = Joystick(pad, axis=0, start=315)
    pad.axis = Axis(low + round(share * span), low, low + span)
    vrot = stick.vrot()
    assert -10 <= vrot <= 10
    assert vrot == 0 or (vrot > 0) == (pad.axis.value > low + span / 2)
    for value, wanted in ((low, -10), (low + span, 10), (low + span // 2, 0)):
        pad.axis = Axis(value, low, low + span)
        assert stick.vrot() == wanted


def test_start_ends_the_lesson_and_an_unplugged_stick_is_told() -> None:
    pad = Gamepad()
    stick = Joystick(pad, axis=0, start=315)
    ended = []
    for pad.pressed in ([], [304], [315], []):
        stick.vrot()
        ended.append(stick.done)
    assert ended == [False, False, True, True]
    pad.unplugged = True
    with pytest.raises(LinkLost, match="a gamepad is gone"):
        stick.vrot()


def test_a_person_at_the_keyboard_teaches_in_wall_time(tmp_path: Path) -> None:
    """The whole way: keys into a terminal, wheels of the emulated robot, a data set; q ends it."""
    master, slave = pty.openpty()
    words = ["teach", "avoid", "--teacher", "keyboard", "--seed", "1", "--duration", "60", "--out", "mine.json"]
    lesson = subprocess.Popen(
        [sys.executable, "-m", "khepera_hil", *words],
        stdin=slave,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        cwd=tmp_path,
        env=environment(),
    )
    os.close(slave)
    assert lesson.stdout is not None
    for line in lesson.stdout:
        if "avoid runs" in line:  # the first tick is done
            break
    os.write(master, RIGHT * 3)
    log = next(tmp_path.glob("runs/*/ticks.jsonl"))
    while '"Vrot":6' not in log.read_text():
        assert lesson.poll() is None
        time.sleep(0.05)
    os.write(master, b"q")
    rest = lesson.stdout.read()
    lesson.stdout.close()
    assert lesson.wait(timeout=60) == 0
    assert "stopped (teacher)" in rest
    assert "situations visited" in rest
    os.close(master)
    _, columns = load_data(tmp_path / "mine.json", [Vrot, Dir, Prox])
    assert 6 in columns["Vrot"]
