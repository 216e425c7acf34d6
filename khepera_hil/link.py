"""Ask and wait over one port: deadlines, resynchronisation, and a robot that was reset in between.

One request is in flight at a time, under one absolute deadline. An answer counts only when it came whole, with
the right letter, count and ranges, and with nothing left over. After anything else the line is not trusted:
an old answer may still be on its way, and a client that goes on reading stays one answer behind for ever. So
before the next request the line is brought back by :meth:`Link.resynchronise`.

Time is the clock's alone. With a simulated clock the port's ``read`` moves it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf

from khepera_hil.clock import Clock
from khepera_hil.errors import (
    BadAnswer,
    LinkLost,
    NoAnswer,
    ProtocolError,
    Refused,
    RobotError,
    RobotReset,
)
from khepera_hil.lookout import Lookout
from khepera_hil.opening import PORT_ERRORS, Port, close_port
from khepera_hil.protocol import COMMANDS, encode_request, is_refusal, parse_answer, wire_seconds
from khepera_hil.turrets import longest_turret_answer, parse_turret_answer

__all__ = ["MARGIN", "Counters", "Link"]

MARGIN = 0.025
"""Seconds that an answer may take beyond its time on the wire. An FTDI adapter whose latency timer could not be
lowered holds the end of an answer for 16 ms, USB adds 1, the robot's firmware some 3, the host's scheduler the
rest. It is only ever waited for when an answer fails to come."""

QUIET = 0.020
"""Seconds without a byte after which no more is expected of an old answer (longer than FTDI's 16 ms)."""

SILENCE = 0.005
"""Seconds that must pass without a byte after a probe's answer."""

RESYNCHRONISATION = 0.3
"""Seconds after which a resynchronisation begins nothing new and gives up."""

PROBES = ("B", "K", "E")
"""Requests that change nothing and that a tick does not use."""

BOOT_MARKS = (b"ROM of minirobot", b"Serial Communication Protocol")
"""What stands in the boot texts of both robots and in no answer: either is enough, since the other may be cut."""

_LONGEST_MARK = max(map(len, BOOT_MARKS))
_HEARD = 4096  # characters kept of what is thrown away


@dataclass
class Counters:
    """What a link has been through since it was made."""

    requests: int = 0
    accepted: int = 0
    no_answer: int = 0
    bad_answer: int = 0
    refused: int = 0
    unsolicited: int = 0
    """Times that bytes lay in the line before a request although nobody had asked."""
    resynchronisations: int = 0
    """Including those that failed."""
    failed_resynchronisations: int = 0
    boot_texts: int = 0
    """Lines of a boot text that were heard, before the first session too."""


class Link:
    """One line to one robot.

    ``margin`` is the time in seconds that an answer may take beyond its time on the wire. ``on_exchange`` is
    called after every exchange, good or not, probes included, with the bytes sent and all bytes that came;
    bytes that nobody asked for come with an empty request.
    """

    def __init__(
        self,
        port: Port,
        clock: Clock,
        *,
        baud: int,
        margin: float = MARGIN,
        on_exchange: Callable[[bytes, bytes], None] | None = None,
    ) -> None:
        self.port = port
        self.clock = clock
        self.baud = baud
        self.margin = margin
        self.on_exchange = on_exchange
        self.on_sent: Callable[[], None] | None = None
        """Called each time that something has been handed to the port; what it raises goes through."""
        self.lookout = Lookout(port, clock)
        """For who takes bytes away, to be given some time now and then: :meth:`Lookout.look`."""
        self.counters = Counters()
        self.until = inf
        """The clock's time by which a resynchronisation shall be over: the caller's next deadline."""
        self.last_answer = ""
        """The last accepted answer as it came, without CR LF."""
        self._synchronised = False  # nothing is known of a line that was just opened
        self._lost: str | None = None  # why, once it is
        self._heard = bytearray()  # the last of what came since the last resynchronisation began
        self._seam = b""  # the end of what came last: a boot text may come in pieces
        self._in_session = False  # whether the robot has answered since the session began
        self._reset = False  # and whether it was reset since
        self._asked = 0
        self._last_asked = dict.fromkeys(PROBES, 0)

    @property
    def name(self) -> str:
        """The port's name, for the sentences that the user reads."""
        return str(self.port.port).partition("?")[0]

    @property
    def synchronised(self) -> bool:
        """Whether the next request may be sent without resynchronising first."""
        return self._synchronised

    def ask(self, letter: str, *values: int | str) -> tuple[int | str, ...]:
        """Send one request and return the values of its answer, as :func:`~khepera_hil.protocol.parse_answer`.

        Raises NoAnswer, BadAnswer or Refused, after which the next request resynchronises first; RobotReset when
        the robot's boot text was among what came, and with nothing sent from then on until :meth:`begin`; LinkLost
        when the port is gone; ProtocolError, with nothing sent, for values outside the protocol's ranges.
        """
        request = encode_request(letter, *values)
        self.counters.requests += 1
        try:
            self._raise_reset()
            self._trust_the_line(letter)
            self._synchronised = False  # until the answer is in, also when somebody interrupts us
            line, answer = self._exchange(request, letter, values)
        except RobotError as error:
            if isinstance(error, NoAnswer):
                self.counters.no_answer += 1
            elif isinstance(error, BadAnswer):
                self.counters.bad_answer += 1
            elif isinstance(error, Refused):
                self.counters.refused += 1
            if isinstance(error, (NoAnswer, BadAnswer)):
                self.lookout.suspect()
                if others := self.lookout.others:
                    raise type(error)(
                        f"{error}; {self.name} is also open in {others}, which takes bytes away"
                    ) from error
            raise
        self._synchronised = True
        self.counters.accepted += 1
        self.last_answer = line
        return answer

    def send_unanswered(self, letter: str, *values: int | str) -> None:
        """Write a line end, which ends half a command, and a request, and wait for nothing.

        For orders that must go out now (the wheels' stop); the line is unsynchronised afterwards.
        """
        request = b"\n" + encode_request(letter, *values)
        self._synchronised = False
        self._write(request)
        self._report(request, b"")

    def tool(self, text: str, seconds: float = 1.0) -> str:
        """Send one of the robot's text commands, such as ``net``; what it prints within so many seconds.

        Such texts have no end mark: they are read until the line is quiet, and nothing in them is checked but that
        it is no boot text. The next request resynchronises first. Raises RobotReset and LinkLost.
        """
        self._raise_reset()
        self._synchronised = False
        request = text.encode("ascii") + b"\n"
        give_up = self.clock.now() + seconds
        self._write(request)
        printed = bytearray()
        chunk = self._read(seconds)  # the first may take its time
        while chunk and self.clock.now() < give_up:
            printed += chunk
            chunk = self._read(2 * QUIET)
        self._report(request, bytes(printed))
        self._raise_reset()
        return printed.decode("ascii", "backslashreplace")

    def begin(self) -> None:
        """Begin a session with whoever is there now: as :meth:`resynchronise`, but a boot text is nothing new."""
        self._reset = self._in_session = False
        self.resynchronise()

    def resynchronise(self) -> None:
        """Bring requests and answers in step again, or raise: NoAnswer on a silent line, BadAnswer on another.
        RobotReset goes before both: who was reset must first be told to stand still, not be read.

        An empty line ends half a command that the robot may hold. What comes is thrown away until the line is
        quiet. Then a request is sent whose answer cannot be mistaken for an old one: of B, K and E the one
        that was asked longest ago. The robot answers in order, so after a whole answer to that, and a short
        silence, nothing older can follow. Where anything was heard this is tried again, for at most about
        RESYNCHRONISATION seconds, and not past ``until``: what begins is over by then, but for a first attempt,
        which there always is. A silent line is given up after the first probe, since each request tries again and
        the caller has a period to keep.
        """
        self._synchronised = False
        self.counters.resynchronisations += 1
        self._heard.clear()
        now = self.clock.now()
        probe = wire_seconds(max(map(_exchanged, PROBES)), self.baud) + self.margin + SILENCE
        give_up = min(now + RESYNCHRONISATION, max(now + QUIET, self.until - probe))
        while self._discard_until_quiet(give_up):
            letter = min(PROBES, key=self._last_asked.__getitem__)
            try:
                self._exchange(encode_request(letter), letter, ())
                late = self._read(SILENCE)
                if not late:
                    self._synchronised = self._in_session = True
                    return
                self._report(b"", late)
                self._raise_reset()
            except RobotReset:
                raise
            except RobotError:
                if not self._heard:
                    break
        self.counters.failed_resynchronisations += 1
        if self._heard:
            raise BadAnswer(
                f"what {self.name} says at {self.baud} baud makes no sense: {bytes(self._heard[-60:])!r}"
            )
        raise NoAnswer(f"{self.name} is silent")

    def close(self) -> None:
        """Give the port back; the link is of no more use."""
        if self._lost is None:
            self._lost = f"{self.name} has been closed"
        close_port(self.port)

    def _trust_the_line(self, letter: str) -> None:
        """Resynchronise if there is a reason to; a byte that nobody asked for is one."""
        if self._synchronised and self._waiting():
            self.counters.unsolicited += 1
            self._synchronised = False
        if not self._synchronised:
            try:
                self.resynchronise()
            except RobotReset:
                raise
            except RobotError as error:
                raise NoAnswer(f"{letter} was not asked, because {error}") from error

    def _discard_until_quiet(self, give_up: float) -> bool:
        """Send an empty line and throw away what comes; False when ``give_up`` comes before the quiet."""
        noise = bytearray()
        self._write(b"\n")
        quiet = False
        while not quiet and not self._reset and self.clock.now() + QUIET <= give_up:
            chunk = self._read(QUIET)
            quiet = not chunk
            noise += chunk[-_HEARD:]
        self._report(b"\n", bytes(noise))
        self._raise_reset()
        return quiet

    def _exchange(
        self, request: bytes, letter: str, values: tuple[int | str, ...]
    ) -> tuple[str, tuple[int | str, ...]]:
        """One request and its one answer: the line without its end, and its values."""
        self._asked += 1
        if letter in self._last_asked:
            self._last_asked[letter] = self._asked
        longest = COMMANDS[letter].longest_answer
        if letter == "T":
            longest = longest_turret_answer(int(values[0]), str(values[1])) or longest
        allowed = wire_seconds(len(request) + longest, self.baud) + self.margin
        deadline = self.clock.now() + allowed
        self._write(request)
        answer = bytearray()
        # A refusal may be longer than the longest answer. Past that and without an end it is no line of ours.
        while b"\n" not in answer and len(answer) <= longest + 80 and not self._reset:
            left = deadline - self.clock.now()
            # Past the deadline, what the host has kept for us since is still looked at, once.
            chunk = self._read(max(left, 0.0))
            answer += chunk
            if not chunk or left <= 0:
                break
        self._report(request, bytes(answer))
        self._raise_reset()
        if not answer:
            raise NoAnswer(f"{self.name} did not answer {letter} within {allowed * 1000:.0f} ms")
        if b"\n" not in answer and len(answer) <= longest:
            raise NoAnswer(
                f"only a part of the answer to {letter} came within {allowed * 1000:.0f} ms: {bytes(answer)!r}"
            )
        if is_refusal(bytes(answer)):
            raise Refused(f"the robot refused {request[:60]!r}: {bytes(answer[:60])!r}")
        try:
            result = parse_answer(letter, bytes(answer))
            if letter == "T":
                _check_turret(values, result)
        except ProtocolError as error:
            raise BadAnswer(str(error)) from error
        return answer[:-2].decode("ascii"), result

    def _report(self, sent: bytes, came: bytes) -> None:
        if self.on_exchange is not None:
            self.on_exchange(sent, came)

    # The port, with every way in which it can be gone made one.

    def _waiting(self) -> int:
        try:
            return self._open_port().in_waiting
        except PORT_ERRORS as error:
            raise self._gone(error) from error

    def _read(self, seconds: float) -> bytes:
        """What is there, or the first that comes within so many seconds."""
        try:
            port = self._open_port()
            port.timeout = seconds
            waiting = port.in_waiting
            chunk = port.read(waiting or 1)
            if chunk and not waiting and (waiting := port.in_waiting):  # with the first of a lump came the others
                chunk += port.read(waiting)
        except PORT_ERRORS as error:
            raise self._gone(error) from error
        self._heard += chunk
        del self._heard[:-_HEARD]
        self._look_for_boot_text(chunk)
        return chunk

    def _look_for_boot_text(self, chunk: bytes) -> None:
        seen = self._seam + chunk
        self._seam = seen[1 - _LONGEST_MARK :]
        title, mode = BOOT_MARKS
        marks = seen.count(title) + seen.count(mode)
        if marks:
            self._seam = b""
            self.counters.boot_texts += 1
            self._reset = self._reset or self._in_session

    def _raise_reset(self) -> None:
        if self._reset:
            self._synchronised = False
            raise RobotReset(f"the robot behind {self.name} was reset: its boot text came in mid-session")

    def _write(self, data: bytes) -> None:
        try:
            written = self._open_port().write(data)
        except PORT_ERRORS as error:
            raise self._gone(error) from error
        if written is not None and written < len(data):
            raise self._gone("it took only a part of what was written")
        if self.on_sent is not None:
            self.on_sent()

    def _open_port(self) -> Port:
        if self._lost is not None:
            raise LinkLost(self._lost)
        return self.port

    def _gone(self, why: object) -> LinkLost:
        self._synchronised = False
        self._lost = f"{self.name} is gone; is it unplugged, or has the program behind it ended? ({why})"
        self.close()
        return LinkLost(self._lost)


def _exchanged(letter: str) -> int:
    """Characters that go to and fro at the most for a request without values."""
    return len(encode_request(letter)) + COMMANDS[letter].longest_answer


def _check_turret(asked: tuple[int | str, ...], answered: tuple[int | str, ...]) -> None:
    """Hold a turret's answer to what was asked, and strictly where its tables know it. Raises ProtocolError."""
    number, command = int(asked[0]), str(asked[1])[:1]
    if answered[0] != number or str(answered[1])[:1] != command.lower():
        raise ProtocolError(
            f"asked T,{number},{command}, got another's answer: t,{answered[0]},{answered[1]}"[:120]
        )
    if longest_turret_answer(number, command) is not None:
        parse_turret_answer(number, command, str(answered[1]))
