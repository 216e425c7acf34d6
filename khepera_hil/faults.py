"""Faults of the line, injected on purpose: between the emulator and whoever talks to it.

No I/O, no thread, no clock: bytes and the time go in, bytes come out, when they are due. So the same injector
stands in simulated time (inside ``emulator://``) and in wall time (behind a pseudo-terminal). What it does depends
on the seed and on the bytes alone, not on the lumps in which they come. ``faultspec`` says what can be asked for.
"""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from khepera_hil.faultspec import BYTE_KINDS, LINE_KINDS, WAYS, Rule, Specification

__all__ = ["BOOT_TEXT", "Fault", "Faults"]

BOOT_TEXT = (
    b"ROM of minirobot KHEPERA, Edoardo Franzi K-Team S.A. October 22, 1998 Rev. 5.01\r\n"
    b"Serial Communication Protocol\r\n"
)

_NUMBER = frozenset(b"-0123456789")
_KEPT = 10_000  # faults remembered one by one; all are counted
_LONGEST_LINE = 512  # where bytes never end in a line, as at a wrong rate
_LONGEST_GAP = 2**40  # bytes or lines to the next fault where there will be none


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
            for way, seed in zip(WAYS, source.spawn(len(WAYS)), strict=True)
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

    def trouble(self, kind: str, rate: float, since: float, until: float) -> None:
        """Let one more kind strike, by chance, between two moments."""
        rule = Rule(kind, rate, since=since, until=until)
        for name, way in self._ways.items():
            if rule.on(name):
                way.add(rule)

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
        ways = [self._ways[way] for way in WAYS if rule.on(way)]
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
        by_rate = [rule for rule in rules if rule.at is None]
        bytes_seed, lines_seed = seed.spawn(2)
        self._of_bytes = _Dice([rule for rule in by_rate if rule.kind in BYTE_KINDS], bytes_seed)
        self._of_lines = _Dice([rule for rule in by_rate if rule.kind in LINE_KINDS], lines_seed)
        self._line: _Line | None = None
        self._lengths: dict[int, int] = {}  # of the last line that began with this byte
        self._held: deque[tuple[float, bytes]] = deque()
        self._floor = 0.0  # nothing passes before

    def add(self, rule: Rule) -> None:
        """Strike by one rule more."""
        (self._of_bytes if rule.kind in BYTE_KINDS else self._of_lines).add(rule)

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
        rule = self._awaited(LINE_KINDS) or self._of_lines.strike(now)
        if rule is None:
            return _Line()
        line = _Line(rule)
        chance = self._of_lines.chance
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
        rule = self._awaited(BYTE_KINDS) or self._of_bytes.strike(now)
        if rule is None:
            return bytes((byte,))
        kind = rule.kind
        if kind == "frame":
            if byte in _NUMBER:
                if rule.at is not None:
                    self._faults.awaited.append(rule)  # not this one, then
                return bytes((byte,))
            kind = ("drop", "flip", "double")[self._of_bytes.chance.integers(3)]
        if kind == "drop":
            through = b""
        elif kind == "double":
            through = bytes((byte, byte))
        else:
            through = bytes((byte ^ 1 << int(self._of_bytes.chance.integers(8)),))
        self._note(rule.kind, now, f"{bytes((byte,))!r} -> {through!r}")
        return through

    def _awaited(self, kinds: dict[str, str]) -> Rule | None:
        """A rule that was due by time and waits for a byte, or a line, on this way."""
        for rule in self._faults.awaited:
            if rule.kind in kinds and rule.on(self._name):
                self._faults.awaited.remove(rule)
                return rule
        return None

    def _note(self, kind: str, now: float, what: str) -> None:
        self._faults.done(Fault(now, self._name, kind, what))


class _Dice:
    """Strikes bytes, or lines, with the rates of ``rules``; how many go well before the next is drawn at once."""

    def __init__(self, rules: list[Rule], seed: np.random.SeedSequence) -> None:
        self.chance = np.random.default_rng(seed)
        self._all = rules
        self._rules: list[Rule] = []  # those that hold now
        self._change = -math.inf  # when others do
        self._well = 0

    def add(self, rule: Rule) -> None:
        """One rule more, whose time may have begun."""
        self._all.append(rule)
        self._change = -math.inf

    def strike(self, now: float) -> Rule | None:
        """The rule that strikes the next one, if one does."""
        if now >= self._change:
            self._all = [rule for rule in self._all if now < rule.until]
            self._rules = [rule for rule in self._all if rule.since <= now]
            moments = [moment for rule in self._all for moment in (rule.since, rule.until) if moment > now]
            self._change = min(moments, default=math.inf)
            self._draw()
        if self._well > 0:
            self._well -= 1
            return None
        struck = float(self.chance.random()) * sum(rule.rate for rule in self._rules)
        found = self._rules[-1]
        for rule in self._rules:
            if struck < rule.rate:
                found = rule
                break
            struck -= rule.rate
        self._draw()
        return found

    def _draw(self) -> None:
        total = min(sum(rule.rate for rule in self._rules), 1.0)
        self._well = int(self.chance.geometric(total)) - 1 if total > 0 else _LONGEST_GAP
