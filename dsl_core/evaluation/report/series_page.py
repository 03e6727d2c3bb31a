"""One self-contained page about a series of results: the depth test, or errors over seconds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from dsl_core.evaluation.report.pages import render_page
from dsl_core.evaluation.report.pictures import ReportPicture, figure_uri, value_picture
from dsl_core.evaluation.seen_target import SeenTarget
from dsl_core.evaluation.stage_test import StageLine, StageTest, stage_table
from dsl_core.evaluation.time_sweep import FIGURES, SweepFigure, SweepPoint, best_points
from dsl_core.model.figure import with_std_in_places
from dsl_core.solve.normal import BAND_95

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Width and height of a plot, inches at 100 dots.
_SIZE_IN = (8.0, 4.2)
_COLOURS = {"free": "#4477aa", "fixed": "#cc3311", "best": "#cc3311"}
_STAGE_NOTE = (
    "A flat target at known positions of a stage. Positions are as stated by the stage; error bars cover 95"
    " % and do not include errors that all pixels share. A free slope hides an error of scale; a slope of 1"
    " is right only for a stage that moves along the camera's axis."
)
_SWEEP_NOTE = "Scans of one scene: error against capture time, compared with {}."


@dataclass(frozen=True)
class Table:
    """Headings, and rows of text; the first column holds words, the others numbers."""

    heads: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def stage_page(names: Sequence[str], targets: Sequence[SeenTarget], found: StageTest) -> str:
    """The depth test; raises `StoreError` when the page's template is not installed."""
    pictures = [
        _residual(name, position, target)
        for name, position, target in zip(names, found.positions_mm, targets, strict=True)
    ]
    labels = {"xlabel": "position of the stage, mm", "ylabel": "distance minus line, mm"}
    deviations = plot_uri(partial(_stage_plot, found), **labels)
    return render_page(
        "series.html.j2",
        title="Depth test over positions of a stage",
        note=_STAGE_NOTE,
        verdicts=stage_table(found),
        plots=[("Deviation from the line", deviations)],
        table=stage_rows(names, targets, found),
        pictures_title="Distance from the plane",
        pictures=sorted(pictures, key=lambda picture: picture.title),
    )


def sweep_page(points: Sequence[SweepPoint], reference: str) -> str:
    """The sweep; raises `StoreError` when the page's template is not installed."""
    plots = [
        (
            figure.words,
            over_seconds(partial(_sweep_plot, points, figure), _with_unit(figure)),
        )
        for figure in FIGURES
        if any(point.error(figure) is not None for point in points)
    ]
    return render_page(
        "series.html.j2",
        title="Accuracy over time, measured",
        note=_SWEEP_NOTE.format(reference),
        verdicts=(),
        plots=plots,
        table=sweep_rows(points),
        pictures_title="",
        pictures=(),
    )


def stage_rows(names: Sequence[str], targets: Sequence[SeenTarget], found: StageTest) -> Table:
    """A row for each position, in the order of the positions."""
    heads = (
        "Result",
        "Position, mm",
        "Distance, mm",
        "± mm",
        "Off the line, slope free, mm",
        "Off the line, slope 1, mm",
        "Single pixels, RMS mm",
        "Pixels",
        "Left out",
    )
    rows = tuple(
        (
            names[i],
            f"{found.positions_mm[i]:g}",
            f"{found.distances_mm[i]:.4f}",
            f"{found.std_mm[i]:.4f}",
            f"{found.free.deviations_mm[i]:+.4f}",
            f"{found.fixed.deviations_mm[i]:+.4f}",
            f"{targets[i].plane.rms_mm:.3f}",
            str(targets[i].plane.pixels),
            str(targets[i].left_out),
        )
        for i in np.argsort(found.positions_mm).tolist()
    )
    return Table(heads, rows)


def sweep_rows(points: Sequence[SweepPoint]) -> Table:
    """A row for each scan, from quick to slow; a star marks errors that no quicker scan beats."""
    heads = ("Result", "Seconds", *map(_with_unit, FIGURES))
    best = [set(best_points(points, figure)) for figure in FIGURES]
    rows = []
    for i in sorted(range(len(points)), key=lambda i: points[i].seconds):
        errors = [
            points[i].words(each) + (" *" if i in kept else "")
            for each, kept in zip(FIGURES, best, strict=True)
        ]
        rows.append((points[i].name, f"{points[i].seconds:.1f}", *errors))
    return Table(heads, tuple(rows))


def _with_unit(figure: SweepFigure) -> str:
    return f"{figure.words}{figure.unit and ', ' + figure.unit}"


def _residual(name: str, position_mm: float, target: SeenTarget) -> ReportPicture:
    caption = f"{name}: distance of each pixel behind the plane, RMS {target.plane.rms_mm:.3f} mm"
    title = f"{position_mm:7.1f} mm"
    return value_picture(target.residual_mm, title, caption, "mm", "RdBu_r", symmetric=True)


def plot_uri(draw: Callable[[Axes], object], **axes_are: str) -> str:
    """A plot with grid and legend as a PNG data URI, drawn on axes with labels and scales as given."""
    from matplotlib.figure import Figure

    figure = Figure(_SIZE_IN, dpi=100, layout="constrained")
    axes = figure.subplots()
    draw(axes)
    axes.set(**axes_are)
    axes.legend()
    axes.grid(alpha=0.3)
    return figure_uri(figure)


def over_seconds(draw: Callable[[Axes], object], error: str) -> str:
    """A plot of an error over seconds of capture, both in decades, as a PNG data URI."""
    return plot_uri(draw, xscale="log", yscale="log", xlabel="capture, s", ylabel=error)


def _stage_plot(found: StageTest, axes: Axes) -> None:
    order = np.argsort(found.positions_mm)
    at, half = np.array(found.positions_mm)[order], BAND_95 * np.array(found.std_mm)[order]
    for line, key, words in (
        (found.free, "free", f"slope free, RMS {_rms(found.free)}"),
        (found.fixed, "fixed", f"slope 1, RMS {_rms(found.fixed)}"),
    ):
        off = np.array(line.deviations_mm)[order]
        axes.errorbar(at, off, half, fmt="o-", ms=4, lw=0.8, capsize=2, color=_COLOURS[key], label=words)
    axes.axhline(0.0, color="gray", lw=0.8)


def _rms(line: StageLine) -> str:
    return f"{with_std_in_places(line.rms_mm, line.rms_std_mm, '.4f')} mm"


def _sweep_plot(points: Sequence[SweepPoint], shown: SweepFigure, axes: Axes) -> None:
    for point in points:
        error = point.error(shown)
        if error is None:
            continue
        half = BAND_95 * (point.std(shown) or 0.0)
        # A bar down to nothing has no end on an axis that counts decades.
        lower = min(half, 0.9 * error)
        axes.errorbar(point.seconds, error, [[lower], [half]], fmt="o", ms=5, color=_COLOURS["free"])
        axes.annotate(point.name, (point.seconds, error), (4, 4), textcoords="offset points", fontsize=8)
    front = [(points[k].seconds, points[k].error(shown)) for k in best_points(points, shown)]
    axes.plot(*zip(*front, strict=True), color=_COLOURS["best"], lw=1, label="none is better in both")
