"""The usual memory of the watchman: Behavior_t-1, Move_t-1, and how long it has moved so."""

from __future__ import annotations

from brp import Value
from brp.programs.move import QUOTA

__all__ = ["Drawn"]


class Drawn:
    """One Behavior and one Move, drawn given the motors that were drawn.

    So the motors keep the law of E10.4 and the memory fits the movement: wheels that stand still are remembered as
    a stop. Before the first tick it is that of a robot on its way home: of that Behavior_t-1 nothing is impossible.
    """

    def __init__(self) -> None:
        self.behavior, self.move, self.age = "homing", "stop", 0

    def evidence(self, *, arrived: bool) -> dict[str, Value]:
        """Behavior_t-1, Move_t-1 and Tempo. An approach has run its time also when the robot has arrived."""
        lasted = self.move in QUOTA and self.age >= QUOTA[self.move]
        elapsed = lasted or (self.move == "approach" and arrived)
        return {
            "Behavior_t-1": self.behavior,
            "Move_t-1": self.move,
            "Tempo": "elapsed" if elapsed else "running",
        }

    def keep(self, behavior: str, move: str) -> None:
        """Remember this tick's."""
        self.age = self.age + 1 if move == self.move else 1
        self.behavior, self.move = behavior, move
