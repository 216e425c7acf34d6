"""The sink that owns all calls into rerun: ticks in, chunks out, to a file or to whoever looks on."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime
from typing import Any

import numpy as np
import rerun as rr

from khepera_hil.recording import Tick
from khepera_hil.viewer import colours
from khepera_hil.viewer.beliefs import Beliefs
from khepera_hil.viewer.columns import Columns, Lane, Stamp, vectors
from khepera_hil.viewer.eye import Eye
from khepera_hil.viewer.layout import about, layout
from khepera_hil.viewer.scene import Scene, readings
from khepera_hil.viewer.states import States, is_word
from khepera_hil.viewer.stream import abandon, open_stream

__all__ = ["RerunSink"]

PROBE = 100
"""Ticks between two questions to the file whether it still takes anything: after a full disk it says so only
when flushed."""

LEVELS = {
    "debug": "DEBUG",
    "info": "INFO",
    "warning": "WARN",
    "warn": "WARN",
    "error": "ERROR",
    "critical": "CRITICAL",
}


_SENSORS = frozenset(f"{kind}{i}" for kind in ("Px", "L") for i in range(1, 9))


class RerunSink:
    """Sends to ``where``; ``rows`` ticks of an entity make one chunk, and the entities take turns.

    All sinks of one run have the same application and recording, so that a viewer takes them for one.
    """

    def __init__(self, where: rr.FileSink | rr.GrpcServerSink, manifest: Mapping[str, Any], *, rows: int) -> None:
        program = str(manifest.get("program", "run"))
        plain = "".join(c if c.isalnum() and c.isascii() else "-" for c in program)
        # The viewer remembers a layout that the user changed by the application's name: one for each program.
        self._stream = open_stream(
            f"khepera-hil-{plain}", str(manifest.get("run", program)), where, layout(manifest)
        )
        self._rows = rows
        self._count = 0
        started = manifest.get("started")
        self._stream.send_recording_name(f"{program}, seed {manifest.get('seed')}, {started}")
        if started:
            when = datetime.fromisoformat(str(started)).timestamp()
            self._stream.send_recording_start_time_nanos(int(when * 1e9))
        self._scene = Scene(self._stream, manifest)
        self._beliefs = Beliefs(self._stream, manifest)
        self._states = States(self._stream, manifest)
        self._eye = Eye(manifest)
        self._lanes = _own_lanes(self._stream)
        self._variables: dict[str, Lane] = {}
        self._stream.log(
            "/about", rr.TextDocument(about(manifest), media_type=rr.MediaType.MARKDOWN), static=True, strict=True
        )

    def write(self, tick: Tick, dropped: int) -> None:
        """Keep the tick's rows and send the chunks whose turn it is."""
        stamp = (tick.tick, tick.t, tick.wall)
        self._scene.write(tick, stamp)
        self._beliefs.write(tick, stamp)
        self._states.write(tick, stamp)
        self._eye.write(tick, stamp)
        self._own(tick, stamp, dropped)
        self._count += 1
        for i, lane in enumerate(self._all()):
            if (self._count + i) % self._rows == 0:
                lane.send(self._stream)
        if self._count % PROBE == 0:
            self._stream.flush(timeout_sec=2)

    def flush(self) -> None:
        """Send everything that is held back."""
        for lane in self._all():
            lane.send(self._stream)
        self._stream.flush(timeout_sec=2)

    def close(self) -> None:
        """Send everything; a file gets its footer. Raises RuntimeError when the file took not all of it."""
        try:
            self.flush()
        except RuntimeError:
            abandon(self._stream)
            raise
        self._stream.disconnect()

    def _all(self) -> list[Lane]:
        drawn = (self._beliefs.lanes, self._states.lanes, self._scene.lanes, self._eye.lanes)
        owners = (self._lanes, self._variables, *drawn)
        return [lane for lanes in owners for lane in lanes.values()]

    def _own(self, tick: Tick, stamp: Stamp, dropped: int) -> None:
        for letter, name in (("N", "proximity"), ("O", "light")):
            numbers = readings(tick, letter)
            self._lanes[name].add(stamp, np.full(8, np.nan) if numbers is None else numbers)
        command = (np.nan, np.nan) if tick.command is None else tick.command
        self._lanes["motors"].add(stamp, np.array(command, np.float64))
        self._lanes["ms"].add(stamp, np.array([tick.late_ms, tick.work_ms]))
        self._lanes["counts"].add(stamp, np.array([tick.missed, dropped], np.float64))
        asked = sum(len(answer) + 2 for letter, answer in tick.raw.items() if letter != "?")
        self._lanes["link"].add(stamp, np.array([asked, len(tick.raw.get("?", ""))], np.float64))
        for name, value in tick.evidence.items():
            if is_word(value) or name in _SENSORS:
                continue  # a state, or one of the eight that are drawn together
            lane = self._variables.get(name)
            if lane is None:
                lane = self._variables[name] = _variable(self._stream, name)
            lane.add(stamp, value)
        for level, text in tick.events:
            self._lanes["events"].add(stamp, (LEVELS.get(level.lower(), "INFO"), text))
        for order in tick.orders:
            self._lanes["orders"].add(stamp, ("INFO", order))


def _own_lanes(stream: rr.RecordingStream) -> dict[str, Lane]:
    def series(path: str, names: list[str], hues: tuple[int, ...]) -> Lane:
        look = rr.SeriesLines(names=names, colors=colours.packed(*hues), widths=[1.5] * len(names))
        stream.log(path, look, static=True, strict=True)
        return Lane(path, vectors(len(names)))

    return {
        "proximity": series("/sensors/proximity", [f"Px{i}" for i in range(1, 9)], colours.SENSORS),
        "light": series("/sensors/light", [f"L{i}" for i in range(1, 9)], colours.SENSORS),
        "motors": series("/motors", ["left", "right"], (colours.LEFT, colours.RIGHT)),
        "ms": series("/loop/ms", ["late", "work"], (colours.LATE, colours.WORK)),
        "counts": series("/loop/counts", ["missed", "dropped by the recorder"], colours.PALETTE[1:3]),
        "link": series("/link", ["answered", "not asked for"], (colours.INK, colours.LATE)),
        "events": Lane("/events", _texts),
        "orders": Lane("/orders", _texts),
    }


def _variable(stream: rr.RecordingStream, name: str) -> Lane:
    path = "/variables/" + rr.escape_entity_path_part(name)
    look = rr.SeriesLines(names=[name], widths=[1.5])
    stream.log(path, look, static=True, strict=True)
    return Lane(path, lambda rows: rr.Scalars.columns(scalars=np.array(rows, np.float64)))


def _texts(rows: list[tuple[str, str]]) -> Columns:
    levels, texts = zip(*rows, strict=True)
    return rr.TextLog.columns(text=texts, level=levels)
