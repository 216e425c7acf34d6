"""The wire's budget: what a program reads in which tick, and whether the line can carry it.

Everything is counted at its longest: the widest number of every field, one request after the other, 11 bit times
a character. How long the robot thinks before it answers is printed nowhere and is not in it; RESERVE is kept for
that, for computing and for the host's lateness.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from khepera_hil.errors import WireTooSlow
from khepera_hil.perception import Need
from khepera_hil.plausible import READINGS, TRUST
from khepera_hil.protocol import BAUD_RATES, COMMANDS, encode_request, wire_seconds
from khepera_hil.turrets import longest_turret_answer

__all__ = ["READ_BACK", "RESERVE", "SPEEDS", "Plan", "needed", "plan", "seconds"]

RESERVE = 0.1
"""The part of a period that the wire must leave free."""

READ_BACK = 10
"""Ticks from one reading of the wheels' measured speeds (command E) to the next."""

SPEEDS = Need("E", every=READ_BACK)

_KHEPERA_RATES = BAUD_RATES[:3]  # what the jumpers of the first Khepera can be set to


@dataclass(frozen=True)
class Plan:
    """Which needs are met in which tick. Every tick ends with the speeds (D)."""

    turns: tuple[tuple[Need, ...], ...]
    """The needs of tick 0, 1, 2 ..., in the order in which they are asked; then all begins anew."""
    worst: float
    """Seconds that the fullest tick is on the wire."""

    def at(self, tick: int) -> tuple[Need, ...]:
        """What is asked in tick number ``tick``."""
        return self.turns[tick % len(self.turns)]


def seconds(need: Need, baud: int, *, verify: bool = False) -> float:
    """Seconds that a need is on the wire at the most; with ``verify`` as often as it may have to be asked."""
    command = COMMANDS[need.letter]
    longest = command.longest_answer
    if need.letter == "T":
        longest = longest_turret_answer(int(need.values[0]), str(need.values[1])) or longest
    # D is the one request whose values the plan does not know.
    asked = command.longest_request if need.letter == "D" else len(encode_request(need.letter, *need.values))
    times = READINGS if verify and need.letter in TRUST else 1
    return times * wire_seconds(asked + longest, baud)


def plan(program: str, needs: Iterable[str | Need], *, baud: int, period: float, verify: bool = False) -> Plan:
    """Spread what ``program`` needs over its ticks so that the fullest has as little to carry as can be found.

    The read-back of the speeds (E) and the order at the end of each tick (D) are added. Raises WireTooSlow, with
    what a tick needs and with what would do, when nine tenths of ``period`` seconds do not hold the fullest.
    """
    asked = [Need(need) if isinstance(need, str) else need for need in needs]
    found = _spread(asked, baud, verify)
    if found.worst <= _room(period):
        return found
    ways = []
    for rate in BAUD_RATES:
        if rate > baud and _spread(asked, rate, verify).worst <= _room(period):
            ways.append(f"{rate} baud{' (a Khepera II only)' if rate not in _KHEPERA_RATES else ''}")
            break
    ways.append(f"--period {math.ceil(found.worst / (1 - RESERVE) * 100) / 100:g}")
    if verify and _spread(asked, baud, verify=False).worst <= _room(period):
        ways.append("no --verify")
    parts = [_figures(need, baud, verify) for need in (*asked, SPEEDS, Need("D"))]
    raise WireTooSlow(
        f"{program} needs {found.worst * 1000:.0f} ms a tick at {baud} baud{' with --verify' if verify else ''} "
        f"({', '.join(parts)}), more than the "
        f"{_room(period) * 1000:.0f} ms that a period of {period * 1000:g} ms leaves for the wire: "
        f"use {_either(ways)}"
    )


def needed(needs: Iterable[str | Need], baud: int, *, verify: bool = False) -> float:
    """Seconds that the fullest tick of a program with these needs is on the wire."""
    return _spread([Need(need) if isinstance(need, str) else need for need in needs], baud, verify).worst


def _room(period: float) -> float:
    return (1 - RESERVE) * period


def _spread(needs: Sequence[Need], baud: int, verify: bool) -> Plan:
    """The costliest first, each where it makes the fullest of its ticks least full."""
    length = math.lcm(READ_BACK, *(need.every for need in needs))
    load = [seconds(Need("D"), baud)] * length
    due: list[set[int]] = [set() for _ in range(length)]
    every = [SPEEDS, *needs]  # speeds first: they are those that the last tick asked for
    cost = [seconds(need, baud, verify=verify) for need in every]
    for place in sorted(range(len(every)), key=lambda place: (every[place].every, -cost[place])):
        step = every[place].every
        first = min(range(step), key=lambda first: (max(load[first::step]), sum(load[first::step])))
        for tick in range(first, length, step):
            load[tick] += cost[place]
            due[tick].add(place)
    turns = tuple(tuple(every[place] for place in sorted(places)) for places in due)
    return Plan(turns, max(load))


def _figures(need: Need, baud: int, verify: bool) -> str:
    each = f"{need} {seconds(need, baud, verify=verify) * 1000:.0f}"
    return each if need.every == 1 else f"{each} every {need.every} ticks"


def _either(ways: Sequence[str]) -> str:
    return " or ".join((", ".join(ways[:-1]), ways[-1])) if ways[1:] else ways[0]
