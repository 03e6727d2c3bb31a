"""The depth-stage calibration on a twin whose film nobody knows, and whose geometry only a board told."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from dsl_core.calibration.common.tiles import ColumnSamples
from dsl_core.campaign.common.recipe import Bench, Step
from dsl_core.campaign.depth_stage.planes import SeenPlane
from dsl_core.campaign.depth_stage.recipe import STAGE_NOTE, DepthStageRecipe
from dsl_core.devices.base import Stage
from dsl_core.errors import CalibrationError
from dsl_core.model.calibration.chain import ChainCorrection
from dsl_core.model.calibration.depth_stage import DepthStageCalibration
from dsl_core.model.figure import failures
from dsl_core.model.projector.line_spread import LineSpread
from dsl_core.model.rig import Film, FilmShape
from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.correspondence import GratingModel, correspondence, triangulate, zero_order
from dsl_core.progress import NoProgress, Progress
from tests.cases.board_calibrated import board_calibrated
from tests.cases.film_bench import film_bench, take, take_all, truth_of, without

#: Their fixtures calibrate a rig; `tests/campaign/test_kept_figures.py` calibrates one in any run.
pytestmark = pytest.mark.slow

RECIPE = DepthStageRecipe(
    positions_mm=(620.0, 850.0), filters_nm=(450.0, 540.0, 640.0), code_step_px=5, chain=False
)
SAME = ("emission", "sensor", "flat_field", "response", "white_scale", "projector_response", "efficiency")
#: The step that mishaps happen to.
FILTERED = 6


@pytest.fixture(scope="module")
def bench(module_folder: Path) -> Bench:
    """All steps captured; film unknown, geometry as a board tells it, the rest true."""
    bench = film_bench(module_folder, 1, SAME)
    return take_all(RECIPE, replace(bench, rig=board_calibrated(truth_of(bench.devices), bench.rig, 1)))


@pytest.fixture(scope="module")
def record(bench: Bench) -> DepthStageCalibration:
    return RECIPE.fit(bench, NoProgress())


def test_first_orders_and_depth_are_found(bench: Bench, record: DepthStageCalibration) -> None:
    truth, found = truth_of(bench.devices), RECIPE.apply(record, bench.rig)
    rng = np.random.default_rng(5)
    pixels = torch.as_tensor(rng.integers(0, 112 * 72, 3000))
    depth = torch.as_tensor(rng.uniform(600, 900, 3000))
    column, row = zero_order(truth, pixels, depth)
    lit = (column > 0) & (column < 639) & (row > 0) & (row < 359)
    ours = triangulate(found, pixels, column)[0]
    assert float((ours - depth)[lit].square().mean().sqrt()) < 2.5 * record.depth_std_mm < 0.4
    nm = np.arange(440.0, 661.0, 20.0)
    for order in (1, -1):
        seen = GratingModel(truth).exact(pixels, depth, order, nm)
        off = correspondence(found).trace(pixels, ours, order, nm).columns - seen.columns
        assert float(off[seen.inside(640, 360) & lit].square().mean().sqrt()) < 0.02


def test_film_lies_within_its_deviations(bench: Bench, record: DepthStageCalibration) -> None:
    truth = truth_of(bench.devices).film
    pulls = [
        (getattr(record.film, name) - getattr(truth, name)) / std for name, std in record.film_std.items()
    ]
    assert np.sqrt(np.mean(np.square(pulls))) < 2.5


@pytest.mark.parametrize("shown", [(), (0,), (1,), (0, 1)])
def test_columns_of_all_planes_are_counted_from_one_place_of_a_line(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, shown: tuple[int, ...]
) -> None:
    plain = [step for step in RECIPE.steps(bench) if step.placement.filter_nm is None]
    uneven = [
        bench.rig.projector_response.with_spread(LineSpread.of(np.array(shares), 0.5))
        for shares in ((0.2, 0.5, 0.3), (0.3, 0.5, 0.2))
    ]

    def seen(recipe: DepthStageRecipe, bench: Bench, step: Step, progress: Progress) -> SeenPlane:
        number = plain.index(step)
        response = uneven[number] if number in shown else bench.rig.projector_response
        return SeenPlane(ColumnSamples(*np.zeros((3, 0))), response, None)

    monkeypatch.setattr(DepthStageRecipe, "_plain", seen)
    found = [each.response for each in RECIPE._planes(bench, plain, NoProgress())]
    if not shown:
        assert found == [bench.rig.projector_response] * 2
    else:
        assert found == [uneven[k] if k in shown else uneven[1 - k] for k in range(2)]


def test_record_goes_through_json_and_its_figures_pass(record: DepthStageCalibration) -> None:
    assert DepthStageCalibration.model_validate_json(record.model_dump_json()) == record
    assert failures(RECIPE.figures(record)) == ()
    assert record.held_out_px < 0.1
    assert record.frames == 2 * (20 + 2 + 128 + 1 + 128) + 6 * 41
    assert len(record.model_dump_json()) < 100_000


@pytest.mark.parametrize(
    ("scale", "lines_std", "told"), [(-0.004, 0.02, True), (0.001, 0.02, False), (-0.004, 0.7, False)]
)
def test_filters_that_are_all_off_alike_are_told_where_the_film_is_known(
    record: DepthStageCalibration, scale: float, lines_std: float, told: bool
) -> None:
    flat = SpectralCurve.of([400.0, 700.0], [1.0, 1.0])
    chain = ChainCorrection(
        efficiency_factors={1: flat, -1: flat},
        response_factors=(flat, flat, flat),
        white_scale_factor=1.0,
        white_scale_rel_std=0.001,
        chain_rel_std=flat,
        largest_correction=0.0,
        wavelength_scale=scale,
        wavelength_scale_std=1e-4,
        pixels=100,
        chi_square=1.0,
    )
    film_std = record.film_std | {"lines_per_mm": lines_std}
    figures = RECIPE.figures(record.model_copy(update={"chain": chain, "film_std": film_std}))
    failed = [str(figure) for figure in failures(figures)]
    assert failed == (["filters against the LEDs' spectra, at 550 nm -2.200 ± 0.059 nm"] if told else [])


def test_a_film_that_is_no_cylinder_is_told_by_its_slope(record: DepthStageCalibration) -> None:
    def slopes(film: Film) -> list[float]:
        figures = RECIPE.figures(record.model_copy(update={"film": film}))
        return [figure.value for figure in figures if figure.name == "film's largest slope beyond curvature"]

    assert slopes(record.film) == []
    twist = FilmShape(factors=(0.004, 0.0, 0.0, 0.0, 0.0, 0.0))
    side_mm = record.film.distance_mm * record.projector.width_px / 2 / record.projector.fx_px
    (slope,) = slopes(record.film.model_copy(update={"shape": twist}))
    assert slope == pytest.approx(np.degrees(0.004 * side_mm))


def test_a_bulge_is_told_in_mm(record: DepthStageCalibration) -> None:
    assert record.bow_mm == pytest.approx(0.0, abs=3 * record.bow_std_mm)
    figures = RECIPE.figures(record.model_copy(update={"bow_mm": 0.5}))
    assert [figure.name for figure in failures(figures)] == ["bulge of the target over 300 mm"]


def test_finished_scan_is_not_taken_again(bench: Bench) -> None:
    step = RECIPE.steps(bench)[FILTERED]
    before = bench.scan_of(step).entries
    take(RECIPE, bench, step)
    assert bench.scan_of(step).entries == before


def test_stage_notes_where_it_was(bench: Bench) -> None:
    notes = [(bench.step_folder(step) / STAGE_NOTE).read_text() for step in RECIPE.steps(bench)]
    assert ["850.0" in note for note in notes] == [False] * 4 + [True] * 4


def test_a_capture_without_first_orders_is_named(bench: Bench, tmp_path: Path) -> None:
    step = RECIPE.steps(bench)[FILTERED]
    other = without(bench, tmp_path, step)
    take(RECIPE, other, step, film=False)
    with pytest.raises(CalibrationError, match="850 mm, filter of 540 nm: no first orders were found"):
        RECIPE.fit(other, NoProgress())


class ShortStage(Stage):
    """A stage that only answers how far it goes."""

    def __init__(self, low_mm: float, high_mm: float) -> None:
        self.ends_mm = low_mm, high_mm

    @property
    def range_mm(self) -> tuple[float, float]:
        return self.ends_mm

    @property
    def position_mm(self) -> float:
        return self.ends_mm[0]

    def move_to(self, position_mm: float) -> float:
        raise AssertionError(f"nothing is captured at {position_mm:g} mm")


@pytest.mark.parametrize(
    ("ends_mm", "wanted_mm"),
    [
        ((400.0, 1200.0), [600, 750, 900]),
        ((600.4, 750.0), [601, 676, 750]),
        ((0.0, 150.0), [0, 75, 150]),
    ],
)
def test_usual_positions_are_those_that_the_stage_reaches(
    bench: Bench, ends_mm: tuple[float, float], wanted_mm: list[float]
) -> None:
    short = replace(bench, devices=replace(bench.devices, stage=ShortStage(*ends_mm)))
    steps = DepthStageRecipe().steps(short)
    assert sorted({step.placement.options["depth_mm"] for step in steps}) == wanted_mm


def test_a_position_beyond_the_stage_is_refused_before_anything_is_captured(bench: Bench) -> None:
    short = replace(bench, devices=replace(bench.devices, stage=ShortStage(480.0, 760.0)))
    with pytest.raises(CalibrationError, match="names 900 mm; the stage moves from 480 to 760 mm"):
        DepthStageRecipe(positions_mm=(600.0, 750.0, 900.0)).steps(short)


def test_positions_and_filters_are_needed(bench: Bench) -> None:
    with pytest.raises(CalibrationError, match="given 1 and 3"):
        DepthStageRecipe(positions_mm=(700.0,)).steps(bench)
