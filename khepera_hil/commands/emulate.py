"""``khepera-hil emulate``: the robots' end alone, for any programs that drive Kheperas over serial ports."""

from __future__ import annotations

import argparse
import os
import secrets
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any

from khepera_hil.commands.parser import Parser, baud, seed
from khepera_hil.commands.scored import scored
from khepera_hil.diary import Diary
from khepera_hil.disturbed import Disturbed, line_faults
from khepera_hil.emulator import Company
from khepera_hil.endpoints import LOOPBACK, Endpoint, pseudo_terminal, tcp_port
from khepera_hil.errors import RecordingError, UsageError
from khepera_hil.faultspec import GROUPS, KINDS, Specification
from khepera_hil.follower import Follower
from khepera_hil.onlooker import Onlooker, shown
from khepera_hil.rom import DEFAULT_FITTINGS, FITTINGS, MODELS, model_for, turrets
from khepera_hil.serve import serve
from khepera_hil.uart import FIFO_16550
from khepera_hil.viewer.live import address, open_live
from khepera_hil.viewer.program import has_screen
from khepera_hil.world import MOST_ROBOTS, World, load_scenario

__all__ = ["main"]

_LAST_PORT = 65535

_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)

EPILOG = """\
examples:
  khepera-hil emulate --pty khepera --seed 3                           in one terminal
  khepera-hil --port khepera --program home                            a program of ours in another,
  python -m serial.tools.miniterm --eol LF -e ./khepera 38400          or your own fingers

  khepera-hil emulate --tcp :4000 --robot khepera2 --baud 115200
  khepera-hil --port socket://127.0.0.1:4000 --baud 115200 --program avoid

  khepera-hil emulate --robots 2 --pty khepera --world watchman        two robots: khepera-1 and khepera-2
  khepera-hil --port khepera-1 --program watchman                      each with a program of its own
  khepera-hil --port khepera-2 --program avoid

exit codes: 0 ended by Ctrl-C or SIGTERM  2 wrong arguments or arena  3 the link or the port  6 the log
"""


def main(arguments: Sequence[str]) -> int:
    """Serve emulated robots until Ctrl-C or SIGTERM, then say what their world saw."""
    asked = _asked(arguments)
    if asked.view and not has_screen():
        raise UsageError(
            "there is no screen here to open the viewer on; leave --view out (--log tells the truth too)"
        )
    model = model_for(asked.robot, asked.baud)
    faults = Specification(()) if asked.faults is None else Specification.parse(asked.faults)
    chosen = secrets.randbits(32) if asked.seed is None else asked.seed
    scenario = None if asked.scenario is None else load_scenario(asked.scenario)
    arena = asked.world or (scenario.world if scenario is not None else None) or "furnished"
    world = World(arena, chosen, scenario, robots=asked.robots)
    with ExitStack() as stack:
        endpoints = [stack.enter_context(opening) for opening in _endpoints(asked)]
        several = len(endpoints) > 1
        about: dict[str, Any] = {
            "robot": model.name,
            "turrets": list(asked.turrets),
            "name": ", ".join(endpoint.name for endpoint in endpoints),
            "baud": asked.baud,
            "arena": arena,
            "scenario": asked.scenario,
            "seed": chosen,
            "faults": asked.faults,
            "started": datetime.now().isoformat(timespec="seconds"),
        }
        diary = None if asked.log is None else Diary(asked.log, world, about, complain=_complain)
        emulators = [_emulator(asked, world, robot.number, faults, chosen, diary) for robot in world.robots]
        if several:
            Company(emulators)
        watchers: list[Callable[[float], None]] = [] if diary is None else [diary.watch]
        if asked.view:
            watchers.append(stack.enter_context(_viewed(world, about)).watch)
        stop = stack.enter_context(_signals())
        events = "" if asked.scenario is None else f" with {asked.scenario}"
        where = f"{model.title} at {asked.baud} baud in {arena}{events}, seed {chosen}"
        for number, endpoint in enumerate(endpoints, 1):
            name = endpoint.name if endpoint.device in endpoint.name else f"{endpoint.name} -> {endpoint.device}"
            which = f"robot {number}, " if several else ""
            print(f"{name}: {which}{where}; Ctrl-C ends {'all' if several else 'it'}", flush=True)

        def watch(now: float) -> None:
            for watcher in watchers:
                watcher(now)

        ended = serve(zip(endpoints, emulators, strict=True), stop=stop, watch=watch)
    for robot, emulator in zip(world.robots, emulators, strict=True):
        whose = f"robot {robot.number}: " if several else ""
        if counts := emulator.faults.counts:
            print(f"{whose}faults: " + ", ".join(f"{kind} {n}" for kind, n in sorted(counts.items())))
        print(f"{whose}score: {scored(world.score(robot.number))}")
    if diary is None:
        return 0
    diary.close(ended)
    return 0 if diary.whole else RecordingError.exit_code


def _endpoints(asked: argparse.Namespace) -> Iterator[AbstractContextManager[Endpoint]]:
    """Where each robot is found: one under the very name, several under LINK-1, LINK-2 ... or PORT, PORT+1 ..."""
    for place in range(asked.robots):
        if asked.tcp is not None:
            host, port = asked.tcp
            yield tcp_port(host, port + place if port else 0)
        elif asked.robots == 1:
            yield pseudo_terminal(asked.pty, asked.baud)
        else:
            yield pseudo_terminal(asked.pty.with_name(f"{asked.pty.name}-{place + 1}"), asked.baud)


def _emulator(
    asked: argparse.Namespace, world: World, number: int, faults: Specification, seed: int, diary: Diary | None
) -> Disturbed:
    """A robot at the end of its line, which tells the diary what passes."""
    on_fault = None if diary is None else partial(diary.fault, robot=number)
    return Disturbed(
        world,
        asked.baud,
        number=number,
        faults=line_faults(faults, seed, number, on_fault=on_fault),
        host_follows=asked.tcp is not None,
        fifo=FIFO_16550,
        robot=asked.robot,
        turrets=asked.turrets,
        on_request=None if diary is None else partial(diary.request, robot=number),
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


def _asked(arguments: Sequence[str]) -> argparse.Namespace:
    parser = _parser()
    asked = parser.parse_args(arguments)
    if asked.tcp is not None and asked.tcp[1] and asked.tcp[1] + asked.robots - 1 > _LAST_PORT:
        parser.error(
            f"argument --tcp: {asked.robots} robots from port {asked.tcp[1]} on need ports beyond {_LAST_PORT}"
        )
    if asked.pty is not None and not asked.pty.name:
        parser.error(f"argument --pty: {str(asked.pty)!r} is no name for a link")
    return asked


def _parser() -> Parser:
    parser = Parser(
        "khepera-hil emulate",
        "Emulated Kheperas behind pseudo-terminals or TCP ports, for any programs.",
        EPILOG,
    )
    where = parser.add_mutually_exclusive_group(required=True)
    where.add_argument(
        "--pty",
        type=Path,
        metavar="LINK",
        help="the name under which clients open it; several robots are LINK-1, LINK-2 ...",
    )
    where.add_argument(
        "--tcp",
        type=_address,
        metavar="HOST:PORT",
        help=f"where clients connect; :PORT is {LOOPBACK}, port 0 any that is free; several robots are at PORT, "
        "PORT+1 ...",
    )
    add = parser.add_argument
    add(
        "--robots",
        type=_count,
        default=1,
        metavar="N",
        help=f"how many are in the arena, from 1 to {MOST_ROBOTS}, all of one kind (default: %(default)s)",
    )
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
    if not colon or not (port.isascii() and port.isdigit()) or int(port) > _LAST_PORT:
        raise argparse.ArgumentTypeError(f"{text!r} is no HOST:PORT, such as :4000 or 127.0.0.1:4000")
    return host or LOOPBACK, int(port)


def _count(text: str) -> int:
    """A type for argparse: how many robots."""
    if not text.isascii() or not text.isdigit() or not 1 <= int(text[:9]) <= MOST_ROBOTS:
        raise argparse.ArgumentTypeError(f"{text!r} is no number of robots from 1 to {MOST_ROBOTS}")
    return int(text)


def _turrets(text: str) -> tuple[str, ...]:
    """A type for argparse: names with commas between them, or none."""
    try:
        return turrets(text)
    except UsageError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
