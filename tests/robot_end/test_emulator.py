"""The robot's end of the protocol, to the last byte."""

from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from khepera_hil.emulator import BOOT_TEXT, Emulator
from khepera_hil.errors import UsageError
from khepera_hil.protocol import COMMAND_NOT_FOUND, LED_ABSENT, LED_ACTION, PROTOCOL_ERROR, wire_seconds
from khepera_hil.world import World

_BOOTED = 1.0


def robot(baud: int = 38400, *, arena: str = "empty", seed: int = 0, fifo: int = 1) -> Emulator:
    emulator = Emulator(World(arena, seed), baud, fifo=fifo)
    assert emulator.transmitted(_BOOTED) == BOOT_TEXT
    return emulator


def dialogue(emulator: Emulator, data: bytes, now: float = _BOOTED, wait: float = 2.0) -> bytes:
    emulator.receive(data, now)
    return emulator.transmitted(now + wait)


@pytest.mark.parametrize(
    ("request_", "answer"),
    [
        (b"B\n", b"b,5.01,5.00\r\n"),
        (b"D,5,-3\n", b"d\r\n"),
        (b"G,7,-8\n", b"g\r\n"),
        (b"G,7,-8\rH\r", b"g\r\nh,7,-8\r\n"),
        (b"E\r\n", b"e,0,0\r\n"),
        (b"K\n", b"k,1,0,0,1,0,0\r\n"),
        (b"L,0,1\n", b"l\r\n"),
        (b"L,2,1\n", LED_ABSENT),
        (b"L,1,3\n", LED_ACTION),
        (b"D,128,0\n", PROTOCOL_ERROR),
        (b"D,1\n", PROTOCOL_ERROR),
        (b"d,1,1\n", COMMAND_NOT_FOUND),
        (b" \n", COMMAND_NOT_FOUND),
        (b"\n\r\n", b""),
        (b"  B  \n", b"b,5.01,5.00\r\n"),
        (b"\xff\xfe\n", COMMAND_NOT_FOUND),
        (b"N" * 500 + b"\nB\n", PROTOCOL_ERROR + b"b,5.01,5.00\r\n"),
    ],
)
def test_the_manuals_dialogues_are_answered_to_the_last_byte(request_: bytes, answer: bytes) -> None:
    assert dialogue(robot(), request_) == answer


@pytest.mark.parametrize("baud", [9600, 19200, 38400])
def test_a_byte_takes_eleven_bit_times_each_way(baud: int) -> None:
    emulator = robot(baud)
    emulator.receive(b"B\n", _BOOTED)
    asked = _BOOTED + wire_seconds(2, baud)
    answer = b"b,5.01,5.00\r\n"
    for sent in range(len(answer) + 1):
        moment = asked + wire_seconds(sent, baud)
        assert emulator.transmitted(moment - 1e-7) == b""
        assert emulator.transmitted(moment + 1e-7) == answer[sent - 1 : sent] if sent else True
    assert emulator.next_event() is None


def test_a_command_counts_when_its_last_bit_has_arrived() -> None:
    emulator = robot(9600)
    emulator.receive(b"D,10,10\n", _BOOTED)
    arrival = _BOOTED + wire_seconds(8, 9600)
    emulator.advance(arrival - 1e-6)
    assert emulator.world.wheel_travel() == (0.0, 0.0)
    emulator.advance(arrival + 0.02)
    assert min(emulator.world.wheel_travel()) > 0


def test_leds_are_switched_and_toggled() -> None:
    emulator = robot()
    dialogue(emulator, b"L,0,1\nL,1,2\nL,1,2\nL,1,2\n")
    assert emulator.leds == (1, 1)
    dialogue(emulator, b"L,0,2\nL,1,0\n", now=4.0)
    assert emulator.leds == (0, 0)


def test_counters_wrap_at_32_bits() -> None:
    emulator = robot()
    dialogue(emulator, b"G,2147483647,-2147483648\nD,10,-10\n")
    left, right = map(int, dialogue(emulator, b"D,0,0\nH\n", now=4.0).split(b"\r\n")[1].split(b",")[1:])
    assert -(2**31) <= left < -(2**31) + 3000
    assert 2**31 - 3000 < right < 2**31


def test_the_wheels_keep_their_speed_when_the_host_is_silent() -> None:
    emulator = robot()
    dialogue(emulator, b"D,3,-3\n")
    assert dialogue(emulator, b"E\nK\n", now=60.0) == b"e,3,-3\r\nk,1,0,0,1,0,0\r\n"


def test_the_error_in_speed_mode_is_what_is_lacking() -> None:
    emulator = robot()
    emulator.receive(b"D,20,-20\n", _BOOTED)
    emulator.advance(_BOOTED + 0.03)
    emulator.receive(b"K\n", _BOOTED + 0.03)
    answer = emulator.transmitted(_BOOTED + 1).split(b"\r\n")[1].split(b",")
    assert answer[1:3] == [b"0", b"0"]
    assert 0 < int(answer[3]) < 20
    assert -20 < int(answer[6]) < 0


_SCRIPT = b"N\nO\rD,6,5\r\nH\nN\nbad\nE\nD,4,-4\nN\n\nO\nH\nK\nL,0,2\nN\nO\n"


@given(cuts=st.lists(st.integers(0, len(_SCRIPT)), max_size=20), looks=st.lists(st.floats(1.0, 1.4), max_size=20))
@settings(max_examples=30, deadline=None)
def test_how_the_bytes_are_cut_and_how_often_one_looks_changes_nothing(cuts: list[int], looks: list[float]) -> None:
    whole, cut = robot(seed=4), robot(seed=4)
    for first, last in pairwise([0, *sorted(cuts), len(_SCRIPT)]):
        cut.receive(_SCRIPT[first:last], _BOOTED)
    seen = b"".join(cut.transmitted(moment) for moment in sorted(looks))
    assert seen + cut.transmitted(2.0) == dialogue(whole, _SCRIPT, wait=1.0)


@given(data=st.binary(max_size=300))
@settings(max_examples=40, deadline=None)
def test_whatever_comes_the_next_command_is_answered(data: bytes) -> None:
    emulator = robot()
    dialogue(emulator, data, wait=20.0)
    answer = dialogue(emulator, b"\nB\n", now=30.0)
    assert answer.endswith(b"b,5.01,5.00\r\n")


def test_a_host_at_another_rate_reads_and_writes_garbage() -> None:
    emulator = Emulator(World("empty"), 38400, host_baud=9600)
    boot = emulator.transmitted(1.0)
    assert boot
    assert boot not in BOOT_TEXT
    answer = dialogue(emulator, b"B\n")
    assert b"b,5.01" not in answer
    emulator.host_baud = 38400
    dialogue(emulator, b"\n", now=5.0)
    assert dialogue(emulator, b"B\n", now=8.0) == b"b,5.01,5.00\r\n"


def test_a_rate_that_no_khepera_has_is_refused_with_those_that_there_are() -> None:
    with pytest.raises(UsageError, match=r"12345 baud.*9600, 19200, 38400"):
        Emulator(World("empty"), 12345)
