"""``khepera-hil check``: a robot, its line and this computer, before anything moves."""

from __future__ import annotations

import contextlib
import json
import secrets
import sys
from collections.abc import Sequence
from contextlib import closing
from typing import Any

import serial

from khepera_hil.adapter import latency_ms
from khepera_hil.budget import RESERVE
from khepera_hil.budget import needed as seconds_needed
from khepera_hil.checkup import PLACES, TURRETS, RoundTrips, Watch, budgets, inputs, round_trips, turrets, watch
from khepera_hil.clock import WallClock
from khepera_hil.commands.address import port_url
from khepera_hil.commands.parser import Parser, baud, number
from khepera_hil.controllers import PROGRAMS
from khepera_hil.errors import RobotError
from khepera_hil.khepera import Khepera
from khepera_hil.link import Link
from khepera_hil.opening import open_port
from khepera_hil.protocol import BAUD_RATES
from khepera_hil.quantiles import Quantiles

__all__ = ["main"]

DARK = 450
"""Counts of ambient light above which it is dark for a sensor (Khepera User Manual 5.02, figure 10)."""

BRIGHT = 60
"""Counts below which a lamp is in its face."""

SATURATED = 1020
"""Counts of proximity that cannot rise."""

INPUTS = {0: "charger", 1: "reflected light", 2: "ambient light"}
"""A Khepera II's A/D inputs that are not free (Khepera II User Manual 1.1, appendix A); 6 is a current."""

EPILOG = """\
Lines that begin with ! say what should be looked at.

examples:
  khepera-hil check --port /dev/ttyUSB0
  khepera-hil check --port emulator --json | tail -n 1

exit codes: 0 all is well  1 something should be looked at  2 wrong arguments  3 port  4 robot
"""


def main(arguments: Sequence[str]) -> int:
    """Look at everything and print it; 1 where something should be looked at."""
    asked = _parser().parse_args(arguments)
    url = port_url(asked.port, None, fast=False, seed=secrets.randbits(32))
    # From here on pyserial knows emulator://.
    if "khepera_hil.ports" not in serial.protocol_handler_packages:
        serial.protocol_handler_packages.append("khepera_hil.ports")
    remarks: list[str] = []
    with closing(open_port(url, asked.baud, remarks.append)) as port:
        khepera = Khepera(Link(port, getattr(port, "clock", None) or WallClock(), baud=asked.baud))
        found = _look(khepera, asked.n, asked.period, asked.seconds)
        held = latency_ms(str(port.port)) if "://" not in url else None
    _print(found, khepera, asked.period, held)
    remarks += found["remarks"]
    for remark in remarks:
        print(f"! {remark}")
    if not remarks:
        print("all is well; no wheel was moved")
    if asked.json:
        print(
            json.dumps({"port": asked.port, "baud": asked.baud, "period_s": asked.period, **_plain(found, remarks)})
        )
    return 1 if remarks else 0


def _look(khepera: Khepera, each: int, period: float, seconds: float) -> dict[str, Any]:
    _progress("looking for the robot")
    versions = khepera.handshake()
    found: dict[str, Any] = {"versions": versions, "speeds": (0, 0)}
    with contextlib.suppress(RobotError):
        found["speeds"] = khepera.speeds()
    _progress("turrets and inputs")
    found["turrets"] = turrets(khepera)
    found["net"] = _net(khepera)
    found["inputs"] = inputs(khepera)
    _progress(f"{each} round trips of each kind")
    found["trips"] = round_trips(khepera, each)
    _progress(f"{seconds:g} s of sensors")
    found["watch"] = watch(khepera, period, seconds)
    found["budgets"] = budgets({name: one.make().needs for name, one in PROGRAMS.items()}, period)
    needed = seconds_needed(("N", "O"), khepera.link.baud)
    found["remarks"] = [*_of_the_line(found, needed, period), *_of_the_sensors(found["watch"])]
    return found


def _net(khepera: Khepera) -> list[str]:
    """What the robot's own tool says of its turrets; nothing where it knows no such tool."""
    try:
        printed = khepera.link.tool("net")
    except RobotError:
        return []
    lines = [line.strip() for line in printed.splitlines()]
    return [line for line in lines if line and "not found" not in line]


def _of_the_line(found: dict[str, Any], needed: float, period: float) -> list[str]:
    remarks = []
    if any(found["speeds"]):
        remarks.append(f"the wheels turn at {found['speeds']}: nobody of ours told them to")
    lost = sum(trips.lost for trips in found["trips"].values())
    asked = sum(trips.asked for trips in found["trips"].values())
    if lost:
        remarks.append(f"{lost} of {asked} requests had no usable answer: see the cable and its plugs")
    seen: Watch = found["watch"]
    if needed > (1 - RESERVE) * period:
        remarks.append(
            f"N and O need {1000 * needed:.0f} ms at this rate: a loop of {1000 * period:g} ms cannot read them"
        )
    elif seen.missed:
        due = seen.ticks + seen.missed
        remarks.append(f"the loop missed {seen.missed} of {due} deadlines: is this computer busy?")
    return remarks


def _of_the_sensors(seen: Watch) -> list[str]:
    if not seen.proximity:
        return ["no sensor could be read"]
    remarks = []
    for name, values in (("proximity", seen.proximity), ("light", seen.light)):
        for place, one in zip(PLACES, zip(*values, strict=True), strict=True):
            low, high = min(one), max(one)
            if name == "proximity" and low >= SATURATED:
                remarks.append(f"proximity at {place} is always {low} or more: does something touch it?")
            elif low == high and len(one) > 5 and not (name == "proximity" and low == 0):
                remarks.append(f"{name} at {place} is always {low}, without any noise: is it stuck?")
    return remarks


def _print(found: dict[str, Any], khepera: Khepera, period: float, held: int | None) -> None:
    link = khepera.link
    print(f"port      {link.name} at {link.baud} baud{'' if held is None else f', latency timer {held} ms'}")
    second = found["versions"][0] >= "6"
    name = "Khepera II" if second else "Khepera"
    print(f"robot     {name}: BIOS {found['versions'][0]}, protocol {found['versions'][1]}")
    fitted = [f"{number} {TURRETS[number]} {version}" for number, version in found["turrets"].items()]
    print(f"turrets   {', '.join(fitted) or 'none answers'}")
    for line in found["net"]:
        print(f"          {line}")
    trips: dict[str, RoundTrips] = found["trips"]
    print("line      round trips, ms     median      p99   lost")
    for letter, of_letter in trips.items():
        print(
            f"          {letter:<17} {_ms(of_letter.seconds, 0.5):>8} {_ms(of_letter.seconds, 0.99):>8} "
            f"{of_letter.lost:>3} of {of_letter.asked}"
        )
    room = 1000 * (1 - RESERVE) * period
    print(f"budget    ms a tick on the wire, of {room:g} that may be used; in brackets with --verify")
    print("          " + " " * 12 + "".join(f"{rate:>16}" for rate in BAUD_RATES))
    for program, rates in found["budgets"].items():
        print(f"          {program:12}" + "".join(f"{_budget(figures):>16}" for figures in rates.values()))
    seen: Watch = found["watch"]
    if seen.proximity:
        print("sensors   " + " " * 12 + "".join(f"{place:>12}" for place in PLACES))
        for name, values in (("proximity", seen.proximity), ("light", seen.light)):
            ranges = [f"{min(one)}..{max(one)}" for one in zip(*values, strict=True)]
            print(f"          {name:12}" + "".join(f"{text:>12}" for text in ranges))
        light = [value for reading in seen.light for value in reading]
        look = "dark" if min(light) >= DARK else "a lamp is near" if min(light) <= BRIGHT else "some light"
        print(f"          {look}; {len(seen.proximity)} readings of {seen.ticks}")
    channels = [_input(channel, value, second) for channel, value in found["inputs"].items()]
    print(f"inputs    {', '.join(channels) or 'none could be read (command I)'}")
    print(
        f"loop      ticks of {1000 * period:g} ms came late by {_ms(seen.late, 0.5)} ms (median), "
        f"{_ms(seen.late, 0.99)} (p99), {1000 * seen.latest:.2f} (max of {seen.ticks})"
    )


def _input(channel: int, value: int, second: bool) -> str:
    if second and channel == 6:
        return f"{value} mA used"
    what = f" {INPUTS[channel]}" if second and channel in INPUTS else ""
    return f"{channel}{what}: {4.09 * value / 1024:.2f} V"


def _budget(figures: dict[str, Any]) -> str:
    plain = f"{figures['ms']:.0f}{'' if figures['fits'] else ' no'}"
    return f"{plain} ({figures['verified_ms']:.0f}{'' if figures['verified_fits'] else ' no'})"


def _ms(seconds: Quantiles, share: float) -> str:
    found = seconds.at(share)
    return "-" if found is None else f"{1000 * found:.2f}"


def _plain(found: dict[str, Any], remarks: list[str]) -> dict[str, Any]:
    """The same for a program: plain values, milliseconds."""
    seen: Watch = found["watch"]

    def ranges(values: list[tuple[int, ...]]) -> list[list[int]]:
        return [[min(one), max(one)] for one in zip(*values, strict=True)]

    return {
        "robot": {"bios": found["versions"][0], "protocol": found["versions"][1]},
        "turrets": {str(number): version for number, version in found["turrets"].items()},
        "round_trips_ms": {
            letter: {
                "p50": _rounded(trips.seconds, 0.5),
                "p99": _rounded(trips.seconds, 0.99),
                "asked": trips.asked,
                "lost": trips.lost,
            }
            for letter, trips in found["trips"].items()
        },
        "budget": found["budgets"],
        "proximity": ranges(seen.proximity),
        "light": ranges(seen.light),
        "inputs": {str(channel): value for channel, value in found["inputs"].items()},
        "loop_late_ms": {
            "p50": _rounded(seen.late, 0.5),
            "p99": _rounded(seen.late, 0.99),
            "max": round(1000 * seen.latest, 3),
            "ticks": seen.ticks,
            "missed": seen.missed,
        },
        "remarks": remarks,
    }


def _rounded(seconds: Quantiles, share: float) -> float | None:
    found = seconds.at(share)
    return None if found is None else round(1000 * found, 3)


def _progress(what: str) -> None:
    if sys.stderr is not None and sys.stderr.isatty():
        print(f"\r\x1b[K{what} ...", end="\r", file=sys.stderr, flush=True)


def _parser() -> Parser:
    parser = Parser("khepera-hil check", "Look at a robot, its line and this computer. No wheel is moved.", EPILOG)
    add = parser.add_argument
    add("--port", default="emulator", help="a device, a URL of pyserial's, or emulator (default: %(default)s)")
    add("--baud", type=baud, default=38400, help="the rate of the robot's mode (default: %(default)s)")
    add(
        "--period",
        type=number(0.01, 2.0, "seconds"),
        default=0.1,
        metavar="SECONDS",
        help="of a tick, for the budget and the loop (default: %(default)s)",
    )
    add("--n", type=_count, default=100, help="round trips of each kind (default: %(default)s)")
    add(
        "--seconds",
        type=number(0.1, 3600.0, "seconds"),
        default=3.0,
        metavar="SECONDS",
        help="for which the sensors are watched (default: %(default)s)",
    )
    add("--json", action="store_true", help="the last line on standard output is the result as one JSON object")
    return parser


def _count(text: str) -> int:
    """A type for argparse: how often."""
    return int(number(1, 100_000, "times")(text))
