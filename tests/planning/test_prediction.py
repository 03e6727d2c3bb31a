"""Predictions follow what is known: more light and finer lines are better, and the twin agrees."""

from __future__ import annotations

import pytest

from dsl_core.errors import PlanError
from dsl_core.model.plan import CapturePlan, GrayCode, LineComb, NoCode, NoSpectral, ScanLines, Setting
from dsl_core.model.presets import PRESETS, Preset
from dsl_core.planning import references
from dsl_core.planning.expected import Prediction
from dsl_core.planning.prediction import predict
from dsl_core.planning.samples import plane_samples
from dsl_core.simulation.published_rig import published_rig
from tests.cases.trial import run_trial, trial_samples

BRIGHT = (Setting(exposure_ms=1000 / 6, level=0.2), Setting(exposure_ms=1000 / 3, level=0.8))


def plan(spectral: ScanLines | LineComb, *settings: Setting) -> CapturePlan:
    chosen = settings or BRIGHT
    return CapturePlan(
        code=GrayCode(rows=False), spectral=spectral, settings=chosen, code_settings=tuple(range(len(chosen)))
    )


def figures(spectral: ScanLines | LineComb, *settings: Setting) -> Prediction:
    rig = published_rig()
    return predict(rig, plan(spectral, *settings), plane_samples(rig, grid=(4, 2)), latency_ms=50)


@pytest.mark.slow
def test_less_light_and_fewer_lines_cost_accuracy() -> None:
    fine, coarse = figures(ScanLines(step_px=4)), figures(ScanLines(width_px=16, step_px=8))
    dim = figures(ScanLines(step_px=4), Setting(exposure_ms=1000 / 60, level=0.4))
    assert fine.pixel_rmse < coarse.pixel_rmse
    assert fine.pixel_rmse < 0.5 * dim.pixel_rmse
    assert fine.fwhm_nm is not None
    assert coarse.fwhm_nm is not None
    assert 8 < fine.fwhm_nm < coarse.fwhm_nm
    assert fine.depth_std_mm < coarse.depth_std_mm


@pytest.mark.slow
@pytest.mark.parametrize("preset", PRESETS, ids=lambda preset: preset.key)
def test_every_preset_has_an_error_that_is_a_number(preset: Preset) -> None:
    # A single long setting saturates, so that columns stay unrefined and their amplitudes unknown.
    rig = published_rig()
    found = predict(rig, preset.plan, plane_samples(rig, grid=(4, 2)), latency_ms=50, peaks=False)
    assert 0 < found.pixel_rmse < 0.3
    assert 0 < found.depth_std_mm < 10


@pytest.mark.slow
def test_a_code_that_only_an_overexposed_setting_shows_finds_fewer_pixels() -> None:
    rig, both = published_rig(), plan(ScanLines(width_px=16, step_px=8))
    view = plane_samples(rig, grid=(4, 2))
    bright = both.model_copy(update={"code_settings": (1,)})
    found = [predict(rig, each, view, peaks=False).coverage for each in (both, bright)]
    assert found[1] < found[0] - 0.02


@pytest.mark.slow
def test_predictions_are_for_the_depths_that_the_rig_is_for() -> None:
    near = published_rig()
    assert near.usual_depth_mm == 700
    rig = near.model_copy(update={"depth_range_mm": (900.0, 1400.0)})
    assert plane_samples(rig).depth_mm == pytest.approx(1100, abs=1e-6)
    found = [predict(each, plan(ScanLines(width_px=16, step_px=8)), peaks=False) for each in (near, rig)]
    assert found[1].depth_std_mm > 1.3 * found[0].depth_std_mm


def test_time_and_bytes_are_those_of_the_plan() -> None:
    made = plan(ScanLines(step_px=4))
    found = figures(ScanLines(step_px=4))
    assert found.frames == made.shot_count
    assert found.seconds == pytest.approx(made.duration_s(50), abs=1e-3)
    assert found.raw_bytes == 2 * 890 * 580 * made.shot_count


def test_a_plan_without_patterns_or_code_is_refused() -> None:
    rig = published_rig()
    for update in ({"spectral": NoSpectral()}, {"code": NoCode()}):
        with pytest.raises(PlanError, match="to predict for"):
            predict(rig, CapturePlan().model_copy(update=update))


@pytest.mark.slow
@pytest.mark.parametrize(
    "spectral",
    [
        ScanLines(step_px=4),
        LineComb(width_px=6, step_px=4, period_px=64),
        LineComb(width_px=5, step_px=2, period_px=80),
    ],
)
def test_the_twin_agrees(spectral: ScanLines | LineComb) -> None:
    """Combs leave columns unrefined, which puts the zero order where the model does not expect it."""
    rig, chart = published_rig(), references.chart()
    found = predict(rig, plan(spectral), trial_samples(rig, chart), peaks=False)
    measured = run_trial(rig, plan(spectral), chart)
    assert found.pixel_rmse == pytest.approx(measured.pixel_rmse, rel=0.2)
    assert found.depth_std_mm == pytest.approx(measured.depth_rmse_mm, rel=0.4)


@pytest.mark.parametrize("shifts_px", [(0, 0, 0), (0, 21, 43)], ids=["white", "colours"])
def test_pictures_of_few_pixels_tell_as_much_of_combs(shifts_px: tuple[int, int, int]) -> None:
    """Colours come from samples of the mosaic whole lines apart, each of which is modelled at its column."""
    full, chart = published_rig(), references.chart()
    comb = LineComb(width_px=6, step_px=4, period_px=64, shifts_px=shifts_px)
    found = []
    for camera in (full.camera, full.camera.resized(112, 72)):
        rig = full.model_copy(update={"camera": camera})
        found.append(predict(rig, plan(comb), trial_samples(rig, chart), peaks=False))
    assert found[1].pixel_rmse == pytest.approx(found[0].pixel_rmse, rel=0.3)
    assert found[1].rmse == pytest.approx(found[0].rmse, rel=0.4)


def test_black_that_saturates_is_a_plan_without_depth_and_no_crash() -> None:
    rig = published_rig()
    rig = rig.model_copy(update={"white_scale": 100 * rig.white_scale})
    comb = LineComb(width_px=6, step_px=4, period_px=64)
    found = predict(
        rig, plan(comb, Setting(exposure_ms=2000.0, level=0.4)), plane_samples(rig, grid=(2, 1)), peaks=False
    )
    assert found.coverage == 0.0


@pytest.mark.parametrize(
    ("changed", "least_rmse", "least_coverage"),
    [
        ({"projector_response": {"blur_px": 0.2}}, 0.0025, 0.99),
        ({"sensor": {"read_noise_dn": 20.0}}, 0.005, 0.78),
    ],
)
def test_patch_means_have_what_noise_does_to_them_and_first_orders_help_to_decode(
    changed: dict[str, dict[str, float]], least_rmse: float, least_coverage: float
) -> None:
    """Trials of these plans found 0.0030, and 0.0115 with a depth in 90 % of the picture."""
    rig = published_rig()
    parts = {part: getattr(rig, part).model_copy(update=values) for part, values in changed.items()}
    rig = rig.model_copy(update={**parts, "camera": rig.camera.resized(112, 72)})
    found = predict(rig, plan(ScanLines(step_px=4)), trial_samples(rig, references.chart()), peaks=False)
    assert least_rmse < found.rmse < 0.012
    assert found.coverage > least_coverage
