"""Faults of the line, injected on purpose: between the emulator and whoever talks to it.

No I/O, no thread, no clock: bytes and the time go in, bytes come out, when they are due. So the same injector
stands in simulated time (inside ``emulator://``) and in wall time (behind a pseudo-terminal). What it does depends
on the seed and on the bytes alone, not on the lumps in which they come.

A specification is a list such as ``flip=1e-3,late=0.01:0.08,host.lose=0.005,disconnect@30+5``:

    KIND=RATE              for each byte or each line with this probability
    KIND=RATE:SECONDS      lasting about so long (late, stall, disconnect)
    KIND@TIME+SECONDS      once, so many seconds after the line was opened; +SECONDS may be left out
    KIND@TIME+SECONDS/P    and again every P seconds
    robot. or host.        before a kind: only on the way to the one; otherwise on both
    seed=N                 chance of its own; otherwise it comes with the run's
"""

from __future__ import annotations

import math
import re
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from khepera_hil.errors import UsageError

__all__ = ["BOOT_TEXT", "BYTE_KINDS", "GROUPS", "KINDS", "LINE_KINDS", "Fault", "Faults", "Rule", "Specification"]

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

_WAYS = ("robot", "host")

BOOT_TEXT = (
    b"ROM of minirobot KHEPERA, Edoardo Franzi K-Team S.A. October 22, 1998 Rev. 5.01\r\n"
    b"Serial Communication Protocol\r\n"
)

_NUMBER = frozenset(b"-0123456789")
_KEPT = 10_000  # faults remembered one by one; all are counted
_LONGEST_LINE = 512  # where bytes never end in a line, as at a wrong rate
_LONGEST_GAP = 2**40  # bytes or lines to the next fault where there will be none


@dataclass(frozen=True)
class Rule:
    """One item of a specification. ``way`` is where the bytes go: ``robot``, ``host`` or both (None)."""

    kind: str
    rate: float = 0.0
    seconds: float = 0.0
    way: str | None = None
    at: float | None = None
    every: float | None = None

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
        r"(?:=(?P<rate>[^:@]*)(?::(?P<about>.*))?|@(?P<at>[^+/]*)(?:\+(?P<lasts>[^/]*))?(?:/(?P<every>.*))?)\Z"
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
        for way in _WAYS:
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
        if way is not None and way not in _WAYS:
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
            return [Rule(one, rate, seconds or _SECONDS.get(one, 0.0), way) for one in kinds]
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


@dataclass(frozen=True)
class Fault:
    """Something that was done: when, on which way, and to what."""

    at: float
    way: str
    kind: str
    what: str = ""


class Faults:
    """An injector between a host and a robot: see the module. ``rng`` decides where the specification has no seed.

    The two ways are asked with what has come by ``now`` seconds and give what goes on by then; time never goes
    back. ``on_fault`` hears of every fault as it happens.
    """

    def __init__(
        self,
        specification: str | Specification,
        rng: np.random.SeedSequence | int = 0,
        *,
        on_fault: Callable[[Fault], None] | None = None,
    ) -> None:
        if isinstance(specification, str):
            specification = Specification.parse(specification)
        self.specification = specification
        self.on_fault = on_fault
        self.counts: Counter[str] = Counter()
        """How often what was done, by kind."""
        self.log: deque[Fault] = deque(maxlen=_KEPT)
        """The last faults, one by one."""
        self.awaited: list[Rule] = []
        """Rules that were due by time and wait for a byte or a line, whichever way it goes."""
        source = rng if specification.seed is None else specification.seed
        source = np.random.SeedSequence(source) if isinstance(source, int) else source
        self._ways = {
            way: _Way(self, way, [rule for rule in specification.rules if rule.on(way)], seed)
            for way, seed in zip(_WAYS, source.spawn(len(_WAYS)), strict=True)
        }
        self._due: list[tuple[float, Rule]] = [
            (rule.at, rule) for rule in specification.rules if rule.at is not None
        ]
        self._now = self._back = 0.0
        self.unpluggings = 0
        """How often the line was unplugged: who has it open has lost it, however soon it is back."""

    def to_robot(self, data: bytes, now: float) -> bytes:
        """The host's bytes, as the robot gets them."""
        return self._pass("robot", data, now)

    def to_host(self, data: bytes, now: float) -> bytes:
        """The robot's bytes, as the host gets them."""
        return self._pass("host", data, now)

    def connected(self, now: float) -> bool:
        """Whether the line is plugged in; while it is not, nothing passes, and what was under way is lost."""
        self._now = now
        self._begin_what_is_due(now)
        return now >= self._back

    def next_event(self) -> float | None:
        """When something may next come out by itself, or the line be pulled or plugged in (None: never)."""
        moments = [moment for way in self._ways.values() if (moment := way.next_release()) is not None]
        if self._now < self._back:
            moments.append(self._back)
        moments += [at for at, rule in self._due if rule.kind in ("stall", "disconnect")]
        return min(moments, default=None)

    @property
    def back(self) -> float:
        """When the line that is unplugged is plugged in again."""
        return self._back

    def _pass(self, way: str, data: bytes, now: float) -> bytes:
        if not self.connected(now):
            return b""
        self._ways[way].feed(data, now)
        if now < self._back:  # it was unplugged by a line in the middle of this
            self._ways[way].clear()
        return self._ways[way].released(now)

    def _begin_what_is_due(self, now: float) -> None:
        for place, (at, rule) in enumerate(self._due):
            if at > now:
                continue
            if rule.kind in ("stall", "disconnect"):
                self.interrupt(rule, at, rule.seconds)
            else:
                self.awaited.append(rule)
            self._due[place] = (at + rule.every if rule.every is not None else math.inf, rule)
        if any(at == math.inf for at, _ in self._due):
            self._due = [(at, rule) for at, rule in self._due if at != math.inf]

    def interrupt(self, rule: Rule, at: float, seconds: float) -> None:
        """Nothing passes from ``at`` on, for so long; where a line is unplugged, what was under way is lost."""
        ways = [self._ways[way] for way in _WAYS if rule.on(way)]
        self.done(Fault(at, rule.way or "both", rule.kind, f"{seconds:.3f} s"))
        if rule.kind == "stall":
            for way in ways:
                way.hold(at + seconds)
        else:
            self._back = max(self._back, at + seconds)
            self.unpluggings += 1
            for other in self._ways.values():
                other.clear()

    def done(self, fault: Fault) -> None:
        """Write down what was done."""
        self.counts[fault.kind] += 1
        self.log.append(fault)
        if self.on_fault is not None:
            self.on_fault(fault)


@dataclass
class _Line:
    """What happens to the line that is passing."""

    rule: Rule | None = None
    cut: int = 0
    """Bytes after which the rest is lost, where any is."""
    behind: bytes = b""
    """What follows when it has passed."""
    passed: bytearray = field(default_factory=bytearray)

    def passes(self, number: int) -> bool:
        """Whether byte ``number`` (from 1) of the line passes."""
        if self.rule is None or self.rule.kind not in ("lose", "truncate"):
            return True
        return number <= self.cut


class _Way:
    """One direction."""

    def __init__(self, faults: Faults, name: str, rules: list[Rule], seed: np.random.SeedSequence) -> None:
        self._faults, self._name = faults, name
        bytes_seed, lines_seed = seed.spawn(2)
        self._of_bytes = np.random.default_rng(bytes_seed)
        self._of_lines = np.random.default_rng(lines_seed)
        by_rate = [rule for rule in rules if rule.at is None and rule.rate > 0]
        self._byte_rules = [rule for rule in by_rate if rule.kind in BYTE_KINDS]
        self._line_rules = [rule for rule in by_rate if rule.kind in LINE_KINDS]
        self._line: _Line | None = None
        self._lengths: dict[int, int] = {}  # of the last line that began with this byte
        self._held: deque[tuple[float, bytes]] = deque()
        self._floor = 0.0  # nothing passes before
        self._to_byte = self._gap(self._of_bytes, self._byte_rules)
        self._to_line = self._gap(self._of_lines, self._line_rules)

    def feed(self, data: bytes, now: float) -> None:
        """Bytes that come at ``now``."""
        out = bytearray()
        for byte in data:
            line = self._line
            if line is None:
                line = self._line = self._begin_line(byte, now, out)
            ends = byte == 0x0A or (self._name == "robot" and byte == 0x0D) or len(line.passed) >= _LONGEST_LINE
            through = self._through(byte, now)
            line.passed.append(byte)
            if line.passes(len(line.passed)):
                out += through
            if ends:
                self._end_line(line, now, out)
        self._hand_on(bytes(out), now)

    def released(self, now: float) -> bytes:
        """Take out what is due."""
        out = b""
        while self._held and self._held[0][0] <= now:
            out += self._held.popleft()[1]
        return out

    def next_release(self) -> float | None:
        """When the next of what is held back is due."""
        return self._held[0][0] if self._held else None

    def hold(self, until: float) -> None:
        """Let nothing pass before ``until``, not even what was due earlier."""
        self._floor = max(self._floor, until)
        self._held = deque((max(moment, until), data) for moment, data in self._held)

    def clear(self) -> None:
        """Everything under way is lost, and the line that was passing with it."""
        self._held.clear()
        self._line = None
        self._floor = 0.0

    def _hand_on(self, data: bytes, now: float) -> None:
        if data:
            self._held.append((max(now, self._floor), data))

    def _begin_line(self, first: int, now: float, out: bytearray) -> _Line:
        rule = self._pick(self._of_lines, self._line_rules, LINE_KINDS)
        if rule is None:
            return _Line()
        line = _Line(rule)
        chance = self._of_lines
        seconds = rule.seconds if rule.at is not None else rule.seconds * float(chance.uniform(0.5, 1.5))
        if rule.kind == "truncate":
            # Of the last line of this kind, so that the cut mostly falls into the line.
            line.cut = int(chance.integers(self._lengths.get(first, 8)))
        elif rule.kind == "boot":
            if chance.random() < 0.5:
                out += BOOT_TEXT
                self._note("boot", now, "before a line")
            else:
                line.behind = BOOT_TEXT
        elif rule.kind in ("late", "stall", "disconnect"):
            # What was before this line passes; the line and all behind it do not.
            self._hand_on(bytes(out), now)
            out.clear()
            if rule.kind == "late":
                self._floor = max(self._floor, now + seconds)
                self._note("late", now, f"{seconds:.3f} s")
            else:
                self._faults.interrupt(rule, now, seconds)
        return line

    def _end_line(self, line: _Line, now: float, out: bytearray) -> None:
        passed = bytes(line.passed)
        self._lengths[passed[0]] = len(passed)
        self._line = None
        kind = line.rule.kind if line.rule is not None else None
        if kind == "lose" or (kind == "truncate" and line.cut < len(passed)):
            self._note(str(kind), now, repr(passed))
        elif kind == "repeat":
            out += passed
            self._note("repeat", now, repr(passed))
        elif line.behind:
            out += line.behind
            self._note("boot", now, "behind a line")

    def _through(self, byte: int, now: float) -> bytes:
        """What becomes of one byte."""
        rule = self._pick(self._of_bytes, self._byte_rules, BYTE_KINDS)
        if rule is None:
            return bytes((byte,))
        kind = rule.kind
        if kind == "frame":
            if byte in _NUMBER:
                if rule.at is not None:
                    self._faults.awaited.append(rule)  # not this one, then
                return bytes((byte,))
            kind = ("drop", "flip", "double")[self._of_bytes.integers(3)]
        if kind == "drop":
            through = b""
        elif kind == "double":
            through = bytes((byte, byte))
        else:
            through = bytes((byte ^ 1 << int(self._of_bytes.integers(8)),))
        self._note(rule.kind, now, f"{bytes((byte,))!r} -> {through!r}")
        return through

    def _pick(self, chance: np.random.Generator, rules: list[Rule], kinds: dict[str, str]) -> Rule | None:
        """The rule that strikes the next byte, or the next line, if one does."""
        for rule in self._faults.awaited:
            if rule.kind in kinds and rule.on(self._name):
                self._faults.awaited.remove(rule)
                return rule
        of_bytes = kinds is BYTE_KINDS
        left = self._to_byte if of_bytes else self._to_line
        if left > 0:
            if of_bytes:
                self._to_byte -= 1
            else:
                self._to_line -= 1
            return None
        rates = [rule.rate for rule in rules]
        struck = float(chance.random()) * sum(rates)
        found = rules[-1]
        for rule in rules:
            if struck < rule.rate:
                found = rule
                break
            struck -= rule.rate
        gap = self._gap(chance, rules)
        if of_bytes:
            self._to_byte = gap
        else:
            self._to_line = gap
        return found

    @staticmethod
    def _gap(chance: np.random.Generator, rules: list[Rule]) -> int:
        """How many bytes, or lines, go well before the next that does not."""
        total = sum(rule.rate for rule in rules)
        return int(chance.geometric(min(total, 1.0))) - 1 if total > 0 else _LONGEST_GAP

    def _note(self, kind: str, now: float, what: str) -> None:
        self._faults.done(Fault(now, self._name, kind, what))
