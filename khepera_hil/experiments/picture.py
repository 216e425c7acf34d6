"""Pictures as SVG: the arena from above with the robot at many moments, bar charts, and curves with their bands."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

from khepera_hil.experiments.figures import Figure

__all__ = ["BODY", "Chart", "Curve", "FromAbove", "charted", "superposed", "written_charts"]

Pose = tuple[float, float, float]

BODY = 28.5
"""Radius of the robot, mm."""

_COLOURS = ("#27c", "#d62", "#293", "#a3a", "#777")
_FILL = {"wall": "#555", "fixed": "#555", "block": "#c96", "disc": "#c96", "base": "#ffe9a8"}


@dataclass(frozen=True)
class Chart:
    """Bars: a probability (or another number) for each value; ``at`` are the values, where they are numbers."""

    title: str
    axis: str
    p: Sequence[float]
    at: Sequence[float] | None = None
    labels: Sequence[str] | None = None


def charted(title: str, axis: str, figures: Mapping[str, Figure]) -> Chart:
    """A bar for each figure, by its short name; what was not measured has none."""
    return Chart(title, axis, [figure.value or 0.0 for figure in figures.values()], None, list(figures))


@dataclass(frozen=True)
class Curve:
    """Lines over the same whole numbers, each a figure at each of them: value and 95 % interval."""

    title: str
    axis: str
    at: Sequence[int]
    lines: Mapping[str, Sequence[Figure]]


@dataclass(frozen=True)
class FromAbove:
    """The floor (m) with everything where it came to be, and the robot at every so many ticks."""

    title: str
    size: tuple[float, float]
    shapes: Sequence[Mapping[str, Any]]
    """As the witness has them: where they stood at first."""
    poses: Mapping[str, Pose]
    """Where they came to be, by name, if they were moved."""
    robot: Sequence[Pose] = ()
    every: int = 1
    names: bool = False
    """Whether each thing's name stands below it."""


def superposed(picture: FromAbove) -> str:
    """The picture as SVG; things that were moved are dashed where they stood at first."""
    width, height = (1000 * side for side in picture.size)
    shapes, robot = picture.shapes, picture.robot
    margin = 30.0
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{-margin:g} {-height - margin:g} '
        f'{width + 2 * margin:g} {height + 2 * margin:g}" width="600">',
        f'<rect x="0" y="{-height:g}" width="{width:g}" height="{height:g}" fill="#faf8f2" stroke="#333"/>',
    ]
    for shape in sorted(shapes, key=lambda one: one["kind"] != "base"):
        if shape["kind"] in ("robot", "lamp"):
            continue
        first = tuple(shape["pose"])
        now = picture.poses.get(shape["name"], first)
        if math.dist(first[:2], now[:2]) > 0.005:
            parts.append(_outline(shape, first, 'fill="none" stroke="#888" stroke-width="3" stroke-dasharray="8"'))
        parts.append(_outline(shape, now, f'fill="{_FILL.get(shape["kind"], "#c96")}" stroke="#333"'))
        if picture.names:
            parts.append(
                f'<text x="{1000 * now[0]:.1f}" y="{-1000 * now[1] + 125:.1f}" text-anchor="middle" '
                f'font-family="sans-serif" font-size="20">{escape(shape["name"])}</text>'
            )
    for shape in shapes:
        if shape["kind"] == "lamp":
            x, y = 1000 * shape["pose"][0], -1000 * shape["pose"][1]
            parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="14" fill="#fc0" stroke="#a80"/>')
    way = " ".join(f"{1000 * x:.1f},{-1000 * y:.1f}" for x, y, _ in robot)
    parts.append(f'<polyline points="{way}" fill="none" stroke="#27c" stroke-width="2"/>')
    for x, y, theta in robot[:: picture.every]:
        cx, cy = 1000 * x, -1000 * y
        tip = cx + BODY * math.cos(theta), cy - BODY * math.sin(theta)
        parts.append(
            f'<circle cx="{cx:.1f}" cy="{cy:.1f}" r="{BODY}" fill="#27c" fill-opacity=".12" stroke="#27c"/>'
        )
        parts.append(f'<line x1="{cx:.1f}" y1="{cy:.1f}" x2="{tip[0]:.1f}" y2="{tip[1]:.1f}" stroke="#27c"/>')
    return "\n".join([*parts, "</svg>\n"])


def _outline(shape: Mapping[str, Any], pose: Sequence[float], style: str) -> str:
    x, y, theta = pose[0], pose[1], pose[2]
    if "polygon" not in shape:
        radius = 1000 * shape.get("radius", 0.0)
        return f'<circle cx="{1000 * x:.1f}" cy="{-1000 * y:.1f}" r="{radius:.1f}" {style}/>'
    cosine, sine = math.cos(theta), math.sin(theta)
    corners = " ".join(
        f"{1000 * (x + cosine * a - sine * b):.1f},{-1000 * (y + sine * a + cosine * b):.1f}"
        for a, b in shape["polygon"]
    )
    return f'<polygon points="{corners}" {style}/>'


def written_charts(title: str, charts: Sequence[Chart], curves: Sequence[Curve] = (), *, columns: int = 2) -> str:
    """Bar charts beside and below each other, then curves."""
    wide, high, gap = 320, 190, 20
    rows = math.ceil((len(charts) + len(curves)) / columns)
    width, height = columns * (wide + gap) + gap, rows * (high + gap) + gap + 30
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" '
        'font-family="sans-serif" font-size="12">',
        f'<rect width="{width}" height="{height}" fill="#fff"/>',
        f'<text x="{gap}" y="24" font-size="15">{escape(title)}</text>',
    ]
    shown: list[Chart | Curve] = [*charts, *curves]
    for place, one in enumerate(shown):
        row, column = divmod(place, columns)
        x, y = gap + column * (wide + gap), 36 + gap + row * (high + gap)
        draw = _chart(one, x, y, wide, high - 40) if isinstance(one, Chart) else _curve(one, x, y, wide, high - 40)
        parts += draw
    return "\n".join([*parts, "</svg>\n"])


def _chart(chart: Chart, x: float, y: float, wide: float, high: float) -> list[str]:
    most = max(max(chart.p, default=0.0), 1e-12)
    bar = wide / max(len(chart.p), 1)
    parts = [
        f'<text x="{x:.1f}" y="{y - 4:.1f}">{escape(chart.title)}</text>',
        f'<text x="{x + wide:.1f}" y="{y - 4:.1f}" text-anchor="end" fill="#777">max {most:.3g}</text>',
        f'<line x1="{x:.1f}" y1="{y + high:.1f}" x2="{x + wide:.1f}" y2="{y + high:.1f}" stroke="#333"/>',
    ]
    for place, p in enumerate(chart.p):
        tall = high * max(0.0, p) / most
        parts.append(
            f'<rect x="{x + place * bar + bar * 0.1:.2f}" y="{y + high - tall:.2f}" width="{bar * 0.8:.2f}" '
            f'height="{tall:.2f}" fill="#27c"/>'
        )
    names = chart.labels or ([f"{value:g}" for value in chart.at] if chart.at is not None else [])
    step = max(1, math.ceil(len(names) / 9))
    for place in range(0, len(names), step):
        parts.append(
            f'<text x="{x + (place + 0.5) * bar:.1f}" y="{y + high + 14:.1f}" text-anchor="middle" '
            f'font-size="10">{escape(names[place])}</text>'
        )
    parts.append(
        f'<text x="{x + wide / 2:.1f}" y="{y + high + 28:.1f}" text-anchor="middle" fill="#777" '
        f'font-size="10">{escape(chart.axis)}</text>'
    )
    return parts


def _curve(curve: Curve, x: float, y: float, wide: float, high: float) -> list[str]:
    found = [figure for line in curve.lines.values() for figure in line]
    most = max((figure.high or figure.value or 0.0 for figure in found), default=0.0) or 1.0
    first, last = min(curve.at), max(curve.at)
    place = {at: x + wide * (0.04 + 0.92 * (at - first) / ((last - first) or 1)) for at in curve.at}

    def up(number: float) -> float:
        return y + high - high * min(1.0, max(0.0, number) / most)

    parts = [
        f'<text x="{x:.1f}" y="{y - 4:.1f}">{escape(curve.title)}</text>',
        f'<text x="{x + wide:.1f}" y="{y - 4:.1f}" text-anchor="end" fill="#777">top {most:.3g}</text>',
        f'<line x1="{x:.1f}" y1="{y + high:.1f}" x2="{x + wide:.1f}" y2="{y + high:.1f}" stroke="#333"/>',
    ]
    for number, (name, line) in enumerate(curve.lines.items()):
        colour = _COLOURS[number % len(_COLOURS)]
        known = [(at, f) for at, f in zip(curve.at, line, strict=True) if f.value is not None]
        way = " ".join(f"{place[at]:.1f},{up(f.value or 0.0):.1f}" for at, f in known)
        parts.append(f'<polyline points="{way}" fill="none" stroke="{colour}" stroke-width="2"/>')
        for at, f in known:
            if f.low is not None and f.high is not None:
                parts.append(
                    f'<line x1="{place[at]:.1f}" y1="{up(f.low):.1f}" x2="{place[at]:.1f}" y2="{up(f.high):.1f}" '
                    f'stroke="{colour}"/>'
                )
        if len(curve.lines) > 1:
            parts.append(
                f'<text x="{x + 8:.1f}" y="{y + 12 + 13 * number:.1f}" fill="{colour}" '
                f'font-size="10">{escape(name)}</text>'
            )
    for at in curve.at:
        parts.append(
            f'<text x="{place[at]:.1f}" y="{y + high + 14:.1f}" text-anchor="middle" font-size="10">{at}</text>'
        )
    parts.append(
        f'<text x="{x + wide / 2:.1f}" y="{y + high + 28:.1f}" text-anchor="middle" fill="#777" '
        f'font-size="10">{escape(curve.axis)}</text>'
    )
    return parts
