"""How the file looks when it is opened alone: the layout that travels inside it, and its page of text.

Left the arena and what happened, in the middle the distributions as figure 9 of the paper has them (what is
combined first, the combination last) over a waterfall of the one that is drawn from, right the readings,
variables, wheels and the loop over time.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from khepera_hil.recording import Value
from khepera_hil.viewer import colours
from khepera_hil.viewer.beliefs import HISTORY, MANY, PACE, Panel, panels
from khepera_hil.viewer.eye import PATH, camera_of
from khepera_hil.viewer.scene import trails
from khepera_hil.viewer.states import SERVICE, is_word, states

__all__ = ["about", "layout"]

TRAIL_SECONDS = 120.0

_MANY_LANES = 4
"""States beyond which they get the room, and the variables share theirs."""

GROUND = colours.GROUND


def layout(manifest: Mapping[str, Any]) -> rrb.Blueprint:
    """The layout for this run's questions and arena."""
    shown = panels(manifest)
    if camera_of(manifest) is None:
        left = rrb.Vertical(_space(manifest), _texts(), row_shares=[3.1, 1])
    else:
        eye = rrb.Spatial2DView(origin=PATH, name="Camera, 36 degrees", background=GROUND)
        left = rrb.Vertical(_space(manifest), eye, _texts(), row_shares=[3.1, 0.4, 1])
    columns: list[Any] = [left]
    shares = [1.12]
    if shown:
        columns.append(_beliefs(shown))
        shares.append(1.15)
    columns.append(_series(manifest))
    shares.append(0.9)
    return rrb.Blueprint(
        rrb.Horizontal(*columns, column_shares=shares),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        # Following: a finished file opens at its last tick with its history, and a live one stays at now.
        rrb.TimePanel(timeline="run_time", play_state="following", state="collapsed"),
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
        overrides=dict.fromkeys(trails(manifest), trail),
    )


def _texts() -> rrb.Tabs:
    kind = rrb.encodings.TextLogColumnKind
    return rrb.Tabs(
        rrb.TextLogView(
            origin="/",
            contents=["/events/**", "/orders/**"],
            name="Events and orders",
            columns=rrb.TextLogColumns(
                timeline_columns=[rrb.encodings.TimelineColumn("run_time")],
                text_log_columns=[
                    rrb.encodings.TextLogColumn(kind.LogLevel),
                    rrb.encodings.TextLogColumn(kind.Body),
                ],
            ),
        ),
        rrb.TextDocumentView(origin="/about", name="About this run"),
        active_tab=0,
    )


def _beliefs(shown: list[Panel]) -> rrb.Vertical:
    # What is combined comes first, the combination last, as in figure 9.
    order = [p for p in shown if not p.main] + [p for p in shown if p.main]
    charts = [_chart(panel) for panel in order]
    columns = 1 if len(charts) == 1 else 2 if len(charts) <= 6 else 4
    grid = rrb.Grid(*charts, grid_columns=columns)
    history: list[Any] = [_waterfall(panel) for panel in shown if panel.main and len(panel.values) <= MANY]
    history += [
        _plot(f"/summary/{panel.path}", f"{panel.variable}: mean ± σ, drawn (red)", legend=False)
        for panel in shown
        if panel.main
    ]
    history += [
        _plot(f"/summary/{panel.path}", f"{panel.title} over time", legend=True) for panel in shown if panel.few
    ]
    return rrb.Vertical(grid, rrb.Tabs(*history, active_tab=0), row_shares=[1.9, 1])


def _chart(panel: Panel) -> rrb.BarChartView:
    # Short, since there is little room: the whole question stands on the page about the run.
    title = panel.key if panel.alone else panel.variable
    if panel.words:  # the axis has numbers only
        title += ": " + ", ".join(f"{i} {value}" for i, value in enumerate(panel.values))
    if panel.main:
        title += " (red: drawn)"
    return rrb.BarChartView(
        origin=f"/distributions/{panel.path}", name=title, plot_legend=rrb.PlotLegend(visible=False)
    )


def _waterfall(panel: Panel) -> rrb.Spatial2DView:
    n = len(panel.values)
    return rrb.Spatial2DView(
        origin=f"/waterfall/{panel.path}",
        name=f"{panel.variable}, the last {HISTORY:g} s: {panel.title}",
        visual_bounds=rrb.VisualBounds2D(x_range=[-PACE * HISTORY, 3.0], y_range=[-1.0, n]),
        background=GROUND,
        time_ranges=rrb.VisibleTimeRanges(
            rr.VisibleTimeRange(
                "run_time",
                start=rr.TimeRangeBoundary.cursor_relative(seconds=-HISTORY),
                end=rr.TimeRangeBoundary.cursor_relative(),
            )
        ),
    )


def _series(manifest: Mapping[str, Any]) -> rrb.Vertical:
    variables = _variables(manifest.get("evidence") or {})
    lanes = len(states(manifest))
    if lanes > _MANY_LANES and len(variables) > 1:  # what goes from behavior to behavior is read off its states
        variables = [rrb.Tabs(*variables, active_tab=0)]
    return rrb.Vertical(
        _plot("/sensors/proximity", "Proximity Px1..Px8: 0 far .. 1023 near", legend=False, span=(0, 1023)),
        _plot("/sensors/light", "Light L1..L8: 511 dark .. 0 bright", legend=False, span=(0, 511)),
        *variables,
        _states(manifest),
        _plot("/motors", "Wheels as sent (pulse/10 ms, 1 = 8 mm/s)", legend=True),
        rrb.Tabs(
            _plot("/loop/ms", "Loop: lateness, work (ms)", legend=True),
            _plot("/loop/counts", "missed, dropped (ticks)", legend=True),
            _plot("/link", "Link: characters answered a tick", legend=True),
            active_tab=0,
        ),
        # A lane of states is low, and many of them can be scrolled.
        row_shares=[1.0, 1.0, *[1.0] * len(variables), min(0.9 + 0.35 * lanes, 3.5), 1.0, 0.9],
    )


def _variables(evidence: Mapping[str, Sequence[Value]]) -> list[Any]:
    """The numbers among the evidence over time: variables of like range share a plot."""
    if not evidence:
        return [_plot("/variables", "Variables", legend=True)]
    scales: dict[int, list[str]] = {}
    for name, values in evidence.items():
        if not all(map(is_word, values)) and not re.fullmatch(r"(Px|L)[1-8]", name):
            widest = max((abs(float(value)) for value in values if not isinstance(value, str)), default=1.0)
            scales.setdefault(int(np.log(max(widest, 1.0)) / np.log(8)), []).append(name)
    plots: list[Any] = [
        _plot(
            "/variables",
            ", ".join(map(_with_unit, names)),
            legend=len(names) > 1,
            contents=list(map(_variable, names)),
        )
        for names in scales.values()
    ]
    return plots if len(plots) <= 3 else [rrb.Tabs(*plots, active_tab=0)]


def _with_unit(name: str) -> str:
    return f"{name} (degrees, clockwise)" if name.startswith("Theta") else name


def _states(manifest: Mapping[str, Any]) -> rrb.StateTimelineView:
    """Words over time, a lane each, and the service's state."""
    return rrb.StateTimelineView(
        origin="/",
        contents=["/states/**", SERVICE],
        name="States: of the service; known, drawn or most probable"
        if states(manifest)
        else "State of the service",
        time_view=_window(),
    )


def _variable(name: str) -> str:
    return "/variables/" + rr.escape_entity_path_part(name)


def _plot(
    origin: str,
    name: str,
    *,
    legend: bool,
    contents: Sequence[str] = ("$origin/**",),
    span: tuple[float, float] | None = None,
) -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(
        origin=origin,
        contents=list(contents),
        name=name,
        axis_x=_window(),
        axis_y=None if span is None else rrb.ScalarAxis(range=span),
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
        "- Arena: metres, x right, y up. Red rays grow with proximity, yellow ones with light; the white stroke "
        "points ahead; dots are the trail. What moves by itself and what burns bears its name.",
        "- Sensors clockwise from the left: 1 left, 2 left 45, 3 and 4 front, 5 right 45, 6 right, 7 and 8 back; "
        "blue is left, yellow and orange right, violet behind.",
        "- Light readings fall with brightness. Angles of a program are clockwise degrees, 0 ahead.",
        "- States: words over time, as they were known or drawn; of what was only asked for the most probable one; "
        "and the state of the service (running, degraded where too many of the last ticks went wrong, ...).",
        "- Wheels in pulses per 10 ms, as really sent (1 is 8 mm/s).",
        "- Loop: by how many ms a tick came late and how long it worked, deadlines missed, ticks that this file "
        "lacks; link: characters that the robot answered, and those that nobody had asked for.",
        "- Timelines: `run_time` (robot time), `tick` (number of the deadline), `wall_clock` (host).",
    ]
    return "\n".join(lines)
