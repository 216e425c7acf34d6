"""Which descriptions a question calls, and those which others: Bayesian subroutines (lesson 4, section 11.2)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

from brp.forms import Form
from brp.variables import text

__all__ = ["Hierarchy", "hierarchy"]


@dataclass(frozen=True)
class Hierarchy:
    """A description, by the names of its data set and preliminary knowledge, and the descriptions that it calls.

    One that is called several times, or for several variables, stands once. ``str()`` counts and draws them.
    """

    names: tuple[str, ...]
    calls: tuple[Hierarchy, ...]

    @cached_property
    def levels(self) -> int:
        """How many descriptions the longest chain of calls has."""
        return 1 + max((called.levels for called in self.calls), default=0)

    @cached_property
    def descriptions(self) -> frozenset[tuple[str, ...]]:
        """The names of all descriptions, this one's among them."""
        return frozenset({self.names}).union(*(called.descriptions for called in self.calls))

    def lines(self, indent: str = "  ") -> Iterator[str]:
        """The names, each under those of its caller."""
        yield indent + (text(self.names) or "a description without a name")
        for called in self.calls:
            yield from called.lines(indent + "  ")

    def __str__(self) -> str:
        return "\n".join([f"{len(self.descriptions)} descriptions on {self.levels} levels:", *self.lines()])


def hierarchy(question: Form) -> Hierarchy:
    """The description that a question asks, and those that this one calls."""
    return _called(question, {})


def _called(question: Form, made: dict[int, Hierarchy]) -> Hierarchy:
    if id(question) not in made:
        calls: dict[Hierarchy, None] = {}
        waiting = list(reversed(question.inner))
        while waiting:
            form = waiting.pop()
            if form.names:
                calls[_called(form, made)] = None
            else:
                waiting.extend(reversed(form.inner))
        made[id(question)] = Hierarchy(question.names, tuple(calls))
    return made[id(question)]
