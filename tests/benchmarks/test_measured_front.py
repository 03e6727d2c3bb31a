"""What measured points say: the front of each palette, the plan worth naming, and the page."""

from __future__ import annotations

from pathlib import Path

import pytest

from dsl_core.errors import StoreError
from dsl_core.model.plan import CapturePlan
from dsl_core.simulation.published_rig import published_rig
from tests.benchmarks.measured_front import Comparison, Measured, plot_png, write_measured_report
from tests.benchmarks.sweep import Case, Point, stored


def measured(
    name: str,
    seconds: float,
    error: float | None,
    frames: int = 300,
    solver: str = "best",
    palette: str = "chart",
) -> Measured:
    case = Case(name=name, plan=CapturePlan(name=name), solver=solver, palette=palette)
    point = Point(
        name=name, frames=2 * frames, spectral_frames=frames, seconds=seconds, raw_bytes=1, rmse=error,
        pixel_rmse=error, angle_rad=0, pixel_angle_rad=0, delta_e=0, depth_rmse_mm=0, cpu_s_per_megapixel=1,
        failure="" if error is not None else "nothing was lit",
    )  # fmt: skip
    return Measured(case, point)


POINTS = [
    measured("published", 200, 0.004),
    measured("published", 200, 0.02, solver="published"),
    measured("comb", 40, 0.01, frames=64),
    measured("short comb", 20, 0.03, frames=32),
    measured("slow comb", 90, 0.015, frames=60),
    measured("dark", 5, None, frames=16),
    measured("elsewhere", 1, 0.0001, frames=16, palette="filters"),
]


def test_the_front_leaves_out_what_failed_and_other_palettes() -> None:
    found = Comparison.of("chart", POINTS, "published")
    assert [m.case.name for m in found.best] == ["short comb", "comb", "published"]
    assert set(found.published) == {"best", "published"}


def test_a_plan_is_named_only_when_it_is_as_accurate_as_the_published_one() -> None:
    found = Comparison.of("chart", POINTS, "published")
    named = found.named(64, "published")
    assert named is not None
    assert named.case.name == "comb"
    assert found.named(32, "published") is None
    assert found.named(64, "best") is None
    assert found.named(64, "nearest-line") is None


@pytest.mark.slow
def test_the_page_names_the_baselines_and_what_failed(tmp_path: Path) -> None:
    found = Comparison.of("chart", POINTS, "published")
    page = write_measured_report([found], tmp_path / "front.html").read_text(encoding="utf-8")
    assert "short comb" in page
    assert "nothing was lit" in page
    assert "elsewhere" not in page
    assert "data:image/png;base64," in page
    assert plot_png(found).startswith(b"\x89PNG")
    with pytest.raises(StoreError, match="no measured point"):
        write_measured_report([Comparison.of("none", POINTS, "published")], tmp_path / "empty.html")


def test_a_point_that_was_never_measured_is_none(tmp_path: Path) -> None:
    assert stored(published_rig(), Case(name="new", plan=CapturePlan()), tmp_path, 50.0) is None
