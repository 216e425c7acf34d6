"""What is read in a tick and what of it is believed."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from khepera_hil.budget import READ_BACK, plan
from khepera_hil.clock import SimulatedClock
from khepera_hil.errors import BadAnswer, Implausible, NoAnswer, RobotReset
from khepera_hil.khepera import Khepera
from khepera_hil.link import Link
from khepera_hil.perception import Need
from khepera_hil.plausible import AGREE, TRUST, Motion, alone, doubtful, settled, sudden
from khepera_hil.protocol import SPEED_UNIT_MM_S, RequestLines, encode_answer
from khepera_hil.reader import Reader
from tests.client_end.lines import BAUD, BOOT_TEXT, SimulatedPort

REST = (100, 200, 300, 400, 500, 600, 700, 800)


class Speaking(SimulatedPort):
    """Says what it is told to say, in turn; the last of it again and again."""

    def __init__(self) -> None:
        super().__init__(SimulatedClock())
        self.says: dict[bytes, list[bytes]] = {
            b"B": [b"b,5.01,5.00\r\n"],
            b"K": [b"k,1,0,0,1,0,0\r\n"],
            b"E": [b"e,0,0\r\n"],
            b"D": [b"d\r\n"],
        }
        self._lines = RequestLines()

    def readings(self, letter: str, *values: Sequence[int]) -> None:
        self.says[letter.encode()] = [encode_answer(letter, *each) for each in values]

    def respond(self, data: bytes) -> None:
        for line in self._lines.feed(data):
            if line:
                said = self.says[line if line in self.says else line[:1]]
                self.come(said.pop(0) if said[1:] else said[0])


def reader(*needs: str | Need, verify: bool = False) -> tuple[Reader, Speaking]:
    port = Speaking()
    khepera = Khepera(Link(port, port.clock, baud=BAUD))
    khepera.handshake()
    return Reader(khepera, plan("test", needs, baud=BAUD, period=0.2, verify=verify), verify), port


def but(place: int, value: int) -> tuple[int, ...]:
    return (*REST[:place], value, *REST[place + 1 :])


# Verifying


def test_two_readings_that_agree_are_enough_and_the_newer_counts() -> None:
    reads, port = reader("N", verify=True)
    port.readings("N", REST, but(2, 300 + AGREE))
    assert reads.read(1).proximity == but(2, 300 + AGREE)
    assert (reads.checks.verified, reads.checks.third, reads.remarks) == (1, 0, [])


@pytest.mark.parametrize("broken", [0, 1])
def test_a_number_that_lost_a_digit_is_settled_by_a_third_reading(broken: int) -> None:
    reads, port = reader("N", verify=True)
    first_two: list[tuple[int, ...]] = [REST, REST]
    first_two[broken] = but(4, 50)
    port.readings("N", *first_two, but(4, 510))
    assert reads.read(1).proximity[4] in (500, 510)
    assert reads.checks.third == 1
    assert reads.remarks == ["N was read a third time for right 45"]


def test_three_readings_of_which_no_two_agree_are_refused() -> None:
    reads, port = reader("N", verify=True)
    port.readings("N", but(0, 100), but(0, 200), but(0, 300))
    with pytest.raises(Implausible, match="N at left 90 reads 100, 200, 300: no two of them agree"):
        reads.read(1)
    assert reads.checks.refused == 1


def test_a_robot_that_stands_cannot_see_a_sudden_change_unless_three_readings_do() -> None:
    reads, port = reader("O", verify=True)
    port.readings("O", REST)
    reads.read(1)
    port.readings("O", but(3, 40), but(3, 40), but(3, 400))
    with pytest.raises(Implausible, match=r"O at right 10 reads 40, 40, 400: 0\.0 mm and 0\.00 rad after 400"):
        reads.read(2)
    port.readings("O", but(3, 40))
    assert reads.read(3).light == but(3, 40), "a lamp was switched on"


def test_what_a_robot_that_drives_may_see_depends_on_how_it_drives() -> None:
    def change(left: int, right: int) -> int:
        """The change of light that is taken without a third reading, 0.1 s after these speeds."""
        for size in range(0, 500, 5):
            reads, port = reader("O", verify=True)
            port.readings("O", but(3, 0))
            reads.read(1)
            reads.khepera.set_speed(left, right)
            port.clock.sleep_until(port.clock.now() + 0.1)
            port.readings("O", but(3, size))
            reads.read(2)
            if reads.checks.third:
                return size
        return 500

    still, slow, fast, turning = change(0, 0), change(2, 2), change(10, 10), change(8, -8)
    assert still < slow < fast
    assert turning > still + 150


def test_slow_readings_are_taken_once_when_they_are_due() -> None:
    image = Need("T", (2, "O"), every=3)
    reads, port = reader("N", image, verify=True)
    port.readings("N", REST)
    port.says[b"T"] = [b"t,2,o,31\r\n"]
    due = [tick for tick in range(12) if reads.read(tick).answers]
    assert len(due) == 4
    assert {later - sooner for sooner, later in pairwise(due)} == {3}
    assert reads.read(due[0]).answers["T", 2, "O"] == ("o", 31)
    assert port.written.count(b"T,2,O") == 5


def test_what_a_robot_lacks_is_told_once_and_asked_for_again_after_a_while() -> None:
    camera = Need("T", (2, "O"), without="no camera")
    reads, port = reader("N", camera)
    port.readings("N", REST)
    refused, image = b"z,Turret order not supported\r\n", b"t,2,o,31\r\n"
    told, answered = [], []
    for tick in range(120):
        port.says[b"T"] = [refused if tick < 50 else image]
        found = reads.read(tick)
        assert found.proximity == REST
        answered += [tick] if found.answers else []
        told += [(tick, remark) for remark in reads.remarks]
    assert told == [(1, "no camera"), (101, "T,2,O is answered now")]
    assert answered == list(range(101, 120))
    assert port.written.count(b"T,2,O") == 2 + 19


def test_one_refusal_is_a_garbled_request_and_not_a_missing_turret() -> None:
    reads, port = reader("N", Need("T", (2, "O"), without="no camera"))
    port.readings("N", REST)
    port.says[b"T"] = [b"z,Turret order not supported\r\n", b"t,2,o,31\r\n"]
    assert [bool(reads.read(tick).answers) for tick in range(4)] == [False, True, True, True]
    assert not reads.remarks


def test_a_turret_that_talks_nonsense_is_a_bad_answer() -> None:
    for turret, sentence in ((2, "O's pixel is no plain integer"), (7, "T,7,O is no list of numbers")):
        reads, port = reader(Need("T", (turret, "O")))
        port.says[b"T"] = [f"t,{turret},o,lamp\r\n".encode()]
        with pytest.raises(BadAnswer, match=sentence):
            reads.read(0)


# Reading the speeds back


def test_speeds_that_are_not_what_was_ordered_are_told() -> None:
    reads, port = reader("N")
    port.readings("N", REST)
    reads.khepera.set_speed(20, -20)
    reads.khepera.set_speed(8, 8)
    told = []
    port.says[b"E"] = [b"e,13,-5\r\n", b"e,8,20\r\n"]
    for tick in range(2 * READ_BACK):
        reads.read(tick)
        told += reads.remarks
    assert told == ["the wheels turn at (8, 20), told (8, 8)"]
    assert (reads.checks.read_back, reads.checks.off) == (2, 1)


def test_speeds_that_cannot_be_read_back_cost_no_tick() -> None:
    reads, port = reader("N")
    port.readings("N", REST)
    port.says[b"E"] = [b"z,Protocol error\r\n"]
    remarks = []
    for tick in range(READ_BACK):
        assert reads.read(tick).proximity == REST
        remarks += reads.remarks
    assert len(remarks) == 1
    assert "could not be read back" in remarks[0]


def test_a_reset_is_none_of_the_small_troubles() -> None:
    reads, port = reader("N")
    port.readings("N", REST)
    port.says[b"E"] = [BOOT_TEXT.lstrip()]
    with pytest.raises(RobotReset):  # noqa: PT012 - when the speeds are read is the plan's choice
        for tick in range(READ_BACK):
            reads.read(tick)


def test_no_reading_outlives_its_tick() -> None:
    reads, port = reader("N", "O", verify=True)
    port.readings("N", REST)
    port.readings("O", REST)
    assert reads.read(0).light == REST
    port.says[b"O"] = [b""]
    with pytest.raises(NoAnswer):
        reads.read(1)


# The arithmetic of it

COUNTS = st.tuples(*[st.integers(0, 1023)] * 8)


@given(COUNTS, COUNTS, COUNTS)
def test_what_is_settled_is_supported_or_said_to_be_alone(
    a: Sequence[int], b: Sequence[int], c: Sequence[int]
) -> None:
    values = settled([a, b, c])
    for place in range(8):
        near = sum(abs(values[place] - reading[place]) <= AGREE for reading in (a, b, c))
        assert (near == 1) == (place in alone([a, b, c]))
    assert settled([a, b]) == tuple(b)
    assert all(abs(a[p] - b[p]) > AGREE for p in doubtful(a, b))


@given(COUNTS, COUNTS, st.integers(0, 7), st.integers(0, 1023), st.integers(0, 2), st.integers(0, 300))
def test_one_broken_number_of_three_never_moves_what_is_believed_far(
    true: Sequence[int], before: Sequence[int], place: int, broken: int, which: int, most: int
) -> None:
    readings = [list(true) for _ in range(3)]
    readings[which][place] = broken
    assert settled(readings) == tuple(true)
    suspects = sudden(before, readings, most)
    changed = {p for p in range(8) if abs(true[p] - before[p]) > most}
    assert set(suspects) <= changed, "only where the truth itself is sudden may a tick be refused"


@given(st.lists(st.tuples(st.integers(-127, 127), st.integers(-127, 127), st.floats(0, 0.5)), max_size=20))
def test_the_way_is_never_less_than_the_wheels_were_told(orders: Sequence[tuple[int, int, float]]) -> None:
    motion, now, way, turn = Motion(), 0.0, 0.0, 0.0
    for left, right, seconds in orders:
        motion.told(left, right, now)
        now += seconds
        way += abs(left + right) / 2 * SPEED_UNIT_MM_S * seconds
        turn += abs(left - right) * SPEED_UNIT_MM_S / 53 * seconds
    most_way, most_turn = motion.until(now)
    assert most_way >= way - 1e-6
    assert most_turn >= turn - 1e-6


def test_a_robot_that_stands_is_allowed_the_noise_of_two_readings() -> None:
    assert {slope.most(0, 0) for slope in TRUST.values()} == {2 * AGREE}
