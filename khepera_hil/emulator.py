"""The robot's end of the line: bytes in, bytes out at the wire's pace, a robot in its world behind them.

No I/O, no thread, no clock of its own: every method is told what time it is (seconds since power-up), and
time never goes back. Who carries the bytes is none of its business: ``ports`` does it inside the process,
``serve`` over a pseudo-terminal or TCP. What the robot says is ``rom``'s.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable, Sequence

from khepera_hil.protocol import RequestLines
from khepera_hil.rom import DEFAULT_FITTINGS, KHEPERA, Rom, model_for
from khepera_hil.uart import Fifo, Line
from khepera_hil.world import Reset, World
from khepera_hil.world.world import STEP

__all__ = ["BOOT_TEXT", "VERSIONS", "Company", "Emulator"]

BOOT_TEXT = KHEPERA.boot
"""What a Khepera prints when it is switched on in a serial mode."""

VERSIONS = KHEPERA.versions
"""Of the BIOS and of the protocol, as a Khepera answers B."""

_WAITING_REQUESTS = 4096
"""Requests that the robot keeps while it is still answering earlier ones; what comes on top of them is lost.
No manual names a limit."""

_LINE_ENDS = b"\r\n"


class Emulator:
    """A Khepera on its cable.

    ``baud`` is the rate of the robot's mode (its jumpers), to which each start brings it back; ``robot`` a name of
    :data:`~khepera_hil.rom.MODELS`, by default a Khepera where it has the rate; ``turrets`` names of
    :data:`~khepera_hil.rom.FITTINGS`. ``number`` says which of the world's robots it is; several that are emulated
    in one world are to be one :class:`Company`.

    ``host_baud`` is the rate of the other end, by default the same; where the two differ, bytes arrive garbled both
    ways. ``host_follows``: the other end has no rate of its own and is always at the robot's. ``fifo`` is the
    number of characters that the host's UART collects before its driver sees them (1: each at once; see
    :class:`~khepera_hil.uart.Fifo`). ``on_request`` is told each request with its moment, for a log.

    A request counts when the last bit of its CR or LF has arrived, and it is taken up when the answer before
    it has left; so requests may be sent ahead and are answered in order. The command itself takes no time:
    nothing published says how long the robot needs.

    Raises :class:`~khepera_hil.errors.UsageError` for a robot, a rate or a turret that there is not.
    """

    def __init__(
        self,
        world: World,
        baud: int,
        *,
        number: int = 1,
        host_baud: int | None = None,
        host_follows: bool = False,
        fifo: int = 1,
        robot: str | None = None,
        turrets: Sequence[str] = DEFAULT_FITTINGS,
        on_request: Callable[[float, bytes], None] | None = None,
    ) -> None:
        self.world = world
        self.body = world.robots[number - 1]
        """The robot in the world."""
        self.company: Company | None = None
        """Where other robots are in the same world: who lets everything happen in its order."""
        self.model = model_for(robot, baud)
        self.baud = baud
        """The robot's rate now."""
        self._mode_baud = baud
        self._host_follows = host_follows
        self._on_request = on_request
        self._rom = Rom(self.body, self.model, turrets)
        self._to_robot = Line(host_baud or baud, baud)
        self._to_host = Line(baud, host_baud or baud)
        self._fifo = Fifo(fifo)
        self._lines = RequestLines()
        self._waiting: deque[tuple[float, bytes]] = deque()
        self._reset_at = self._next_reset()
        self.keeps_up = True
        """Whether the world keeps up with the line. In simulated time it need not: it stands where the robot last
        did something until somebody looks (who does moves it on first), and goes in fewer and longer strides, of
        which less is remembered."""
        self._now = -1.0
        """Until when everything has happened; earlier than any time when there is something new."""
        self._to_host.send(self.model.boot, 0.0)

    @property
    def host_baud(self) -> int:
        """The rate that the other end is set to."""
        return self._to_robot.sender

    @host_baud.setter
    def host_baud(self, baud: int) -> None:
        if baud != self.host_baud:
            self._to_robot.sender = self._to_host.receiver = baud
            self._now = -1.0

    def follow(self, baud: int, now: float) -> None:
        """The other end is at this rate from ``now`` on."""
        if baud != self.host_baud:
            if self.company is not None:
                self.advance(now)  # what was said until now was said at the old one, whoever looked first
            self.host_baud = baud

    @property
    def leds(self) -> tuple[int, int]:
        """LED 0 (lateral) and 1 (front): 1 is on."""
        return self._rom.leds[0], self._rom.leds[1]

    def receive(self, data: bytes, now: float) -> None:
        """The host puts ``data`` on the wire, behind what it has not sent yet."""
        self._to_robot.send(data, now)
        self._now = -1.0

    def unsent(self, now: float) -> int:
        """How many characters the host has handed over whose last bit has not left."""
        left = (self._to_robot.free - now) * self.host_baud / 11
        return max(0, math.ceil(left - 1e-6))

    def drop_unsent(self, now: float) -> None:
        """The host forgets what it has not sent."""
        self._to_robot.clear(now)

    def advance(self, now: float) -> None:
        """Let everything happen that happens until ``now``, in its order."""
        if now == self._now:
            return
        self._now = now
        if self.company is not None:
            self.company.advance(now)
        else:
            if self._waiting or self._to_robot.pending or self._next_alarm() <= now:
                self._happen(now)
            if self.keeps_up:
                self.world.advance(now)
        if self._to_host.pending:
            self._fifo.put(self._to_host.certain(now, before=self._reset_at), self.host_baud)

    def _happen(self, now: float) -> None:
        """What is asked, and what the robot does by itself, until ``now``."""
        while (first := self.coming(now)) <= now:
            self.world.advance(first)
            self.happen(first)

    def coming(self, now: float) -> float:
        """When the robot next does something, once it has heard what comes until ``now`` and before that."""
        while True:
            first = min(self._next_answer(), self._next_alarm())
            if not self._hear(min(first, now)):
                return first
            # With one line more, which may be due before all others.

    def happen(self, moment: float) -> None:
        """Do what :meth:`coming` has named, the world being as far as ``moment``."""
        if moment == self._reset_at:
            self._restart(moment)
            self.body.due(Reset)
            self._reset_at = self._next_reset()
        elif moment == self._next_alarm():
            self._rom.act(moment)
        else:
            self._answer(self._waiting.popleft()[1], moment)

    def transmitted(self, now: float) -> bytes:
        """Take out what has come to the host's driver by ``now``."""
        self.advance(now)
        return self._fifo.shown(now)

    @property
    def talking(self) -> bool:
        """Whether anything is under way that came from the host or goes to it."""
        return bool(
            self._waiting or self._to_robot.pending or self._to_host.pending or self._fifo.next_show() is not None
        )

    def next_event(self) -> float | None:
        """A moment before which the host sees no further byte, unless it sends something (None: never).

        It may be too early, never too late: who waits for bytes sleeps until then and asks again.
        """
        first = min(self._next_answer(), self._reset_at)
        for moment in (
            self._to_robot.next_arrival(_LINE_ENDS) if self._to_robot.pending else None,
            self._to_host.next_arrival() if self._to_host.pending else None,
            self._fifo.next_show(),
        ):
            if moment is not None and moment < first:
                first = moment
        return first if first < math.inf else None

    def _hear(self, until: float) -> bool:
        """Take in the bytes that arrive until a moment, up to the first line's end: whether there were any."""
        heard = self._to_robot.arrived(until, _LINE_ENDS)
        if not heard:
            return False
        for line in self._lines.feed(bytes([byte for _, byte in heard])):
            if line and len(self._waiting) < _WAITING_REQUESTS:
                self._waiting.append((heard[-1][0], line))  # it ended with the last of them
        return True

    def _next_answer(self) -> float:
        return max(self._waiting[0][0], self._to_host.free) if self._waiting else math.inf

    def _next_alarm(self) -> float:
        """When the robot next does something that no line asked for."""
        due = self._rom.due
        return self._reset_at if due is None else min(due, self._reset_at)

    def _next_reset(self) -> float:
        """The end of the world's step in which the scenario resets the robot."""
        at = self.body.next_due(Reset)
        if at is None:
            return math.inf
        step = math.ceil(at / STEP - 1e-9)
        return (step if step * STEP >= at else step + 1) * STEP

    def _answer(self, line: bytes, moment: float) -> None:
        if self._on_request is not None:
            self._on_request(moment, line)
        reply = self._rom.answer(line, moment)
        if reply.restart:
            self._restart(moment)
        if reply.rate is not None:
            self._change_rate(reply.rate, moment)
        self._to_host.send(reply.text, moment)

    def _restart(self, moment: float) -> None:
        """Everything is as after power-up but the world; what the robot was saying breaks off."""
        self._rom.reset()
        self._waiting.clear()
        self._lines = RequestLines()
        self._to_host.clear(moment)
        self._change_rate(self._mode_baud, moment)
        self._to_host.send(self.model.boot, moment)

    def _change_rate(self, baud: int, moment: float) -> None:
        if baud == self.baud:
            return
        self.baud = baud
        self._to_host.sender = baud
        if self._host_follows:
            self._to_robot.sender = self._to_robot.receiver = self._to_host.receiver = baud
        else:
            self._to_robot.listen(baud, moment)


class Company:
    """Emulated robots of one world, which is moved on for all of them: what happens to any happens in its order.

    So it makes no difference whose bytes are asked for first, or how often. What comes at one moment comes in the
    order of the robots' numbers. Raises ValueError for robots of several worlds, or the same one twice.
    """

    def __init__(self, emulators: Iterable[Emulator]) -> None:
        self._emulators = sorted(emulators, key=lambda emulator: emulator.body.number)
        worlds = {id(emulator.world) for emulator in self._emulators}
        numbers = {emulator.body.number for emulator in self._emulators}
        if len(worlds) > 1 or len(numbers) < len(self._emulators):
            raise ValueError("robots of one company are different ones of the same world")
        for emulator in self._emulators:
            emulator.company = self

    def advance(self, now: float) -> None:
        """Let everything happen that happens until ``now``, to any of them."""
        emulators = self._emulators
        world = emulators[0].world
        moments = [emulator.coming(now) for emulator in emulators]
        while (first := min(moments)) <= now:
            number = moments.index(first)
            world.advance(first)
            emulators[number].happen(first)
            moments[number] = emulators[number].coming(now)
        world.advance(now)
