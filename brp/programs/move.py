"""Section 10.1: which movement a behavior is made of now. The paper names the variables and prints no more.

    Move, Move_t-1 in {stop, wander, home, follow, approach, blow}
    Behavior as in section 9
    Tempo in {running, elapsed}
    Tour in {undone, done}

    P(Move Behavior Move_t-1 Tempo Tour | pi-move)
    = P(Move_t-1 | pi-move) P(Move | Move_t-1 pi-move) P(Behavior | Move pi-move)
      P(Tempo | Move Move_t-1 pi-move) P(Tour | Move pi-move)

    P(Move_t-1 | pi-move) = Uniform; all others: tables

    P(Move | Behavior Move_t-1 Tempo Tour pi-move)
    = 1/Sigma P(Move | Move_t-1 pi-move) P(Behavior | Move pi-move) P(Tempo | Move Move_t-1 pi-move)
      P(Tour | Move pi-move)

Programmed inversely, as section 9 is. The decomposition and the tables are ours. Tempo is elapsed when Move_t-1 has
lasted its `QUOTA`; Tour is done when the robot has gone once around the object. No combination of what is known is
impossible. So the robot patrols by wandering, "stops occasionally to detect movement", follows the contour of an
object to recognise it, and verifies "that it is really facing a fire by trying to blow it".
"""

from brp.description import Specification
from brp.forms import Table, Uniform
from brp.programs.behavior import Behavior
from brp.variables import P, Variable

__all__ = ["QUOTA", "Behavior", "Move", "Move_t_1", "Tempo", "Tour", "move", "moving", "pi_move"]

Move = Variable("Move", ("stop", "wander", "home", "follow", "approach", "blow"))
Move_t_1 = Variable("Move_t-1", Move.values)
Tempo = Variable("Tempo", ("running", "elapsed"))
Tour = Variable("Tour", ("undone", "done"))

QUOTA = {"stop": 20, "wander": 100, "follow": 900, "approach": 200, "blow": 20}
"""After how many ticks of a Move Tempo is elapsed; homing has no end but the base. An approach has 20 s, enough for
400 mm; on the robot its Tempo is elapsed as well when it has come up to the flame. With a fixed 5 s the turbine
blew at flames that were still out of its reach, and three blows without effect are a false fire."""

move_given_last = [
    # stop   wander home   follow approach blow     was Move_t-1
    [0.900, 0.025, 0.025, 0.025, 0.02, 0.02],  # stop
    [0.025, 0.900, 0.025, 0.025, 0.02, 0.02],  # wander
    [0.025, 0.025, 0.900, 0.025, 0.02, 0.02],  # home
    [0.025, 0.025, 0.025, 0.900, 0.02, 0.02],  # follow
    [0.025, 0.025, 0.025, 0.025, 0.90, 0.02],  # approach
    [0.000, 0.000, 0.000, 0.000, 0.02, 0.90],  # blow
]

behavior_given_move = {
    "stop": {"idle": 0.6, "patrol": 0.3, "recognition": 0.1},
    "wander": {"patrol": 1},
    "home": {"homing": 0.5, "recharge": 0.5},
    "follow": {"recognition": 1},
    "approach": {"fire-intervention": 1},
    "blow": {"fire-intervention": 1},
}

done_given_move = {"stop": 0.9, "wander": 0.1, "follow": 0.00001, "home": 0.5, "approach": 0.5, "blow": 0.5}


def tempo(Tempo: str, Move: str, Move_t_1: str) -> float:
    """Elapsed is what lets one expect another Move."""
    elapsed = 0.02 if Move == Move_t_1 else 0.99
    return elapsed if Tempo == "elapsed" else 1 - elapsed


pi_move = Specification(
    {
        P(Move_t_1): Uniform(),
        P(Move | Move_t_1): Table(move_given_last),
        P(Behavior | Move): Table(behavior_given_move),
        P(Tempo | Move, Move_t_1): Table(tempo),
        P(Tour | Move): Table({m: {"undone": 1 - done, "done": done} for m, done in done_given_move.items()}),
    },
    name="pi-move",
)

moving = pi_move.identify()

move = moving.ask(P(Move | Behavior, Move_t_1, Tempo, Tour))
