"""A program on a robot from the handshake to wheels that stand still, whatever happens in between."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Sequence
from math import inf
from typing import Any

import numpy as np

from khepera_hil.budget import plan
from khepera_hil.clock import Clock
from khepera_hil.conduct import Conduct
from khepera_hil.controllers import Commanded, Controller
from khepera_hil.errors import (
    GuardLost,
    KheperaHilError,
    LinkLost,
    NoAnswer,
    OrderRefused,
    RobotError,
    RobotReset,
    Stopped,
)
from khepera_hil.guarding import Guarding, Unguarded
from khepera_hil.khepera import Khepera
from khepera_hil.lifecycle import Health, Lifecycle
from khepera_hil.orders import Order, Orders
from khepera_hil.quantiles import Quantiles
from khepera_hil.reader import Checks, Reader
from khepera_hil.recording import Recording, Tick
from khepera_hil.scheduler import Beat, beats
from khepera_hil.transcript import name_of
from khepera_hil.wayback import WayBack
from khepera_hil.wheels import Wheels
from khepera_hil.witness import Sight, Staged, Witness

__all__ = ["PATIENCE", "Service"]

PATIENCE = 30.0
"""Seconds without a usable answer, or without a port, after which the robot counts as gone and the run ends."""


class Service:
    """Runs one controller on one robot, and owns the wheels while it does.

    ``rng`` is the program's own stream of chance. With ``verify`` the sensors are read twice (see
    :class:`~khepera_hil.reader.Reader`). ``guard`` stops the wheels when we cannot. When the line is lost,
    ``reopen`` is called, with pauses, until it returns a robot on a new line, for ``patience`` seconds of the
    robot's time; without it a lost line ends the run. A robot that was reset is set in motion again by the order
    ``resume`` only, or with ``resume`` at once. ``idle`` is called after each tick with the seconds left until the
    next. ``stopwatch`` (seconds) and ``wall`` (Unix time) fill the columns of the log that are the host's own;
    nothing is decided by them. Raises WireTooSlow for what does not fit into a tick.
    """

    def __init__(
        self,
        khepera: Khepera,
        controller: Controller,
        *,
        clock: Clock,
        period: float,
        rng: np.random.Generator,
        verify: bool = False,
        witness: Witness | None = None,
        guard: Guarding | None = None,
        reopen: Callable[[], Khepera] | None = None,
        resume: bool = False,
        patience: float = PATIENCE,
        idle: Callable[[float], None] = lambda slack: None,
        stopwatch: Callable[[], float] = time.perf_counter,
        wall: Callable[[], float] = time.time,
    ) -> None:
        self.health = Health()
        self.lifecycle = Lifecycle(self.health)
        self.ticks = self.missed = self.blind = 0
        """Ticks done, deadlines missed, ticks without readings."""
        self.work, self.late = Quantiles(), Quantiles()
        """Seconds of the host that each tick took, waiting for the wire included; seconds that it came late."""
        self.ended: str | None = None
        """Why the loop ended: ``duration``, the reason given to :meth:`stop`, or ``error``."""
        self.error: str | None = None
        """What ended the loop, when it was an error of ours."""
        self._khepera, self._controller, self._sight = khepera, controller, Sight(witness)
        self._guard: Guarding = guard or Unguarded()
        self._wheels = Wheels(khepera, self._guard, self.health)
        self._way_back = WayBack(
            khepera,
            self._wheels,
            self.health,
            clock,
            become=self._become,
            adopt=self._adopt,
            reopen=reopen,
            resume=resume,
            patience=patience,
        )
        self._clock, self._period = clock, period
        self._idle, self._stopwatch, self._wall = idle, stopwatch, wall
        self._staged: list[Orders] = [] if witness is None else [Staged(witness)]
        self._orders: Sequence[Orders] = ()
        self._reason: str | None = None
        self._remarks: list[tuple[str, str]] = []  # what is to be said in the next tick
        self._raw: dict[str, str] = {}
        self._guard_lost: GuardLost | None = None  # between two ticks; the next one tells it
        needed = plan(controller.name, controller.needs, baud=khepera.link.baud, period=period, verify=verify)
        self._conduct = Conduct(controller, Reader(khepera, needed, verify), self._wheels, rng)
        khepera.link.on_exchange = self._heard

    @property
    def state(self) -> str:
        """Of the lifecycle."""
        return str(self.lifecycle.current_state_value)

    @property
    def commanded(self) -> bool:
        """Whether its program takes orders of its own."""
        return isinstance(self._controller, Commanded)

    @property
    def rested(self) -> bool:
        """Whether the robot acknowledged the last order to stand still."""
        return self.health.rested

    @property
    def losses(self) -> int:
        """Times that the line was lost."""
        return self._way_back.losses

    @property
    def resets(self) -> int:
        """Times that the robot was reset."""
        return self._way_back.resets

    @property
    def checks(self) -> Checks:
        """What came of not taking readings on trust."""
        return self._conduct.reader.checks

    def connect(self) -> tuple[str, str]:
        """Shake hands, and command the wheels to stand still; the robot's versions (manual's B).

        Raises Stopped when :meth:`stop` came before a robot was found.
        """
        self._become("connect")
        try:
            self._wheels.watch(self._khepera)
            versions = self._khepera.handshake(lambda: self._reason is not None)
            if not self._wheels.stop():
                raise NoAnswer("the robot does not confirm the order to stand still: see that its line is good")
        except KheperaHilError:
            self._become("fail")
            if self._reason is None:
                raise
            raise Stopped(
                f"stopped ({self._reason}) before a robot was found at {self._khepera.link.name}"
            ) from None
        self._become("connected")
        return versions

    def program(self) -> dict[str, Any]:
        """What the program asks each tick and what it knows then, for the run's manifest."""
        return self._conduct.manifest()

    def stop(self, reason: str) -> None:
        """End the loop at its next tick; may be called from a signal's handler."""
        self._reason = self._reason or reason

    def remark(self, level: str, text: str) -> None:
        """Have an event recorded with the next tick; may be called from a signal's handler."""
        self._remarks.append((level, text))

    def run(self, recording: Recording, *, duration: float | None = None, orders: Sequence[Orders] = ()) -> None:
        """The loop, for so many seconds of the robot's time; however it ends, the wheels are commanded to stop.

        ``orders`` are looked at at the beginning of each tick.
        """
        self._orders = [*self._staged, *orders]
        self.ended = "error"  # until the loop is seen to end well
        try:
            self._guard.record_in(recording.folder)
            self._become("start")
            for beat in beats(
                self._clock,
                self._period,
                duration=duration,
                stopped=lambda: self._reason is not None,
                waiting=self._show_life,
            ):
                self._turn(beat, recording)
            self.ended = self._reason or "duration"
        except KheperaHilError as error:
            self.error = str(error)
            raise
        finally:
            self._rest()

    def close(self) -> None:
        """Give the port back and part with the guard; the service is of no more use."""
        self._way_back.close()
        self._khepera.link.close()
        self._guard.close()

    # A tick's frame: what is done in each, in whatever state.

    def _turn(self, beat: Beat, recording: Recording) -> None:
        tick = self._begin(beat)
        began, start = self._stopwatch(), self._clock.now()
        failure: KheperaHilError | None = None
        good = False
        try:
            if self._guard_lost is not None:
                raise self._guard_lost
            self._guard.beat()
            self._khepera.link.until = start + self._period - beat.late
            self._obey(tick)
            good = self._advance(tick)
        except (LinkLost, GuardLost) as error:
            tick.events.append(("error", str(error)))
            failure = error
            with contextlib.suppress(LinkLost, GuardLost):
                self._wheels.halt()  # before the log, which may take its time
        self._settle(tick, good)
        self._sight.tell(tick)
        tick.work_ms = 1e3 * (self._stopwatch() - began)
        recording.write(tick)
        self.ticks += 1
        self.missed += tick.missed
        self.work.add(tick.work_ms / 1e3)
        self.late.add(beat.late)
        if failure is not None:
            raise failure
        if (gone := self._way_back.given_up(tick)) is not None:
            raise gone
        self._khepera.link.lookout.look()
        self._idle(self._period - beat.late - (self._clock.now() - start))

    def _begin(self, beat: Beat) -> Tick:
        self._raw = {}
        tick = Tick(tick=beat.tick, t=beat.due, late_ms=1e3 * beat.late, missed=beat.missed, raw=self._raw)
        tick.wall = self._wall()
        self._sight.note(tick)
        if beat.tick == 0:
            tick.events.append(("info", f"{self._controller.name} runs, a tick every {self._period:g} s"))
        if beat.missed:
            tick.events.append(("warning", f"{beat.missed} deadlines missed"))
        while self._remarks:
            tick.events.append(self._remarks.pop(0))
        return tick

    def _settle(self, tick: Tick, good: bool) -> None:
        """What the tick means for the state."""
        self.health.add(good)
        self.blind += not tick.evidence
        if self.state == "running" and self.health.ailing:
            self._become("degrade", tick)
        elif self.state == "degraded" and self.health.sound:
            self._become("recover", tick)
        tick.state = self.state

    def _become(self, event: str, tick: Tick | None = None) -> None:
        before = self.state
        self.lifecycle.send(event)
        events = self._remarks if tick is None else tick.events
        if events and events[-1][1].endswith(f" -> {before}"):
            before = events.pop()[1]  # one line for what is one way
        events.append(("info", f"{before} -> {self.state}"))

    # What the operator ordered.

    def _obey(self, tick: Tick) -> None:
        for source in self._orders:
            for order in source.take():
                tick.orders.append(order.words)
                try:
                    order.obeyed(self._carry_out(order))
                except OrderRefused as error:
                    order.refused(str(error))
                    tick.events.append(("warning", f"order refused: {error}"))

    def _carry_out(self, order: Order) -> str:
        if order.words == "stop":
            self.stop("order")
            return "the run ends, its wheels stand still"
        if order.words == "resume":
            if self.health.may_move:
                raise OrderRefused("there is nothing to resume: the robot may move")
            self.health.may_move = True
            return "the robot is set in motion again"
        if isinstance(self._controller, Commanded):
            return self._controller.order(order.words)
        raise OrderRefused(f"{self._controller.name} knows no order {order.words!r}; it takes stop and resume")

    # What is done in a tick, state by state. Whether it was a good one.

    def _advance(self, tick: Tick) -> bool:
        try:
            if self.state == "disconnected":
                self._way_back.search(tick)
            elif self.state == "connecting":
                self._way_back.shake_hands(tick)
            elif self.state == "ready" and not self.health.may_move:
                return self._way_back.wait(tick)
            else:
                return self._drive(tick)
        except LinkLost as error:
            self._way_back.lost(tick, error)
        except RobotReset as error:
            self._way_back.was_reset(tick, error)
            if self.state != "connecting":
                self._become("reset", tick)
        return False

    def _drive(self, tick: Tick) -> bool:
        if self.state == "ready":
            self._become("start", tick)
        self._way_back.went(tick, self._conduct.turn(tick))
        return bool(tick.evidence) and tick.command is not None

    def _adopt(self, found: Khepera) -> None:
        """A robot on a new line."""
        self._khepera = found
        before = self._conduct.reader
        self._conduct.reader = Reader(found, before.plan, before.verify, before.checks)
        found.link.on_exchange = self._heard

    def _show_life(self) -> None:
        """While the loop waits for its next tick."""
        try:
            if self._guard_lost is None:
                self._guard.beat()
            self._khepera.link.lookout.look()
        except GuardLost as error:
            self._guard_lost = error
            with contextlib.suppress(LinkLost, GuardLost):
                self._wheels.halt()

    def _rest(self) -> None:
        # What is said from here on belongs to no tick, and nothing that becomes of the guard may disturb it.
        self._khepera.link.on_exchange = self._beat
        self._khepera.link.until = inf
        self._become("stop")
        try:
            self._wheels.stop()
            for letter, *values in getattr(self._controller, "at_rest", ()):
                with contextlib.suppress(RobotError):  # the wheels stand still; that is what counts
                    self._wheels.beside(str(letter), *values)
        except LinkLost:
            if self.ended != "error":
                raise  # else the error that ended the loop says more
        finally:
            self._become("rest" if self.health.rested else "fail")

    def _beat(self, request: bytes, answer: bytes) -> None:
        with contextlib.suppress(GuardLost):
            self._guard.beat()

    def _heard(self, request: bytes, answer: bytes) -> None:
        # What came although nobody had asked stands under "?"; it is only ever there when the line was in trouble.
        text = answer.decode("ascii", "backslashreplace").rstrip("\r\n")
        if request.strip():
            self._raw[name_of(request, self._raw)] = text
        elif text:
            self._raw["?"] = (self._raw.get("?", "") + text)[-500:]
        self._guard.beat()  # a tick on a bad line may take longer than the guard would wait
