"""The robot's program: one line from the host, and what it answers and does."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from khepera_hil.protocol import (
    COMMAND_NOT_FOUND,
    LONGEST_LINE,
    PROTOCOL_ERROR,
    RequestRefused,
    encode_answer,
    parse_request,
)
from khepera_hil.rom import tools
from khepera_hil.rom.fitted import DEFAULT_FITTINGS, ask, fit
from khepera_hil.rom.models import KHEPERA, Model
from khepera_hil.turrets import TURRET_ABSENT
from khepera_hil.units import ENCODER_PULSES_PER_MM
from khepera_hil.world import Robot

__all__ = ["Reply", "Rom"]

_CHARGER, _REFLECTED, _AMBIENT, _CURRENT = 0, 1, 2, 6  # A/D inputs of a Khepera II (manual, command I)
_SENSOR_TIME = 0.0025  # s, each sensor's turn (manual, section 3.1.6)
_OPEN_BUS = 255  # what a byte of the extension bus reads where nobody drives it (proposed)
_MOVES = "CDP"
_DEMO_PERIOD = 0.1
_DEMO_SPEED = 6  # pulse/10 ms

Value = int | str


@dataclass(frozen=True)
class Reply:
    """What a line did beside the world: the bytes to send, a new rate of the line, a restart."""

    text: bytes
    rate: int | None = None
    restart: bool = False


class Rom:
    """A robot of one model, its turrets plugged on, in a world whose time somebody else moves.

    Whoever carries its bytes gives it :meth:`answer` each line, calls :meth:`act` when :attr:`due` has come, and
    :meth:`reset` when the robot starts anew. Raises UsageError for a turret that there is not.
    """

    def __init__(self, body: Robot, model: Model = KHEPERA, turrets: Sequence[str] = DEFAULT_FITTINGS) -> None:
        self.model = model
        self._body = body
        self._motion = body.motion
        self._turrets, self._port = fit(body, turrets)
        self.due: float | None = None
        """When the robot next does something by itself, seconds."""
        self._orders: dict[str, Callable[..., None]] = {
            "A": self._motion.set_speed_gains,
            "C": self._motion.set_position,
            "D": self._motion.set_speed,
            "F": self._motion.set_position_gains,
            "G": lambda *values: self._motion.set_counters(values, self._ways()),
            "J": self._motion.set_profile,
            "L": self._change_led,
            "P": self._motion.set_pwm,
            "W": self._write_bus,
        }
        self._questions: dict[str, Callable[..., Sequence[Value]]] = {
            "B": lambda: self.model.versions,
            "E": self._measured_speeds,
            "H": lambda: self._motion.counters(self._ways()),
            "I": lambda channel: (self._analog(channel),),
            "K": lambda: self._motion.status(self._measured_speeds(), self._ways()),
            "N": self._body.proximity,
            "O": self._body.light,
            "R": lambda address: (self._read_bus(address),),
        }
        self._now = 0.0
        self.reset()

    def reset(self) -> None:
        """As after power-up; what the wheels still do is physics."""
        self._motion.reset()
        self.due = None
        self.leds = [0, 0]
        """LED 0 (lateral) and 1 (front): 1 is on."""
        self._loading = False
        for turret in self._turrets.values():
            turret.reset()
        if self._port is not None:
            self._port.reset()

    def answer(self, line: bytes, now: float) -> Reply:
        """Do what ``line`` (without its terminator) asks for at ``now``; whatever it is, nothing is raised."""
        self._now = now
        if self._loading:
            return self._load(line)
        words = line.decode("ascii").split() if line.isascii() and len(line) <= LONGEST_LINE else []
        if words and words[0] in tools.TOOLS:
            return self._tool(*words)
        return Reply(self._command(line))

    def act(self, now: float) -> None:
        """One period of the demonstration: ahead, and away from what is near."""
        near = self._body.proximity()
        left, right = max(near[0] / 2, near[1], near[2]), max(near[5] / 2, near[4], near[3])
        turn = math.copysign(10, left - right) * min(1.0, max(left, right) / 400)
        ahead = _DEMO_SPEED * (1 - min(1.0, max(left, right) / 400))
        self._motion.set_speed(round(ahead + turn), round(ahead - turn))
        self.due = now + _DEMO_PERIOD

    # The protocol

    def _command(self, line: bytes) -> bytes:
        try:
            request = parse_request(line)
            if request is None:
                return b""
            letter, values = request
            if letter == "T":
                number, text = values
                told = ask(self._turrets, int(number), str(text))
                return TURRET_ABSENT if told is None else encode_answer("T", number, told)
        except RequestRefused as refused:
            return refused.reply
        if letter in self._questions:
            return encode_answer(letter, *self._questions[letter](*values))
        if letter in _MOVES:
            self.due = None  # the host's order ends the demonstration's
        self._orders[letter](*values)
        return encode_answer(letter)

    def _ways(self) -> list[float]:
        return [way * ENCODER_PULSES_PER_MM for way in self._body.wheel_travel()]

    def _measured_speeds(self) -> list[int]:
        """Pulses in the last whole 10 ms, as the robot counts them."""
        before, after = self._body.wheel_window()
        speeds = [
            math.floor(new * ENCODER_PULSES_PER_MM) - math.floor(old * ENCODER_PULSES_PER_MM)
            for old, new in zip(before, after, strict=True)
        ]
        return [max(-255, min(255, speed)) for speed in speeds]

    def _change_led(self, led: int, action: int) -> None:
        self.leds[led] = action if action < 2 else 1 - self.leds[led]

    def _analog(self, channel: int) -> int:
        if self._port is not None and (value := self._port.analog(channel)) is not None:
            return value
        if self.model.charger:
            battery, sensor = self._body.battery, int(self._now / _SENSOR_TIME) % 8
            if channel == _CHARGER:
                return 1023 if battery.charging else 0
            if channel == _REFLECTED:
                return self._body.proximity()[sensor]
            if channel == _AMBIENT:
                return self._body.light()[sensor]
            if channel == _CURRENT:
                return min(1023, round(battery.current_ma))
        return 0

    def _read_bus(self, address: int) -> int:
        data = None if self._port is None else self._port.read(address)
        return _OPEN_BUS if data is None else data

    def _write_bus(self, data: int, address: int) -> None:
        if self._port is not None:
            self._port.write(address, data)

    # The tools

    def _tool(self, name: str, *words: str) -> Reply:
        if name not in tools.tools_of(self.model):
            return Reply(COMMAND_NOT_FOUND)
        if name == "help" and len(words) <= 1:
            return Reply(tools.help_text(self.model, words[0] if words else None) or COMMAND_NOT_FOUND)
        if name == "serial" and len(words) == 1 and words[0] in map(str, self.model.rates):
            return Reply(b"", rate=int(words[0]))  # nothing is said: the host would have to follow first
        if name == "run" and len(words) == 1:
            return Reply(self._run(words[0]))
        if name == "flash" and words in (("E",), ("W",)):
            return Reply(tools.lines(f"FLASH user segments {'erased' if words == ('E',) else 'written'}"))
        if words or name in ("serial", "run", "flash"):
            return Reply(PROTOCOL_ERROR)
        if name == "restart":
            return Reply(b"", restart=True)
        if name == "sfill":
            self._loading = True
            return Reply(tools.lines("S format Motorola loader mode"))
        plain: dict[str, Callable[[], bytes]] = {
            "list": lambda: tools.listing(self.model),
            "k-team": tools.about_maker,
            "net": lambda: tools.network((number, turret.revision) for number, turret in self._turrets.items()),
            "memory": tools.memory,
            "process": lambda: tools.processes(self.due is not None),
        }
        return Reply(plain[name]())

    def _run(self, function: str) -> bytes:
        if function not in tools.functions_of(self.model):
            return COMMAND_NOT_FOUND
        start = "Run the selected application..."
        if function == "demo":
            self.due = self._now
            return tools.lines(start)
        if function == "sloader":
            self._loading = True
            return tools.lines(start, "S format Motorola loader mode")
        return tools.lines(start, "There is no application in the FLASH")

    def _load(self, line: bytes) -> Reply:
        """S records are taken in silently, and never run: there is no such processor here.

        The last record ends the download, and so does a line that is none: it is answered as usual.
        """
        if not line.startswith(b"S"):
            self._loading = False
            return self.answer(line, self._now) if line else Reply(b"")
        if line[1:2] in (b"7", b"8", b"9"):
            self._loading = False
            return Reply(tools.lines("S: download terminated"))
        return Reply(b"")
