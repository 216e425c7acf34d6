"""A link asks, waits no longer than it must, believes nothing twice, and finds its way back."""

from __future__ import annotations

import contextlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from khepera_hil.clock import SimulatedClock
from khepera_hil.errors import BadAnswer, LinkLost, NoAnswer, ProtocolError, Refused, RobotError, RobotReset
from khepera_hil.link import MARGIN, QUIET, RESYNCHRONISATION, SILENCE, Link
from khepera_hil.protocol import COMMAND_NOT_FOUND, PROTOCOL_ERROR, wire_seconds
from tests.client_end.lines import BAUD, BOOT_TEXT, SYNCHRONISED, FaultyRobot, ScriptedPort, SimulatedPort, Turn

READING = b"n,0,1,20,300,1023,5,0,7\r\n"
VALUES = (0, 1, 20, 300, 1023, 5, 0, 7)


def conversation(*script: Turn) -> tuple[Link, ScriptedPort]:
    clock = SimulatedClock()
    port = ScriptedPort(clock, *script)
    return Link(port, clock, baud=BAUD), port


# Believing


@pytest.mark.parametrize(
    ("after", "each"),
    [(0.0, 0.0), (0.001, 0.0002865), (0.012, 0.001), (0.03, 0.0)],
    ids=["burst", "wire", "slow", "late"],
)
def test_an_answer_is_taken_however_its_bytes_come(after: float, each: float) -> None:
    link, port = conversation(*SYNCHRONISED, Turn(b"N\n", READING, after, each))
    assert link.ask("N") == VALUES
    assert link.last_answer == "n,0,1,20,300,1023,5,0,7"
    assert port.finished
    assert link.counters.accepted == 1


@given(st.lists(st.floats(0, 0.004), min_size=len(READING), max_size=len(READING)))
def test_an_answer_is_taken_or_missed_by_its_last_byte_alone(gaps: list[float]) -> None:
    class Uneven(ScriptedPort):
        def respond(self, data: bytes) -> None:
            super().respond(data)
            if data == b"N\n":
                for byte, gap in zip(READING, gaps, strict=True):
                    self.come(bytes([byte]), each=gap)

    clock = SimulatedClock()
    link = Link(Uneven(clock, *SYNCHRONISED, Turn(b"N\n")), clock, baud=BAUD)
    spare = wire_seconds(2 + 43, BAUD) + MARGIN - sum(gaps)
    if spare > 1e-6:
        assert link.ask("N") == VALUES
    elif spare < -1e-6:
        with pytest.raises(NoAnswer):
            link.ask("N")


@pytest.mark.parametrize(
    ("answer", "error"),
    [
        (b"", NoAnswer),
        (READING[:-1], NoAnswer),
        (READING[:10], NoAnswer),
        (READING + READING, BadAnswer),
        (READING[:-2] + b"\n", BadAnswer),
        (READING[:-2] + READING, BadAnswer),
        (b"\r\n" + READING, BadAnswer),
        (READING + b"n", BadAnswer),
        (b"o" + READING[1:], BadAnswer),
        (b"N" + READING[1:], BadAnswer),
        (b"n,0,1,20,300,1023,5,0\r\n", BadAnswer),
        (b"n,0,1,20,300,1023,5,0,7,7\r\n", BadAnswer),
        (b"n,0,1,20,300,1024,5,0,7\r\n", BadAnswer),
        (b"n,0,01,20,300,1023,5,0,7\r\n", BadAnswer),
        (b"n,0,-1,20,300,1023,5,0,7\r\n", BadAnswer),
        (b"N\n" + READING, BadAnswer),
        (b"\xff" * 500, BadAnswer),
        (COMMAND_NOT_FOUND, Refused),
        (PROTOCOL_ERROR, Refused),
    ],
)
def test_anything_else_is_refused_and_the_line_found_again(answer: bytes, error: type[RobotError]) -> None:
    link, port = conversation(
        *SYNCHRONISED,
        Turn(b"N\n", answer, each=0.0),
        Turn(b"\n"),
        Turn(b"K\n", b"k,0,0,3,0,0,-4\r\n"),
        Turn(b"N\n", READING),
    )
    with pytest.raises(error):
        link.ask("N")
    assert link.last_answer == ""
    assert not link.synchronised
    assert link.ask("N") == VALUES
    assert port.finished
    counters = link.counters
    assert counters.no_answer + counters.bad_answer + counters.refused == 1
    assert (counters.requests, counters.accepted, counters.resynchronisations) == (2, 1, 2)


def test_a_late_answer_is_not_taken_for_the_next_one() -> None:
    link, port = conversation(
        *SYNCHRONISED,
        Turn(b"N\n", b"n,1,1,1,1,1,1,1,1\r\n", after=0.06),
        Turn(b"\n"),
        Turn(b"K\n", b"k,0,0,0,0,0,0\r\n"),
        Turn(b"\n"),
        Turn(b"E\n", b"e,0,0\r\n"),
        Turn(b"N\n", b"n,2,2,2,2,2,2,2,2\r\n"),
    )
    with pytest.raises(NoAnswer):
        link.ask("N")
    assert link.ask("N") == (2,) * 8
    assert port.finished


def test_bytes_that_nobody_asked_for_are_thrown_away_before_the_request() -> None:
    link, port = conversation(
        *SYNCHRONISED, Turn(b"N\n", READING), Turn(b"\n"), Turn(b"K\n", b"k,0,0,0,0,0,0\r\n"), Turn(b"N\n", READING)
    )
    link.ask("N")
    port.come(b"n,9,9,9,9,9,9,9,9\r\n", each=0.0)
    assert link.ask("N") == VALUES
    assert port.finished
    assert link.counters.unsolicited == 1
    assert link.counters.resynchronisations == 2


def test_another_turrets_answer_is_no_answer() -> None:
    link, _ = conversation(*SYNCHRONISED, Turn(b"T,2,O\n", b"t,3,o,31\r\n"))
    with pytest.raises(BadAnswer):
        link.ask("T", 2, "O")
    link, _ = conversation(*SYNCHRONISED, Turn(b"T,2,O\n", b"t,2,p,31\r\n"))
    with pytest.raises(BadAnswer):
        link.ask("T", 2, "O")
    link, _ = conversation(*SYNCHRONISED, Turn(b"T,2,O\n", b"t,2,o,31\r\n"))
    assert link.ask("T", 2, "O") == (2, "o,31")


def pixels(*values: int) -> bytes:
    return b"t,2,n," + ",".join(map(str, values)).encode() + b"\r\n"


@pytest.mark.parametrize(
    "answer", [pixels(*range(63)), pixels(*range(65)), pixels(*range(63), 256), pixels(*range(63)) + b"\n"]
)
def test_an_image_is_whole_and_in_range_or_none(answer: bytes) -> None:
    link, _ = conversation(*SYNCHRONISED, Turn(b"T,2,N\n", answer))
    with pytest.raises(BadAnswer):
        link.ask("T", 2, "N")
    assert not link.synchronised
    link, _ = conversation(*SYNCHRONISED, Turn(b"T,2,N\n", pixels(*range(64))))
    assert link.ask("T", 2, "N")[0] == 2


def test_values_outside_the_protocol_are_never_sent() -> None:
    link, port = conversation()
    with pytest.raises(ProtocolError):
        link.ask("D", 128, 0)
    assert not port.written


def test_every_exchange_is_reported_as_it_was() -> None:
    link, _ = conversation(*SYNCHRONISED, Turn(b"N\n", READING), Turn(b"O\n", READING))
    transcript: list[tuple[bytes, bytes]] = []
    link.on_exchange = lambda request, answer: transcript.append((request, answer))
    link.ask("N")
    with pytest.raises(BadAnswer):
        link.ask("O")
    assert transcript == [(b"\n", b""), (b"B\n", b"b,5.01,5.00\r\n"), (b"N\n", READING), (b"O\n", READING)]


def test_an_interrupted_request_leaves_no_trust_in_the_line() -> None:
    link, port = conversation(*SYNCHRONISED, Turn(b"N\n", READING))

    def interrupt(request: bytes, answer: bytes) -> None:
        if request == b"N\n":
            raise KeyboardInterrupt

    link.on_exchange = interrupt
    with pytest.raises(KeyboardInterrupt):
        link.ask("N")
    assert port.finished
    assert not link.synchronised


# A robot that was reset


def in_session(*script: Turn) -> tuple[Link, ScriptedPort]:
    link, port = conversation(*SYNCHRONISED, *script)
    link.resynchronise()
    return link, port


@pytest.mark.parametrize(
    "text", [BOOT_TEXT.lstrip(), BOOT_TEXT.lstrip()[:60], BOOT_TEXT[-31:]], ids=["whole", "first", "second"]
)
@pytest.mark.parametrize("behind", [b"", READING], ids=["instead", "before"])
def test_a_boot_text_that_comes_for_an_answer_is_a_reset(text: bytes, behind: bytes) -> None:
    link, _ = in_session(Turn(b"N\n", text + behind, each=0.0))
    with pytest.raises(RobotReset, match="/dev/scripted was reset"):
        link.ask("N")


def test_a_boot_text_between_two_requests_is_a_reset_before_anything_is_sent_to_the_robot() -> None:
    link, port = in_session(Turn(b"N\n", READING), Turn(b"\n"))
    link.ask("N")
    port.come(BOOT_TEXT)
    port.clock.sleep_until(port.clock.now() + 0.01)
    with pytest.raises(RobotReset):
        link.ask("D", 5, 5)
    assert port.finished
    assert port.clock.now() < 0.15


@given(st.integers(1, len(BOOT_TEXT) - 1), st.integers(1, len(BOOT_TEXT) - 1))
def test_a_boot_text_is_known_however_it_is_chopped(one: int, other: int) -> None:
    first, second = sorted((one, other))
    link, port = in_session(*[Turn(b"\n")] * 9)
    for piece in (BOOT_TEXT[:first], BOOT_TEXT[first:second], BOOT_TEXT[second:]):
        port.come(piece, after=0.015, each=0.0)
    port.clock.sleep_until(port.clock.now() + 0.016)
    with pytest.raises(RobotReset):
        link.ask("N")


def test_after_a_reset_nothing_is_asked_until_a_session_begins() -> None:
    link, port = in_session(
        Turn(b"N\n", BOOT_TEXT.lstrip()),
        Turn(b"\n"),
        Turn(b"K\n", b"k,0,0,0,0,0,0\r\n"),
        Turn(b"N\n", READING),
    )
    sent = len(port.written)
    for letter in ("N", "O", "N"):
        with pytest.raises(RobotReset):
            link.ask(letter)
    assert port.written[sent:] == b"N\n"
    link.begin()
    assert link.ask("N") == VALUES
    assert link.counters.boot_texts == 2


def test_the_boot_text_of_a_robot_that_was_just_switched_on_is_none() -> None:
    link, port = conversation(*SYNCHRONISED, Turn(b"N\n", READING))
    port.come(BOOT_TEXT)
    assert link.ask("N") == VALUES
    assert link.counters.boot_texts == 2


# Waiting


def test_a_request_waits_for_its_time_on_the_wire_and_the_margin_and_no_longer() -> None:
    link, port = conversation(*SYNCHRONISED, Turn(b"N\n"))
    link.resynchronise()
    before = port.clock.now()
    with pytest.raises(NoAnswer, match=r"/dev/scripted did not answer N within 38 ms"):
        link.ask("N")
    assert port.clock.now() - before == pytest.approx(wire_seconds(2 + 43, BAUD) + MARGIN)


def test_dribbling_bytes_do_not_move_the_deadline() -> None:
    link, port = conversation(*SYNCHRONISED, Turn(b"N\n", b"n,1,2,3,4,5,6,7,8", each=0.01))
    link.resynchronise()
    before = port.clock.now()
    with pytest.raises(NoAnswer, match="only a part"):
        link.ask("N")
    assert port.clock.now() - before == pytest.approx(wire_seconds(2 + 43, BAUD) + MARGIN)


def test_what_the_host_kept_for_us_while_we_were_late_is_still_taken() -> None:
    clock = SimulatedClock()

    class StalledHost(ScriptedPort):
        """The process is stopped for a second just after it has written."""

        def respond(self, data: bytes) -> None:
            super().respond(data)
            if data == b"N\n":
                self.clock.sleep_until(self.clock.now() + 1.0)

    link = Link(StalledHost(clock, *SYNCHRONISED, Turn(b"N\n", READING)), clock, baud=BAUD)
    assert link.ask("N") == VALUES


def test_a_silent_line_costs_one_probe_a_request() -> None:
    clock = SimulatedClock()
    port = SimulatedPort(clock)
    link = Link(port, clock, baud=BAUD)
    with pytest.raises(NoAnswer, match="N was not asked, because /dev/scripted is silent"):
        link.ask("N")
    assert port.written == b"\nB\n"
    assert clock.now() < QUIET + wire_seconds(30, BAUD) + MARGIN
    for letter in (b"K", b"E", b"B", b"K"):
        port.written.clear()
        with pytest.raises(NoAnswer):
            link.ask("N")
        assert port.written == b"\n" + letter + b"\n"
    assert link.counters.failed_resynchronisations == 5


def test_a_line_that_never_falls_silent_is_given_up_in_time() -> None:
    clock = SimulatedClock()
    port = SimulatedPort(clock)
    port.come(b"\x55" * 20_000)
    link = Link(port, clock, baud=BAUD)
    with pytest.raises(NoAnswer, match="makes no sense"):
        link.ask("N")
    assert clock.now() <= RESYNCHRONISATION
    assert b"N" not in port.written


PROBED = QUIET + wire_seconds(2 + 21, BAUD) + MARGIN + SILENCE
"""Seconds that an attempt to come in step again may take at the most: K has the longest answer of the probes."""


@pytest.mark.parametrize("left", [0.25, 0.1, 0.06, 0.02, 0.0, -0.05])
@pytest.mark.parametrize("noise", [0.01, 0.05, 0.2, 6.0])
def test_to_come_in_step_again_takes_no_deadline_of_the_callers(left: float, noise: float) -> None:
    """But for the first attempt, which there always is: a loop that is late would else never come back."""
    clock = SimulatedClock()
    clock.sleep_until(1.0)
    port = FaultyRobot(clock, np.random.default_rng(0), rate=0.0)
    link = Link(port, clock, baud=BAUD)
    link.resynchronise()
    link.ask("N")
    began = clock.now()
    link.until = began + left
    port.come(b"\x55" * round(noise / wire_seconds(1, BAUD)))
    with contextlib.suppress(RobotError):
        link.resynchronise()
    assert clock.now() - began <= max(left, PROBED) + 1e-9
    assert link.synchronised or noise > min(left, RESYNCHRONISATION) - PROBED


def test_a_letter_that_the_program_asked_last_is_not_the_probe() -> None:
    link, port = conversation(
        *SYNCHRONISED, Turn(b"K\n"), Turn(b"\n"), Turn(b"E\n", b"e,0,0\r\n"), Turn(b"K\n", b"k,0,0,0,0,0,0\r\n")
    )
    with pytest.raises(NoAnswer):
        link.ask("K")
    link.ask("K")
    assert port.finished


def test_a_doubled_answer_to_the_probe_is_no_proof() -> None:
    link, port = conversation(
        Turn(b"\n"),
        Turn(b"B\n", b"b,5.01,5.00\r\nb,5.01,5.00\r\n"),
        Turn(b"\n"),
        Turn(b"K\n", b"k,0,0,0,0,0,0\r\n"),
        Turn(b"N\n", READING),
    )
    assert link.ask("N") == VALUES
    assert port.finished


def test_a_resynchronisation_takes_quiet_probe_and_silence() -> None:
    link, port = conversation(*SYNCHRONISED)
    link.resynchronise()
    probe = 0.001 + wire_seconds(len(b"b,5.01,5.00\r\n"), BAUD)
    assert port.clock.now() == pytest.approx(QUIET + probe + SILENCE)


# The law: no stale value, ever


@pytest.mark.parametrize("seed", range(12))
def test_no_stale_reading_is_accepted_whatever_happens_to_lines(seed: int) -> None:
    rng = np.random.default_rng(seed)
    clock = SimulatedClock()
    robot = FaultyRobot(clock, rng, rate=(0.02, 0.1, 0.3)[seed % 3])
    link = Link(robot, clock, baud=BAUD)
    accepted = 0
    for tick in range(700):
        for letter in ("N", "O", "D"):
            before = robot.readings.get(letter, 0)
            try:
                values = link.ask(letter, *((5, -5) if letter == "D" else ()))
            except RobotReset:
                with contextlib.suppress(RobotError):
                    link.begin()
                continue
            except RobotError:
                continue
            if letter != "D":
                high, low, *rest = (int(value) for value in values)
                assert high * 1000 + low > before, f"tick {tick}: an answer from before the request was taken"
                assert rest == [7] * 6
                accepted += 1
        clock.sleep_until(clock.now() + 0.02)
    assert robot.faults > 20
    assert accepted > 150
    robot.rate = 0.0
    clock.sleep_until(clock.now() + 2.0)
    link.begin()
    assert len(link.ask("N")) == 8, "one request after the last fault the line is well again"


# Losing the port


@pytest.mark.parametrize("method", ["write", "read", "in_waiting"])
def test_a_port_that_fails_is_lost_for_good_and_closed(method: str) -> None:
    clock = SimulatedClock()

    class Unplugged(ScriptedPort):
        failing = False

        def write(self, data: bytes, /) -> int:
            if self.failing and method == "write":
                raise OSError(5, "Input/output error")
            return super().write(data)

        def read(self, size: int = 1, /) -> bytes:
            if self.failing and method == "read":
                raise OSError(5, "Input/output error")
            return super().read(size)

        @property
        def in_waiting(self) -> int:
            if self.failing and method == "in_waiting":
                raise OSError(5, "Input/output error")
            return super().in_waiting

    port = Unplugged(clock, *SYNCHRONISED, Turn(b"N\n", READING), Turn(b"N\n", READING))
    link = Link(port, clock, baud=BAUD)
    link.ask("N")
    port.failing = True
    with pytest.raises(LinkLost, match="/dev/scripted is gone"):
        link.ask("N")
    assert not port.open
    port.failing = False
    with pytest.raises(LinkLost, match="/dev/scripted is gone"):
        link.ask("N")


def test_a_port_that_takes_only_a_part_is_lost() -> None:
    clock = SimulatedClock()

    class Full(SimulatedPort):
        def write(self, data: bytes, /) -> int:
            return 0

    with pytest.raises(LinkLost):
        Link(Full(clock), clock, baud=BAUD).ask("N")


def test_a_closed_link_says_so() -> None:
    link, port = conversation()
    link.close()
    assert not port.open
    with pytest.raises(LinkLost, match="has been closed"):
        link.ask("N")
