"""The guard, on whole runs over a real pseudo-terminal, with the robot's end as the witness.

    python -m benchmarks.guard kill  [--count 100] [--busy N] [--realtime] [--json]
    python -m benchmarks.guard hang  [--count 100] [--busy N] [--realtime] [--json]
    python -m benchmarks.guard quiet [--seconds 3600] [--busy 2] [--realtime] [--json]

``kill`` and ``hang`` start a run, send it SIGKILL or SIGSTOP at a moment drawn at random while its wheels move, and
take the time until ``D,0,0`` is at the robot's end. A stopped run is woken again, and must end by itself. Each time
the log must hold every tick that was acknowledged (the service says so to its manager, whose socket is ours) and
the speeds that the robot got, in their order. ``quiet`` lets one run go on and counts what the guard did.
``--busy`` spins so many processes beside.
"""

from __future__ import annotations

import argparse
import fcntl
import json
import multiprocessing
import os
import pty
import random
import select
import signal
import socket
import statistics
import struct
import subprocess
import sys
import tempfile
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

from khepera_hil.emulator import Emulator
from khepera_hil.guard import LOG as GUARD_LOG
from khepera_hil.protocol import RequestLines
from khepera_hil.recording import LOG
from khepera_hil.uart import FIFO_16550
from khepera_hil.world import World

BAUD = 38400
STOP = b"D,0,0"
TAKEN_BACK = 0.05
"""Seconds within which an order that a service sent as it woke must be taken back, on a busy machine too."""

_TCGETS2 = 0x802C542A


@dataclass
class Witness:
    """The robot's end of a pseudo-terminal, and what it was told and when."""

    told: list[tuple[float, bytes]] = field(default_factory=list)
    acknowledged: int = 0
    ready: bool = False

    def __post_init__(self) -> None:
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.device = os.ttyname(self._slave)
        self._robot = Emulator(World("empty", 1), BAUD, fifo=FIFO_16550)
        self._robot.host_baud = BAUD
        self._lines = RequestLines()
        self._origin = time.monotonic()
        self._manager = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.address = f"@khepera-hil-benchmark-{os.getpid()}-{id(self)}"
        self._manager.bind("\0" + self.address[1:])
        self._manager.setblocking(False)

    def close(self) -> None:
        """Unplug."""
        os.close(self._master)
        os.close(self._slave)
        self._manager.close()

    def serve(self, until: Callable[[], bool], seconds: float) -> bool:
        """Be a robot until it is true, for so many seconds at the most; whether it became true."""
        end = time.monotonic() + seconds
        while not (done := until()) and time.monotonic() < end:
            self._step(min(0.05, max(0.0, end - time.monotonic())))
        return done

    def moving(self) -> list[tuple[float, bytes]]:
        """The speeds that are not nought."""
        return [(at, line) for at, line in self.told if line != STOP]

    def _step(self, longest: float) -> None:
        now = time.monotonic() - self._origin
        answer = self._robot.transmitted(now)
        if answer:
            with suppress(BlockingIOError):  # nobody fetches it
                os.write(self._master, answer)
        due = self._robot.next_event()
        wait = longest if due is None else min(longest, max(0.0, due - (time.monotonic() - self._origin)))
        readable, _, _ = select.select([self._master, self._manager.fileno()], [], [], wait)
        if self._manager.fileno() in readable:
            said = self._manager.recv(1000)
            self.acknowledged += said == b"WATCHDOG=1"
            self.ready |= said.startswith(b"READY=1")
        if self._master in readable:
            at = time.monotonic()
            data = os.read(self._master, 4096)
            self.told += [(at, line) for line in self._lines.feed(data) if line.startswith(b"D")]
            rate: int = struct.unpack("36xII", fcntl.ioctl(self._slave, _TCGETS2, bytes(44)))[1]
            self._robot.host_baud = rate or BAUD
            self._robot.receive(data, at - self._origin)


@dataclass
class Run:
    """A service, started as a user starts it."""

    process: subprocess.Popen[bytes]
    runs: Path

    @property
    def folder(self) -> Path:
        """Its recording."""
        return next(self.runs.iterdir())

    def ticks(self) -> list[dict[str, Any]]:
        """All that it acknowledged, and perhaps half a line."""
        text = (self.folder / LOG).read_bytes()
        return [json.loads(line) for line in text[: text.rfind(b"\n") + 1].splitlines()]


@contextmanager
def started(witness: Witness, runs: Path, *options: str) -> Iterator[Run]:
    """A run of ``avoid``, wheels in motion."""
    words = ["--port", witness.device, "--program", "avoid", "--seed", "1", "--runs", str(runs), *options]
    process = subprocess.Popen(
        [sys.executable, "-m", "khepera_hil", *words],
        env={**os.environ, "NOTIFY_SOCKET": witness.address},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        if not witness.serve(lambda: witness.ready and bool(witness.moving()), 120.0):
            raise SystemExit("the run did not start")
        yield Run(process, runs)
    finally:
        process.kill()
        process.wait()


def kept(witness: Witness, ticks: list[dict[str, Any]]) -> list[str]:
    """What is wrong with a log, held against the witness; nothing, it is hoped."""
    wrong = []
    if [tick["tick"] for tick in ticks] != list(range(len(ticks))):
        wrong.append("a gap in the ticks' numbers")
    if len(ticks) < witness.acknowledged:
        wrong.append(f"{witness.acknowledged} ticks acknowledged, {len(ticks)} in the log")
    logged = [
        "D,{},{}".format(*tick["command"]).encode() for tick in ticks if tick["command"] not in (None, [0, 0])
    ]
    told = [line for _, line in witness.moving()]
    rest = iter(told)
    if not all(line in rest for line in logged):  # each in what is left behind the one before
        wrong.append("the log has speeds that the robot was not told, or not in this order")
    # The last order may be with the robot and its tick not yet done; and an order may have come whose confirmation
    # did not, which its tick says.
    unconfirmed = sum(bool(tick["draws"]) and tick["command"] is None for tick in ticks)
    if len(told) - len(logged) > 1 + unconfirmed:
        wrong.append(f"{len(told)} speeds at the robot, {len(logged)} in the log, {unconfirmed} unconfirmed")
    return wrong


def once(how: str, chance: random.Random, options: list[str]) -> dict[str, Any]:
    """One run that is killed or held up: how long the wheels turned on, and what went wrong."""
    with tempfile.TemporaryDirectory() as folder:
        witness = Witness()
        try:
            with started(witness, Path(folder), *options) as run:
                witness.serve(lambda: False, chance.uniform(0.3, 1.3))
                count = len(witness.told)
                began = time.monotonic()
                os.kill(run.process.pid, signal.SIGKILL if how == "kill" else signal.SIGSTOP)
                wrong, taken_back = list[str](), 0
                if not witness.serve(lambda: any(line == STOP for _, line in witness.told[count:]), 10.0):
                    return {"seconds": None, "wrong": ["the wheels were never told to stop"], "taken_back": 0}
                stopped = next(at for at, line in witness.told[count:] if line == STOP)
                witness.serve(lambda: False, 0.1)
                if len([line for at, line in witness.told if at >= stopped and line == STOP]) < 2:
                    wrong.append("the order was not repeated")
                ticks = run.ticks()
                if any(at > stopped for at, _ in witness.moving()):
                    wrong.append("set in motion again")
                if how == "hang":
                    more, taken_back = woken(witness, run, stopped)
                    wrong += more
                    ticks = run.ticks()
                if not witness.serve((run.folder / GUARD_LOG).exists, 5.0):
                    wrong.append("the guard left no line")
                found = {"seconds": stopped - began, "wrong": wrong + kept(witness, ticks)}
                return {**found, "taken_back": taken_back}
        finally:
            witness.close()


def woken(witness: Witness, run: Run, stopped: float) -> tuple[list[str], int]:
    """A service that wakes must end by itself, wheels at rest; what is wrong, and how many orders it took back."""
    os.kill(run.process.pid, signal.SIGCONT)
    if not witness.serve(lambda: run.process.poll() is not None, 30.0):
        return ["it did not end when it was woken"], 0
    wrong = [] if run.process.returncode == 7 else [f"it ended with {run.process.returncode}"]
    # Held up between its look at the guard and its order it sends that one, sees, and takes it back at once.
    later = [(at, line) for at, line in witness.told if at > stopped]
    for (at, line), (after, taken_back) in pairwise(later):
        if line != STOP and (taken_back != STOP or after - at > TAKEN_BACK):
            wrong.append(f"set in motion again by {line!r} for {1e3 * (after - at):.0f} ms")
    if later[-1][1] != STOP:
        wrong.append("the last order was to move")
    return wrong, sum(line != STOP for _, line in later)


def quiet(seconds: float, options: list[str]) -> dict[str, Any]:
    """One long run: did the guard act, and how near was it?"""
    with tempfile.TemporaryDirectory() as folder:
        witness = Witness()
        try:
            with started(witness, Path(folder), *options) as run:
                began = time.monotonic()
                witness.serve(lambda: run.process.poll() is not None, seconds)
                lasted = time.monotonic() - began
                trips = (run.folder / GUARD_LOG).exists()
                told = list(witness.told)
                run.process.send_signal(signal.SIGTERM)
                witness.serve(lambda: run.process.poll() is not None, 60.0)
                ticks = run.ticks()
                zeros = sum(line == STOP for _, line in told[1:])
                walls = [tick["wall"] for tick in ticks]
                gaps = [b - a for a, b in pairwise(walls)]
                return {
                    "seconds": round(lasted, 1),
                    "ticks": len(ticks),
                    "missed": sum(tick["missed"] for tick in ticks),
                    "tripped": int(trips),
                    "exit": run.process.returncode,
                    "zeros_at_the_robot": zeros,
                    "zeros_in_the_log": sum(tick["command"] == [0, 0] for tick in ticks),
                    "longest_between_ticks_ms": round(1e3 * max(gaps, default=0.0), 1),
                    "late_p99_ms": round(_share([tick["late_ms"] for tick in ticks], 0.99), 2),
                    "wrong": kept(witness, ticks),
                }
        finally:
            witness.close()


def _share(values: list[float], share: float) -> float:
    return sorted(values)[min(len(values) - 1, int(share * len(values)))]


def _spin() -> None:
    while True:
        pass


@contextmanager
def busy(count: int) -> Iterator[None]:
    """So many processes that do nothing, as hard as they can."""
    spinning = [multiprocessing.get_context("fork").Process(target=_spin, daemon=True) for _ in range(count)]
    for process in spinning:
        process.start()
    try:
        yield
    finally:
        for process in spinning:
            process.kill()
            process.join()


def _many(how: str, asked: argparse.Namespace, options: list[str]) -> dict[str, Any]:
    chance = random.Random(asked.seed)
    took: list[float] = []
    wrong: list[str] = []
    taken_back = 0
    for number in range(asked.count):
        done = once(how, chance, options)
        taken_back += done["taken_back"]
        wrong += [f"run {number}: {text}" for text in done["wrong"]]
        if done["seconds"] is not None:
            took.append(1e3 * done["seconds"])
    return {
        "what": how,
        "count": asked.count,
        "stopped": len(took),
        "median_ms": round(statistics.median(took), 2),
        "p90_ms": round(_share(took, 0.9), 2),
        "worst_ms": round(max(took), 2),
        "orders_taken_back": taken_back,
        "wrong": wrong,
    }


def main() -> None:
    """Print what was asked for; ends with 1 when something was wrong."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.guard", description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=["kill", "hang", "quiet"])
    parser.add_argument("--count", type=int, default=100, help="runs that are killed or held up")
    parser.add_argument("--seconds", type=float, default=3600.0, help="that the quiet run lasts")
    parser.add_argument("--busy", type=int, default=None, help="spinning processes (0; for quiet 2)")
    parser.add_argument("--realtime", action="store_true", help="of the service")
    parser.add_argument("--seed", type=int, default=1, help="of the moments")
    parser.add_argument("--json", action="store_true")
    asked = parser.parse_args()
    count = asked.busy if asked.busy is not None else 2 * (asked.what == "quiet")
    options = ["--realtime"] if asked.realtime else []
    with busy(count):
        if asked.what == "quiet":
            found = {"what": "quiet", **quiet(asked.seconds, options)}
        else:
            found = _many(asked.what, asked, options)
    found |= {"busy": count, "realtime": asked.realtime}
    if asked.json:
        print(json.dumps(found))
    else:
        for name, value in found.items():
            print(f"{name:26} {value}")
    if found["wrong"] or found.get("tripped"):
        sys.exit(1)


if __name__ == "__main__":
    main()
