"""``khepera-hil emulate``: the robot's end alone, for any program that drives a Khepera over a serial port."""

from __future__ import annotations

import argparse
import os
import secrets
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any

from khepera_hil import chance
from khepera_hil.commands.parser import Parser, baud, seed
from khepera_hil.commands.scored import scored
from khepera_hil.diary import Diary
from khepera_hil.disturbed import Disturbed
from khepera_hil.endpoints import LOOPBACK, pseudo_terminal, tcp_port
from khepera_hil.errors import RecordingError, UsageError
from khepera_hil.faults import Faults
from khepera_hil.faultspec import GROUPS, KINDS, Specification
from khepera_hil.follower import Follower
from khepera_hil.onlooker import Onlooker, shown
from khepera_hil.rom import DEFAULT_FITTINGS, FITTINGS, MODELS, model_for, turrets
from khepera_hil.serve import serve
from khepera_hil.uart import FIFO_16550
from khepera_hil.viewer.live import address, open_live
from khepera_hil.viewer.program import has_screen
from khepera_hil.world import World, load_scenario

__all__ = ["main"]

_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)

EPILOG = """\
examples:
  khepera-hil emulate --pty khepera --seed 3                           in one terminal
  khepera-hil --port khepera --program home                            a program of ours in another,
  python -m serial.tools.miniterm --eol LF -e ./khepera 38400          or your own fingers

  khepera-hil emulate --tcp :4000 --robot khepera2 --baud 115200
  khepera-hil --port socket://127.0.0.1:4000 --baud 115200 --program avoid

exit codes: 0 ended by Ctrl-C or SIGTERM  2 wrong arguments or arena  3 the link or the port  6 the log
"""


def main(arguments: Sequence[str]) -> int:
    """Serve an emulated robot until Ctrl-C or SIGTERM, then say what its world saw."""
    asked = _parser().parse_args(arguments)
    if asked.view and not has_screen():
        raise UsageError(
            "there is no screen here to open the viewer on; leave --view out (--log tells the truth too)"
        )
    model = model_for(asked.robot, asked.baud)
    faults = Specification(()) if asked.faults is None else Specification.parse(asked.faults)
    chosen = secrets.randbits(32) if asked.seed is None else asked.seed
    scenario = None if asked.scenario is None else load_scenario(asked.scenario)
    arena = asked.world or (scenario.world if scenario is not None else None) or "furnished"
    world = World(arena, chosen, scenario)
    with ExitStack() as stack:
        endpoint = stack.enter_context(
            pseudo_terminal(asked.pty, asked.baud) if asked.tcp is None else tcp_port(*asked.tcp)
        )
        about: dict[str, Any] = {
            "robot": model.name,
            "turrets": list(asked.turrets),
            "name": endpoint.name,
            "baud": asked.baud,
            "arena": arena,
            "scenario": asked.scenario,
            "seed": chosen,
            "faults": asked.faults,
            "started": datetime.now().isoformat(timespec="seconds"),
        }
        diary = None if asked.log is None else Diary(asked.log, world, about, complain=_complain)
        emulator = _emulator(asked, world, faults, chosen, diary)
        watchers: list[Callable[[float], None]] = [] if diary is None else [diary.watch]
        if asked.view:
            watchers.append(stack.enter_context(_viewed(world, about)).watch)
        stop = stack.enter_context(_signals())
        where = endpoint.name if endpoint.device in endpoint.name else f"{endpoint.name} -> {endpoint.device}"
        events = "" if asked.scenario is None else f" with {asked.scenario}"
        print(
            f"{where}: {model.title} at {asked.baud} baud in {arena}{events}, seed {chosen}; Ctrl-C ends it",
            flush=True,
        )

        def watch(now: float) -> None:
            for watcher in watchers:
                watcher(now)

        ended = serve(endpoint, emulator, stop=stop, watch=watch)
    if emulator.faults.counts:
        print("faults: " + ", ".join(f"{kind} {n}" for kind, n in sorted(emulator.faults.counts.items())))
    print(f"score: {scored(world.score())}")
    if diary is None:
        return 0
    diary.close(ended)
    return 0 if diary.whole else RecordingError.exit_code


def _emulator(
    asked: argparse.Namespace, world: World, faults: Specification, seed: int, diary: Diary | None
) -> Disturbed:
    """The robot at the end of its line, which tells the diary what passes."""
    return Disturbed(
        world,
        asked.baud,
        faults=Faults(faults, chance.streams(seed)["line"], on_fault=None if diary is None else diary.fault),
        host_follows=asked.tcp is not None,
        fifo=FIFO_16550,
        robot=asked.robot,
        turrets=asked.turrets,
        on_request=None if diary is None else diary.request,
    )


@contextmanager
def _viewed(world: World, about: dict[str, Any]) -> Iterator[Onlooker]:
    """A window on the world; what did not reach it is told at the end."""
    opening = partial(open_live, shown(about, world), address(), page=False, window=True)
    follower: Follower[Any] = Follower(opening, name="the live view", waits=False)
    try:
        yield Onlooker(world, follower.offer)
    finally:
        for loss in follower.close():
            _complain(loss)


@contextmanager
def _signals() -> Iterator[int]:
    """A descriptor that is readable when somebody wants this process to end."""
    wakes, wake = os.pipe()
    before = {which: signal.getsignal(which) for which in _SIGNALS}
    for which in before:
        signal.signal(which, lambda number, frame: os.write(wake, b"!") and None)
    try:
        yield wakes
    finally:
        for which, handler in before.items():
            signal.signal(which, handler)
        os.close(wakes)
        os.close(wake)


def _complain(what: str) -> None:
    print(f"khepera-hil: {what}", file=sys.stderr, flush=True)


def _parser() -> Parser:
    parser = Parser(
        "khepera-hil emulate",
        "An emulated Khepera behind a pseudo-terminal or a TCP port, for any program.",
        EPILOG,
    )
    where = parser.add_mutually_exclusive_group(required=True)
    where.add_argument("--pty", type=Path, metavar="LINK", help="the name under which clients open it")
    where.add_argument(
        "--tcp",
        type=_address,
        metavar="HOST:PORT",
        help=f"where clients connect; :PORT is {LOOPBACK}, port 0 any that is free",
    )
    add = parser.add_argument
    add(
        "--world",
        metavar="ARENA",
        help="a name of khepera-hil --list, or a TOML file (default: the scenario's, or furnished)",
    )
    add("--scenario", metavar="SCENARIO", help="what happens in it: a name of khepera-hil --list, or a TOML file")
    add("--robot", choices=tuple(MODELS), help="default: khepera, or khepera2 at a rate that only this one has")
    add("--baud", type=baud, default=38400, help="the rate of the robot's mode (default: %(default)s)")
    add(
        "--turrets",
        type=_turrets,
        default=DEFAULT_FITTINGS,
        metavar="LIST",
        help=f"what is plugged on, of {', '.join(FITTINGS)}, or none (default: {','.join(DEFAULT_FITTINGS)})",
    )
    add("--seed", type=seed, help="of robot, start, arena and noise (default: a new one, told)")
    add(
        "--faults",
        metavar="SPEC",
        help="what goes wrong on the line, such as flip=1e-3,late=0.01,disconnect@30+5: KIND=RATE or "
        f"KIND@TIME+SECONDS, of {', '.join((*KINDS, *GROUPS))}",
    )
    add("--view", action="store_true", help="open the viewer on the emulated world")
    add("--log", type=Path, metavar="FILE", help="append the truth and the score, as JSON lines")
    return parser


def _address(text: str) -> tuple[str, int]:
    """A type for argparse: HOST:PORT, where HOST may be missing or in brackets."""
    host, colon, port = text.rpartition(":")
    if host.startswith("[") and host.endswith("]"):
        host = host[1:-1]
    elif ":" in host:
        colon = ""
    if not colon or not (port.isascii() and port.isdigit()) or int(port) > 65535:
        raise argparse.ArgumentTypeError(f"{text!r} is no HOST:PORT, such as :4000 or 127.0.0.1:4000")
    return host or LOOPBACK, int(port)


def _turrets(text: str) -> tuple[str, ...]:
    """A type for argparse: names with commas between them, or none."""
    try:
        return turrets(text)
    except UsageError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
