"""What measured plans say of accuracy against time: the front, the baselines, and the plans worth naming."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

import jinja2

from dsl_core.errors import StoreError
from dsl_core.io.staging import staged
from dsl_core.resources import resource_path
from dsl_core.solve.front import front
from tests.benchmarks.sweep import Case, Point

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Width and height of the plot of a palette, inches at 100 dots.
SIZE_IN = (8.0, 4.4)
COLOURS = {"best": "#4477aa", "published": "#aa3377", "nearest-line": "#ccbb44", "colour-basis": "#66ccee"}


@dataclass(frozen=True)
class Measured:
    """A case and what it reached; ``error`` is the RMSE of a pixel's reflectance."""

    case: Case
    point: Point

    @property
    def error(self) -> float:
        """RMSE of reflectance over pixels; infinite where the plan gave nothing."""
        return float("inf") if self.point.pixel_rmse is None else self.point.pixel_rmse


@dataclass(frozen=True)
class Comparison:
    """Points of one palette: those on the front, and the published plan by solver."""

    palette: str
    points: tuple[Measured, ...]
    published: dict[str, Measured]

    @classmethod
    def of(cls, palette: str, points: Sequence[Measured], published: str) -> Comparison:
        """Sort the points of a palette by time; ``published`` is the name of the published plan."""
        mine = sorted((m for m in points if m.case.palette == palette), key=lambda m: m.point.seconds)
        baselines = {m.case.solver: m for m in mine if m.case.plan.name == published}
        return cls(palette, tuple(mine), baselines)

    @property
    def best(self) -> list[Measured]:
        """Points that no other beats in both time and error, quickest first."""
        able = [m for m in self.points if m.point.pixel_rmse is not None]
        return [able[i] for i in front([(m.point.seconds, m.error) for m in able])]

    def named(self, frames: int, solver: str) -> Measured | None:
        """The most accurate plan of at most so many spectral frames, read by the best solver.

        None if it is less accurate than the published plan read by ``solver``, or that was not measured.
        """
        if solver not in self.published:
            return None
        able = [m for m in self.points if m.point.spectral_frames <= frames and m.case.solver == "best"]
        good = [m for m in able if m.error <= self.published[solver].error]
        return min(good, key=lambda m: m.error, default=None)


def write_measured_report(found: Sequence[Comparison], path: Path, overwrite: bool = False) -> Path:
    """Write the page, without references to other files; raises `StoreError`."""
    if not any(comparison.best for comparison in found):
        raise StoreError(f"There is no measured point to write into {path}. Measure a plan first.")
    plots = [
        "data:image/png;base64," + base64.b64encode(plot_png(each)).decode("ascii") if each.best else ""
        for each in found
    ]
    templates = jinja2.FileSystemLoader([Path(__file__).parent, resource_path("report")])
    environment = jinja2.Environment(
        loader=templates,
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    template = environment.get_template("measured_front.html.j2")
    page = template.render(found=list(zip(found, plots, strict=True)))
    with staged([path], overwrite=overwrite) as (draft,):
        draft.write_text(page, encoding="utf-8")
    return path


def plot_png(comparison: Comparison) -> bytes:
    """Error of a pixel over seconds of capture, both logarithmic, the published plan marked."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(SIZE_IN, dpi=100, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    _draw(axes, comparison)
    buffer = BytesIO()
    figure.savefig(buffer, format="png")
    return buffer.getvalue()


def _draw(axes: Axes, comparison: Comparison) -> None:
    for solver, colour in COLOURS.items():
        seen = [
            (m.point.seconds, m.error)
            for m in comparison.points
            if m.case.solver == solver and m.point.pixel_rmse is not None
        ]
        if seen:
            seconds, errors = zip(*seen, strict=True)
            axes.scatter(seconds, errors, s=12, color=colour, label=f"{solver} solver")
    line = [(m.point.seconds, m.error) for m in comparison.best]
    axes.plot(*zip(*line, strict=True), color="#cc3311", lw=1, label="none is better in both")
    marked = [(m.error, m.point.seconds, s) for s, m in comparison.published.items() if m.point.pixel_rmse]
    for rank, (error, capture_s, solver) in enumerate(sorted(marked)):
        axes.scatter([capture_s], [error], s=110, marker="*", color=COLOURS[solver], zorder=3)
        # Words in turn below and above their stars, so that those of neighbours stay apart.
        axes.annotate(
            f"published plan, {solver}",
            (capture_s, error),
            (-8, 5 if rank % 2 else -11),
            textcoords="offset points",
            fontsize=7,
            ha="right",
        )
    axes.set(xscale="log", yscale="log", xlabel="capture, s", ylabel="reflectance error of a pixel (RMSE)")
    axes.set_title(comparison.palette)
    axes.legend(fontsize=7)
    axes.grid(alpha=0.3)
