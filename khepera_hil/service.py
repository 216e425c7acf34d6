"""A program on a robot from the handshake to wheels that stand still, whatever happens in between."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from brp import BrpError, Distribution
from khepera_hil.budget import plan
from khepera_hil.clock import Clock
from khepera_hil.controllers import Controller, Decision
from khepera_hil.errors import KheperaHilError, LinkLost, NoAnswer, RobotError
from khepera_hil.khepera import Khepera
from khepera_hil.lifecycle import Lifecycle
from khepera_hil.perception import Readings
from khepera_hil.quantiles import Quantiles
from khepera_hil.reader import Reader
from khepera_hil.recording import Answer, Pose, Recording, Tick
from khepera_hil.scheduler import Beat, beats

__all__ = ["GIVE_UP", "HOLD", "Service", "Witness"]

HOLD = 2
"""Periods without readings during which the wheels keep what they were told; then they are told to stop."""

GIVE_UP = 20
"""Ticks without readings or without an acknowledged speed, one after the other, after which the robot counts as
silent and the run ends."""


class Witness(Protocol):
    """Somebody who sees the robot from outside: the emulator's world, or nobody (metres, radians)."""

    def pose(self) -> Pose:
        """The robot's true pose."""

    def poses(self) -> Mapping[str, Pose]:
        """The true poses of everything that moves or can be moved, the robot (``robot``) among it."""

    def heard_alarm(self) -> None:
        """The program sounded its alarm."""

    def orders(self) -> Sequence[tuple[str, bool]]:
        """The operator's orders since the last time, and whether each is switched on."""


class Service:
    """Runs one controller on one robot, and owns the wheels while it does.

    ``rng`` is the program's own stream of chance. With ``verify`` the sensors are read twice (see
    :class:`~khepera_hil.reader.Reader`). ``stopwatch`` (seconds) and ``wall`` (Unix time) fill the columns of the
    log that are the host's own; nothing is decided by them. Raises WireTooSlow for what does not fit into a tick.
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
        stopwatch: Callable[[], float] = time.perf_counter,
        wall: Callable[[], float] = time.time,
    ) -> None:
        self.lifecycle = Lifecycle()
        self.ticks = self.missed = self.blind = 0
        """Ticks done, deadlines missed, ticks without readings."""
        self.work, self.late = Quantiles(), Quantiles()
        """Seconds of the host that each tick took, waiting for the wire included; seconds that it came late."""
        self.ended: str | None = None
        """Why the loop ended: ``duration``, the reason given to :meth:`stop`, or ``error``."""
        self.rested = False
        """Whether the robot acknowledged the order to stand still at the end."""
        self.error: str | None = None
        """What ended the loop, when it was an error of ours."""
        self._khepera, self._controller, self._witness = khepera, controller, witness
        self._clock, self._period, self._rng = clock, period, rng
        self._stopwatch, self._wall = stopwatch, wall
        self._reason: str | None = None
        self._raw: dict[str, str] = {}
        self._commanding = False
        self._blind_periods = self._silent_in_a_row = 0
        self._told: dict[str, Pose] = {}
        self._shapes = {
            key: (
                question.name,
                tuple(v.name for v in question.searched),
                tuple(tuple(v.values) for v in question.searched),
            )
            for key, question in controller.questions.items()
        }
        self._reader = Reader(
            khepera,
            plan(controller.name, controller.needs, baud=khepera.link.baud, period=period, verify=verify),
            verify,
        )
        khepera.link.on_exchange = self._heard

    def connect(self) -> tuple[str, str]:
        """Shake hands, and command the wheels to stand still; the robot's versions (manual's B)."""
        self.lifecycle.send("connect")
        try:
            versions = self._khepera.handshake()
            if not self._khepera.stop():
                raise NoAnswer("the robot does not confirm the order to stand still: see that its line is good")
        except (RobotError, LinkLost):
            self.lifecycle.send("fail")
            raise
        self.lifecycle.send("connected")
        return versions

    def program(self) -> dict[str, Any]:
        """What the program asks each tick and what it knows then, for the run's manifest."""
        known = {v.name: list(v.values) for question in self._controller.questions.values() for v in question.known}
        questions = [
            {
                "key": key,
                "name": name,
                "description": " ".join(self._controller.questions[key].names),
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

    def run(self, recording: Recording, *, duration: float | None = None) -> None:
        """The loop, for so many seconds of the robot's time; however it ends, the wheels are commanded to stop."""
        self.lifecycle.send("start")
        self.ended = "error"  # until the loop is seen to end well
        try:
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

    def _turn(self, beat: Beat, recording: Recording) -> None:
        tick = self._begin(beat)
        began = self._stopwatch()
        lost = None
        try:
            self._tick(tick)
        except LinkLost as error:
            tick.events.append(("error", str(error)))
            lost = error
        tick.work_ms = 1e3 * (self._stopwatch() - began)
        recording.write(tick)
        self.ticks += 1
        self.missed += tick.missed
        self.work.add(tick.work_ms / 1e3)
        self.late.add(beat.late)
        if lost is not None:
            raise lost
        if self._silent_in_a_row >= GIVE_UP:
            raise NoAnswer(
                f"no usable answer for {GIVE_UP} ticks: is the robot still switched on, and the cable in?"
            )

    def _rest(self) -> None:
        self._raw = {}  # what is said from here on belongs to no tick
        try:
            self.rested = self._khepera.stop()
            for letter, *values in getattr(self._controller, "at_rest", ()):
                with contextlib.suppress(RobotError):  # the wheels stand still; that is what counts
                    self._khepera.command(str(letter), *values)
        except LinkLost:
            if self.ended != "error":
                raise  # else the error that ended the loop says more
        finally:
            self.lifecycle.send("stop")
            self.lifecycle.send("rest" if self.rested else "fail")

    def _begin(self, beat: Beat) -> Tick:
        self._raw = {}
        tick = Tick(tick=beat.tick, t=beat.due, late_ms=1e3 * beat.late, missed=beat.missed, raw=self._raw)
        tick.wall = self._wall()
        self._look(tick)
        if beat.tick == 0:
            tick.events.append(("info", f"{self._controller.name} runs, a tick every {self._period:g} s"))
        if beat.missed:
            tick.events.append(("warning", f"{beat.missed} deadlines missed"))
        return tick

    def _tick(self, tick: Tick) -> None:
        try:
            readings = self._read(tick)
            decision = self._controller.step(readings, self._rng)
        except RobotError as error:
            self._silent_in_a_row += 1
            self._without_data(tick, error)
        except BrpError as error:
            # Evidence that is refused or impossible counts as a tick without data, so that the loop goes on.
            self._silent_in_a_row = 0
            self._without_data(tick, error)
        else:
            self._blind_periods = 0
            self._act(tick, decision)
            # A robot that can be read but never confirms its speeds is as little under control as a silent one.
            self._silent_in_a_row = 0 if tick.command is not None else self._silent_in_a_row + 1

    def _read(self, tick: Tick) -> Readings:
        try:
            return self._reader.read(tick.tick)
        finally:
            tick.events += [("info", remark) for remark in self._reader.remarks]

    def _act(self, tick: Tick, decision: Decision) -> None:
        tick.evidence, tick.clipped = dict(decision.evidence), dict(decision.clipped)
        tick.u, tick.draws = dict(decision.u), dict(decision.draws)
        tick.events.extend(decision.events)
        tick.answers = {key: self._answer(key, given) for key, given in decision.answers.items()}
        self._send(tick, decision.left, decision.right)
        self._command(tick, decision.commands)
        if self._witness is not None and any(level == "alarm" for level, _ in decision.events):
            self._witness.heard_alarm()

    def _send(self, tick: Tick, left: int, right: int) -> None:
        try:
            tick.command = self._khepera.set_speed(left, right)
        except RobotError as error:
            tick.events.append(("warning", f"speeds not acknowledged: {error}"))

    def _command(self, tick: Tick, commands: Sequence[tuple[int | str, ...]]) -> None:
        """What the body does beyond its wheels. It is none of the readings, so it stands in the log as a whole."""
        for letter, *values in commands:
            self._commanding = True
            try:
                self._khepera.command(str(letter), *values)
            except RobotError as error:
                tick.events.append(("warning", f"{','.join(map(str, (letter, *values)))} not acknowledged: {error}"))
            finally:
                self._commanding = False

    def _without_data(self, tick: Tick, error: Exception) -> None:
        tick.events.append(("warning", f"no data: {error}"))
        self.blind += 1
        self._blind_periods += 1 + tick.missed
        if self._blind_periods > HOLD:
            if self._khepera.halt():
                tick.command = (0, 0)
            else:
                tick.events.append(("warning", "ordered to stand still, not acknowledged"))

    def _answer(self, key: str, given: Distribution) -> Answer:
        name, variables, values = self._shapes[key]
        return Answer(name, variables, values, given.p)

    def _heard(self, request: bytes, answer: bytes) -> None:
        # What came although nobody had asked stands under "?"; it is only ever there when the line was in trouble.
        text = answer.decode("ascii", "backslashreplace").rstrip("\r\n")
        if asked := request.strip().decode("ascii"):
            # A letter says enough, but where one has many questions; what is read again in a tick is numbered.
            name = asked if asked[0] in "IRT" else asked[0]
            again = sum(known.partition(" ")[0] == name for known in self._raw)
            self._raw[f"{name} {again + 1}" if again else name] = text
        elif text:
            self._raw["?"] = (self._raw.get("?", "") + text)[-500:]

    def _look(self, tick: Tick) -> None:
        if self._witness is None:
            return
        tick.pose = _rounded(self._witness.pose())
        tick.orders = [f"{order} {'on' if on else 'off'}" for order, on in self._witness.orders()]
        for name, pose in self._witness.poses().items():
            seen = _rounded(pose)
            if name != "robot" and self._told.get(name) != seen:
                self._told[name] = tick.moved[name] = seen


def _rounded(pose: Pose) -> Pose:
    """To a hundredth of a millimetre, and as much of an angle: what is below would only fill the log."""
    return round(pose[0], 5), round(pose[1], 5), round(pose[2], 5)
