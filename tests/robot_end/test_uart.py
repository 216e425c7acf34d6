"""The wire: pace, garbling, the host's FIFO."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from khepera_hil.protocol import BAUD_RATES, BITS_PER_CHARACTER
from khepera_hil.uart import Fifo, Line, resample

baud_rates = st.sampled_from(BAUD_RATES)


@given(data=st.binary(max_size=40), baud=baud_rates)
def test_equal_rates_change_nothing(data: bytes, baud: int) -> None:
    assert resample(data, baud, baud) == data


@given(data=st.binary(max_size=40), baud=baud_rates, off=st.floats(-0.03, 0.03))
def test_a_receiver_three_per_cent_off_still_understands(data: bytes, baud: int, off: float) -> None:
    assert resample(data, baud, round(baud * (1 + off))) == data


@given(data=st.binary(min_size=1, max_size=12), sender=baud_rates, receiver=baud_rates)
def test_garbling_is_what_a_receiver_reads_off_the_waveform(data: bytes, sender: int, receiver: int) -> None:
    # Brute force: the waveform as a string of samples, all rates being divisors of 115200.
    fine = 16
    a, b = 115_200 // sender * fine, 115_200 // receiver * fine
    bits = "".join("0" + "".join(str(byte >> place & 1) for place in range(8)) + "11" for byte in data)
    wave = "1" * b + "".join(bit * a for bit in bits) + "1" * (12 * b)
    expected, at, sample = bytearray(), b, b * 9 // 16
    while (at := wave.find("10", at - 1) + 1) > 0:
        if wave[at + sample] == "0":
            expected.append(sum((wave[at + sample + (1 + place) * b] == "1") << place for place in range(8)))
            at += 9 * b
        at += sample
    assert resample(data, sender, receiver) == bytes(expected)


@pytest.mark.parametrize(
    ("data", "sender", "receiver", "seen"),
    [
        (b"\xff", 9600, 19200, b"\xfe"),  # a start bit of twice the length: start, one 0, seven 1
        (b"\x00", 9600, 19200, b"\x00"),  # nine low bits are eighteen; the rest of them is a framing error
        (b"\x00", 38400, 9600, b"\xfe"),  # nine low bits are two and a bit: start, one 0, the rest is idle
        (b"\x7f", 38400, 9600, b""),  # low for a quarter of the receiver's bit: a glitch
    ],
)
def test_garbled_bytes_worked_out_by_hand(data: bytes, sender: int, receiver: int, seen: bytes) -> None:
    assert resample(data, sender, receiver) == seen


@given(
    data=st.binary(min_size=1, max_size=30),
    cuts=st.lists(st.integers(0, 30), max_size=5),
    sender=baud_rates,
    receiver=baud_rates,
    steps=st.integers(1, 200),
)
def test_neither_cutting_nor_looking_more_often_changes_what_arrives(
    data: bytes, cuts: list[int], sender: int, receiver: int, steps: int
) -> None:
    whole, cut = Line(sender, receiver), Line(sender, receiver)
    whole.send(data, 1.0)
    for first, last in pairwise([0, *sorted(min(place, len(data)) for place in cuts), len(data)]):
        cut.send(data[first:last], 1.0)
    end = whole.free + BITS_PER_CHARACTER / receiver
    seen = []
    for step in range(1, steps + 1):
        seen += cut.arrived(1.0 + (end - 1.0) * step / steps)
    seen += cut.arrived(end)
    assert seen == whole.arrived(end)


@given(
    data=st.binary(min_size=1, max_size=20),
    rates=st.tuples(baud_rates, baud_rates),
    after=st.integers(0, 20),
    looks=st.lists(st.integers(0, 200), max_size=8),
)
def test_a_receiver_that_changes_its_rate_reads_what_came_before_and_garbles_the_rest(
    data: bytes, rates: tuple[int, int], after: int, looks: list[int]
) -> None:
    sent_at, later = rates
    after = min(after, len(data))
    line = Line(sent_at, sent_at)
    line.send(data, 0.0)
    change = after * BITS_PER_CHARACTER / sent_at
    end = line.free + BITS_PER_CHARACTER / later
    seen = b""
    for moment in sorted(place / 200 * change for place in looks):
        seen += bytes(byte for _, byte in line.arrived(moment))
    line.listen(later, change)
    for moment in sorted([*(change + place / 200 * (end - change) for place in looks), end]):
        seen += bytes(byte for _, byte in line.arrived(moment))
    assert seen == data[:after] + resample(data[after:], sent_at, later)


def test_a_byte_arrives_with_its_last_stop_bit() -> None:
    line = Line(9600, 9600)
    line.send(b"ab", 2.0)
    character = 11 / 9600
    assert line.arrived(2.0 + 0.999 * character) == []
    assert line.arrived(2.0 + character) == [(2.0 + character, ord("a"))]
    assert line.next_arrival() == 2.0 + character + character


def test_the_fifo_hands_over_fourteen_or_what_has_rested_for_four_characters() -> None:
    fifo, baud = Fifo(14), 38400
    character = 11 / baud
    fifo.put((((place + 1) * character, place) for place in range(9)), baud)
    fifo.put((((place + 1) * character, place) for place in range(9, 20)), baud)
    assert fifo.next_show() == 14 * character
    assert fifo.shown(13.9 * character) == b""
    assert fifo.shown(14 * character) == bytes(range(14))
    assert fifo.next_show() == pytest.approx(24 * character)
    assert fifo.shown(23.9 * character) == b""
    assert fifo.shown(24.1 * character) == bytes(range(14, 20))
    assert fifo.next_show() is None
