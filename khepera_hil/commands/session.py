"""One run from the opened port to the closed recording, for every command that drives a robot."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any
from urllib.parse import parse_qsl, urlsplit

import serial

from khepera_hil import chance
from khepera_hil.apart import Apart
from khepera_hil.budget import plan
from khepera_hil.clock import Clock, WallClock
from khepera_hil.commands.address import world_of
from khepera_hil.commands.ending import TERMINAL, called, finish
from khepera_hil.commands.signals import heeded
from khepera_hil.controllers import Controller
from khepera_hil.errors import NoAnswer, UsageError
from khepera_hil.follower import Follower
from khepera_hil.guarding import Guarding, Process, Unguarded, limit
from khepera_hil.keys import HELP, LABELS, Keys, foreground
from khepera_hil.khepera import Khepera
from khepera_hil.link import Link
from khepera_hil.opening import Port, close_port, descriptor, open_port, reopen
from khepera_hil.orders import Orders, OrderSocket
from khepera_hil.realtime import Collector, ask_for_realtime
from khepera_hil.reconnection import stable_name
from khepera_hil.recording import Listener, Recording, Tick
from khepera_hil.service import Service
from khepera_hil.systemd import Manager
from khepera_hil.terminal import Terminal
from khepera_hil.viewer import FILE, ROWS_FAST, ROWS_WALL, open_file
from khepera_hil.viewer.live import Address, address, open_live
from khepera_hil.viewer.program import has_screen

__all__ = ["LOCAL", "run_on_robot"]

LOCAL = "127.0.0.1"
"""Where a running loop is shown unless an address is given: to this computer."""


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
            witness=getattr(port, "witness", None),
            guard=guard,
            reopen=partial(_reopened, port, stable_name(url), asked.baud, clock),
            resume=asked.resume,
            patience=asked.patience,
            idle=between.idle,
        )
        between.service = service
        listener = on_open(getattr(port, "witness", None), service)
        with closing(service), heeded(service):
            witness = getattr(port, "witness", None)
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
        "world": None if witness is None else {**world_of(url), "size": witness.size(), "shapes": witness.shapes()},
    }
    recording = Recording.create(
        asked.runs, program=asked.program, seed=seed, manifest=manifest, started=datetime.now()
    )
    try:
        print(f"{asked.program} on {asked.port}: Khepera {versions[0]}, seed {seed}, recording {recording.folder}")
        rows = ROWS_FAST if clock.simulated else ROWS_WALL
        viewer = _following(
            open_file, FILE, clock, path=recording.folder / FILE, manifest=recording.manifest, rows=rows
        )
        recording.follow(viewer)
        if listener is not None:
            recording.follow(listener)
        viewer.wait_until_open()
        if live is not None:
            page = asked.serve is not None
            manifest = recording.manifest
            looking = {"manifest": manifest, "where": live, "page": page, "window": asked.view}
            recording.follow(_following(open_live, "the live view", clock, **looking))
            if page:
                print(f"look on at {live.page} or by: {called('rerun')} {live.stream}")
        if sys.stdout is not None:  # nobody looks where it was closed
            sys.stdout.flush()
            recording.follow(Follower(Terminal(sys.stdout, asked.program, note=note), name=TERMINAL, waits=False))
        labels = getattr(asked, "labels", False)
        with _orders(recording.folder, clock, service, labels=labels) as orders:
            between.manager.ready(f"{asked.program} on {asked.port}")
            between.collector.begin()
            try:
                service.run(recording, duration=asked.duration, orders=orders)
            finally:
                between.collector.end()
                between.manager.stopping()
    except BaseException:
        finish(recording, service, witness, as_json=asked.json)
        raise
    if (failure := finish(recording, service, witness, as_json=asked.json)) is not None:
        raise failure
    if not service.rested:
        raise NoAnswer("the robot did not acknowledge the order to stop: see that its wheels stand still")


def _following(
    opening: Callable[..., Any], name: str, clock: Clock, **arguments: Any
) -> Apart[Tick] | Follower[Tick]:
    """Who makes what is derived from the log: beside the loop where the loop has deadlines, else in a thread, for
    which the loop waits."""
    if clock.simulated:
        return Follower(partial(opening, **arguments), name=name, waits=True)
    return Apart(f"{opening.__module__}:{opening.__qualname__}", arguments, name=name)


@contextmanager
def _orders(folder: Path, clock: Clock, service: Service, *, labels: bool) -> Iterator[list[Orders]]:
    """The operator's socket and keys; none in simulated time, which must repeat. ``labels``: the program takes
    his word for Behavior."""
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
                service.remark("info", f"{HELP}; {LABELS}" if labels else HELP)
        yield sources


def _remark(sentence: str) -> None:
    print(f"khepera-hil: {sentence}", file=sys.stderr)
