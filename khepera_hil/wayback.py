"""The way back: from a line that was lost, or a robot that was reset, to wheels that may turn again.

What is done in a tick of the states ``disconnected``, ``connecting`` and ``ready``, and how long a robot may be
without an answer.
"""

from __future__ import annotations

from collections.abc import Callable

from khepera_hil.clock import Clock
from khepera_hil.errors import KheperaHilError, LinkLost, NoAnswer, RobotError, RobotReset
from khepera_hil.khepera import Khepera
from khepera_hil.lifecycle import Health
from khepera_hil.reconnection import Reconnection
from khepera_hil.recording import Tick
from khepera_hil.wheels import Wheels

__all__ = ["WayBack"]


class WayBack:
    """Leads one service's robot back.

    ``become`` takes the lifecycle on by an event, ``adopt`` has the service use a robot on a new line; ``reopen``,
    ``resume`` and ``patience`` are as in :class:`~khepera_hil.service.Service`.
    """

    def __init__(
        self,
        khepera: Khepera,
        wheels: Wheels,
        health: Health,
        clock: Clock,
        *,
        become: Callable[[str, Tick], None],
        adopt: Callable[[Khepera], None],
        reopen: Callable[[], Khepera] | None,
        resume: bool,
        patience: float,
    ) -> None:
        self.losses = self.resets = 0
        """Times that the line was lost, the robot reset."""
        self._khepera, self._wheels, self._health, self._clock = khepera, wheels, health, clock
        self._become, self._adopt = become, adopt
        self._reopen, self._resume, self._patience = reopen, resume, patience
        self._reconnection: Reconnection | None = None
        self._new_line = False
        self._answered_at = 0.0  # the robot's time of the last tick that went as it should
        self._trouble: KheperaHilError | None = None  # the last one since then

    def went(self, tick: Tick, trouble: KheperaHilError | None) -> None:
        """How a tick went with the robot."""
        if trouble is None:
            self._answered_at = tick.t
        self._trouble = trouble

    def given_up(self, tick: Tick) -> KheperaHilError | None:
        """What ends the run, once nothing usable came for too long."""
        if self._trouble is None or tick.t - self._answered_at < self._patience:
            return None
        if isinstance(self._trouble, LinkLost):
            return LinkLost(f"{self._trouble}; it did not come back within {self._patience:g} s")
        return NoAnswer(
            f"no usable answer for {self._patience:g} s: is the robot still switched on, and the cable in?"
        )

    def lost(self, tick: Tick, error: LinkLost) -> None:
        """The line is gone: look for it, from the next tick on. Raises the error where nobody can open it again."""
        if self._reopen is None:
            raise error
        tick.events.append(("error", str(error)))
        self._trouble = error
        self.losses += 1
        self._become("lose", tick)
        self._wheels.let_go()
        self._reconnection = Reconnection(self._reopen, self._clock)

    def was_reset(self, tick: Tick, error: RobotReset) -> None:
        """The robot stands still and forgot everything; it waits until somebody says that it may go on."""
        tick.events.append(("error", str(error)))
        self._trouble = error
        self.resets += 1
        self._wheels.forget()
        self._health.may_move = self._resume

    def search(self, tick: Tick) -> None:
        """A tick without a line."""
        assert self._reconnection is not None
        found = self._reconnection.poll()
        if found is None:
            return
        tick.events.append(
            ("info", f"{found.link.name} is open again, after {self._reconnection.attempts} attempts")
        )
        self._reconnection.close()
        self._reconnection = None
        found.link.until = self._khepera.link.until
        self._khepera, self._new_line = found, True
        self._adopt(found)
        self._become("connect", tick)
        self._wheels.watch(found)
        self.shake_hands(tick)

    def shake_hands(self, tick: Tick) -> None:
        """The wheels first, and blindly; then everything as at the beginning, an attempt a tick."""
        link = self._khepera.link
        try:
            self._wheels.halt()
            link.begin()
            self._khepera.version()
            tick.command = self._wheels.rest()
            was_reset = self._wheels.were_reset() or (self._new_line and link.counters.boot_texts > 0)
        except RobotReset:
            raise
        except RobotError as error:
            tick.events.append(("warning", f"no data: {error}"))
            self._trouble = error
            return
        self.went(tick, None)
        self._become("connected", tick)
        self._new_line = False
        if was_reset:
            self.resets += 1
            self._health.may_move = self._resume
            tick.events.append(("error", "the robot was reset while its line was lost, or is another"))
        if self._health.may_move:
            self._become("start", tick)
        else:
            tick.events.append(("warning", "the robot waits; it goes on by: khepera-hil order resume"))

    def wait(self, tick: Tick) -> bool:
        """Nothing moves, but the robot is spoken to; whether it answered."""
        try:
            tick.command = self._wheels.rest()
        except RobotReset:
            raise
        except RobotError as error:
            tick.events.append(("warning", f"no data: {error}"))
            self._trouble = error
            return False
        self.went(tick, None)
        return True

    def close(self) -> None:
        """Look for it no more."""
        if self._reconnection is not None:
            self._reconnection.close()
