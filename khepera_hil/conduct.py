"""A program at the wheel, one tick at a time: read, decide, act; and what the wheels do when it is blind."""

from __future__ import annotations

from typing import Any

import numpy as np

from brp import BrpError, Distribution
from khepera_hil.controllers import Controller, Decision
from khepera_hil.errors import RobotError, RobotReset
from khepera_hil.perception import Readings
from khepera_hil.reader import Reader
from khepera_hil.recording import Answer, Tick
from khepera_hil.wheels import Wheels

__all__ = ["HOLD", "Conduct"]

HOLD = 2
"""Periods without readings during which the wheels keep what they were told; then they are told to stop."""


class Conduct:
    """Lets ``controller`` drive by what ``reader`` reads. ``rng`` is the program's own stream of chance."""

    def __init__(self, controller: Controller, reader: Reader, wheels: Wheels, rng: np.random.Generator) -> None:
        self.reader = reader
        """To be replaced when the robot is another."""
        self._controller, self._wheels, self._rng = controller, wheels, rng
        self._blind_periods = 0
        self._shapes = {
            key: (
                question.name,
                tuple(v.name for v in question.searched),
                tuple(tuple(v.values) for v in question.searched),
            )
            for key, question in controller.questions.items()
        }

    def manifest(self) -> dict[str, Any]:
        """What the program asks each tick and what it knows then."""
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
        return {"questions": questions, "evidence": known, "needs": list(map(str, self._controller.needs))}

    def turn(self, tick: Tick) -> RobotError | None:
        """One tick, written into ``tick``; what was wrong with the robot, if anything was.

        Evidence that is refused or impossible counts as a tick without data, so that the loop goes on; it is no
        fault of the robot's. Raises LinkLost, GuardLost and RobotReset.
        """
        try:
            readings = self._read(tick)
            decision = self._controller.step(readings, self._rng)
        except RobotReset:
            raise
        except (RobotError, BrpError) as error:
            self._without_data(tick, error)
            return error if isinstance(error, RobotError) else None
        self._blind_periods = 0
        return self._act(tick, decision)

    def _read(self, tick: Tick) -> Readings:
        try:
            return self.reader.read(tick.tick)
        finally:
            tick.events += [("info", remark) for remark in self.reader.remarks]

    def _act(self, tick: Tick, decision: Decision) -> RobotError | None:
        tick.evidence, tick.clipped = dict(decision.evidence), dict(decision.clipped)
        tick.u, tick.draws = dict(decision.u), dict(decision.draws)
        tick.events.extend(decision.events)
        tick.answers = {key: self._answer(key, given) for key, given in decision.answers.items()}
        try:
            tick.command = self._wheels.move(decision.left, decision.right)
            self._command(tick, decision)
        except RobotReset:
            raise
        except RobotError as error:
            # A robot that can be read but never confirms its speeds is as little under control as a silent one.
            tick.events.append(("warning", f"speeds not acknowledged: {error}"))
            return error
        return None

    def _command(self, tick: Tick, decision: Decision) -> None:
        """What the body does beside its wheels, which come first; the robot is none the worse for not hearing
        it."""
        for letter, *values in decision.commands:
            try:
                self._wheels.beside(str(letter), *values)
            except RobotReset:
                raise
            except RobotError as error:
                said = ",".join(map(str, (letter, *values)))
                tick.events.append(("warning", f"{said} not acknowledged: {error}"))

    def _without_data(self, tick: Tick, error: Exception) -> None:
        tick.events.append(("warning", f"no data: {error}"))
        self._blind_periods += 1 + tick.missed
        if self._blind_periods > HOLD:
            if self._wheels.halt():
                tick.command = (0, 0)
            else:
                tick.events.append(("warning", "ordered to stand still, not acknowledged"))

    def _answer(self, key: str, given: Distribution) -> Answer:
        name, variables, values = self._shapes[key]
        return Answer(name, variables, values, given.p)
