"""Section 9: temporal sequences by inverse programming. What each behavior lets one expect to observe.

    Behavior, Behavior_t-1 in {idle, patrol, recognition, fire-intervention, homing, recharge}     [S9.1]
    Vigil, Base, Fire, Identify in {true, false}
    Energy in {very-high, high, low, very-low}

    P(Behavior Vigil Energy Base Fire Identify Behavior_t-1 | pi-behavior)                         [S9.2]
    = P(Behavior_t-1 | pi-behavior) P(Behavior | Behavior_t-1 pi-behavior)
      P(Vigil | Behavior pi-behavior) P(Energy | Behavior pi-behavior) P(Base | Behavior pi-behavior)
      P(Fire | Behavior pi-behavior) P(Identify | Behavior pi-behavior)

    P(Behavior_t-1 | pi-behavior) = Uniform                                                        [S9.3]
    all others: tables 2 to 7, read by column

    P(Behavior | Vigil Energy Base Fire Identify Behavior_t-1 pi-behavior)                         [E9.1]
    = 1/Sigma P(Behavior_t-1 | pi-behavior) P(Behavior | Behavior_t-1 pi-behavior)
      P(Vigil | Behavior pi-behavior) P(Energy | Behavior pi-behavior) P(Base | Behavior pi-behavior)
      P(Fire | Behavior pi-behavior) P(Identify | Behavior pi-behavior)

An "x" is an equal share of what its column leaves.

Table 2 is misprinted from its fourth row on (columns of the scanned text do not sum to one). It is read by the
prose: in recognition the robot stays by .99, in homing and recharge "the most probable behavior is to stay in the
current mode, although nothing is definitely excluded", and from fire-intervention "any switch to idle, recognition
or homing" is excluded.

18 of the 384 combinations of what is known are impossible under these tables: an idle robot lifted off its base, a
fire that goes out while Vigil is false. "A sequence of actions is always produced" (lesson 9), so there `behavior`
asks again without Behavior_t-1; ``behavior.possible(...)`` says whether it had to.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from brp.counts import Laplace
from brp.description import Description, Specification
from brp.forms import Form, Table, Uniform
from brp.question import Question
from brp.variables import P, Term, Variable

__all__ = ["Base", "Behavior", "Behavior_t_1", "Energy", "Fire", "Identify", "Vigil", "behaving", "behavior"]
__all__ += ["TABLES", "deciding", "pi_behavior", "pi_behavior_taught", "specified", "steadier"]

# [S9.1]
Behavior = Variable("Behavior", ("idle", "patrol", "recognition", "fire-intervention", "homing", "recharge"))
Vigil = Variable("Vigil", (False, True))
Energy = Variable("Energy", ("very-low", "low", "high", "very-high"))
Base = Variable("Base", (False, True))
Fire = Variable("Fire", (False, True))
Identify = Variable("Identify", (False, True))
Behavior_t_1 = Variable("Behavior_t-1", Behavior.values)

x = "x"
table_2: list[list[Any]] = [
    # idle  patrol recognition fire-intervention homing recharge     was Behavior_t-1
    [0.90, x, 0, 0, x, x],  # idle
    [x, 0.90, x, x, x, x],  # patrol
    [0, x, 0.99, 0, x, x],  # recognition
    [x, x, x, x, x, x],  # fire-intervention
    [0, x, x, 0, 0.90, x],  # homing
    [0, x, x, x, x, 0.90],  # recharge
]
# The columns of tables 3 to 7 are Behavior.
table_3 = [
    [0.90, 0, 0, x, 1, x],  # Vigil is false
    [0.10, 1, 1, x, 0, x],  # true
]
table_4 = [
    [0.325, 0, 0, x, x, 0.8],  # Energy is very-low
    [0.325, 0.1, 0.1, x, x, 0.2],  # low
    [0.25, x, x, x, x, 0],  # high
    [0.10, x, x, x, x, 0],  # very-high
]
table_5 = [
    [0, 0.99, 0.99, x, 0.99, 0.99],  # Base is false
    [1, 0.01, 0.01, x, 0.01, 0.01],  # true
]
table_6 = [
    [1, 1, 1, 0, 1, 1],  # Fire is false
    [0, 0, 0, 1, 0, 0],  # true
]
table_7 = [
    [x, x, 0, x, x, x],  # Identify is false
    [x, x, 1, x, x, x],  # true
]


TABLES: Mapping[int, Term] = MappingProxyType(
    {
        2: P(Behavior | Behavior_t_1),
        3: P(Vigil | Behavior),
        4: P(Energy | Behavior),
        5: P(Base | Behavior),
        6: P(Fire | Behavior),
        7: P(Identify | Behavior),
    }
)
"""What each of the paper's tables is about, by its number."""


def specified(tables: Mapping[int, Form]) -> Specification:
    """pi-behavior, with other forms in the places of some of its tables, by their numbers."""
    printed = {2: table_2, 3: table_3, 4: table_4, 5: table_5, 6: table_6, 7: table_7}
    # [S9.2] at the left; [S9.3] and the tables at the right.
    forms: dict[Term, Form] = {P(Behavior_t_1): Uniform()}
    for number, term in TABLES.items():
        forms[term] = tables.get(number) or Table(printed[number])
    return Specification(forms, name="pi-behavior")


pi_behavior = specified({})

pi_behavior_taught = specified({number: Laplace() for number in TABLES})
"""The same decomposition with tables that are learnt (lesson 9: "it is possible to learn these distributions")."""

behaving = (
    pi_behavior.identify()
)  # "No identification is required, as there are no free parameters in pi-behavior."


def deciding(description: Description) -> Question:
    """E9.1 of a description with these variables; where it is impossible, asked again without Behavior_t-1."""
    question = description.ask(P(Behavior | Vigil, Energy, Base, Fire, Identify, Behavior_t_1))
    return question.where_impossible(without=Behavior_t_1)


# [E9.1]
behavior = deciding(behaving)


def steadier(stay: float) -> Question:
    """E9.1 with a table 2 whose ``.90`` are ``stay``: a switch, for with the tables as printed patrol and recharge
    swap every 4.6 s while Energy is low (see ``docs/watchman.md``)."""
    rows = [[stay if entry == 0.90 else entry for entry in row] for row in table_2]
    return deciding(specified({2: Table(rows)}).identify())
