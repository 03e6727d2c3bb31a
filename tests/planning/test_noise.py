"""The planner's noise is the merger's and the demosaicer's, written as formulas."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from dsl_core.model.plan import CapturePlan, ScanLines, Setting
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.demosaic import demosaic_variance
from dsl_core.planning.noise import (
    Bracket,
    demosaic_factors,
    measured_colours,
    own_channel,
    sideways_shares,
)
from dsl_core.planning.prediction import predict
from dsl_core.reconstruction.hdr import BlackFrame, HdrMerger, setting_gains_ms
from tests.cases.small_rig import small_rig


@pytest.mark.parametrize("black_light", [0.0, 0.4])
@pytest.mark.parametrize("radiance", [0.0, 0.5, 8.0, 60.0])
def test_variance_is_that_of_the_merger(radiance: float, black_light: float) -> None:
    rig, plan = small_rig(), CapturePlan()
    gains = setting_gains_ms(plan.settings, rig.projector_response)
    levels = [rig.sensor.black_level_dn + black_light * setting.exposure_ms for setting in plan.settings]
    blacks = [np.full((4, 4), level, np.float32) for level in levels]
    raws = [
        np.clip(np.rint(black + gain * radiance), 0, rig.sensor.full_scale_dn).astype(np.uint16)
        for black, gain in zip(blacks, gains, strict=True)
    ]
    merger = HdrMerger(gains, [BlackFrame(black, np.zeros_like(black)) for black in blacks], rig.sensor)
    merged = merger.merge(raws)
    bracket = Bracket.of(rig, plan.settings)
    expected = float(bracket.variance(torch.tensor([radiance]), torch.tensor([black_light]))[0])
    assert expected == pytest.approx(float(merged.variance[0, 0]), rel=0.05)


def test_saturation_everywhere_is_infinite_variance() -> None:
    bracket = Bracket.of(small_rig(), [Setting(exposure_ms=100, level=1)])
    assert torch.isinf(bracket.variance(torch.tensor([1000.0]), torch.zeros(1))).all()


def test_factors_are_those_of_demosaicing() -> None:
    rig = small_rig()
    height, width = rig.camera.height_px, rig.camera.width_px
    pixels = np.array([width * y + x for y in (20, 21) for x in (30, 31)], np.int64)
    variance = demosaic_variance(np.ones((height, width), np.float32), rig.sensor.bayer).reshape(3, -1)
    assert np.allclose(demosaic_factors(rig, pixels), variance[:, pixels].T)
    assert own_channel(rig, pixels).tolist() == [0, 1, 1, 2]


def without_mosaic(rig: Rig, red: float) -> Rig:
    """The rig with a monochrome sensor, whose curve stands in the place of red as well, times ``red``."""
    curve = rig.response[1]
    other = SpectralCurve(
        wavelengths_nm=curve.wavelengths_nm, values=tuple(red * each for each in curve.values)
    )
    sensor = rig.sensor.model_copy(update={"bayer": "MONO"})
    return rig.model_copy(update={"sensor": sensor, "response": (other, curve, other)})


def test_a_pixel_without_a_mosaic_is_measured_once() -> None:
    rig = small_rig()
    mono = without_mosaic(rig, 1.0)
    pixels = np.array([500, 501], np.int64)
    raw = np.ones((rig.camera.height_px, rig.camera.width_px), np.float32)
    variance = demosaic_variance(raw, "MONO").reshape(3, -1)
    assert np.allclose(demosaic_factors(mono, pixels), variance[:, pixels].T)
    assert not sideways_shares(mono, pixels).any()
    assert measured_colours(mono).tolist() == [False, True, False]
    assert measured_colours(rig).all()


def test_a_prediction_without_a_mosaic_takes_no_copies_for_measurements() -> None:
    plan = CapturePlan(spectral=ScanLines(width_px=8, step_px=8))
    copied, blind = (
        predict(without_mosaic(small_rig(), red), plan, peaks=False).pixel_rmse for red in (1.0, 0.0)
    )
    assert copied == pytest.approx(blind, rel=1e-3)


@pytest.mark.parametrize(("read_noise_dn", "remains"), [(0.01, 1.0), (0.4, 0.05)])
def test_rounding_is_what_means_of_rounded_values_are_off_by(read_noise_dn: float, remains: float) -> None:
    """Noise carries light across steps; without it, no mean of many values is right."""
    rig, rng = small_rig(), np.random.default_rng(2)
    sensor = rig.sensor.model_copy(
        update={"read_noise_dn": read_noise_dn, "electrons_per_dn": 1e6, "black_level_dn": 16.3}
    )
    bracket = Bracket((2.0,), (3.0,), sensor)
    radiance, black = torch.linspace(0.0, 2.0, 33, dtype=torch.float64), torch.full((33,), 0.03)
    said = bracket.rounding(radiance, black.double()).numpy()
    raw = 16.3 + 0.09 + 2.0 * radiance.numpy()
    noisy, dark = (each + read_noise_dn * rng.standard_normal((4000, 33)) for each in (raw, 16.39))
    true = (np.rint(noisy).mean(0) - raw - np.rint(dark).mean(0) + 16.39) / 2.0
    assert said == pytest.approx(true, abs=0.05)
    assert np.abs(said).max() < 0.5 * remains
