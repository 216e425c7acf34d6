"""Words over time: every variable of few words, known, drawn or only asked for, as a lane of states.

A lane stands still until its variable changes, so it costs next to nothing; an empty state is a gap. Of a variable
that is only asked for (H of home) the most probable value is shown.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import rerun as rr

from khepera_hil.recording import Tick, Value
from khepera_hil.viewer import colours
from khepera_hil.viewer.columns import Lane, Stamp

__all__ = ["FEW_WORDS", "States", "is_word", "states"]

FEW_WORDS = 24
"""Values up to which a variable of words has a lane."""


def is_word(value: Value) -> bool:
    """Whether a value is one of the paper's words; true and false are."""
    return isinstance(value, (str, bool))


def states(manifest: Mapping[str, Any]) -> dict[str, tuple[Value, ...]]:
    """The variables that have a lane, and their values: the searched first, in the manifest's order."""
    found: dict[str, tuple[Value, ...]] = {}
    for question in manifest.get("questions") or []:
        for variable, values in zip(question["variables"], question["values"], strict=True):
            found.setdefault(str(variable), tuple(values))
    for name, values in (manifest.get("evidence") or {}).items():
        found.setdefault(str(name), tuple(values))
    return {
        name: values for name, values in found.items() if len(values) <= FEW_WORDS and all(map(is_word, values))
    }


class States:
    """Turns each tick into changes of state."""

    def __init__(self, stream: rr.RecordingStream, manifest: Mapping[str, Any]) -> None:
        self.lanes: dict[str, Lane] = {}
        self._now: dict[str, str] = {}
        self._searched: dict[str, list[tuple[str, int]]] = {}
        for name, values in states(manifest).items():
            path = "/states/" + rr.escape_entity_path_part(name)
            texts = [str(value) for value in values]
            look = rr.StateConfiguration(values=texts, labels=texts, colors=colours.many(len(texts)))
            stream.log(path, look, static=True, strict=True)
            self.lanes[name] = Lane(path, lambda rows: rr.StateChange.columns(state=rows))
            self._now[name] = ""
        for question in manifest.get("questions") or []:
            for axis, variable in enumerate(question["variables"]):
                self._searched.setdefault(str(variable), []).append((str(question["key"]), axis))

    def write(self, tick: Tick, stamp: Stamp) -> None:
        """Keep what has changed."""
        for name, lane in self.lanes.items():
            value = self._value(tick, name)
            now = "" if value is None else str(value)
            if now != self._now[name]:
                self._now[name] = now
                lane.add(stamp, now)

    def _value(self, tick: Tick, name: str) -> Value | None:
        """Known, drawn, or the most probable."""
        for said in (tick.evidence, tick.draws):
            if name in said:
                return said[name]
        searched: Sequence[tuple[str, int]] = self._searched.get(name, ())
        for key, axis in searched:
            answer = tick.answers.get(key)
            if answer is not None:
                others = tuple(i for i in range(answer.p.ndim) if i != axis)
                return answer.values[axis][int(np.argmax(answer.p.sum(axis=others)))]
            if key in tick.draws:
                return tick.draws[key]
        return None
