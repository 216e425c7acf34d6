"""Section 10: the night watchman. All previous descriptions integrated into a single one.

    Sensory-variables = Px1 ... Px8 L1 ... L8 Vigil Energy Fire Identify Behavior_t-1              [E10.1]
                        Move_t-1 Tempo Tour Dir Prox DirL ProxL Vtrans_c Nlt Nrt Per Lrl

    P(Sensory-variables Base Theta2 Behavior Move H Vrot Vtrans O | pi-watchman)                   [E10.2]
    = P(Sensory-variables | pi-watchman)
      P(Base | Px1 ... Px8 L1 ... L8 pi-base)
      P(Theta2 | L1 L2 L3 L4 L5 L6 L7 L8 pi-fusion)
      P(Behavior | Vigil Energy Base Fire Identify Behavior_t-1 pi-behavior)
      P(Move | Behavior Move_t-1 Tempo Tour pi-move)
      P(H | Prox pi-home)
      P(Vrot Vtrans | Move H Dir Prox DirL ProxL Vtrans_c Theta2 pi-speed)
      P(O | Nlt Nrt Per Lrl pi-object)

    P(Sensory-variables | pi-watchman) = Uniform

    P(Vrot Vtrans O | Sensory-variables pi-watchman)                                               [E10.3]
    = 1/Sigma P(O | Nlt Nrt Per Lrl pi-object)                                                     [E10.4]
      Sum_Move Sum_H Sum_Theta2
        Sum_Behavior [ P(Move | Behavior ... Tour pi-move)
          Sum_Base [ P(Behavior | Vigil ... Behavior_t-1 pi-behavior) P(Base | Px1 ... L8 pi-base) ] ]    [E10.5]
        P(Theta2 | L1 ... L8 pi-fusion) P(H | Prox pi-home) P(Vrot Vtrans | Move ... Theta2 pi-speed)

Each term is a question, normalised for every value of what it knows, and none is evidence about another: what
Move_t-1, Tempo and Tour are says nothing about Behavior. Behavior knows Base; where that row is impossible under
pi-behavior, it is asked again without Behavior_t-1 (see `brp.programs.behavior`).
"""

from brp.description import Specification
from brp.forms import Form, Uniform
from brp.programs.base import Base, Px, at_base
from brp.programs.behavior import Behavior, Behavior_t_1, Energy, Fire, Identify, Vigil, behavior
from brp.programs.fusion import L, Theta2, locate
from brp.programs.home import H, command2
from brp.programs.move import Move, Move_t_1, Tempo, Tour, move
from brp.programs.object import Lrl, Nlt, Nrt, O, Per, recognise
from brp.programs.speed import Dir, DirL, Prox, ProxL, Vrot, Vtrans, Vtrans_c, speed
from brp.variables import P

__all__ = ["O", "Sensory_variables", "Vrot", "Vtrans", "pi_watchman", "watching", "watchman"]

# [E10.1]
Sensory_variables = (
    *(*Px, *L),
    *(Vigil, Energy, Fire, Identify, Behavior_t_1),
    *(Move_t_1, Tempo, Tour, Dir, Prox, DirL, ProxL, Vtrans_c),
    *(Nlt, Nrt, Per, Lrl),
)


def pi_watchman(
    recognise: Form = recognise, *, locate: Form = locate, behavior: Form = behavior, move: Form = move
) -> Specification:
    """The preliminary knowledge, with what is known of the objects by now.

    ``locate`` answers P(Theta2 | L1 ... L8); the robot's watchman takes `brp.programs.beacon`, whose lamp may be
    far or out of sight. ``behavior`` and ``move`` are the two temporal sequences.
    """
    # [E10.2]
    return Specification(
        {
            P(Sensory_variables): Uniform(),
            P(Base | Px, L): at_base,
            P(Theta2 | L): locate,
            P(Behavior | Vigil, Energy, Base, Fire, Identify, Behavior_t_1): behavior,
            P(Move | Behavior, Move_t_1, Tempo, Tour): move,
            P(H | Prox): command2,
            P(Vrot, Vtrans | Move, H, Dir, Prox, DirL, ProxL, Vtrans_c, Theta2): speed,
            P(O | Nlt, Nrt, Per, Lrl): recognise,
        },
        name="pi-watchman",
    )


watching = pi_watchman().identify()  # "No identification is required."

watchman = watching.ask(P(Vrot, Vtrans, O | Sensory_variables))  # [E10.3]
