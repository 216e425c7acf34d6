"""What is to go wrong on a line, as the user writes it.

A list such as ``flip=1e-3,late=0.01:0.08,host.lose=0.005,drop=0.1@60+10,disconnect@30+5``:

    KIND=RATE              for each byte or each line with this probability
    KIND=RATE:SECONDS      lasting about so long (late, stall, disconnect)
    KIND=RATE@TIME+SECONDS only from this moment on, for so long (TIME: seconds since the line was opened)
    KIND@TIME+SECONDS      once, at this moment; +SECONDS, how long it lasts, may be left out
    KIND@TIME+SECONDS/P    and again every P seconds
    robot. or host.        before a kind: only on the way to the one; otherwise on both
    seed=N                 chance of its own; otherwise it comes with the run's
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from khepera_hil.errors import UsageError

__all__ = ["BYTE_KINDS", "GROUPS", "KINDS", "LINE_KINDS", "WAYS", "Rule", "Specification"]

BYTE_KINDS = {
    "drop": "a byte is lost",
    "flip": "a bit of a byte is turned over",
    "double": "a byte comes twice",
    "frame": "a byte that belongs to no number is lost, turned over or doubled",
}
LINE_KINDS = {
    "truncate": "a line is cut, its end is lost",
    "lose": "a line is lost",
    "repeat": "a line comes twice",
    "late": "a line comes late, and all behind it",
    "boot": "the robot's boot text comes before or behind a line",
    "stall": "nothing passes for a while, then all of it at once",
    "disconnect": "the line is unplugged for a while",
}
KINDS = BYTE_KINDS | LINE_KINDS

GROUPS = {
    "bytes": ("drop", "flip", "double"),
    "lines": ("truncate", "lose", "repeat", "late", "boot", "stall"),
}
"""Kinds that share a rate evenly."""

_SECONDS = {"late": 0.08, "stall": 0.12, "disconnect": 5.0}
"""How long these last unless it is said."""

WAYS = ("robot", "host")


@dataclass(frozen=True)
class Rule:
    """One item of a specification. ``way`` is where the bytes go: ``robot``, ``host`` or both (None).

    Either it strikes by chance, with ``rate``, from ``since`` until ``until``; or by time, first ``at`` and then
    every ``every`` seconds. ``seconds`` is how long it lasts.
    """

    kind: str
    rate: float = 0.0
    seconds: float = 0.0
    way: str | None = None
    at: float | None = None
    every: float | None = None
    since: float = 0.0
    until: float = math.inf

    def on(self, way: str) -> bool:
        """Whether it concerns bytes on their way to ``way``; a robot alone says boot texts."""
        return self.way in (None, way) and not (self.kind == "boot" and way == "robot")


@dataclass(frozen=True)
class Specification:
    """What is to be injected. ``seed`` None: whoever runs it has one."""

    rules: tuple[Rule, ...]
    seed: int | None = None

    _ITEM = re.compile(
        r"(?:(?P<way>[a-z]+)\.)?(?P<kind>[a-z]+)"
        r"(?:=(?P<rate>[^:@]*)(?::(?P<about>[^@]*))?(?:@(?P<since>[^+]*)\+(?P<span>.*))?"
        r"|@(?P<at>[^+/]*)(?:\+(?P<lasts>[^/]*))?(?:/(?P<every>.*))?)\Z"
    )

    @classmethod
    def parse(cls, text: str) -> Specification:
        """Read what the user wrote. Raises UsageError, which names what was expected."""
        rules: list[Rule] = []
        seed = None
        for item in filter(None, (part.strip() for part in text.split(","))):
            if item.startswith("seed="):
                if not (item[5:].isascii() and item[5:].isdigit()):
                    raise UsageError(f"{item!r} among the faults: a seed is a whole number, 0 or more")
                seed = int(item[5:])
            else:
                rules += cls._rules(item)
        if not rules:
            raise UsageError("no faults are named: write a list such as flip=1e-3,late=0.01,disconnect@30+5")
        for way in WAYS:
            for kinds, what in ((BYTE_KINDS, "byte"), (LINE_KINDS, "line")):
                total = sum(rule.rate for rule in rules if rule.kind in kinds and rule.on(way))
                if total > 1:
                    raise UsageError(f"the rates of the faults of a {what} add up to {total:g}: at most 1")
        return cls(tuple(rules), seed)

    @classmethod
    def _rules(cls, item: str) -> list[Rule]:
        found = cls._ITEM.match(item)
        if found is None:
            raise UsageError(f"{item!r} is no fault: write KIND=RATE, such as flip=1e-3, or KIND@SECONDS")
        way, kind = found["way"], found["kind"]
        if way is not None and way not in WAYS:
            raise UsageError(f"{item!r} among the faults: bytes go to the robot or to the host, not to {way!r}")
        if kind not in KINDS and kind not in GROUPS:
            raise UsageError(f"there is no fault {kind!r}; there are {', '.join((*KINDS, *GROUPS))}")
        lasting = found["about"] if found["rate"] is not None else found["lasts"]
        if lasting is not None and kind not in _SECONDS:
            raise UsageError(f"{item!r} among the faults: only {', '.join(_SECONDS)} last for seconds")
        if kind == "boot" and way == "robot":
            raise UsageError(f"{item!r} among the faults: boot texts only go to the host")
        seconds = _SECONDS.get(kind, 0.0) if lasting is None else _number(item, lasting, "seconds", 3600.0)
        if found["rate"] is not None:
            kinds = GROUPS.get(kind, (kind,))
            rate = _number(item, found["rate"], "a rate", 1.0) / len(kinds)
            since, until = 0.0, math.inf
            if found["since"] is not None:
                since = _number(item, found["since"], "seconds", 1e9)
                until = since + _number(item, found["span"], "seconds", 1e9)
            return [
                Rule(one, rate, seconds or _SECONDS.get(one, 0.0), way, since=since, until=until) for one in kinds
            ]
        if kind in GROUPS:
            raise UsageError(f"{item!r} among the faults: {kind} stands for several kinds, name one of them")
        at = _number(item, found["at"], "seconds", 1e9)
        every = None if found["every"] is None else _number(item, found["every"], "seconds", 1e9)
        if every is not None and every <= seconds:
            raise UsageError(f"{item!r} among the faults: it would begin again before it ended")
        return [Rule(kind, 0.0, seconds, way, at, every)]


def _number(item: str, text: str, what: str, most: float) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0 <= value <= most:
        raise UsageError(f"{item!r} among the faults: {text!r} is no number of {what} from 0 to {most:g}")
    return value
