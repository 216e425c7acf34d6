"""What is plugged onto the robot: turrets that answer T, and the passive one on the extension bus."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

from khepera_hil.errors import UsageError
from khepera_hil.turrets import CAMERA, GRIPPER, SCAN_PERIODS, TURRETS, encode_turret_answer, parse_turret_request
from khepera_hil.world import Robot

__all__ = ["DEFAULT_FITTINGS", "FITTINGS", "GeneralIO", "Intelligent", "ask", "fit", "turrets"]

_FULL = 1023
_VOLTS_A_STEP = 4.09 / 1024  # of the A/D converter (manual, command I)
_DIGITAL = 32  # the general I/O turret's digital port on the extension bus (RoadNarrows)
_BATTERY, _CONTACT = 3, 4


class Intelligent(Protocol):
    """A turret with a processor of its own."""

    number: int
    revision: tuple[int, int]

    def reset(self) -> None:
        """As after power-up."""

    def answer(self, letter: str, values: Sequence[int]) -> tuple[int, ...]:
        """What it answers to a command of its table."""


class Gripper:
    """Answers as a gripper with nothing between its fingers; the world has none, so it moves nothing.

    It reaches every position at once: nothing published says how long it takes.
    """

    number = GRIPPER.number
    revision = (1, 0)

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Open, the arm up."""
        self._closed = 0
        self._arm = 180

    def answer(self, letter: str, values: Sequence[int]) -> tuple[int, ...]:
        """Air does not conduct and lets light through; the jumpers are those of turret 1."""
        if letter == "D":
            (self._closed,) = values
        elif letter == "E":
            (self._arm,) = values
        elif letter == "H":
            return (self._arm if values[0] else self._closed,)
        else:
            return {"B": self.revision, "F": (255,), "G": (255,), "J": (self.number,)}[letter]
        return ()


class Camera:
    """The K213, which looks at the world."""

    number = CAMERA.number
    revision = (1, 2)

    def __init__(self, body: Robot) -> None:
        self._body = body
        self._reads: dict[str, Callable[[list[int]], Sequence[int]]] = {
            "N": lambda pixels: pixels,
            "M": lambda pixels: [
                even & 0xF0 | odd >> 4 for even, odd in zip(pixels[::2], pixels[1::2], strict=True)
            ],
            "S": lambda pixels: pixels[::2],
            "T": lambda pixels: pixels[::4],
            "O": lambda pixels: (pixels.index(max(pixels)),),
            "P": lambda pixels: (pixels.index(min(pixels)),),
        }

    def reset(self) -> None:
        """It chooses its own period again."""
        self._body.set_camera_period(SCAN_PERIODS[0])

    def answer(self, letter: str, values: Sequence[int]) -> tuple[int, ...]:
        """Everything is read from the frame that is held now."""
        if letter == "B":
            return self.revision
        if letter == "U":
            self._body.set_camera_period(SCAN_PERIODS[values[0]])
            return ()
        if letter == "L":
            return divmod(self._body.camera_light(), 256)
        pixels = self._body.camera()
        if letter in "QR":
            return tuple(pixels[values[0] : values[0] + (8 if letter == "Q" else 16)])
        return tuple(self._reads[letter](pixels))


class GeneralIO:
    """The general I/O turret, which has no processor: a digital port on the extension bus, and A/D inputs.

    As the watchman needs it (nothing published says how the paper's robot was wired): bit 0 of the port drives the
    micro-turbine, input 3 has half of the battery's voltage, input 4 is high while the base's contacts charge.
    """

    def __init__(self, body: Robot) -> None:
        self._body = body
        self._port = 0

    def reset(self) -> None:
        """The port's pins fall to 0."""
        self.write(_DIGITAL, 0)

    def write(self, address: int, data: int) -> None:
        """Other addresses are nobody's."""
        if address == _DIGITAL:
            self._port = data
            self._body.set_turbine(bool(data & 1))

    def read(self, address: int) -> int | None:
        """The port's pins read as they are driven."""
        return self._port if address == _DIGITAL else None

    def analog(self, channel: int) -> int | None:
        """One of its inputs, 0..1023."""
        if channel == _BATTERY:
            return min(_FULL, round(self._body.battery.volts / 2 / _VOLTS_A_STEP))
        if channel == _CONTACT:
            return _FULL if self._body.battery.charging else 0
        return None


FITTINGS = ("gripper", "k213", "genio")
"""What can be plugged on, by name."""

DEFAULT_FITTINGS = ("k213", "genio")
"""The night watchman's: its camera, and its micro-turbine's port."""


def turrets(text: str) -> tuple[str, ...]:
    """The names in a list such as ``k213,genio``; ``none`` is none. Raises UsageError."""
    names = [name.strip() for name in text.split(",")] if text.strip() != "none" else []
    for name in names:
        if name not in FITTINGS:
            raise UsageError(f"there is no turret {name!r}; there are {', '.join(FITTINGS)}")
    return tuple(dict.fromkeys(names))


def fit(body: Robot, names: Sequence[str]) -> tuple[dict[int, Intelligent], GeneralIO | None]:
    """The turrets of these names, the intelligent ones by number. Raises UsageError."""
    turrets(",".join(names) or "none")
    makers: dict[str, Callable[[], Intelligent]] = {"gripper": Gripper, "k213": lambda: Camera(body)}
    fitted = [make() for name, make in makers.items() if name in names]
    return {turret.number: turret for turret in fitted}, GeneralIO(body) if "genio" in names else None


def ask(fitted: dict[int, Intelligent], number: int, text: str) -> str | None:
    """What the turret ``number`` answers to ``text``; None where none is fitted. Raises RequestRefused."""
    turret = fitted.get(number)
    if turret is None or number not in TURRETS:
        return None
    letter, values = parse_turret_request(number, text)
    return encode_turret_answer(number, letter, *turret.answer(letter, values))
