"""A chart refines what the data sheets have wrong, judged by patches that the curves never saw."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest

from dsl_core.calibration.colour.color_checker import (
    LIGHTS,
    WORST_PERCENT,
    ChartPictures,
    color_checker_figures,
    disagreement,
    expected_colours,
    led_levels,
    measure_patches,
    patch_colours,
    refine_on_chart,
)
from dsl_core.calibration.colour.patches import ChartPose, PatchSignals, patch_samples
from dsl_core.calibration.light import spectral_refinement
from dsl_core.calibration.light.spectral_refinement import FINE_NM
from dsl_core.errors import CalibrationError
from dsl_core.model.calibration.color_checker import ColorCheckerCalibration
from dsl_core.model.figure import failures
from dsl_core.model.rig import Rig
from dsl_core.optics.charts import chart_reflectance
from dsl_core.optics.sensor import bayer_channels
from dsl_core.optics.shading import Plane
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.random_rig import random_rig

CHART = "BabelColor Average"
POSE = ChartPose(np.array([[10.0, 8.0], [130.0, 8.0], [130.0, 88.0], [10.0, 88.0]]), 0)
PLANE = Plane(np.array([0.0, 0.1, 1.0]) / 700.0)


def signals(rig: Rig, light: int, level: float = 1.0) -> np.ndarray:
    """Exact signals of the patches under one light, (24, 3), at unit shading."""
    reflectance = np.stack(list(chart_reflectance(FINE_NM, CHART).values()))
    response = np.stack([curve.at(FINE_NM) for curve in rig.response])
    emission = LIGHTS[light] @ np.stack([curve.at(FINE_NM) for curve in rig.emission])
    return np.asarray(level * rig.white_scale * (reflectance * emission) @ response.T)


def seen(rig: Rig, level: float = 1.0, noise: float = 3e-4) -> list[PatchSignals]:
    rng, found = np.random.default_rng(0), []
    for light in range(4):
        mean = signals(rig, light, level)
        std = noise * (mean + 0.1 * mean.max(0))
        noisy = mean + std * rng.standard_normal(mean.shape)
        found.append(PatchSignals(noisy, std, np.full((24, 3), 40), np.zeros((24, 3))))
    return found


@pytest.fixture(scope="module")
def record() -> ColorCheckerCalibration:
    """With the published weight alone, which is enough to see that all is put together rightly."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(spectral_refinement, "WEIGHTS", (spectral_refinement.PUBLISHED_WEIGHT * 1e-3,))
        patch.setattr(spectral_refinement, "REFLECTANCE_ERRORS", (0.0,))
        return refine_on_chart(known(), seen(truth(), level=1.01), POSE, PLANE, CHART)


def truth() -> Rig:
    return random_rig(2, published_rig())


def known() -> Rig:
    """Emission and white as the Spectralon gave them, the response from a data sheet that fits the white."""
    true = truth()
    white = [sum(curve.at(FINE_NM).sum() for curve in rig.response) for rig in (true, published_rig())]
    return true.model_copy(
        update={"response": published_rig().response, "white_scale": true.white_scale * white[0] / white[1],
                "white_scale_rel_std": 0.05}
    )  # fmt: skip


def test_held_out_patches_are_explained_better_than_before(record: ColorCheckerCalibration) -> None:
    assert record.held_out < 0.5 * record.start
    assert record.residual <= record.held_out
    assert record.chart_level == pytest.approx(0.01, abs=0.02)
    assert [patch.name for patch in record.patches] == list(chart_reflectance(FINE_NM, CHART))
    assert (record.tilt_deg, record.distance_mm) == (PLANE.tilt_deg, PLANE.distance_mm)


def test_curves_that_do_not_help_stay_as_they_were() -> None:
    true = truth()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(spectral_refinement, "WEIGHTS", (spectral_refinement.PUBLISHED_WEIGHT * 1e-5,))
        patch.setattr(spectral_refinement, "REFLECTANCE_ERRORS", (0.0,))
        found = refine_on_chart(true, seen(true, noise=0.01), POSE, PLANE, CHART)
    assert found.held_out == found.start
    for before, after in zip(true.response, found.response, strict=True):
        assert after.at(FINE_NM) == pytest.approx(before.at(FINE_NM), abs=1e-9)


def test_colours_to_show_are_measured_and_expected_over_white(record: ColorCheckerCalibration) -> None:
    measured, expected = patch_colours(record, known())
    assert measured.shape == expected.shape == (24, 3)
    assert np.sqrt(np.mean((measured - expected) ** 2)) < 0.02
    white = list(chart_reflectance(FINE_NM, CHART)).index("white 9.5 (.05 D)")
    assert measured[white] == pytest.approx(0.9, abs=0.06)


def test_expected_colours_are_those_of_the_rig() -> None:
    assert expected_colours(truth(), CHART) == pytest.approx(signals(truth(), 3), rel=1e-9)


def test_figures_are_shares_of_white_in_percent(record: ColorCheckerCalibration) -> None:
    found = {figure.name: figure.value for figure in color_checker_figures(record)}
    assert found["residual before the refinement"] == pytest.approx(100 * record.start)
    assert found["residual"] == pytest.approx(100 * record.residual)
    assert found["residual of patches held out"] == pytest.approx(100 * record.held_out)


def test_figures_pass_and_a_bad_patch_is_named(record: ColorCheckerCalibration) -> None:
    assert "worst patch" not in " ".join(figure.name for figure in failures(color_checker_figures(record)))
    spoilt = record.patches[7].model_copy(update={"held_out": 1.1 * WORST_PERCENT / 100})
    patches = (*record.patches[:7], spoilt, *record.patches[8:])
    failed = {
        figure.name: figure
        for figure in failures(color_checker_figures(record.model_copy(update={"patches": patches})))
    }
    (name,) = (name for name in failed if name.startswith("worst patch"))
    assert record.patches[7].name in name
    assert record.patches[7].name in failed[name].advice


def pictures(rig: Rig) -> ChartPictures:
    """The chart filling a mosaic of 96 x 140 px, under a shading of one half."""
    channel = bayer_channels(rig.sensor.bayer, 96, 140)
    row, column = np.mgrid[:96, :140]
    patch = (np.clip((row - 8) // 20, 0, 3) * 6 + np.clip((column - 10) // 20, 0, 5)).astype(int)
    radiance = np.stack([0.5 * signals(rig, light)[patch, channel] for light in range(4)])
    return ChartPictures(radiance, np.zeros((96, 140), bool), np.full((96, 140), 0.5))


def test_patches_are_measured_at_unit_shading_and_saturated_or_small_ones_named() -> None:
    rig = truth()
    taken, samples = pictures(rig), patch_samples(POSE.corners_px, (96, 140))
    found = measure_patches(taken, rig, samples, CHART)
    for light in range(4):
        assert found[light].mean == pytest.approx(signals(rig, light), rel=1e-9)
    name = next(iter(chart_reflectance(FINE_NM, CHART)))
    full = taken.saturated.copy()
    full[8:28, 10:30] = True
    with pytest.raises(CalibrationError, match=f"patch '{name}' of the Color Checker is saturated"):
        measure_patches(replace(taken, saturated=full), rig, samples, CHART)
    few = replace(samples, pixels=(samples.pixels[0][:12], *samples.pixels[1:]))
    with pytest.raises(CalibrationError, match=f"patch '{name}' of the Color Checker has only [0-7] pixels"):
        measure_patches(taken, rig, few, CHART)


@pytest.mark.parametrize(("share", "told"), [(0.12, False), (0.08, True), (0.0, True)])
def test_patches_that_the_projector_does_not_light_are_named(share: float, told: bool) -> None:
    rig = truth()
    taken, samples = pictures(rig), patch_samples(POSE.corners_px, (96, 140))
    taken.radiance[:, 68:88, 10:50] *= share
    with (
        pytest.raises(
            CalibrationError, match=r"not light all .*: 'white .*', 'neutral 8 .*' had less than 10%"
        )
        if told
        else nullcontext()
    ):
        assert measure_patches(taken, rig, samples, CHART)


def whites(rig: Rig) -> np.ndarray:
    """Signals of a perfect white (channels, LEDs)."""
    response, emission = (np.stack([c.at(FINE_NM) for c in of]) for of in (rig.response, rig.emission))
    return np.asarray(rig.white_scale * response @ emission.T)


def lit(rig: Rig, reds: float, greens: float, blues: float) -> np.ndarray:
    """Signals (24, channels, lights) of a chart that is so much brighter under each LED."""
    alone = [factor * signals(rig, light) for light, factor in enumerate((reds, greens, blues))]
    return np.stack([*alone, np.sum(alone, axis=0)], 2)


def test_grey_patches_say_how_the_spectralon_differs_under_each_led() -> None:
    assert led_levels(truth(), lit(truth(), 1.01, 1.0, 1.04), CHART) == pytest.approx(
        (0.01, 0, 0.04), abs=1e-9
    )
    # A response that is off is none of it, as the rig gives white what was seen of it.
    start, true = known(), truth()
    seen_by = lit(true, 1.0, 1.0, 1.0)
    seen_by[:, :, :3] *= (whites(start) / whites(true))[None]
    assert np.abs(led_levels(start, seen_by, CHART)).max() < 0.01


def test_a_spectralon_of_another_colour_than_stated_is_refused_and_white_is_less_sure(
    record: ColorCheckerCalibration,
) -> None:
    name = "colour of the light on the chart against the Spectralon"
    fair = record.model_copy(update={"led_levels": (0.02, 0.01, 0.035)})
    assert name not in [figure.name for figure in failures(color_checker_figures(fair))]
    yellow = record.model_copy(update={"led_levels": (0.0, 0.001, 0.032)})
    assert name in [figure.name for figure in failures(color_checker_figures(yellow))]
    assert disagreement((-0.01, 0.0, 0.03)) == pytest.approx(0.03 / 2**0.5)
    assert record.led_levels is not None
    assert record.reference_rel_std == pytest.approx(disagreement(record.led_levels))


@pytest.mark.parametrize(("share", "is_accepted"), [(0.05, True), (0.2, False)])
def test_detail_of_curves_that_patches_leave_open_is_stated_and_not_refused(
    record: ColorCheckerCalibration, share: float, is_accepted: bool
) -> None:
    """Where red has another edge than the data sheet says, patches are explained and 5 % of the peak open."""
    unsure = tuple(
        curve.model_copy(update={"std": (share * max(curve.values),) * len(curve.values)})
        for curve in record.response
    )
    found = failures(color_checker_figures(record.model_copy(update={"response": unsure})))
    named = [figure.name for figure in found]
    assert ("deviation of the response, of its peak" not in named) == is_accepted
