"""Results against each other on the command line: two of them, a stage, a sweep."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.io.result.result_file import load_result, save_result
from dsl_core.model.result import build_result
from dsl_core.model.spectral import SpectralCurve, at_bands
from dsl_core.workflows.series import position_of, seconds_of
from tests.cases.small_result import small_result
from tests.cases.stage_series import write_stage, write_sweep

from .conftest import SMALL_PLAN, SMALL_RIG, Give

POSITIONS = (700.0, 725.0, 750.0, 775.0)


def test_two_results_are_compared_first_minus_second(give: Give, tmp_path: Path) -> None:
    first, second = tmp_path / "first.zarr", tmp_path / "second.zarr"
    save_result(small_result(), first)
    nearer = load_result(first).load()
    nearer["depth_mm"] = nearer["depth_mm"] - 2 - 0.001 * (np.indices(nearer["depth_mm"].shape).sum(0) % 2)
    save_result(nearer, second)
    figures = give("compare", first, second, "--json").json["figures"]
    mean = figures["Depth, mean difference"]
    assert mean["value"] == pytest.approx(2.0005, abs=2e-4)
    assert 0 < mean["std"] < 1e-3
    assert figures["Pixels that both have"]["std"] is None
    assert "Depth, mean difference" in give("compare", first, second).out


def test_bands_of_different_widths_are_compared_as_the_wider_ones(give: Give, tmp_path: Path) -> None:
    fine = np.arange(400.0, 701.0)
    edge = SpectralCurve.of(fine, np.where(fine > 575, 0.6, 0.05))
    paths = []
    for step_nm in (5.0, 10.0):
        nm = np.arange(430.0, 661.0, step_nm)
        spectrum = at_bands(edge, nm).values.astype(np.float32)
        arrays: dict[str, NDArray[Any]] = {
            "depth_mm": np.full((6, 9), 700, np.float32),
            "reflectance": np.broadcast_to(spectrum[:, None, None], (nm.size, 6, 9)).copy(),
        }
        paths.append(save_result(build_result(arrays, nm, {}), tmp_path / f"{step_nm:g}.zarr"))
    for pair in (paths, paths[::-1]):
        figures = give("compare", *pair, "--json").json["figures"]
        assert figures["Common bands"]["value"] == 24
        assert figures["Reflectance, RMS difference"]["value"] < 0.002


@pytest.mark.parametrize("command", [("compare",), ("sweep", "--against")])
def test_different_parts_of_the_picture_are_not_compared(
    give: Give, tmp_path: Path, command: tuple[str, ...]
) -> None:
    whole = small_result()
    first = save_result(whole.isel(x=slice(0, 4)), tmp_path / "first.zarr")
    second = save_result(whole.isel(x=slice(5, 9)), tmp_path / "second.zarr")
    ending = give(*command, first, second)
    assert ending.code == 2
    assert "x 0 to 3, y 0 to 5" in ending.sentence
    assert "x 5 to 8, y 0 to 5" in ending.sentence
    assert "Choose two of the same region" in ending.sentence


def test_a_result_that_is_not_there_is_named(give: Give, tmp_path: Path) -> None:
    ending = give("compare", tmp_path / "a.zarr", tmp_path / "b.zarr")
    assert ending.code == 2
    assert "a.zarr" in ending.sentence


@pytest.fixture
def stage(tmp_path: Path) -> list[Path]:
    return [write_stage(tmp_path, position, seed=i) for i, position in enumerate(POSITIONS)]


def test_a_target_is_tested_at_the_positions_of_its_names(give: Give, stage: list[Path]) -> None:
    said = give("depth-test", *stage, "--json").json
    assert said["positions_mm"] == list(POSITIONS)
    assert said["free"]["scale"] == pytest.approx(1.0, abs=1e-3)
    assert said["straightness_mm"]["slope_1"] < 0.05
    assert all(std > 0 for std in said["std_mm"])
    words = give("depth-test", *stage).out
    assert "Straightness, slope fixed to 1 (RMS)" in words
    assert "stage 725 mm" in words


def test_given_positions_count_and_the_report_says_all(give: Give, stage: list[Path], tmp_path: Path) -> None:
    report = tmp_path / "test.html"
    given = ["--positions", "0,25,50,75", "--region", "4,4,40,30"]
    said = give("depth-test", *stage, *given, "--report", report, "--json").json
    # The target leans, and the middle of the region is half a pixel off that of the picture.
    assert said["fixed"]["offset_mm"] == pytest.approx(700.0, abs=0.15)
    page = report.read_text(encoding="utf-8")
    assert "Straightness, slope free (RMS)" in page
    assert page.count("<img") == 1 + len(stage)
    assert "http" not in page.replace("http-equiv", "")
    again = give("depth-test", *stage, "--report", report)
    assert again.code == 2
    assert "already exists" in again.sentence


def test_what_is_missing_is_said(give: Give, stage: list[Path], tmp_path: Path) -> None:
    assert "needs 3 positions" in give("depth-test", *stage[:2]).sentence
    assert "4 results and 2 positions" in give("depth-test", *stage, "--positions", "1,2").sentence
    assert "--positions must be numbers" in give("depth-test", *stage, "--positions", "1,b").sentence
    assert "--region must be X,Y" in give("depth-test", *stage, "--region", "1,2").sentence
    unnamed = stage[0].rename(tmp_path / "unnamed.zarr")
    ending = give("depth-test", unnamed, *stage[1:])
    assert ending.code == 2
    assert "unnamed.zarr does not say where the stage was" in ending.sentence
    outside = give("depth-test", *stage[1:], "--region", "0,0,99,9")
    assert "stage 725 mm.zarr: The region 99 x 9 px" in outside.sentence


@pytest.mark.slow
def test_a_sweep_against_the_longest_scan(give: Give, tmp_path: Path) -> None:
    reference, *scans = write_sweep(tmp_path)
    report = tmp_path / "sweep.html"
    said = give("sweep", *scans, "--against", reference, "--report", report, "--json").json
    assert [point["seconds"] for point in said["points"]] == [10.0, 30.0, 60.0]
    assert said["points"][0]["depth_mm"] == pytest.approx(1.0, rel=0.1)
    assert said["points"][0]["depth_std_mm"] == pytest.approx(1.0 / (2 * 36 * 48) ** 0.5, rel=0.5)
    assert said["best"]["depth_mm"] == ["quick", "good"]
    assert report.read_text(encoding="utf-8").count("<img") == 3
    assert (
        "what the others are compared with"
        in give("sweep", *scans, reference, "--against", reference).sentence
    )
    assert "needs two scans" in give("sweep", scans[0], "--against", reference).sentence


@pytest.mark.slow
def test_a_sweep_against_the_truth_of_the_twin(give: Give, finished: Path, tmp_path: Path) -> None:
    assert give("scan", tmp_path / "quick.dsl", *SMALL_RIG, *SMALL_PLAN[:-1], "100@0.8").code == 0
    assert give("reconstruct", tmp_path / "quick.dsl", "--bands", "430:660:10").code == 0
    said = give("sweep", tmp_path / "quick.zarr", finished / "scan.zarr", "--json").json
    assert said["reference"] == "the truth of the twin"
    quick, slow = said["points"]
    # Frames cost exposure and latency.
    assert slow["seconds"] / quick["seconds"] == pytest.approx((333.3 + 50) / (100 + 50), rel=0.01)
    assert 0 < slow["reflectance"] < 0.1
    options = [*SMALL_RIG, "-O", "scene=plane", *SMALL_PLAN]
    assert give("scan", tmp_path / "plane.dsl", *options).code == 0
    assert give("reconstruct", tmp_path / "plane.dsl", "--bands", "430:660:10").code == 0
    ending = give("sweep", finished / "scan.zarr", tmp_path / "plane.zarr")
    assert "plane.zarr shows another scene" in ending.sentence


@pytest.mark.parametrize(
    ("name", "position_mm"),
    [
        ("stage -10 mm", -10.0),
        ("pos_−5.5mm", -5.5),
        ("x=+3 mm", 3.0),
        ("stage 700,2 mm", 700.2),
        ("scan2 700 mm", 700.0),
        ("2026-11-30 z700mm", 700.0),
        # A dash may be a minus or not, a comma or space may part thousands: nothing is guessed.
        ("z-12.5mm", None),
        ("plate 2 mm z-12.5mm", None),
        ("stage 1,200 mm", None),
        ("stage 1 200 mm", None),
        ("stage 7e2 mm", None),
    ],
)
def test_a_name_states_a_position_in_one_way_or_not_at_all(name: str, position_mm: float | None) -> None:
    assert position_of(Path(f"{name}.zarr"), {}) == position_mm


def test_a_twin_says_where_it_put_the_target() -> None:
    options = '{"scene": "plane", "depth_mm": "742.5"}'
    notes = {"scanned_with": "twin", "scanned_with_options": options}
    assert position_of(Path("a.zarr"), notes) == 742.5
    assert position_of(Path("b 12 mm.zarr"), notes) == 12.0
    assert position_of(Path("5 mm and 6 mm.zarr"), {}) is None
    assert position_of(Path("a.zarr"), {}) is None
    assert seconds_of({}) is None
