"""Words over time: every variable of few words, known, drawn or only asked for, as a lane of states.

A lane stands still until its variable changes, so it costs next to nothing; an empty state is a gap. Of a variable
that is only asked for (H of home) the most probable value is shown. The service's own state is a lane too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from khepera_hil.recording import Tick, Value
from khepera_hil.viewer import colours
from khepera_hil.viewer.columns import Lane, Stamp

__all__ = ["FEW_WORDS", "SERVICE", "SERVICE_STATES", "States", "is_word", "states"]

FEW_WORDS = 24
"""Values up to which a variable of words has a lane."""

SERVICE = "/loop/state"
"""Where the service's state is."""

SERVICE_STATES = {
    "disconnected": colours.LATE,
    "connecting": colours.LAMP,
    "ready": colours.LEFT,
    "running": colours.WORK,
    "degraded": colours.RIGHT,
    "stopping": colours.WALL,
    "stopped": colours.WALL,
    "faulted": colours.DRAWN,
}
"""The states of ``lifecycle``, and their colours."""


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
        self._paths: dict[str, str] = {}
        self._searched: dict[str, list[tuple[str, int]]] = {}
        self._lane(stream, SERVICE, list(SERVICE_STATES), colours.packed(*SERVICE_STATES.values()))
        for name, values in states(manifest).items():
            self._paths[name] = path = "/states/" + rr.escape_entity_path_part(name)
            self._lane(stream, path, [str(value) for value in values], colours.many(len(values)))
        for question in manifest.get("questions") or []:
            for axis, variable in enumerate(question["variables"]):
                self._searched.setdefault(str(variable), []).append((str(question["key"]), axis))

    def _lane(self, stream: rr.RecordingStream, path: str, texts: list[str], hues: NDArray[np.uint32]) -> None:
        look = rr.StateConfiguration(values=texts, labels=texts, colors=hues)
        stream.log(path, look, static=True, strict=True)
        self.lanes[path] = Lane(path, lambda rows: rr.StateChange.columns(state=rows))
        self._now[path] = ""

    def write(self, tick: Tick, stamp: Stamp) -> None:
        """Keep what has changed."""
        self._change(SERVICE, tick.state, stamp)
        for name, path in self._paths.items():
            value = self._value(tick, name)
            self._change(path, "" if value is None else str(value), stamp)

    def _change(self, path: str, now: str, stamp: Stamp) -> None:
        if now != self._now[path]:
            self._now[path] = now
            self.lanes[path].add(stamp, now)

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
