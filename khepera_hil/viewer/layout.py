"""How the file looks when it is opened alone: the layout that travels inside it, and its page of text.

Left the arena and what happened, in the middle the distributions as figure 9 of the paper has them (what is
combined first, the combination last) over a waterfall of the one that is drawn from, right the readings,
variables, wheels and the loop over time.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import rerun as rr
import rerun.blueprint as rrb

from khepera_hil.viewer.beliefs import HISTORY, MANY, METRE_PER_SECOND, Panel, panels
from khepera_hil.viewer.scene import TRAIL

__all__ = ["about", "layout"]

TRAIL_SECONDS = 120.0
GROUND = [13, 16, 17, 255]


def layout(manifest: Mapping[str, Any]) -> rrb.Blueprint:
    """The layout for this run's questions and arena."""
    shown = panels(manifest)
    left = rrb.Vertical(_space(manifest), _texts(), row_shares=[3.1, 1])
    columns: list[Any] = [left]
    shares = [1.12]
    if shown:
        columns.append(_beliefs(shown))
        shares.append(1.15)
    columns.append(_series(manifest, shown))
    shares.append(0.9)
    return rrb.Blueprint(
        rrb.Horizontal(*columns, column_shares=shares),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        # Paused: a file that begins to play when it is opened is never where one looks.
        rrb.TimePanel(timeline="run_time", play_state="paused", state="collapsed"),
        auto_views=False,
        auto_layout=False,
    )


def _space(manifest: Mapping[str, Any]) -> rrb.Spatial2DView:
    world = manifest.get("world")
    if not world:
        return rrb.Spatial2DView(
            origin="/",
            contents=["/world/robot/**"],
            name="Robot: rays = proximity (red), light (yellow)",
            visual_bounds=rrb.VisualBounds2D(x_range=[-0.12, 0.12], y_range=[-0.12, 0.12]),
            background=GROUND,
        )
    width, height = world["size"]
    margin = 0.02 * max(width, height)
    trail = rrb.VisibleTimeRanges(
        rr.VisibleTimeRange(
            "run_time",
            start=rr.TimeRangeBoundary.cursor_relative(seconds=-TRAIL_SECONDS),
            end=rr.TimeRangeBoundary.cursor_relative(),
        )
    )
    return rrb.Spatial2DView(
        origin="/",
        contents=["/world/**"],
        name=f"Arena {world.get('name', '')}, {width:g} m x {height:g} m: rays = proximity (red), light (yellow)",
        visual_bounds=rrb.VisualBounds2D(x_range=[-margin, width + margin], y_range=[-height - margin, margin]),
        background=GROUND,
        overrides={TRAIL: trail},
    )


def _texts() -> rrb.Tabs:
    return rrb.Tabs(
        rrb.TextLogView(origin="/events", name="Events"),
        rrb.TextDocumentView(origin="/about", name="About this run"),
        active_tab=0,
    )


def _beliefs(shown: list[Panel]) -> rrb.Vertical:
    # What is combined comes first, the combination last, as in figure 9.
    order = [p for p in reversed(shown) if not p.main] + [p for p in shown if p.main]
    charts = [_chart(panel) for panel in order]
    columns = 1 if len(charts) == 1 else 2 if len(charts) <= 6 else 4
    grid = rrb.Grid(*charts, grid_columns=columns)
    over_time: list[Any] = []
    for panel in shown:
        if not panel.main:
            continue
        if len(panel.values) <= MANY:
            over_time.append(_waterfall(panel))
        over_time.append(
            rrb.TimeSeriesView(
                origin=f"/summary/{panel.path}",
                name=f"{panel.variable}: mean ± σ and drawn",
                axis_x=_window(),
                plot_legend=rrb.PlotLegend(visible=False),
            )
        )
    if not over_time:
        return rrb.Vertical(grid)
    return rrb.Vertical(grid, rrb.Tabs(*over_time, active_tab=0), row_shares=[2, 1])


def _chart(panel: Panel) -> rrb.BarChartView:
    title = panel.title if panel.alone else f"{panel.variable} of {panel.title}"
    if panel.main:
        title += "   drawn: red"
    return rrb.BarChartView(
        origin=f"/distributions/{panel.path}",
        name=title,
        plot_legend=rrb.PlotLegend(visible=panel.few, corner=rrb.Corner2D.RightTop),
    )


def _waterfall(panel: Panel) -> rrb.Spatial2DView:
    n = len(panel.values)
    return rrb.Spatial2DView(
        origin=f"/waterfall/{panel.path}",
        name=f"{panel.variable}, the last {HISTORY:g} s: {panel.title}",
        visual_bounds=rrb.VisualBounds2D(x_range=[-METRE_PER_SECOND * HISTORY, 3.0], y_range=[-1.0, n]),
        background=GROUND,
        time_ranges=rrb.VisibleTimeRanges(
            rr.VisibleTimeRange(
                "run_time",
                start=rr.TimeRangeBoundary.cursor_relative(seconds=-HISTORY),
                end=rr.TimeRangeBoundary.cursor_relative(),
            )
        ),
    )


def _series(manifest: Mapping[str, Any], shown: list[Panel]) -> rrb.Vertical:
    views: list[Any] = [
        _plot("/sensors/proximity", "Proximity Px1..Px8 (0 far .. 1023 near)", legend=True),
        _plot("/sensors/light", "Light L1..L8 (low = bright)", legend=False),
    ]
    variables = [str(name) for name in manifest.get("evidence") or []]
    if variables:
        views.append(
            rrb.Tabs(
                *(_plot(f"/variables/{rr.escape_entity_path_part(name)}", name, legend=False) for name in variables)
            )
        )
    else:
        views.append(_plot("/variables", "Variables", legend=True))
    views += [_plot(f"/summary/{p.path}", p.title, legend=True) for p in shown if p.few]
    views += [
        _plot("/motors", "Wheels as sent (pulse/10 ms; 1 = 8 mm/s)", legend=True),
        rrb.Tabs(
            _plot("/loop/ms", "Loop: late, work (ms)", legend=True),
            _plot("/loop/counts", "Loop: missed, dropped", legend=True),
        ),
    ]
    return rrb.Vertical(*views)


def _plot(origin: str, name: str, *, legend: bool) -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(
        origin=origin,
        name=name,
        axis_x=_window(),
        plot_legend=rrb.PlotLegend(visible=legend, corner=rrb.Corner2D.LeftTop),
    )


def _window() -> rrb.TimeAxis:
    boundary = rr.TimeRangeBoundary.cursor_relative
    return rrb.TimeAxis(view_range=rr.TimeRange(start=boundary(seconds=-HISTORY), end=boundary(seconds=1.0)))


def about(manifest: Mapping[str, Any]) -> str:
    """The page of text inside the file, Markdown."""
    questions = manifest.get("questions") or []
    world = manifest.get("world") or {}
    rows = [
        ("program", manifest.get("program")),
        ("seed", manifest.get("seed")),
        ("started", manifest.get("started")),
        ("port", manifest.get("port")),
        ("period", f"{manifest['period_s']:g} s" if "period_s" in manifest else None),
        ("clock", manifest.get("clock")),
        ("arena", world.get("name")),
        ("Python", manifest.get("python")),
        ("host", manifest.get("platform")),
        ("versions", ", ".join(f"{k} {v}" for k, v in (manifest.get("versions") or {}).items())),
    ]
    lines = [f"# {manifest.get('program')}", "", "| | |", "|---|---|"]
    lines += [f"| {name} | {value} |" for name, value in rows if value not in (None, "")]
    lines += ["", "## Questions asked at every tick", ""]
    lines += [f"- **{q['key']}**: {q['name']}{' (drawn from)' if q.get('main') else ''}" for q in questions]
    lines += [
        "",
        "## Reading the panels",
        "",
        "- Bars: probability of each value at the cursor; red is the value that was drawn.",
        "- Waterfall: the same distribution over the last seconds, now at the right; brighter is more probable; "
        "red dots are the draws.",
        "- Arena: metres, x right, y up. Red rays grow with proximity, yellow ones with light; the red stroke "
        "points ahead; dots are the trail.",
        "- Sensors clockwise from the left: 1 left, 2 left 45, 3 and 4 front, 5 right 45, 6 right, 7 and 8 back.",
        "- Light readings fall with brightness. Angles of a program are clockwise degrees, 0 ahead.",
        "- Wheels in pulses per 10 ms, as really sent.",
        "- Timelines: `run_time` (robot time), `tick` (number of the deadline), `wall_clock` (host).",
    ]
    return "\n".join(lines)
