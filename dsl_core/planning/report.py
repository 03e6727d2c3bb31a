"""One page that compares plans: a curve of error over time, and a table."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from dsl_core.evaluation.report.pages import render_page
from dsl_core.evaluation.report.series_page import over_seconds
from dsl_core.io.staging import write_text
from dsl_core.planning.choice import Weighed, pareto

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLOURS = {"plan": "#4477aa", "front": "#cc3311", "chosen": "#228833"}


def write_tradeoff_report(
    weighed: Sequence[Weighed],
    chosen: Weighed,
    path: Path,
    overwrite: bool = False,
) -> Path:
    """Write the page, without references to other files; raises `StoreError`."""
    best = pareto(weighed)
    page = render_page(
        "tradeoff.html.j2",
        rows=sorted(weighed, key=lambda each: each.expected.seconds),
        front={each.plan.name for each in best},
        chosen=chosen,
        plot=over_seconds(partial(_plot, weighed, chosen), "reflectance error of a pixel (RMSE)"),
    )
    return write_text(path, page, overwrite=overwrite)


def _plot(weighed: Sequence[Weighed], chosen: Weighed, axes: Axes) -> None:
    """Error of a pixel over seconds of capture."""
    points = [(each.expected.seconds, each.expected.pixel_rmse) for each in weighed]
    seconds, errors = zip(*points, strict=True)
    axes.scatter(seconds, errors, s=12, color=COLOURS["plan"], label="predicted")
    line = [(each.expected.seconds, each.expected.pixel_rmse) for each in pareto(weighed)]
    axes.plot(*zip(*line, strict=True), color=COLOURS["front"], label="none is better in both")
    mark = chosen.expected
    axes.scatter([mark.seconds], [mark.pixel_rmse], s=80, marker="*", color=COLOURS["chosen"], label="chosen")
