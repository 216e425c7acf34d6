"""Pictures as SVG: the arena from above with the robot at many moments, and bar charts of distributions."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

__all__ = ["Chart", "superposed", "written_charts"]

Pose = tuple[float, float, float]

_BODY = 28.5  # mm
_FILL = {"wall": "#555", "fixed": "#555", "block": "#c96", "disc": "#c96", "base": "#ffe9a8"}


@dataclass(frozen=True)
class Chart:
    """Bars: a probability (or another number) for each value; ``at`` are the values, where they are numbers."""

    title: str
    axis: str
    p: Sequence[float]
    at: Sequence[float] | None = None
    labels: Sequence[str] | None = None


def superposed(
    size: tuple[float, float],
    shapes: Sequence[Mapping[str, Any]],
    poses: Mapping[str, Pose],
    robot: Sequence[Pose],
    every: int,
) -> str:
    """The floor (m) with everything where it came to be, and the robot at every so many ticks.

    Things that were moved are dashed where they stood at first.
    """
    width, height = (1000 * side for side in size)
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
        now = poses.get(shape["name"], first)
        if math.dist(first[:2], now[:2]) > 0.005:
            parts.append(_outline(shape, first, 'fill="none" stroke="#888" stroke-width="3" stroke-dasharray="8"'))
        parts.append(_outline(shape, now, f'fill="{_FILL.get(shape["kind"], "#c96")}" stroke="#333"'))
    for shape in shapes:
        if shape["kind"] == "lamp":
            x, y = 1000 * shape["pose"][0], -1000 * shape["pose"][1]
            parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="14" fill="#fc0" stroke="#a80"/>')
    way = " ".join(f"{1000 * x:.1f},{-1000 * y:.1f}" for x, y, _ in robot)
    parts.append(f'<polyline points="{way}" fill="none" stroke="#27c" stroke-width="2"/>')
    for x, y, theta in robot[::every]:
        cx, cy = 1000 * x, -1000 * y
        tip = cx + _BODY * math.cos(theta), cy - _BODY * math.sin(theta)
        parts.append(
            f'<circle cx="{cx:.1f}" cy="{cy:.1f}" r="{_BODY}" fill="#27c" fill-opacity=".12" stroke="#27c"/>'
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


def written_charts(title: str, charts: Sequence[Chart], *, columns: int = 2) -> str:
    """Bar charts beside and below each other."""
    wide, high, gap = 320, 190, 20
    rows = math.ceil(len(charts) / columns)
    width, height = columns * (wide + gap) + gap, rows * (high + gap) + gap + 30
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" '
        'font-family="sans-serif" font-size="12">',
        f'<rect width="{width}" height="{height}" fill="#fff"/>',
        f'<text x="{gap}" y="24" font-size="15">{escape(title)}</text>',
    ]
    for place, chart in enumerate(charts):
        row, column = divmod(place, columns)
        x, y = gap + column * (wide + gap), 36 + gap + row * (high + gap)
        parts += _chart(chart, x, y, wide, high - 40)
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
