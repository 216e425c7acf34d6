"""What the watchman remembers from one tick to the next: Behavior_t-1, Move_t-1, and how long it has moved so."""

from __future__ import annotations

from collections.abc import Mapping
from typing import cast

from brp import Value
from brp.programs.move import QUOTA

__all__ = ["Drawn", "tempo"]


def tempo(move: str, age: int, *, arrived: bool) -> str:
    """Tempo, when ``move`` has lasted ``age`` ticks. An approach has run its time also when it has arrived."""
    lasted = move in QUOTA and age >= QUOTA[move]
    return "elapsed" if lasted or (move == "approach" and arrived) else "running"


class Drawn:
    """The usual memory: one Behavior and one Move, drawn given the motors that were drawn.

    So the motors keep the law of E10.4 and the memory fits the movement: wheels that stand still are remembered as
    a stop. Before the first tick it is an idle robot's.
    """

    def __init__(self) -> None:
        self.behavior, self.move, self.age = "idle", "stop", 0

    def evidence(self, *, arrived: bool) -> dict[str, Value]:
        """Behavior_t-1, Move_t-1 and Tempo."""
        return {
            "Behavior_t-1": self.behavior,
            "Move_t-1": self.move,
            "Tempo": tempo(self.move, self.age, arrived=arrived),
        }

    def keep(self, draws: Mapping[str, Value]) -> None:
        """Remember what was drawn in this tick."""
        move = cast(str, draws["Move"])
        self.age = self.age + 1 if move == self.move else 1
        self.behavior, self.move = cast(str, draws["Behavior"]), move
