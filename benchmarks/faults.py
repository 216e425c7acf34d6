"""``python -m benchmarks.faults CAMPAIGN``: what a client believes of a faulty line, judged by what the robot sent.

    structural   every fault but changes inside a number: how many stale or wrong values are accepted (none)
    bytes        bytes lost, turned over and doubled, under --verify: how many values are off by more than 60 counts
    recovery     one fault at a time: ticks until there are valid data again
    clean        no faults, under --verify: how many ticks are refused all the same

All in simulated time, each with a seed; ``--json`` prints the result as one object. The figures that stand in the
README come from the defaults.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import serial

from benchmarks.witness import CountingRobot, overhear
from brp import BrpError
from khepera_hil import chance
from khepera_hil.budget import plan
from khepera_hil.clock import SimulatedClock
from khepera_hil.controllers import PROGRAMS
from khepera_hil.errors import Implausible, LinkLost, RobotError, RobotReset
from khepera_hil.faults import Fault, Faults
from khepera_hil.faultspec import BYTE_KINDS, LINE_KINDS
from khepera_hil.khepera import Khepera
from khepera_hil.link import Link
from khepera_hil.opening import open_port
from khepera_hil.perception import Readings
from khepera_hil.plausible import AGREE
from khepera_hil.reader import Checks, Reader

__all__ = ["byte_faults", "clean", "recovery", "structural"]

PERIOD = 0.1
CALM = 5
"""Ticks around a fault in which no other strikes, for one that is judged alone."""

STRUCTURAL = "lines=0.03,frame=0.002,disconnect=2e-4:1"
"""Faults of all kinds but changes inside a number: some four in ten ticks."""

Say = Callable[[str], None]


class Watched(Reader):
    """A reader that calls ``judge`` with each answer to N or O that the link took, and how it was asked for."""

    judge: Callable[[str, tuple[int, ...], int], None]
    asked: Callable[[str], int]

    def _sensors(self, letter: str) -> tuple[int, ...]:
        before = self.asked(letter)
        values = super()._sensors(letter)
        self.judge(letter, values, before)
        return values


def structural(
    wanted: int, *, seed: int = 0, faults: str = STRUCTURAL, say: Say = lambda text: None
) -> dict[str, Any]:
    """Read N and O in ticks until so many faults have struck; the robot numbers its answers."""
    clock = SimulatedClock()
    line = Faults(faults, chance.streams(seed)["line"])
    robot = CountingRobot(clock, line)
    accepted = stale = wrong = ticks = valid = sessions = 0

    def judge(letter: str, values: tuple[int, ...], before: int) -> None:
        nonlocal accepted, stale, wrong
        accepted += 1
        number = robot.number(values)
        if number is None or number > robot.counts[letter]:
            wrong += 1
        elif number <= before:
            stale += 1

    program = plan("campaign", ("N", "O"), baud=robot.baud, period=PERIOD)
    reader: Watched | None = None
    while line.counts.total() < wanted:
        try:
            if reader is None:
                robot.open()
                sessions += 1
                reader = Watched(Khepera(Link(robot, clock, baud=robot.baud)), program)
                reader.judge, reader.asked = judge, robot.counts.__getitem__
                reader.khepera.handshake()
            reader.khepera.link.until = PERIOD * (int(clock.now() / PERIOD + 1e-9) + 1)
            reader.read(ticks)
            valid += 1
            reader.khepera.set_speed(5, 5)
        except RobotReset:
            reader = None  # as after a reset: a new session
        except RobotError:
            pass
        except (LinkLost, serial.SerialException):
            reader = None
        ticks += 1
        clock.sleep_until(PERIOD * (int(clock.now() / PERIOD + 1e-9) + 1))
        if ticks % 5000 == 0:
            say(f"{line.counts.total()} faults in {ticks} ticks: {accepted} accepted, {stale} stale, {wrong} wrong")
    return {
        "faults": line.counts.total(),
        "by_kind": dict(line.counts),
        "ticks": ticks,
        "valid_ticks": valid,
        "sessions": sessions,
        "accepted": accepted,
        "stale": stale,
        "wrong": wrong,
    }


class Tick(NamedTuple):
    """One tick of a program on the emulated robot."""

    sent: dict[str, list[tuple[int, ...]]]
    """What the robot sent in it."""
    readings: Readings | None
    failure: Exception | None


@dataclass
class _Emulated:
    """One run of a program on the emulated robot, tick by tick, with an ear at the robot's end."""

    program: str
    seed: int
    faults: str
    verify: bool
    checks: Checks = field(default_factory=Checks)

    def ticks(self, number: int) -> Iterator[Tick]:
        if "khepera_hil.ports" not in serial.protocol_handler_packages:
            serial.protocol_handler_packages.append("khepera_hil.ports")
        url = f"emulator://furnished?seed={self.seed}&clock=simulated&faults={self.faults}"
        port: Any = open_port(url, 38400)
        clock: SimulatedClock = port.clock
        sent: dict[str, list[tuple[int, ...]]] = {"N": [], "O": []}
        overhear(port.faults, lambda letter, values: sent[letter].append(tuple(int(value) for value in values)))
        controller = PROGRAMS[self.program][1]()
        rng = chance.generator(self.seed, "program")
        khepera = Khepera(Link(port, clock, baud=38400))
        reader = Reader(
            khepera,
            plan(self.program, controller.needs, baud=38400, period=PERIOD, verify=self.verify),
            self.verify,
            self.checks,
        )
        _find(khepera)
        start, blind = clock.now(), 0
        for tick in range(number):
            for answers in sent.values():
                answers.clear()
            readings: Readings | None = None
            failure: Exception | None = None
            khepera.link.until = start + (tick + 1) * PERIOD
            try:
                readings = reader.read(tick)
                decision = controller.step(readings, rng)
                blind = 0
                khepera.set_speed(decision.left, decision.right)
            except RobotReset as error:
                failure = error
                with contextlib.suppress(RobotError):
                    khepera.handshake()
            except (RobotError, BrpError) as error:
                failure = error
                blind += readings is None
                if blind > 2:
                    khepera.halt()
            yield Tick(sent, readings, failure)
            clock.sleep_until(max(clock.now(), start + (tick + 1) * PERIOD))
        port.close()


def byte_faults(
    ticks: int,
    *,
    seed: int = 0,
    rate: float = 1e-3,
    program: str = "home",
    verify: bool = True,
    part: int = 10_000,
    say: Say = lambda text: None,
) -> dict[str, Any]:
    """Run a program on the emulated robot with byte faults, a new robot and world every ``part`` ticks."""
    valid = accepted = wrong = worst = done = refused = third = 0
    off: Counter[str] = Counter()
    while done < ticks:
        number = min(part, ticks - done)
        run = _Emulated(program, seed + done // part, f"bytes={rate:g}", verify)
        for sent, readings, _ in run.ticks(number):
            if readings is None:
                continue
            valid += 1
            for letter, values in (("N", readings.proximity), ("O", readings.light)):
                if not values:
                    continue
                accepted += 1
                # Sensor by sensor, since a median's values may come from two answers.
                error = max(
                    min((abs(value - said[place]) for said in sent[letter]), default=1024)
                    for place, value in enumerate(values)
                )
                worst = max(worst, error)
                wrong += error > AGREE
                off["up to 60" if 0 < error <= AGREE else "more than 60" if error else "none"] += 1
        refused += run.checks.refused
        third += run.checks.third
        done += number
        say(f"{done} ticks, {valid} with data, {accepted} answers accepted, {wrong} wrong, worst {worst} counts")
    return {
        "program": program,
        "verify": verify,
        "rate": rate,
        "ticks": done,
        "valid_ticks": valid,
        "accepted": accepted,
        "wrong_by_more_than_60": wrong,
        "worst_counts": worst,
        "off": dict(off),
        "third_readings": third,
        "refused_ticks": refused,
    }


def clean(
    ticks: int,
    *,
    seed: int = 0,
    programs: tuple[str, ...] = ("home", "avoid"),
    part: int = 6000,
    say: Say = lambda text: None,
) -> dict[str, Any]:
    """Run programs under --verify on a line without faults: what is refused all the same."""
    result: dict[str, Any] = {}
    for program in programs:
        done = refused = third = verified = 0
        while done < ticks:
            number = min(part, ticks - done)
            run = _Emulated(program, seed + done // part, "flip=0", verify=True)
            refused += sum(isinstance(tick.failure, Implausible) for tick in run.ticks(number))
            third += run.checks.third
            verified += run.checks.verified
            done += number
            say(f"{program}: {done} ticks, {refused} refused, {third} third readings of {verified}")
        result[program] = {
            "ticks": done,
            "refused_ticks": refused,
            "refused_share": refused / done,
            "third_readings": third,
            "verified": verified,
        }
    return result


def recovery(each: int, *, seed: int = 0, say: Say = lambda text: None) -> dict[str, Any]:
    """One fault of one kind now and then, ``each`` of a kind: ticks lost until there were valid data again.

    Counted are faults that have no other within CALM ticks before and after them.
    """
    kinds = [*BYTE_KINDS, *(kind for kind in LINE_KINDS if kind not in ("boot", "disconnect"))]
    result: dict[str, Any] = {}
    everything: list[int] = []
    for place, kind in enumerate(kinds):
        found: list[int] = []
        part = 0
        while len(found) < each:
            found += _lost_ticks(kind, 1000 * seed + 100 * place + part, min(4000, 40 * each))
            part += 1
        del found[each:]
        everything += found
        result[kind] = _distribution(found)
        say(f"{kind}: {result[kind]}")
    result["all"] = _distribution(everything)
    return result


def _lost_ticks(kind: str, seed: int, number: int) -> list[int]:
    """For each fault that struck alone in so many ticks: how many ticks were lost to it."""
    clock = SimulatedClock()
    struck: list[Fault] = []
    rate = 5e-4 if kind in BYTE_KINDS else 7e-3  # one in some twenty ticks
    line = Faults(f"{kind}={rate}", seed, on_fault=struck.append)
    robot = CountingRobot(clock, line)
    khepera = Khepera(Link(robot, clock, baud=robot.baud))
    reader = Reader(khepera, plan("campaign", ("N", "O"), baud=robot.baud, period=PERIOD))
    _find(khepera)
    start = clock.now()
    good, hit = [], []
    for tick in range(number):
        before = len(struck)
        khepera.link.until = start + (tick + 1) * PERIOD
        try:
            reader.read(tick)
            khepera.set_speed(5, 5)
            good.append(True)
        except RobotError:
            good.append(False)
        clock.sleep_until(max(clock.now(), start + (tick + 1) * PERIOD))
        hit.append(len(struck) - before)
    return [
        good.index(True, tick) - tick
        for tick in range(CALM, number - CALM)
        if hit[tick] == 1 == sum(hit[tick - CALM : tick + CALM + 1]) and True in good[tick:]
    ]


def _find(khepera: Khepera) -> None:
    """A handshake may fail on a bad line; the service would try again too."""
    for _ in range(100):
        with contextlib.suppress(RobotError):
            khepera.handshake()
            return
    raise AssertionError("no robot was found in a hundred handshakes")


def _distribution(lost: list[int]) -> dict[str, Any]:
    """Of ticks lost to a fault; valid data come in the tick after them."""
    return {
        "faults": len(lost),
        "ticks_lost": {str(number): count for number, count in sorted(Counter(lost).items())},
        "p99": float(np.quantile(lost, 0.99, method="higher")),
        "max": max(lost),
    }


def main() -> int:
    """Run one campaign and print what came of it; 1 where it found what must not be."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.faults",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("campaign", choices=("structural", "bytes", "recovery", "clean"))
    parser.add_argument("--n", type=int, help="faults (structural: 10000, recovery: 1000 a kind) or ticks (100000)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--program", default="home", help="of the campaign bytes")
    parser.add_argument("--rate", type=float, default=1e-3, help="of byte faults")
    parser.add_argument(
        "--trusting", action="store_true", help="bytes: without --verify, to see what it is good for"
    )
    parser.add_argument("--json", action="store_true")
    asked = parser.parse_args()

    def say(text: str) -> None:
        print(text, file=sys.stderr, flush=True)

    began = time.perf_counter()
    if asked.campaign == "structural":
        result = structural(asked.n or 10_000, seed=asked.seed, say=say)
        failed = result["stale"] + result["wrong"]
    elif asked.campaign == "bytes":
        result = byte_faults(
            asked.n or 100_000,
            seed=asked.seed,
            rate=asked.rate,
            program=asked.program,
            verify=not asked.trusting,
            say=say,
        )
        failed = result["wrong_by_more_than_60"] and not asked.trusting
    elif asked.campaign == "recovery":
        result = recovery(asked.n or 1000, seed=asked.seed, say=say)
        failed = result["all"]["p99"] > 2
    else:
        result = clean(asked.n or 100_000, seed=asked.seed, say=say)
        failed = any(found["refused_share"] >= 0.01 for found in result.values())
    result["seconds"] = round(time.perf_counter() - began, 1)
    print(json.dumps(result) if asked.json else json.dumps(result, indent=2))
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main())
