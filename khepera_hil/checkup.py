"""What can be found out about a robot, its line and this computer without moving a wheel.

Each function asks the robot for something and returns plain values; what they mean to the user is said by
``commands.check``. What the line does not carry is counted, or missing; all of them raise LinkLost only.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from khepera_hil.budget import RESERVE, needed
from khepera_hil.errors import RobotError
from khepera_hil.khepera import Khepera
from khepera_hil.perception import Need
from khepera_hil.protocol import BAUD_RATES, COMMANDS
from khepera_hil.quantiles import Quantiles
from khepera_hil.scheduler import beats

__all__ = ["PLACES", "RoundTrips", "Watch", "budgets", "inputs", "round_trips", "turrets", "watch"]

PLACES = tuple(place.name for place in COMMANDS["N"].answer)
"""Of the eight sensors."""

TURRETS = {1: "gripper", 2: "K213 vision", 3: "laser GPS", 4: "radio"}
"""Intelligent turrets by their number on the robot's network."""

_MEASURED = ("B", "E", "N", "O")  # what is asked for round trips: short and long answers


@dataclass
class RoundTrips:
    """Of one command: seconds from the request to its whole answer, and how often there was none."""

    seconds: Quantiles = field(default_factory=Quantiles)
    asked: int = 0
    lost: int = 0


@dataclass
class Watch:
    """What the sensors said in some time, and how punctual the loop was that asked them."""

    proximity: list[tuple[int, ...]] = field(default_factory=list)
    light: list[tuple[int, ...]] = field(default_factory=list)
    late: Quantiles = field(default_factory=Quantiles)
    """Seconds by which the loop's ticks came late."""
    latest: float = 0.0
    ticks: int = 0
    missed: int = 0
    without_data: int = 0


def round_trips(khepera: Khepera, each: int) -> dict[str, RoundTrips]:
    """Ask B, E, N and O so many times, in turn."""
    found = {letter: RoundTrips() for letter in _MEASURED}
    clock = khepera.link.clock
    for _ in range(each):
        for letter, trips in found.items():
            _bring_back(khepera)
            began = clock.now()
            trips.asked += 1
            try:
                khepera.link.ask(letter)
            except RobotError:
                trips.lost += 1
            else:
                trips.seconds.add(clock.now() - began)
    return found


def watch(khepera: Khepera, period: float, seconds: float) -> Watch:
    """Read proximity and light every ``period`` seconds, for so long, as a program does."""
    found = Watch()
    for beat in beats(khepera.link.clock, period, duration=seconds, stopped=lambda: False):
        found.ticks += 1
        found.missed += beat.missed
        found.late.add(beat.late)
        found.latest = max(found.latest, beat.late)
        _bring_back(khepera)
        try:
            proximity, light = khepera.proximity(), khepera.light()
        except RobotError:
            found.without_data += 1
        else:
            found.proximity.append(proximity)
            found.light.append(light)
    return found


def turrets(khepera: Khepera) -> dict[int, str]:
    """The turrets that answer when they are asked for their version: number, and what they answered."""
    found = {}
    for number in TURRETS:
        _bring_back(khepera)
        try:
            _, answer = khepera.link.ask("T", number, "B")
        except RobotError:  # refused by a robot without it; some say nothing at all
            continue
        found[number] = str(answer).partition(",")[2].replace(",", ".")
    return found


def inputs(khepera: Khepera) -> dict[int, int]:
    """The A/D inputs (command I) by channel, 4 mV a count; those that could be read."""
    found: dict[int, int] = {}
    for channel in range(COMMANDS["I"].request[0].high + 1):
        _bring_back(khepera)
        with contextlib.suppress(RobotError):
            found[channel] = int(khepera.link.ask("I", channel)[0])
    return found


def _bring_back(khepera: Khepera) -> None:
    """Find the robot again after trouble, so that one bad answer does not count as two; also when it was reset."""
    if not khepera.link.synchronised:
        with contextlib.suppress(RobotError):
            khepera.link.begin()


def budgets(
    programs: Mapping[str, Iterable[str | Need]], period: float
) -> dict[str, dict[int, dict[str, float | bool]]]:
    """For each program and baud rate: ms on the wire in its fullest tick, plainly and verified, and what fits."""
    return {
        name: {baud: _figures(list(needs), baud, period) for baud in BAUD_RATES} for name, needs in programs.items()
    }


def _figures(needs: Sequence[str | Need], baud: int, period: float) -> dict[str, float | bool]:
    room = (1 - RESERVE) * period
    plain, verified = needed(needs, baud), needed(needs, baud, verify=True)
    return {
        "ms": round(1e3 * plain, 1),
        "fits": plain <= room,
        "verified_ms": round(1e3 * verified, 1),
        "verified_fits": verified <= room,
    }
