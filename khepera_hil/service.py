"""A program on a robot from the handshake to wheels that stand still, whatever happens in between."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from brp import BrpError, Distribution
from khepera_hil.clock import Clock
from khepera_hil.controllers import Commanded, Controller, Decision
from khepera_hil.errors import GuardLost, KheperaHilError, LinkLost, NoAnswer, OrderRefused, RobotError, RobotReset
from khepera_hil.guarding import Guarding, Unguarded
from khepera_hil.khepera import Khepera
from khepera_hil.lifecycle import Health, Lifecycle
from khepera_hil.orders import Order, Orders
from khepera_hil.perception import Readings
from khepera_hil.quantiles import Quantiles
from khepera_hil.reconnection import Reconnection
from khepera_hil.recording import Answer, Recording, Tick
from khepera_hil.scheduler import Beat, beats
from khepera_hil.wheels import Wheels
from khepera_hil.witness import Sight, Witness

__all__ = ["HOLD", "PATIENCE", "Service"]

HOLD = 2
"""Periods without readings during which the wheels keep what they were told; then they are told to stop."""

PATIENCE = 30.0
"""Seconds without a usable answer, or without a port, after which the robot counts as gone and the run ends."""


class Service:
    """Runs one controller on one robot, and owns the wheels while it does.

    ``rng`` is the program's own stream of chance. ``guard`` stops the wheels when we cannot. When the line is lost
    ``reopen`` is called, with pauses, until it returns a robot on a new line, for ``patience`` seconds of the
    robot's time; without it a lost line ends the run. A robot that was reset is set in motion again by the order
    ``resume`` only, or with ``resume`` at once. ``idle`` is called after each tick with the seconds left until the
    next. ``stopwatch`` (seconds) and ``wall`` (Unix time) fill the columns of the log that are the host's own;
    nothing is decided by them.
    """

    def __init__(
        self,
        khepera: Khepera,
        controller: Controller,
        *,
        clock: Clock,
        period: float,
        rng: np.random.Generator,
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
        self.ticks = self.missed = self.blind = self.losses = self.resets = 0
        """Ticks done, deadlines missed, ticks without readings; times that the line was lost, the robot reset."""
        self.work, self.late = Quantiles(), Quantiles()
        """Seconds of the host that each tick took, waiting for the wire included; seconds that it came late."""
        self.ended: str | None = None
        """Why the loop ended: ``duration``, the reason given to :meth:`stop`, or ``error``."""
        self.error: str | None = None
        """What ended the loop, when it was an error of ours."""
        self._khepera, self._controller, self._sight = khepera, controller, Sight(witness)
        self._guard: Guarding = guard or Unguarded()
        self._wheels = Wheels(khepera, self._guard, self.health)
        self._reopen, self._resume, self._patience = reopen, resume, patience
        self._reconnection: Reconnection | None = None
        self._clock, self._period, self._rng = clock, period, rng
        self._idle, self._stopwatch, self._wall = idle, stopwatch, wall
        self._orders: Sequence[Orders] = ()
        self._reason: str | None = None
        self._remarks: list[tuple[str, str]] = []  # what is to be said in the next tick
        self._raw: dict[str, str] = {}
        self._blind_periods = 0
        self._answered_at = 0.0  # the robot's time of the last tick that went as it should
        self._trouble: KheperaHilError | None = None  # the last one since then
        self._shapes = {
            key: (
                question.name,
                tuple(v.name for v in question.searched),
                tuple(tuple(v.values) for v in question.searched),
            )
            for key, question in controller.questions.items()
        }
        khepera.link.on_exchange = self._heard

    @property
    def state(self) -> str:
        """Of the lifecycle."""
        return str(self.lifecycle.current_state_value)

    @property
    def rested(self) -> bool:
        """Whether the robot acknowledged the last order to stand still."""
        return self.health.rested

    def connect(self) -> tuple[str, str]:
        """Shake hands, and command the wheels to stand still; the robot's versions (manual's B)."""
        self._become("connect")
        try:
            self._wheels.watch(self._khepera)
            versions = self._khepera.handshake()
            if not self._wheels.stop():
                raise NoAnswer("the robot does not confirm the order to stand still: see that its line is good")
        except KheperaHilError:
            self._become("fail")
            raise
        self._become("connected")
        return versions

    def program(self) -> dict[str, Any]:
        """What the program asks each tick and what it knows then, for the run's manifest."""
        known = {v.name: list(v.values) for question in self._controller.questions.values() for v in question.known}
        questions = [
            {
                "key": key,
                "name": name,
                "variables": variables,
                "values": values,
                "main": key == self._controller.decides,
            }
            for key, (name, variables, values) in self._shapes.items()
        ]
        return {"questions": questions, "evidence": known}

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
        self._orders = orders
        self.ended = "error"  # until the loop is seen to end well
        try:
            self._guard.record_in(recording.folder)
            self._become("start")
            for beat in beats(
                self._clock, self._period, duration=duration, stopped=lambda: self._reason is not None
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
        if self._reconnection is not None:
            self._reconnection.close()
        self._khepera.link.close()
        self._guard.close()

    # A tick's frame: what is done in each, in whatever state.

    def _turn(self, beat: Beat, recording: Recording) -> None:
        tick = self._begin(beat)
        began, start = self._stopwatch(), self._clock.now()
        failure: KheperaHilError | None = None
        good = False
        try:
            self._guard.beat()
            self._obey(tick)
            good = self._advance(tick)
        except (LinkLost, GuardLost) as error:
            tick.events.append(("error", str(error)))
            failure = error
            with contextlib.suppress(LinkLost, GuardLost):
                self._wheels.halt()  # before the log, which may take its time
        self._settle(tick, good)
        tick.work_ms = 1e3 * (self._stopwatch() - began)
        recording.write(tick)
        self.ticks += 1
        self.missed += tick.missed
        self.work.add(tick.work_ms / 1e3)
        self.late.add(beat.late)
        if failure is not None:
            raise failure
        if self._trouble is not None and tick.t - self._answered_at >= self._patience:
            raise self._given_up(self._trouble)
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
        if good:
            self._answered_at, self._trouble = tick.t, None
        if self.state == "running" and self.health.ailing:
            self._become("degrade", tick)
        elif self.state == "degraded" and self.health.sound:
            self._become("recover", tick)
        tick.state = self.state

    def _given_up(self, trouble: KheperaHilError) -> KheperaHilError:
        if isinstance(trouble, LinkLost):
            return LinkLost(f"{trouble}; it did not come back within {self._patience:g} s")
        return NoAnswer(
            f"no usable answer for {self._patience:g} s: is the robot still switched on, and the cable in?"
        )

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
                try:
                    order.obeyed(self._carry_out(order, tick))
                except OrderRefused as error:
                    order.refused(str(error))
                else:
                    tick.orders.append(order.words)

    def _carry_out(self, order: Order, tick: Tick) -> str:
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

    # What is done in a tick, state by state. Each returns whether the tick was a good one.

    def _advance(self, tick: Tick) -> bool:
        try:
            if self.state == "disconnected":
                return self._search(tick)
            if self.state == "connecting":
                return self._shake_hands(tick)
            if self.state == "ready":
                if not self.health.may_move:
                    return self._wait(tick)
                self._become("start", tick)
            return self._tick(tick)
        except LinkLost as error:
            if self._reopen is None:
                raise
            self._lose(tick, error, self._reopen)
        except RobotReset as error:
            self._was_reset(tick, error)
        return False

    def _tick(self, tick: Tick) -> bool:
        try:
            readings = self._read(tick)
            decision = self._controller.step(readings, self._rng)
        except RobotReset:
            raise
        except RobotError as error:
            self._without_data(tick, error)
            self._trouble = error
        except BrpError as error:
            # Evidence that is refused or impossible counts as a tick without data, so that the loop goes on; but
            # the robot was there.
            self._without_data(tick, error)
            self._answered_at, self._trouble = tick.t, None
        else:
            self._blind_periods = 0
            self._act(tick, decision)
            return tick.command is not None
        return False

    def _read(self, tick: Tick) -> Readings:
        readings: dict[str, tuple[int, ...]] = {}
        for letter in self._controller.needs:
            if letter == "N":
                readings["proximity"] = self._khepera.proximity()
            elif letter == "O":
                readings["light"] = self._khepera.light()
            else:
                raise NotImplementedError(f"no program may need {letter} yet")
        return Readings(**readings)

    def _act(self, tick: Tick, decision: Decision) -> None:
        tick.evidence, tick.clipped = dict(decision.evidence), dict(decision.clipped)
        tick.u, tick.draws = dict(decision.u), dict(decision.draws)
        tick.answers = {key: self._answer(key, given) for key, given in decision.answers.items()}
        self._send(tick, decision.left, decision.right)

    def _send(self, tick: Tick, left: int, right: int) -> None:
        try:
            tick.command = self._wheels.move(left, right)
        except RobotReset:
            raise
        except RobotError as error:
            # A robot that can be read but never confirms its speeds is as little under control as a silent one.
            tick.events.append(("warning", f"speeds not acknowledged: {error}"))
            self._trouble = error

    def _without_data(self, tick: Tick, error: Exception) -> None:
        tick.events.append(("warning", f"no data: {error}"))
        self.blind += 1
        self._blind_periods += 1 + tick.missed
        if self._blind_periods > HOLD:
            if self._wheels.halt():
                tick.command = (0, 0)
            else:
                tick.events.append(("warning", "ordered to stand still, not acknowledged"))

    # The way back: from a line that was lost, from a robot that was reset.

    def _lose(self, tick: Tick, error: LinkLost, reopen: Callable[[], Khepera]) -> None:
        tick.events.append(("error", str(error)))
        self._trouble = error
        self.losses += 1
        self.blind += 1
        self._become("lose", tick)
        self._wheels.let_go()
        self._reconnection = Reconnection(reopen, self._clock)

    def _search(self, tick: Tick) -> bool:
        assert self._reconnection is not None
        found = self._reconnection.poll()
        if found is None:
            self.blind += 1
            return False
        tick.events.append(
            ("info", f"{found.link.name} is open again, after {self._reconnection.attempts} attempts")
        )
        self._reconnection.close()
        self._reconnection = None
        self._khepera = found
        found.link.on_exchange = self._heard
        self._become("connect", tick)
        self._wheels.watch(found)
        return self._shake_hands(tick)

    def _was_reset(self, tick: Tick, error: RobotReset) -> None:
        tick.events.append(("error", str(error)))
        self._trouble = error
        self.resets += 1
        self.blind += 1
        self._wheels.forget()
        self.health.may_move = self._resume
        if self.state != "connecting":
            self._become("reset", tick)

    def _shake_hands(self, tick: Tick) -> bool:
        """The wheels first, and blindly; then everything as at the beginning, an attempt a tick."""
        self.blind += 1
        try:
            self._wheels.halt()
            self._khepera.link.resynchronise()
            self._khepera.version()
            tick.command = self._wheels.rest()
            was_reset = self._wheels.were_reset()
        except RobotReset:
            raise
        except RobotError as error:
            tick.events.append(("warning", f"no data: {error}"))
            self._trouble = error
            return False
        self._answered_at, self._trouble = tick.t, None
        self._become("connected", tick)
        if was_reset:
            self.resets += 1
            self.health.may_move = self._resume
            tick.events.append(("error", "the robot was reset unheard, or is another: its counters are back at 0"))
        if self.health.may_move:
            self._become("start", tick)
        else:
            tick.events.append(("warning", "the robot waits; it goes on by: khepera-hil order resume"))
        return False

    def _wait(self, tick: Tick) -> bool:
        """Nothing moves, but the robot is spoken to."""
        self.blind += 1
        try:
            tick.command = self._wheels.rest()
        except RobotReset:
            raise
        except RobotError as error:
            tick.events.append(("warning", f"no data: {error}"))
            self._trouble = error
            return False
        return True

    def _rest(self) -> None:
        # What is said from here on belongs to no tick, and nothing that becomes of the guard may disturb it.
        self._khepera.link.on_exchange = self._beat
        self._become("stop")
        try:
            self._wheels.stop()
        except LinkLost:
            if self.ended != "error":
                raise  # else the error that ended the loop says more
        finally:
            self._become("rest" if self.health.rested else "fail")

    def _beat(self, request: bytes, answer: bytes) -> None:
        with contextlib.suppress(GuardLost):
            self._guard.beat()

    def _answer(self, key: str, given: Distribution) -> Answer:
        name, variables, values = self._shapes[key]
        return Answer(name, variables, values, given.p)

    def _heard(self, request: bytes, answer: bytes) -> None:
        # What came although nobody had asked stands under "?"; it is only ever there when the line was in trouble.
        text = answer.decode("ascii", "backslashreplace").rstrip("\r\n")
        if request.strip():
            self._raw[chr(request.strip()[0])] = text
        elif text:
            self._raw["?"] = (self._raw.get("?", "") + text)[-500:]
        self._guard.beat()  # a tick on a bad line may take longer than the guard would wait
