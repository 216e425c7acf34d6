"""What a tick reads from the robot, when, and whether it may be believed."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import inf
from typing import NoReturn

from khepera_hil.budget import SPEEDS, Plan
from khepera_hil.errors import BadAnswer, Implausible, ProtocolError, Refused, RobotError, RobotReset
from khepera_hil.khepera import Khepera
from khepera_hil.perception import Need, Readings
from khepera_hil.plausible import TRUST, alone, doubtful, settled, sudden
from khepera_hil.transcript import numbers

__all__ = ["Checks", "Reader"]

_OFF = 4  # units of command D by which a wheel's measured speed may miss the order before anybody is told
_SURE = 2
"""Times in a row that a need is refused until the robot counts as one that lacks it: a request may be garbled."""

_LOOK_AGAIN = 100
"""Ticks after which such a need is asked again: a turret may be plugged in, or have been garbled twice."""

_SENSORS = ("left 90", "left 45", "left 10", "right 10", "right 45", "right 90", "back right", "back left")


@dataclass
class Checks:
    """What came of not taking readings on trust."""

    verified: int = 0
    """Answers that were read twice."""
    third: int = 0
    """Of these, those that a third reading had to settle."""
    refused: int = 0
    """Ticks whose readings were refused although the line had carried them well."""
    read_back: int = 0
    """Times that the wheels' measured speeds were compared with the orders."""
    off: int = 0
    """Of these, those that missed them."""


@dataclass(frozen=True)
class _Believed:
    values: tuple[int, ...]
    way: float
    turn: float


@dataclass
class Reader:
    """Meets a program's needs tick by tick, as ``plan`` spreads them.

    With ``verify`` the sensors that move the robot (N and O) are read twice. One whose two readings differ by more
    than 60 counts is settled by the median with a third; and what has changed since it was last believed by more
    than the robot's way and turn allow is believed when three readings bear it out, and else the tick is refused.
    Other readings (the camera's, the counters') are taken once.
    """

    khepera: Khepera
    plan: Plan
    verify: bool = False
    checks: Checks = field(default_factory=Checks)
    remarks: list[str] = field(default_factory=list)
    """What the user should know of the last tick's readings, a sentence each."""
    _believed: dict[str, _Believed] = field(default_factory=dict)
    _refused: dict[Need, tuple[int, int]] = field(default_factory=dict)
    """Of needs that a program can do without: how often in a row, and the tick before which they are not asked."""

    def read(self, tick: int) -> Readings:
        """The readings of tick number ``tick``; a need that is not due in it, or that the robot lacks and the
        program can do without, is not among them.

        Raises what :meth:`Khepera.proximity` raises, and Implausible. There is no other way to get a reading
        than from this tick's own answers.
        """
        self.remarks.clear()
        answers: dict[tuple[int | str, ...], tuple[int | str, ...]] = {}
        named: dict[str, tuple[int, ...]] = {}
        for need in self.plan.at(tick):
            if need is SPEEDS:
                self._read_back()
            elif need.letter in TRUST:
                values = self._verified(need.letter) if self.verify else self._sensors(need.letter)
                named["proximity" if need.letter == "N" else "light"] = values
            elif (other := self._other(need) if not need.without else self._if_there(need, tick)) is not None:
                answers[(need.letter, *need.values)] = other
        return Readings(**named, answers=answers)

    def _sensors(self, letter: str) -> tuple[int, ...]:
        return self.khepera.proximity() if letter == "N" else self.khepera.light()

    def _verified(self, letter: str) -> tuple[int, ...]:
        readings = [self._sensors(letter), self._sensors(letter)]
        self.checks.verified += 1
        way, turn = self.khepera.motion.until(self.khepera.link.clock.now())
        old, most, moved = readings[0], inf, ""
        if (before := self._believed.get(letter)) is not None:
            old, most = before.values, TRUST[letter].most(way - before.way, turn - before.turn)
            moved = f"{way - before.way:.1f} mm and {turn - before.turn:.2f} rad"
        if places := sorted({*doubtful(*readings), *sudden(old, readings, most)}):
            self.checks.third += 1
            readings.append(self._sensors(letter))
            self.remarks.append(f"{letter} was read a third time for {', '.join(_SENSORS[p] for p in places)}")
            if apart := alone(readings):
                self._refuse(letter, apart[0], readings, "no two of them agree")
            if jumped := sudden(old, readings, most):
                self._refuse(letter, jumped[0], readings, f"{moved} after {old[jumped[0]]}, and not all say so")
        self._believed[letter] = _Believed(settled(readings), way, turn)
        return settled(readings)

    def _refuse(self, letter: str, place: int, readings: list[tuple[int, ...]], why: str) -> NoReturn:
        self.checks.refused += 1
        values = ", ".join(str(reading[place]) for reading in readings)
        raise Implausible(f"{letter} at {_SENSORS[place]} reads {values}: {why}")

    def _other(self, need: Need) -> tuple[int | str, ...]:
        try:
            return numbers(need, self.khepera.link.ask(need.letter, *need.values))
        except ProtocolError as error:
            raise BadAnswer(str(error)) from error

    def _if_there(self, need: Need, tick: int) -> tuple[int | str, ...] | None:
        """A need that the program can do without; None where the robot lacks it."""
        often, again = self._refused.get(need, (0, 0))
        if tick < again:
            return None
        try:
            values = self._other(need)
        except Refused:
            often += 1
            self._refused[need] = often, tick + 1 if often < _SURE else tick + _LOOK_AGAIN
            if often == _SURE:
                self.remarks.append(need.without)
            return None
        if often >= _SURE:
            self.remarks.append(f"{need} is answered now")
        self._refused.pop(need, None)
        return values

    def _read_back(self) -> None:
        """Compare the measured speeds with the orders of the last two ticks, between which the wheels may be."""
        motion = self.khepera.motion
        try:
            measured = self.khepera.speeds()
        except RobotReset:
            raise
        except RobotError as error:
            self.remarks.append(f"the wheels' speeds could not be read back: {error}")
            return
        self.checks.read_back += 1
        for is_at, *orders in zip(measured, *motion.orders, strict=True):
            if not min(orders) - _OFF <= is_at <= max(orders) + _OFF:
                self.checks.off += 1
                self.remarks.append(f"the wheels turn at {measured}, told {motion.orders[-1]}")
                return
