"""The main job: ``khepera-hil --port PORT --program NAME``."""

from __future__ import annotations

import argparse
import json
import os
import secrets
import shutil
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import asdict
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any
from urllib.parse import parse_qsl, quote, unquote, urlencode, urlsplit

import serial

from khepera_hil import chance
from khepera_hil.budget import plan
from khepera_hil.clock import Clock, WallClock
from khepera_hil.commands import COMMANDS
from khepera_hil.commands.parser import Parser, baud, existing_name, number, seed
from khepera_hil.commands.scored import scored
from khepera_hil.commands.setting import add_setting, setting_of
from khepera_hil.commands.signals import heeded
from khepera_hil.controllers import PROGRAMS, Controller
from khepera_hil.errors import NoAnswer, RecordingError, UsageError
from khepera_hil.faultspec import Specification
from khepera_hil.follower import Follower
from khepera_hil.guarding import Guarding, Process, Unguarded, limit
from khepera_hil.keys import HELP, Keys, foreground
from khepera_hil.khepera import Khepera
from khepera_hil.link import Link
from khepera_hil.opening import Port, close_port, descriptor, open_port, reopen
from khepera_hil.orders import Orders, OrderSocket
from khepera_hil.quantiles import Quantiles
from khepera_hil.realtime import Collector, ask_for_realtime
from khepera_hil.reconnection import stable_name
from khepera_hil.recording import Listener, Recording, Tick
from khepera_hil.service import PATIENCE, Service
from khepera_hil.systemd import Manager
from khepera_hil.terminal import Terminal
from khepera_hil.viewer import FILE, ROWS_FAST, ROWS_WALL, open_file
from khepera_hil.viewer.live import Address, address, open_live
from khepera_hil.viewer.program import has_screen
from khepera_hil.world import arenas, load_scenario, scenarios

__all__ = ["main", "parser_of_run", "port_url", "run_on_robot"]

DEFAULT_WORLD = "furnished"
LOCAL = "127.0.0.1"
_TERMINAL = "the terminal"
_COMMANDS = "\n".join(f"  khepera-hil {name:9} {does}" for name, does in COMMANDS.items() if name != "run")

EPILOG = f"""\
commands (each has its --help):
{_COMMANDS}

examples:
  khepera-hil --program home --duration 60                    on the emulated robot
  khepera-hil --port /dev/ttyS0 --program avoid               on a robot, until Ctrl-C
  khepera-hil --program home --fast --duration 120 --seed 3   simulated time, repeatable
  khepera-hil --program avoid --serve                         with a page for browsers to look on

exit codes: 0 ended well (duration, Ctrl-C, SIGTERM, order)  2 wrong arguments  3 port  4 robot
            5 wire too slow  6 recording  7 guard  1 anything else
"""


def main(arguments: Sequence[str]) -> int:
    """Run a program on a robot, record it, and say how it went."""
    asked = parser_of_run().parse_args(arguments)
    if asked.list:
        _list()
        return 0
    existing_name("program", asked.program, list(PROGRAMS))
    chosen_seed = secrets.randbits(32) if asked.seed is None else asked.seed
    url = port_url(asked.port, asked.world, asked.scenario, fast=asked.fast, seed=chosen_seed, faults=asked.faults)
    setting = setting_of(asked)
    about = {"setting": {"unknown": list(setting.unknown), "data": asked.data}}
    run_on_robot(asked, chosen_seed, url, PROGRAMS[asked.program].make(setting), about)
    return 0


def run_on_robot(
    asked: argparse.Namespace,
    chosen_seed: int,
    url: str,
    controller: Controller,
    about: dict[str, Any],
    *,
    on_open: Callable[[Any, Service], Listener | None] = lambda witness, service: None,
    note: Callable[[], str] = lambda: "",
) -> None:
    """A controller on the robot behind ``url``, recorded and told; ``about`` goes into the manifest.

    ``on_open`` is told who sees the robot from outside (or None) and the service, before the first tick; what it
    returns hears of every tick. ``note`` is shown in the terminal's line.
    """
    live = _live(asked)
    # From here on pyserial knows emulator:// (a module protocol_emulator in our package of handlers).
    if "khepera_hil.ports" not in serial.protocol_handler_packages:
        serial.protocol_handler_packages.append("khepera_hil.ports")
    plan(controller.name, controller.needs, baud=asked.baud, period=asked.period, verify=asked.verify)
    if asked.realtime:
        for refusal in ask_for_realtime():
            _remark(refusal)
    port = open_port(url, asked.baud, _remark)
    clock: Clock = getattr(port, "clock", None) or WallClock()
    witness = getattr(port, "witness", None)
    try:
        guard = _guard(port, asked)
    except BaseException:
        close_port(port)
        raise
    with closing(Manager()) as manager:
        between = _Between(manager, Collector())
        service = Service(
            Khepera(Link(port, clock, baud=asked.baud)),
            controller,
            clock=clock,
            period=asked.period,
            rng=chance.generator(chosen_seed, "program"),
            verify=asked.verify,
            witness=witness,
            guard=guard,
            reopen=partial(_reopened, port, stable_name(url), asked.baud, clock),
            resume=asked.resume,
            patience=asked.patience,
            idle=between.idle,
        )
        between.service = service
        listener = on_open(witness, service)
        with closing(service), heeded(service):
            _run(asked, chosen_seed, url, service, clock, witness, between, live, about, listener, note)


def _live(asked: argparse.Namespace) -> Address | None:
    """Where viewers of the running loop are served, if they are."""
    if asked.view and not has_screen():
        raise UsageError("there is no screen here to open the viewer on; --serve shows the run in a browser")
    if not asked.view and asked.serve is None:
        return None
    return address(LOCAL if asked.serve is None else asked.serve)


def _guard(port: Port, asked: argparse.Namespace) -> Guarding:
    """A guard where the port has a descriptor to write to in our place; else one line, or none for the emulator."""
    if descriptor(port) is not None:
        return Process(limit(asked.period))
    if not hasattr(port, "witness"):
        _remark(
            f"{asked.port} has no descriptor, so there is no guard: "
            "should this process be killed, the wheels keep their speed"
        )
    return Unguarded()


def _reopened(port: Port, name: str, baud: int, clock: Clock) -> Khepera:
    return Khepera(Link(reopen(port, name, baud), clock, baud=baud))


class _Between:
    """What is done when a tick is done: the service manager told, garbage collected."""

    service: Service

    def __init__(self, manager: Manager, collector: Collector) -> None:
        self.manager, self.collector = manager, collector
        self._told = ""

    def idle(self, slack: float) -> None:
        """With so many seconds left before the next tick."""
        self.manager.alive()
        if self.service.state != self._told:
            self._told = self.service.state
            self.manager.status(self._told)
        self.collector.idle(slack)


def _run(
    asked: argparse.Namespace,
    seed: int,
    url: str,
    service: Service,
    clock: Clock,
    witness: Any,
    between: _Between,
    live: Address | None,
    about: dict[str, Any],
    listener: Listener | None,
    note: Callable[[], str],
) -> None:
    versions = service.connect()
    manifest: dict[str, Any] = {
        "port": asked.port,
        "baud": asked.baud,
        "period_s": asked.period,
        "clock": "simulated" if clock.simulated else "wall",
        "verify": asked.verify,
        "faults": dict(parse_qsl(urlsplit(url).query)).get("faults"),
        "robot": {"bios": versions[0], "protocol": versions[1]},
        **service.program(),
        **about,
        "world": None
        if witness is None
        else {**_world_of(url), "size": witness.size(), "shapes": witness.shapes()},
    }
    recording = Recording.create(
        asked.runs, program=asked.program, seed=seed, manifest=manifest, started=datetime.now()
    )
    try:
        print(f"{asked.program} on {asked.port}: Khepera {versions[0]}, seed {seed}, recording {recording.folder}")
        rows = ROWS_FAST if clock.simulated else ROWS_WALL
        opening = partial(open_file, recording.folder / FILE, recording.manifest, rows=rows)
        viewer: Follower[Tick] = Follower(opening, name=FILE, waits=clock.simulated)
        recording.follow(viewer)
        if listener is not None:
            recording.follow(listener)
        viewer.wait_until_open()
        if live is not None:
            page = asked.serve is not None
            looking = partial(open_live, recording.manifest, live, page=page, window=asked.view)
            recording.follow(Follower(looking, name="the live view", waits=clock.simulated))
            if page:
                print(f"look on at {live.page} or by: {_called('rerun')} {live.stream}")
        if sys.stdout is not None:  # nobody looks where it was closed
            sys.stdout.flush()
            recording.follow(Follower(Terminal(sys.stdout, asked.program, note=note), name=_TERMINAL, waits=False))
        with _orders(recording.folder, clock, service) as orders:
            between.manager.ready(f"{asked.program} on {asked.port}")
            between.collector.begin()
            try:
                service.run(recording, duration=asked.duration, orders=orders)
            finally:
                between.collector.end()
                between.manager.stopping()
    except BaseException:
        _finish(recording, service, witness, as_json=asked.json)
        raise
    if (failure := _finish(recording, service, witness, as_json=asked.json)) is not None:
        raise failure
    if not service.rested:
        raise NoAnswer("the robot did not acknowledge the order to stop: see that its wheels stand still")


@contextmanager
def _orders(folder: Path, clock: Clock, service: Service) -> Iterator[list[Orders]]:
    """The operator's socket and keys; none in simulated time, which must repeat."""
    sources: list[Orders] = []
    with ExitStack() as stack:
        if not clock.simulated:
            try:
                sources.append(stack.enter_context(closing(OrderSocket(folder))))
            except OSError as error:
                why = error.strerror or error
                service.remark("warning", f"no orders will be taken: {folder} holds no socket ({why})")
            if service.commanded and sys.stdin is not None and foreground(sys.stdin):
                sources.append(stack.enter_context(closing(Keys(sys.stdin.fileno(), service.remark))))
                service.remark("info", HELP)
        yield sources


def _finish(recording: Recording, service: Service, witness: Any, *, as_json: bool) -> RecordingError | None:
    """Close the recording and say how the run went; what could not be written is returned, not raised."""
    ending: dict[str, Any] = {
        "ticks": service.ticks,
        "missed": service.missed,
        "without_data": service.blind,
        "lines_lost": service.losses,
        "robot_resets": service.resets,
        "checks": asdict(service.checks),
        "faults": {} if witness is None else witness.faults(),
        "work_ms": _percentiles(service.work),
        "late_ms": _percentiles(service.late),
        "stop": service.ended,
        "state": service.state,
        "rested": service.rested,
        "error": service.error,
        "score": {} if witness is None else witness.score(),
    }
    failure = None
    try:
        losses = recording.close(ending)
    except RecordingError as error:
        losses, failure = [], error
    for loss in losses:
        if not loss.startswith(_TERMINAL):  # who closed it knows that
            print(f"khepera-hil: {loss}", file=sys.stderr)
    print(f"stopped ({ending['stop']}) after {ending['ticks']} ticks, {ending['missed']} deadlines missed")
    if ending["checks"]["verified"]:
        print(
            "verified: {verified} answers, {third} read a third time, {refused} ticks refused".format_map(
                ending["checks"]
            )
        )
    if ending["faults"]:
        print("faults: " + ", ".join(f"{kind} {number}" for kind, number in sorted(ending["faults"].items())))
    if ending["score"]:
        print(scored(ending["score"]))
    print(f"recorded in {recording.folder}; to look at it: {_called('khepera-hil')} review {recording.folder}")
    if as_json:
        about = {name: recording.manifest[name] for name in ("program", "seed")}
        print(json.dumps({"run": str(recording.folder), **about, **ending}))
    return failure


def _remark(sentence: str) -> None:
    print(f"khepera-hil: {sentence}", file=sys.stderr)


def _called(name: str) -> str:
    """How a program is called here: it is installed beside the interpreter, which may not be on the PATH."""
    beside = Path(sys.executable).with_name(name)
    if shutil.which(name) is None and beside.exists():
        return os.path.relpath(beside) if beside.is_relative_to(Path.cwd()) else str(beside)
    return name


def _percentiles(seconds: Quantiles) -> dict[str, float | None]:
    """In milliseconds; null where there was no tick."""
    found = {"p50": seconds.at(0.5), "p99": seconds.at(0.99)}
    return {name: None if value is None else round(1e3 * value, 3) for name, value in found.items()}


def port_url(
    port: str,
    world: str | None,
    scenario: str | None = None,
    *,
    fast: bool,
    seed: int,
    faults: str | None = None,
) -> str:
    """What pyserial is asked to open. Only the in-process emulator has worlds, scenarios and a simulated clock."""
    for flag, text in (("--port", port), ("--world", world), ("--scenario", scenario)):
        if text == "":
            raise UsageError(f"{flag} is empty; leave it out for the emulator in its usual arena")
    if port.partition(":")[0].lower() != "emulator":
        asked = {"--world": world, "--scenario": scenario, "--faults": faults, "--fast": fast or None}
        for flag, given in ((flag, value is not None) for flag, value in asked.items()):
            if given:
                raise UsageError(f"{flag} goes with --port emulator only; {port} is a robot of its own")
        return port
    try:
        parts = urlsplit(port if ":" in port else "emulator://")
    except ValueError:
        raise UsageError(f"--port {port} is no name of an emulator; write emulator://ARENA") from None
    named = unquote(parts.netloc + parts.path)
    if world is not None and named and named != world:
        raise UsageError(f"--port {port} and --world {world} name two different worlds; leave one of them out")
    # A plus is a plus, as in disconnect@30+5.
    query = dict(parse_qsl(parts.query.replace("+", "%2B"), keep_blank_values=True))
    for key, flag in (("seed", "--seed"), ("clock", "--fast")):
        if key in query:
            raise UsageError(f"{key} does not go into the port's name; say {flag}")
    if scenario is not None and query.setdefault("scenario", scenario) != scenario:
        raise UsageError(
            f"--port {port} and --scenario {scenario} name two different scenarios; leave one of them out"
        )
    if not (where := world or named) and "scenario" in query:
        where = load_scenario(query["scenario"]).world or ""
    query |= {"seed": str(seed), "clock": "simulated" if fast else "wall"}
    if faults is not None and query.setdefault("faults", faults) != faults:
        raise UsageError(f"--port {port} and --faults {faults} name two different faults; leave one of them out")
    if "faults" in query:
        Specification.parse(query["faults"])  # a mistake is told before anything else happens
    return f"emulator://{quote(where or DEFAULT_WORLD)}?{urlencode(query, quote_via=quote)}"


def _world_of(url: str) -> dict[str, str | None]:
    """Name and scenario of the world that a URL is about."""
    parts = urlsplit(url)
    query = dict(parse_qsl(parts.query))
    return {"name": unquote(parts.netloc + parts.path), "scenario": query.get("scenario")}


def _list() -> None:
    print("programs (--program):")
    for name, one in PROGRAMS.items():
        print(f"  {name:13} {one.about}")
    print("arenas of the emulator (--world):")
    for name, looks in arenas().items():
        print(f"  {name:13} {looks}")
    print("scenarios of the emulator (--scenario):")
    for name, happens in scenarios().items():
        print(f"  {name:13} {happens}")


def parser_of_run() -> Parser:
    """The options of a run."""
    parser = Parser(
        "khepera-hil", "Run a Bayesian robot program on a Khepera and record every distribution.", EPILOG
    )
    add = parser.add_argument
    add("--port", default="emulator", help="a device, a URL of pyserial's, or emulator (default: %(default)s)")
    add("--program", default="home", metavar="NAME", help="what to run, see --list (default: %(default)s)")
    add_setting(parser)
    add("--baud", type=baud, default=38400, help="the rate of the robot's mode (default: %(default)s)")
    add(
        "--period",
        type=number(0.01, 2.0, "seconds"),
        default=0.1,
        metavar="SECONDS",
        help="of a tick (default: %(default)s)",
    )
    add(
        "--duration",
        type=number(0.0, 1e7, "seconds"),
        metavar="SECONDS",
        help="of the robot's time (default: until stopped)",
    )
    add("--seed", type=seed, help="of all chance: robot, arena, draws (default: a new one, told and recorded)")
    add(
        "--world",
        metavar="ARENA",
        help=f"of the in-process emulator: a name of --list or a TOML file (default: {DEFAULT_WORLD}, "
        "or what the scenario was made for)",
    )
    add(
        "--scenario",
        metavar="NAME",
        help="what happens in the world of the in-process emulator: a name of --list or a TOML file",
    )
    add(
        "--faults",
        metavar="SPEC",
        help="faults of the line of the in-process emulator, such as flip=1e-3,late=0.01,disconnect@30+5",
    )
    add("--fast", action="store_true", help="simulated time, as quick as the machine can; in-process emulator only")
    add(
        "--verify",
        action="store_true",
        help="read the sensors twice, and hold them to what the robot can have moved: for a line that loses bytes",
    )
    add(
        "--patience",
        type=number(0.1, 1e6, "seconds"),
        default=PATIENCE,
        metavar="SECONDS",
        help="for a lost line, or a silent robot, to come back (default: %(default)g)",
    )
    add("--resume", action="store_true", help="let a robot that was reset drive on by itself")
    add("--realtime", action="store_true", help="ask for SCHED_FIFO and locked memory; a line says when refused")
    add("--runs", type=Path, default=Path("runs"), metavar="DIR", help="where recordings go (default: %(default)s)")
    add("--view", action="store_true", help="open the viewer on the running loop")
    add(
        "--serve",
        nargs="?",
        const=LOCAL,
        metavar="ADDRESS",
        help="serve the running loop to browsers and viewers, at HOST or HOST:PORT (default: %(const)s)",
    )
    add("--json", action="store_true", help="the last line on standard output is the result as one JSON object")
    add("--list", action="store_true", help="list programs, arenas and scenarios, and end")
    return parser
