"""An experiment's own recording for rerun: a page of figures and tables, charts, curves, pictures from above."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from khepera_hil.errors import RecordingError
from khepera_hil.experiments.experiment import Experiment, Report
from khepera_hil.experiments.figures import table
from khepera_hil.experiments.picture import BODY, Chart, Curve, FromAbove, written_charts

__all__ = ["written"]

_ROBOT, _WAY = 0x5AA2FFFF, 0x5AA2FF60

_FEW = 6
"""Bars that a legend names; more are named on the page alone."""

_ROOM = 0.15
"""Beside the robot's way, m."""


def written(
    experiment: Experiment, seeds: range, report: Report, pictures: Sequence[FromAbove], folder: Path
) -> list[Path]:
    """Write ``NAME.rrd`` and, where there are charts or curves, ``NAME.svg`` into the folder; where they are.

    Raises RecordingError when they cannot be written.
    """
    path, drawing = folder / f"{experiment.name}.rrd", folder / f"{experiment.name}.svg"
    drawn = bool(report.charts or report.curves)
    title = report.title or f"{experiment.name}: {experiment.about}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if drawn:
            drawing.write_text(written_charts(title, report.charts, report.curves, columns=report.columns), "utf-8")
        path.write_bytes(b"")  # on a full disk or in a folder of somebody else rerun would say nothing
    except OSError as error:
        raise RecordingError(f"{folder} cannot be written: {error.strerror or error}") from None
    _Page(path, experiment, seeds, report, pictures)
    return [path, drawing] if drawn else [path]


class _Page:
    """What of a report and its pictures goes where."""

    def __init__(
        self, path: Path, experiment: Experiment, seeds: range, report: Report, pictures: Sequence[FromAbove]
    ) -> None:
        os.environ.setdefault("RUST_LOG", "off")
        import rerun as rr  # late: it takes half a second
        import rerun.blueprint as rrb

        from khepera_hil.viewer.stream import open_stream

        charts = [
            rrb.BarChartView(
                origin=f"/charts/{place}",
                name=chart.title,
                plot_legend=rrb.PlotLegend(visible=0 < len(chart.labels or ()) <= _FEW),
            )
            for place, chart in enumerate(report.charts)
        ]
        curves = [
            rrb.TimeSeriesView(
                origin=f"/curves/{place}",
                name=f"{curve.title}, over {curve.axis}",
                plot_legend=rrb.PlotLegend(visible=True, corner=rrb.Corner2D.RightBottom),
            )
            for place, curve in enumerate(report.curves)
        ]
        above = [
            rrb.Spatial2DView(
                origin="/",
                contents=[f"/above/{place}/**"],
                name=picture.title,
                visual_bounds=_bounds(picture),
            )
            for place, picture in enumerate(pictures)
        ]
        page = rrb.TextDocumentView(origin="/page", name="Figures")
        columns: list[Any] = []
        if above:
            columns.append(above[0] if len(above) == 1 else rrb.Grid(*above))
        if charts or curves:
            many = [*charts, *curves]
            columns.append(rrb.Grid(*many, grid_columns=min(report.columns, len(many))))
        columns.append(page)
        wide = 1.0 + 0.5 * (report.columns - 1)
        shares = [1.0 if above else None, wide if charts or curves else None, 1.1]
        timeline = report.curves[0].axis if report.curves else None
        look = rrb.Blueprint(
            rrb.Horizontal(*columns, column_shares=[share for share in shares if share is not None]),
            rrb.BlueprintPanel(state="collapsed"),
            rrb.SelectionPanel(state="collapsed"),
            rrb.TimePanel(state="collapsed", play_state="paused", timeline=timeline),
            auto_views=False,
            auto_layout=False,
        )
        # The viewer remembers a layout that the user changed by the application's name: one for each experiment.
        name = f"khepera-hil paper {experiment.name}"
        self._stream = open_stream(name, experiment.name, rr.FileSink(str(path), write_footer=True), look)
        self._stream.send_recording_name(f"{experiment.name}, seeds {seeds[0]} to {seeds[-1]}")
        text = _text(experiment, seeds, report)
        self._log("/page", rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN))
        for place, chart in enumerate(report.charts):
            self._chart(f"/charts/{place}", chart)
        for place, curve in enumerate(report.curves):
            self._curve(f"/curves/{place}", curve)
        for place, picture in enumerate(pictures):
            self._above(f"/above/{place}", picture)
        try:
            self._stream.flush(timeout_sec=10)
        except RuntimeError as error:
            raise RecordingError(f"{path} cannot be written, is there room? {error}") from None
        self._stream.disconnect()

    def _log(self, path: str, what: Any) -> None:
        self._stream.log(path, what, static=True, strict=True)

    def _chart(self, path: str, chart: Chart) -> None:
        """Bars; one that has a name is an entity of its own, with a colour of its own."""
        import rerun as rr

        from khepera_hil.viewer import colours

        p = np.array(chart.p, np.float64)
        if not chart.labels:
            at = np.array(chart.at if chart.at is not None else range(len(p)), np.float64)
            wide = float(np.min(np.diff(at))) if len(at) > 1 else 1.0
            self._log(
                path, rr.BarChart(p, abscissa=at - wide / 2, widths=np.full(len(p), wide), color=colours.MAIN)
            )
            return
        for place, (label, value) in enumerate(zip(chart.labels, p, strict=True)):
            bar = rr.BarChart(
                np.array([value]), abscissa=np.array([place - 0.5]), color=int(colours.many(len(p))[place])
            )
            self._log(f"{path}/{rr.escape_entity_path_part(label)}", bar)

    def _curve(self, path: str, curve: Curve) -> None:
        """A line with the bounds of its interval beside it."""
        import rerun as rr

        from khepera_hil.viewer import colours

        for number, (name, line) in enumerate(curve.lines.items()):
            colour = int(colours.many(len(curve.lines))[number])
            where = f"{path}/{rr.escape_entity_path_part(name)}"
            thin = colours.mixed(colour, 0.5)
            look = rr.SeriesLines(
                names=[name, "95 %, low", "95 %, high"],
                colors=colours.packed(colour, thin, thin),
                widths=[2.5, 1, 1],
            )
            self._log(where, look)
            rows = [[_number(f.value), _number(f.low), _number(f.high)] for f in line]
            self._stream.send_columns(
                where,
                indexes=[rr.TimeColumn(curve.axis, sequence=list(curve.at))],
                columns=rr.Scalars.columns(scalars=np.array(rows)),
            )

    def _above(self, path: str, picture: FromAbove) -> None:
        """Superposed images, as the paper's photographs have them. The viewer's plane has y down."""
        import rerun as rr

        from khepera_hil.viewer import colours

        self._log(path, rr.Transform3D(scale=[1, -1, 1]))
        width, height = picture.size
        edge = np.array([[0, 0], [width, 0], [width, height], [0, height], [0, 0]])
        self._log(f"{path}/floor", rr.LineStrips2D([edge], radii=0.002, colors=colours.packed(colours.WALL)))
        for shape in picture.shapes:
            if shape["kind"] != "robot":
                self._thing(path, picture, shape)
        if not picture.robot:
            return
        way = [[x, y] for x, y, _ in picture.robot]
        seen = picture.robot[:: picture.every]
        turn = np.linspace(0, 2 * np.pi, 33)
        rim = BODY / 1000 * np.column_stack([np.cos(turn), np.sin(turn)])
        noses = [
            [[x, y], [x + BODY / 1000 * math.cos(theta), y + BODY / 1000 * math.sin(theta)]] for x, y, theta in seen
        ]
        images = [rim + np.array([x, y]) for x, y, _ in seen]
        self._log(f"{path}/way", rr.LineStrips2D([way], radii=0.0015, colors=colours.packed(_WAY)))
        self._log(
            f"{path}/robot",
            rr.LineStrips2D([*images, *noses], radii=0.0012, colors=colours.packed(_ROBOT), draw_order=50.0),
        )

    def _thing(self, path: str, picture: FromAbove, shape: Any) -> None:
        import rerun as rr

        from khepera_hil.viewer import colours

        first = tuple(shape["pose"])
        now = picture.poses.get(shape["name"], first)
        moved = math.dist(first[:2], now[:2]) > 0.005
        colour = colours.shape(shape["kind"], bool(shape.get("movable")))
        for which, pose in (("first", first), ("now", now)) if moved else (("now", now),):
            where = f"{path}/{which}/{rr.escape_entity_path_part(shape['name'])}"
            label: dict[str, Any] = {"labels": [shape["name"]], "show_labels": picture.names and which == "now"}
            seen = colours.mixed(colour, 0.4 if which == "first" else 1.0)
            self._log(
                where, rr.LineStrips2D([_outline(shape, pose)], radii=0.0015, colors=colours.packed(seen), **label)
            )


def _outline(shape: Any, pose: Sequence[float]) -> Any:
    x, y, theta = pose[0], pose[1], pose[2]
    if "polygon" in shape:
        points = np.array([*shape["polygon"], shape["polygon"][0]], np.float64)
    else:
        turn = np.linspace(0, 2 * np.pi, 49)
        points = shape.get("radius", 0.01) * np.column_stack([np.cos(turn), np.sin(turn)])
    cosine, sine = math.cos(theta), math.sin(theta)
    return points @ np.array([[cosine, sine], [-sine, cosine]]) + [x, y]


def _bounds(picture: FromAbove) -> Any:
    """What is seen: where the robot went and what stands near there, or the whole floor."""
    import rerun.blueprint as rrb

    (width, height), edge = picture.size, 0.02
    low, high = np.array([-edge, -edge]), np.array([width + edge, height + edge])
    if picture.robot:
        way = np.array(picture.robot)[:, :2]
        low, high = np.maximum(low, way.min(axis=0) - _ROOM), np.minimum(high, way.max(axis=0) + _ROOM)
    return rrb.VisualBounds2D(x_range=[low[0], high[0]], y_range=[-high[1], -low[1]])


def _number(value: float | None) -> float:
    return math.nan if value is None else value


def _text(experiment: Experiment, seeds: range, report: Report) -> str:
    """The page, Markdown."""
    lines = [
        f"# {experiment.name}",
        "",
        f"{experiment.about} (section {experiment.section}), seeds {seeds[0]} to {seeds[-1]}",
    ]
    if report.figures:
        lines += ["", *table(report.figures)]
    for chart in report.charts:
        if chart.labels:
            said = ", ".join(f"{place} {label}" for place, label in enumerate(chart.labels))
            lines += ["", f"- {chart.title}: {said}"]
        else:
            lines += ["", f"- {chart.title}: over {chart.axis}"]
    if report.lines:
        lines += ["", "```", *report.lines, "```"]
    return "\n".join(lines)
