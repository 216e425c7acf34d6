"""``emulator://ARENA?scenario=S&seed=N&clock=wall|simulated&baud=B&faults=F``: an emulated robot as a port.

ARENA is an arena's name or the path of a TOML file (``emulator:///home/me/arena.toml``); without one it is the
scenario's, or ``furnished``. ``scenario`` is a scenario's name or path; ``object`` names a thing that stands on the
arena's stage from the start; ``compression`` makes the battery so many times faster. ``seed`` is 0 by default,
``clock`` the wall's, ``baud`` the rate that the port is opened with (give another one, and the line is garbled).
``robot`` is khepera or khepera2 (by default the first that has the rate), ``turrets`` what is plugged on it, such
as ``gripper,k213`` or ``none``. ``faults`` are injected into the line (see :mod:`khepera_hil.faults`).

``robots`` is how many robots are in the arena, and ``number`` which of them this one is: 1 by default. The others
stand about, unless ports of the same ``share`` (any name) lead to them: they are opened in one process, with the
simulated clock, each in a thread of its own, and wait for each other (see :mod:`khepera_hil.ports.meeting`).

Each opening switches on a new robot in a new world; but a line that a fault has unplugged is plugged in again by
opening the same object anew, and meanwhile the robot went on as robots do.

Everything runs in the caller's thread: the world is moved on when the port is used, as far as the clock
says; with the simulated clock it is the reading and the sleeping that move the clock.
"""

from __future__ import annotations

import errno
import math
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qsl, unquote, urlsplit

import serial
from serial.serialutil import SerialBase

from khepera_hil.clock import SimulatedClock, WallClock
from khepera_hil.disturbed import Disturbed, line_faults
from khepera_hil.emulator import Emulator
from khepera_hil.errors import UsageError
from khepera_hil.faults import Faults
from khepera_hil.faultspec import Specification
from khepera_hil.ports.meeting import Meeting, Seat, meeting
from khepera_hil.rom import turrets
from khepera_hil.uart import FIFO_16550
from khepera_hil.world import MOST_ROBOTS, LinkFault, Order, World, load_scenario

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer

__all__ = ["Serial", "Witness"]

_DRIVER_BUFFER = 4096
"""Characters that the host's driver takes before ``write`` has to wait, as a Linux terminal does."""

_OF_WORLD = ("scenario", "object", "compression", "seed", "robots")
_KEYS = (*_OF_WORLD, "clock", "baud", "robot", "turrets", "faults", "number", "share")
_CLOCKS: dict[str, type[WallClock] | type[SimulatedClock]] = {"wall": WallClock, "simulated": SimulatedClock}


class Witness:
    """What the emulated world saw, up to the clock's now. Metres, radians counter-clockwise, seconds."""

    def __init__(
        self, world: World, catch_up: Callable[[], float], faults: Faults | None = None, robot: int = 1
    ) -> None:
        self._world = world
        self._robot = world.robots[robot - 1]
        self._catch_up = catch_up
        self._faults = faults

    def pose(self) -> tuple[float, float, float]:
        """The robot's true pose: x, y, theta."""
        self._catch_up()
        return self._robot.pose()

    def faults(self) -> dict[str, int]:
        """How often what was done to the line, by kind."""
        return {} if self._faults is None else dict(self._faults.counts)

    def size(self) -> tuple[float, float]:
        """The floor's width and depth; its corner is the origin."""
        width, depth = self._world.arena.size
        return width / 1000, depth / 1000

    def shapes(self) -> list[dict[str, Any]]:
        """Everything there is, at its starting pose: see :meth:`khepera_hil.world.World.shapes`."""
        return self._world.shapes(self._robot.number)

    def poses(self) -> dict[str, tuple[float, float, float]]:
        """Where the movable things are now, by name: "robot" is the one whose port this is."""
        self._catch_up()
        return self._world.poses(self._robot.number)

    def orders(self) -> list[tuple[str, bool]]:
        """The operator's orders since the last time: ``vigil`` or ``identify``, and whether it is switched on."""
        self._catch_up()
        return [(order.order, order.on) for order in self._robot.due(Order)]

    def in_view(self) -> set[str]:
        """The movers that the camera could see now."""
        self._catch_up()
        return self._world.in_view(self._robot.number)

    def heard_alarm(self) -> None:
        """The program sounded its alarm now; for the score."""
        self._catch_up()
        self._robot.heard_alarm()

    def score(self) -> dict[str, Any]:
        """The run's figures so far: see :meth:`khepera_hil.world.score.Score.figures`."""
        self._catch_up()
        return self._world.score(self._robot.number)


class Serial(SerialBase):
    """The port. ``clock`` and ``witness`` are there once it has been opened, and stay when it is closed."""

    clock: WallClock | SimulatedClock | Seat
    witness: Witness

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        self._emulator: Emulator | None = None
        self._meeting: Meeting | None = None
        self._input = bytearray()
        self._pumped = -1.0
        self.faults: Faults | None = None
        """What is done to the line, where anything is."""
        self.unplugged = False
        """Whether a fault has unplugged the line: opened again, it leads to the same robot."""
        super().__init__(*args, **kwargs)

    def open(self) -> None:
        """Switch the robot on. Raises UsageError and WorldError for a URL that makes no sense."""
        if self.is_open:
            raise serial.SerialException("Port is already open.")
        if self.port is None:
            raise serial.SerialException("Port must be configured before it can be used.")
        if self.unplugged and isinstance(self._emulator, Disturbed):
            if not self._emulator.plug_in(self.clock.now()):
                raise serial.SerialException(errno.ENOENT, f"{self.port} is unplugged")
            self._input.clear()
            self._pumped = -1.0
            self.unplugged, self.is_open = False, True
            return
        asked = _Asked(self.port)
        self._checked_baudrate()
        if asked.share is None:
            self._emulator, self.clock = self._made(asked, asked.world()), asked.clock()
        else:
            self._meeting, self._emulator, self.clock = meeting(
                asked.share, asked.shared, asked.world, partial(self._made, asked)
            )
        self._input.clear()
        self._pumped = -1.0
        if self._meeting is not None:
            self._meeting.begin(asked.number)
        if not isinstance(self.clock, WallClock):
            self.clock.on_advance = self._emulator.advance
            self._emulator.keeps_up = False
        self.is_open = True
        self.faults = self._emulator.faults if isinstance(self._emulator, Disturbed) else None
        self.witness = Witness(self._emulator.world, self._catch_up, self.faults, asked.number)

    def _made(self, asked: _Asked, world: World) -> Emulator:
        """A robot of the world, switched on."""
        settings: dict[str, Any] = {
            **asked.fittings,
            "number": asked.number,
            "host_baud": self.baudrate,
            "fifo": FIFO_16550,
        }
        baud = asked.baud or self.baudrate
        faults = asked.faults(world)
        return (
            Emulator(world, baud, **settings)
            if faults is None
            else Disturbed(world, baud, faults=faults, **settings)
        )

    def close(self) -> None:
        """Let go of the robot; its world stands still from now on, unless the line was unplugged."""
        if self.is_open:
            self._catch_up()
            self.is_open = False
            if self.unplugged:
                return
            if not isinstance(self.clock, WallClock):
                self.clock.on_advance = None
            if self._meeting is not None and self._emulator is not None:
                self._meeting.leave(self._emulator.body.number)
                self._meeting = None

    @property
    def in_waiting(self) -> int:
        """Bytes that can be read at once."""
        self._pump(self._robot())
        return len(self._input)

    @property
    def out_waiting(self) -> int:
        """Bytes written whose last bit has not left."""
        return self._robot().unsent(self.clock.now())

    def read(self, size: int = 1, /) -> bytes:
        """``size`` bytes, or those that came within ``timeout`` seconds (None: no limit, 0: do not wait).

        Raises SerialException where waiting would never end: no limit, and nothing on its way.
        """
        robot = self._robot()
        timeout = self.timeout
        deadline = math.inf if timeout is None else self.clock.now() + timeout
        now = self._pump(robot)
        while len(self._input) < size and now < deadline:
            next_event = robot.next_event()
            if next_event is None and timeout is None:
                raise serial.SerialException("nothing is on its way, and the port has no timeout")
            self.clock.sleep_until(min(deadline, math.inf if next_event is None else next_event))
            now = self._pump(robot)
        data = bytes(self._input[:size])
        del self._input[:size]
        return data

    def write(self, b: ReadableBuffer, /) -> int:
        """Hand the bytes ``b`` to the wire; waits only while more than 4096 characters have not left.

        Raises SerialTimeoutException after ``write_timeout`` seconds of that.
        """
        robot = self._robot()
        data = bytes(memoryview(b))
        now = self._pump(robot)
        limit = math.inf if self.write_timeout is None else now + self.write_timeout
        for first in range(0, len(data), _DRIVER_BUFFER):
            part = data[first : first + _DRIVER_BUFFER]
            while (over := robot.unsent(now) + len(part) - _DRIVER_BUFFER) > 0:
                if now >= limit:
                    raise serial.SerialTimeoutException("Write timeout")
                self.clock.sleep_until(min(limit, now + over * 11 / self.baudrate))
                now = self._pump(robot)
            robot.receive(part, now)
            self._pumped = -1.0
        return len(data)

    def flush(self) -> None:
        """Wait until everything that was written has left."""
        robot = self._robot()
        while (left := robot.unsent(self.clock.now())) > 0:
            self.clock.sleep_until(self.clock.now() + left * 11 / self.baudrate)
            self._pump(robot)

    def reset_input_buffer(self) -> None:
        """Forget what has come and was not read."""
        self._pump(self._robot())
        self._input.clear()

    def reset_output_buffer(self) -> None:
        """Forget what was written and has not left."""
        robot = self._robot()
        robot.drop_unsent(self._pump(robot))

    def _robot(self) -> Emulator:
        if not self.is_open or self._emulator is None:
            raise serial.PortNotOpenError
        return self._emulator

    def _pump(self, robot: Emulator) -> float:
        """Take over what has come by now."""
        now = self.clock.now()
        if now == self._pumped:  # nothing takes no time
            return now
        self._pumped = now
        if isinstance(robot, Disturbed) and robot.unplugged(now):
            self.unplugged = True
            raise serial.SerialException(errno.EIO, "the line is unplugged")
        self._input += robot.transmitted(now)
        return now

    def _catch_up(self) -> float:
        now = self.clock.now()
        if (self.is_open or self.unplugged) and self._emulator is not None:
            self._emulator.advance(now)
            self._emulator.world.advance(now)
        return now

    def _checked_baudrate(self) -> int:
        if not 0 < self.baudrate <= 4_000_000:
            raise ValueError(f"invalid baudrate: {self.baudrate!r}")
        return self.baudrate

    def _reconfigure_port(self) -> None:
        """Called by pyserial when a setting changes; only the rate means something to the wire."""
        if self._emulator is not None and self.baudrate != self._emulator.host_baud:
            self._emulator.follow(self._checked_baudrate(), self.clock.now())

    # Lines that a three-wire cable does not have; pyserial sets them on opening and on request.
    def _update_rts_state(self) -> None: ...

    def _update_dtr_state(self) -> None: ...

    def _update_break_state(self) -> None: ...


class _Asked:
    """What a port's name says. Raises UsageError and WorldError for one that makes no sense."""

    def __init__(self, url: str) -> None:
        parts = urlsplit(url)
        self._arena = unquote(parts.netloc + parts.path)
        self._given = given = _given(parts.query)
        clock = given.get("clock", "wall")
        if clock not in _CLOCKS:
            raise UsageError(f"emulator:// has no clock {clock!r}; there are {' and '.join(_CLOCKS)}")
        self.clock = _CLOCKS[clock]
        self.robots = _whole("robots", given.get("robots", "1"))
        if not 1 <= self.robots <= MOST_ROBOTS:
            raise UsageError(f"emulator:// takes from 1 to {MOST_ROBOTS} robots, not {self.robots}")
        self.number = _whole("number", given.get("number", "1"))
        if not 1 <= self.number <= self.robots:
            raise UsageError(f"emulator:// has robots 1 to {self.robots} here, but no number {self.number}")
        self.share = given.get("share")
        if self.share is not None and clock != "simulated":
            raise UsageError("emulator:// shares a world in simulated time only; add clock=simulated")
        self._seed = _whole("seed", given.get("seed", "0"))
        self.baud = _whole("baud", given["baud"]) if "baud" in given else None
        """The robot's rate (None: the port's)."""
        self.fittings: dict[str, Any] = {"robot": given["robot"]} if "robot" in given else {}
        if "turrets" in given:
            self.fittings["turrets"] = turrets(given["turrets"])
        self._faults = Specification.parse(given["faults"]) if "faults" in given else None
        rules = () if self.share is None or self._faults is None else self._faults.rules
        if any(rule.kind == "disconnect" for rule in rules):
            raise UsageError("emulator:// does not unplug the line of a shared world; leave disconnect out")

    @property
    def shared(self) -> dict[str, object]:
        """What all who share the world must ask for alike."""
        return {"arena": self._arena, **{key: self._given.get(key) for key in _OF_WORLD}}

    def world(self) -> World:
        """The world, furnished."""
        given, arena = self._given, self._arena
        scenario = load_scenario(given["scenario"]) if "scenario" in given else None
        return World(
            arena.rstrip("/") or arena or (scenario.world if scenario is not None else None) or "furnished",
            self._seed,
            scenario,
            compression=_factor(given["compression"]) if "compression" in given else None,
            present=given.get("object"),
            robots=self.robots,
        )

    def faults(self, world: World) -> Faults | None:
        """What goes wrong on the line, if anything may."""
        if self._faults is None and world.robots[self.number - 1].next_due(LinkFault) is None:
            return None
        return line_faults(self._faults or Specification(()), self._seed, self.number)


def _given(query: str) -> dict[str, str]:
    """The keys and values of a port's name."""
    given: dict[str, str] = {}
    # A plus is a plus here, as in disconnect@30+5, and no blank.
    for key, value in parse_qsl(query.replace("+", "%2B"), keep_blank_values=True):
        if key not in _KEYS:
            raise UsageError(f"emulator:// knows no {key!r}; there are {', '.join(_KEYS)}")
        if key in given:
            raise UsageError(f"emulator:// takes one {key}, not both {given[key]!r} and {value!r}")
        given[key] = value
    return given


def _whole(key: str, text: str) -> int:
    if not text.isascii() or not text.isdigit():
        raise UsageError(f"emulator:// takes a whole number for {key}, not {text!r}")
    return int(text)


def _factor(text: str) -> float:
    try:
        factor = float(text)
    except ValueError:
        factor = math.nan
    if not 0.01 <= factor <= 1000:
        raise UsageError(f"emulator:// takes a number from 0.01 to 1000 for compression, not {text!r}")
    return factor
