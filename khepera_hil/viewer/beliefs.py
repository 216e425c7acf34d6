"""What the questions answered: distributions now (bars), and over time (mean, deviation, draw, waterfall)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from khepera_hil.recording import Tick, Value
from khepera_hil.viewer import colours
from khepera_hil.viewer.columns import Columns, Lane, Stamp, bars, static_bars, tensors, vectors
from khepera_hil.viewer.states import is_word

__all__ = ["HISTORY", "PACE", "Beliefs", "Panel", "panels"]

HISTORY = 30.0
"""Seconds of the waterfall that are shown."""

PACE = 1.6
"""The waterfall's pace: one value is one unit high, one second so many units wide (30 s fit a wide panel)."""

FEW = 4
"""A variable of up to so many values is shown value by value."""

MANY = 64
"""A variable of more values has no waterfall: it costs one stroke a value and tick."""


@dataclass(frozen=True)
class Panel:
    """One variable of one question: what is shown as one bar chart."""

    key: str
    description: str
    """Whose question it is, such as ``pi-home``; empty where the manifest does not say."""
    title: str
    variable: str
    axis: int
    values: tuple[Value, ...]
    main: bool
    alone: bool
    """The question asks for this variable only."""
    colour: int

    @cached_property
    def path(self) -> str:
        """Where it hangs: its description, its key, and the variable when there are several."""
        parts = [self.joint] if self.alone else [self.joint, rr.escape_entity_path_part(self.variable)]
        return "/".join(parts)

    @cached_property
    def joint(self) -> str:
        """Where all variables of its question hang."""
        parts = [self.description, self.key] if self.description else [self.key]
        return "/".join(rr.escape_entity_path_part(part) for part in parts)

    @cached_property
    def words(self) -> bool:
        """Whether the values are words, which have no mean."""
        return any(map(is_word, self.values))

    @cached_property
    def few(self) -> bool:
        """Whether each value has its own bar, with its own colour and name."""
        return self.words and len(self.values) <= FEW

    @cached_property
    def at(self) -> NDArray[np.float64]:
        """Where the values stand on the axis: themselves, or for words their place in the list."""
        return np.arange(len(self.values), dtype=np.float64) if self.words else np.array(self.values, np.float64)

    @cached_property
    def step(self) -> float:
        """Distance of neighbours on the axis."""
        at = self.at
        return float(np.min(np.abs(np.diff(at)))) if len(at) > 1 else 1.0

    @cached_property
    def ceiling(self) -> float:
        """A probability that the axis always shows, so that a flat distribution looks flat."""
        return 1.0 if len(self.values) <= FEW else min(1.0, 8 / len(self.values))


def panels(manifest: Mapping[str, Any]) -> list[Panel]:
    """The panels of the manifest's questions, in its order. A question whose role ends in one value's name
    ("Vrot avoidance") takes the colour which that value has where it is asked for."""
    questions = manifest.get("questions") or []
    named: dict[str, int] = {}
    for question in questions:
        for values in question["values"]:
            if all(map(is_word, values)) and len(values) <= FEW:
                named |= {value: colours.PALETTE[i] for i, value in enumerate(values)}
    found = []
    for question in questions:
        key, main = str(question["key"]), bool(question.get("main", False))
        plain = colours.MAIN if main else colours.PALETTE[2]
        for axis, (variable, values) in enumerate(zip(question["variables"], question["values"], strict=True)):
            found.append(
                Panel(
                    key=key,
                    description=str(question.get("description") or ""),
                    title=str(question["name"]),
                    variable=str(variable),
                    axis=axis,
                    values=tuple(values),
                    main=main,
                    alone=len(question["variables"]) == 1,
                    colour=named.get(key.split(" ")[-1], plain),
                )
            )
    return found


class Beliefs:
    """Turns the answers of each tick into rows."""

    def __init__(self, stream: rr.RecordingStream, manifest: Mapping[str, Any]) -> None:
        self.lanes: dict[str, Lane] = {}
        self._panels = panels(manifest)
        self._ramps: dict[str, NDArray[np.uint32]] = {}
        self._period = float(manifest.get("period_s", 0.1))
        for panel in self._panels:
            self._prepare(stream, panel)

    def _prepare(self, stream: rr.RecordingStream, panel: Panel) -> None:
        path, n = panel.path, len(panel.values)
        chart = f"/distributions/{path}"
        if panel.few:
            for i, value in enumerate(panel.values):
                bar = f"{chart}/{rr.escape_entity_path_part(str(value))}"
                static_bars(stream, bar, panel.at[i : i + 1], 0.7, colours.PALETTE[i])
                self.lanes[bar] = Lane(bar, bars)
            over_time = f"/summary/{path}/p"
            look = rr.SeriesLines(
                names=[str(value) for value in panel.values],
                colors=colours.packed(*colours.PALETTE[:n]),
                widths=[2.0] * n,
            )
            stream.log(over_time, look, static=True, strict=True)
            self.lanes[over_time] = Lane(over_time, vectors(n))
        else:
            static_bars(stream, f"{chart}/p", panel.at, 0.86 * panel.step, panel.colour)
            self.lanes[f"{chart}/p"] = Lane(f"{chart}/p", bars)
        if panel.main:
            static_bars(stream, f"{chart}/drawn", panel.at, 0.16 * panel.step, colours.DRAWN)
            self.lanes[f"{chart}/drawn"] = Lane(f"{chart}/drawn", bars)
        static_bars(stream, f"{chart}/axis", panel.at[:1], panel.step, 0x00000001)
        stream.log(
            f"{chart}/axis",
            rr.BarChart.from_fields(values=np.array([panel.ceiling], np.float32)),
            static=True,
            strict=True,
        )
        if not panel.alone:
            joint = f"/distributions/{panel.joint}/joint"
            self.lanes.setdefault(joint, Lane(joint, tensors))
        if panel.main:
            self._prepare_history(stream, panel)

    def _prepare_history(self, stream: rr.RecordingStream, panel: Panel) -> None:
        path = panel.path
        drawn = f"/summary/{path}/drawn"
        look = rr.SeriesPoints(names=["drawn"], colors=colours.packed(colours.DRAWN), marker_sizes=[2.5])
        stream.log(drawn, look, static=True, strict=True)
        self.lanes[drawn] = Lane(drawn, vectors(1))
        if not panel.words:
            mean = f"/summary/{path}/mean"
            stream.log(
                mean,
                rr.Measurements.from_fields(names=["mean ± σ"], colors=colours.packed(panel.colour)),
                static=True,
                strict=True,
            )
            self.lanes[mean] = Lane(mean, _measurements)
        n = len(panel.values)
        if n <= MANY:
            water = f"/waterfall/{path}"
            self._ramps[path] = colours.ramp(panel.colour)
            thick = 0.54 * PACE * self._period  # a little more than half: no seams
            stream.log(
                f"{water}/past/p",
                rr.LineStrips2D.from_fields(radii=[thick], draw_order=1.0),
                static=True,
                strict=True,
            )
            stream.log(
                f"{water}/past/drawn",
                rr.Points2D.from_fields(radii=[0.2], colors=colours.packed(colours.DRAWN), draw_order=2.0),
                static=True,
                strict=True,
            )
            marks = sorted({0, n // 2, n - 1})
            stream.log(
                f"{water}/axis",
                rr.Points2D(
                    [[1.6, n - 1 - i] for i in marks],
                    radii=0.01,
                    colors=colours.packed(*[colours.INK] * len(marks)),
                    labels=[str(panel.values[i]) for i in marks],
                    show_labels=True,
                ),
                static=True,
                strict=True,
            )
            self.lanes[f"{water}/past"] = Lane(f"{water}/past", _shifts)
            self.lanes[f"{water}/past/p"] = Lane(f"{water}/past/p", _strokes)
            self.lanes[f"{water}/past/drawn"] = Lane(
                f"{water}/past/drawn", lambda rows: rr.Points2D.columns(positions=np.array(rows))
            )

    def write(self, tick: Tick, stamp: Stamp) -> None:
        """Keep one tick's rows; a question that was not answered clears its panel."""
        for panel in self._panels:
            answer = tick.answers.get(panel.key)
            drawn = tick.draws.get(panel.key if panel.alone else panel.variable)
            at = panel.values.index(drawn) if drawn in panel.values else None
            p = None
            if answer is not None:
                others = tuple(i for i in range(answer.p.ndim) if i != panel.axis)
                p = np.asarray(answer.p.sum(axis=others) if others else answer.p, np.float64)
                if not panel.alone and panel.axis == 0:
                    self.lanes[f"/distributions/{panel.joint}/joint"].add(stamp, answer.p)
            self._bars(panel, stamp, p, at)
            if panel.main:
                self._history(panel, stamp, p, at)

    def _bars(self, panel: Panel, stamp: Stamp, p: NDArray[np.float64] | None, at: int | None) -> None:
        chart = f"/distributions/{panel.path}"
        if panel.few:
            for i, value in enumerate(panel.values):
                lane = self.lanes[f"{chart}/{rr.escape_entity_path_part(str(value))}"]
                lane.add(stamp, None if p is None else p[i : i + 1])
            if p is not None:
                self.lanes[f"/summary/{panel.path}/p"].add(stamp, p)
        else:
            self.lanes[f"{chart}/p"].add(stamp, p)
        if panel.main:
            needle = None
            if at is not None:
                needle = np.zeros(len(panel.values))
                needle[at] = panel.ceiling
            self.lanes[f"{chart}/drawn"].add(stamp, needle)

    def _history(self, panel: Panel, stamp: Stamp, p: NDArray[np.float64] | None, at: int | None) -> None:
        path, where = panel.path, panel.at
        water = f"/waterfall/{path}/past"
        x = PACE * stamp[1]
        if at is not None:
            self.lanes[f"/summary/{path}/drawn"].add(stamp, where[at : at + 1])
        if p is not None and not panel.words:
            mean = float(p @ where)
            self.lanes[f"/summary/{path}/mean"].add(stamp, (mean, float(p @ (where - mean) ** 2)))
        if water not in self.lanes:
            return
        self.lanes[water].add(stamp, x)
        if p is not None:
            level = np.clip(p / panel.ceiling * 255, 0, 255).astype(np.intp)
            self.lanes[f"{water}/p"].add(stamp, (x, self._ramps[path][level]))
        if at is not None:
            self.lanes[f"{water}/drawn"].add(stamp, (x, len(panel.values) - 1 - at))


def _measurements(rows: list[tuple[float, float]]) -> Columns:
    mean, variance = np.array(rows).T
    return rr.Measurements.columns(values=mean, variances=variance)


def _shifts(rows: list[float]) -> Columns:
    """The whole past slides left, so that now is always at 0."""
    zero = np.zeros(len(rows))
    return rr.Transform3D.columns(translation=np.column_stack([-np.array(rows), zero, zero]))


def _strokes(rows: list[tuple[float, NDArray[np.uint32]]]) -> Columns:
    """One upright stroke a value, the last value on top, in its probability's colour."""
    n = len(rows[0][1])
    strips = np.empty((len(rows), n, 2, 2), np.float32)
    strips[..., 0] = np.array([x for x, _ in rows])[:, None, None]
    strips[..., 1] = np.arange(n - 1, -1, -1)[:, None] + np.array([-0.5, 0.5])
    columns = rr.LineStrips2D.columns(
        strips=strips.reshape(-1, 2, 2), colors=np.concatenate([colour for _, colour in rows])
    )
    return columns.partition([n] * len(rows))
