"""Maps of tables 2 to 7, each entry coloured by what it does: as SVG, and as a recording with its own layout."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brp.programs.behavior import TABLES
from khepera_hil.experiments.stability_tables import ENTRIES, PUBLISHED, Entry

__all__ = ["Cell", "Map", "maps_shown", "svg"]


class Cell(NamedTuple):
    """What is known of an entry."""

    value: float
    seen: bool
    """Whether it is beside zero."""
    clear: bool
    """Whether it still is when all entries are allowed for."""


Map = Mapping[Entry, Cell]

_BEHAVIORS = ("idle", "patrol", "recogn.", "fire", "homing", "recharge")
_GAP = 0.6
"""Between two tables, in rows."""

_POSITIVE, _NEGATIVE = (202, 58, 46), (38, 98, 178)
_GROUND, _STILL = (255, 255, 255), (232, 230, 224)
_WIDE, _HIGH = 48, 24
"""Pixels of a cell in the recording's picture; a gap is a part of it."""
_MIDDLE = 0.15
"""Of a row, where its words hang from: the viewer writes below a point."""
_LEGEND = (
    "red: more of it, blue: less; bold with a frame: beside zero also when all entries are allowed for, "
    "pale: the 95 % interval has zero in it; grey: zero or certain, and not moved"
)
_BESIDE = 3
_SPECK = 0.005
"""Of the greatest value: what is less is written as nearly nothing."""


def _tops() -> dict[int, float]:
    """Where each table begins, in rows from above."""
    found, y = {}, 0.0
    for number, p in PUBLISHED.items():
        found[number] = y
        y += len(p) + _GAP
    return found


_TOPS = _tops()
_ROWS = sum(len(p) for p in PUBLISHED.values()) + _GAP * (len(PUBLISHED) - 1)
_COLUMNS = len(_BEHAVIORS)


def svg(title: str, maps: Mapping[str, Map], *, columns: int = 3) -> str:
    """All maps beside and below each other."""
    wide, high, left, top, gap = 44, 19, 118, 52, 26
    one_wide, one_high = left + wide * _COLUMNS + gap, top + high * _ROWS + gap + 16
    rows = math.ceil(len(maps) / columns)
    width, height = columns * one_wide + gap, rows * one_high + 64
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height:g}" width="{width:g}" '
        'font-family="sans-serif" font-size="10">',
        f'<rect width="{width:g}" height="{height:g}" fill="#fff"/>',
        f'<text x="{gap}" y="24" font-size="16">{escape(title)}</text>',
        f'<text x="{gap}" y="40" fill="#777">{_LEGEND}</text>',
    ]
    for place, (name, cells) in enumerate(maps.items()):
        row, column = divmod(place, columns)
        x, y = gap + column * one_wide, 60 + row * one_high
        parts += _one(name, cells, x, y, (wide, high, left, top))
    return "\n".join([*parts, "</svg>\n"])


def _one(name: str, cells: Map, x: float, y: float, sizes: tuple[int, int, int, int]) -> list[str]:
    wide, high, left, top = sizes
    most = _most(cells)
    parts = [f'<text x="{x:g}" y="{y + 12:g}" font-size="12" font-weight="bold">{escape(name)}</text>']
    parts.append(f'<text x="{x:g}" y="{y + 26:g}" fill="#777">full colour: {most:.3g}</text>')
    for place, behavior in enumerate(_BEHAVIORS):
        middle = x + left + (place + 0.5) * wide
        parts.append(f'<text x="{middle:g}" y="{y + top - 5:g}" text-anchor="middle" fill="#555">{behavior}</text>')
    for number, p in PUBLISHED.items():
        for row in range(len(p)):
            at = y + top + (_TOPS[number] + row) * high
            parts.append(
                f'<text x="{x + left - 5:g}" y="{at + 13:g}" text-anchor="end" fill="#555">'
                f"{escape(_row_name(number, row))}</text>"
            )
    for entry in ENTRIES:
        cell = cells.get(entry)
        corner = x + left + entry.column * wide, y + top + (_TOPS[entry.table] + entry.row) * high
        colour = "rgb({},{},{})".format(*_colour(cell, most))
        frame = ' stroke="#000" stroke-width="1.4"' if cell is not None and cell.clear else ' stroke="#ccc"'
        parts.append(
            f'<rect x="{corner[0]:.1f}" y="{corner[1]:.1f}" width="{wide - 2}" height="{high - 2}" '
            f'fill="{colour}"{frame}/>'
        )
        style = ' font-weight="bold"' if cell is not None and cell.clear else ""
        ink = "#999" if cell is None or not cell.seen else "#000"
        parts.append(
            f'<text x="{corner[0] + (wide - 2) / 2:.1f}" y="{corner[1] + 12:.1f}" text-anchor="middle" '
            f'fill="{ink}"{style}>{_said(entry, cell, most)}</text>'
        )
    return parts


def maps_shown(folder: Path, name: str, title: str, maps: Mapping[str, Map]) -> list[Path]:
    """Write ``name.svg`` and ``name.rrd`` into a folder; where both are."""
    picture = folder / f"{name}.svg"
    picture.write_text(svg(title, maps), "utf-8")
    path = folder / f"{name}.rrd"
    os.environ.setdefault("RUST_LOG", "off")
    import rerun as rr
    import rerun.blueprint as rrb

    stream = rr.RecordingStream("khepera-hil paper", recording_id=name)
    bounds = rrb.VisualBounds2D(
        x_range=[-1.9 * _WIDE, (_COLUMNS + 0.1) * _WIDE], y_range=[-1.4 * _HIGH, (_ROWS + 0.2) * _HIGH]
    )
    views = [
        rrb.Spatial2DView(origin=f"/{place}", name=one, visual_bounds=bounds, background=[250, 250, 250])
        for place, one in enumerate(maps)
    ]
    # Three beside each other: in more rows the words of two lines would lie on each other.
    tabs = [
        rrb.Horizontal(*views[first : first + _BESIDE], name=_kind(list(maps), first))
        for first in range(0, len(views), _BESIDE)
    ]
    layout = rrb.Blueprint(
        rrb.Tabs(*tabs),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed"),
    )
    stream.save(path, default_blueprint=layout)
    for place, cells in enumerate(maps.values()):
        stream.log(f"/{place}/tables", rr.Image(_pixels(cells)), static=True)
        at, words = _labels(cells)
        stream.log(
            f"/{place}/words",
            rr.Points2D(at, labels=words, radii=0.01, colors=[20, 20, 20], show_labels=True),
            static=True,
        )
    stream.flush()
    stream.disconnect()
    return [picture, path]


def _kind(names: Sequence[str], first: int) -> str:
    """A tab's name: what its maps are, and which of all they are."""
    return f"{names[first].partition(':')[0]}, maps {first + 1} to {min(first + _BESIDE, len(names))}"


def _pixels(cells: Map) -> NDArray[np.uint8]:
    most = _most(cells)
    picture = np.full((round(_ROWS * _HIGH), _COLUMNS * _WIDE, 3), 250, np.uint8)
    for entry in ENTRIES:
        y, x = round((_TOPS[entry.table] + entry.row) * _HIGH), entry.column * _WIDE
        cell = cells.get(entry)
        if cell is not None and cell.clear:
            picture[y : y + _HIGH - 1, x : x + _WIDE - 1] = (0, 0, 0)
        picture[y + 1 : y + _HIGH - 2, x + 1 : x + _WIDE - 2] = _colour(cell, most)
    return picture


def _labels(cells: Map) -> tuple[list[tuple[float, float]], list[str]]:
    """Where in the picture which words stand."""
    at: list[tuple[float, float]] = []
    words: list[str] = []
    for place, behavior in enumerate(_BEHAVIORS):
        at.append(((place + 0.5) * _WIDE, -0.6 * _HIGH))
        words.append(behavior)
    for number, p in PUBLISHED.items():
        for row in range(len(p)):
            at.append((-0.95 * _WIDE, (_TOPS[number] + row + _MIDDLE) * _HIGH))
            words.append(_row_name(number, row))
    most = _most(cells)
    for entry, cell in cells.items():
        if cell.seen and abs(cell.value) >= _SPECK * most:
            at.append(((entry.column + 0.5) * _WIDE, (_TOPS[entry.table] + entry.row + _MIDDLE) * _HIGH))
            words.append(_said(entry, cell, most))
    return at, words


def _most(cells: Map) -> float:
    return max((abs(cell.value) for cell in cells.values()), default=0.0) or 1.0


def _colour(cell: Cell | None, most: float) -> tuple[int, int, int]:
    if cell is None:
        return _STILL
    towards = _POSITIVE if cell.value > 0 else _NEGATIVE
    share = min(1.0, abs(cell.value) / most) * (0.85 if cell.seen else 0.2)
    mixed: Sequence[int] = [round(g + (t - g) * share) for g, t in zip(_GROUND, towards, strict=True)]
    return mixed[0], mixed[1], mixed[2]


def _said(entry: Entry, cell: Cell | None, most: float) -> str:
    """Two digits that count; of what is not moved, its probability."""
    if cell is None:
        return f"{PUBLISHED[entry.table][entry.row, entry.column]:.3g}"
    size = abs(cell.value)
    if size < _SPECK * most:
        return "0" if size == 0 else "~0"
    digits = max(0, 1 - math.floor(math.log10(size)))
    return f"{cell.value:+.{digits}f}".replace("+0.", "+.").replace("-0.", "-.")


def _row_name(table: int, row: int) -> str:
    variable = TABLES[table].of[0]
    value = str(variable.values[row]).replace("fire-intervention", "fire")
    return f"{value.lower()}" if table == 2 else f"{variable} {value.lower()}"
