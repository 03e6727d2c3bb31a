"""A plane that moved between the capture without a filter and those through filters is named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.special import erf

from dsl_core.calibration.film.order_paths import LineFrames
from dsl_core.calibration.film.zero_place import require_still, zero_moved
from dsl_core.errors import CalibrationError
from dsl_core.model.plan import ScanLines
from dsl_core.optics.correspondence import zero_order
from dsl_core.optics.sensor import relative_gain
from dsl_core.optics.shading import plane_shading
from tests.cases.order_lines import SIZE, TRUE_FILM, plane_at, rig_with

RIG, LINES, NOISE = rig_with(TRUE_FILM), ScanLines(width_px=5, step_px=16, sparse=True), 0.02
DEPTHS_MM = (600.0, 900.0)
NAMES = [[f"{mm:g} mm, filter of {nm} nm" for nm in (450, 540)] for mm in DEPTHS_MM]


def seen(depth_mm: float, stood_mm: float, seed: int = 0) -> LineFrames:
    """Zero orders of a plane at a distance; it should have stood at another, which its light is that of."""
    rng = np.random.default_rng(seed)
    pixels = np.arange(SIZE[0] * SIZE[1])
    depth = plane_at(stood_mm).depth_mm(RIG).ravel()
    column = zero_order(RIG, torch.as_tensor(pixels), torch.as_tensor(depth))[0].numpy()
    light = (plane_shading(RIG, plane_at(depth_mm)) * relative_gain(RIG)).ravel()
    centres = 2.0 + LINES.step_px * np.arange(40)[:, None]
    blur = np.sqrt(2) * RIG.projector_response.blur_px
    profile = 0.5 * (erf((column - centres + 2.5) / blur) - erf((column - centres - 2.5) / blur))
    radiance = 3.0 * light * profile + 0.1 + NOISE * rng.standard_normal(profile.shape)
    std = np.full(profile.shape, NOISE, np.float32)
    return LineFrames(LINES, pixels, radiance.astype(np.float32), std)


def captures(slipped: dict[tuple[int, int], float]) -> list[list[LineFrames]]:
    """Of both positions through both filters, some of them after the stage slipped by so many mm."""
    return [
        [seen(mm, mm + slipped.get((k, n), 0.0), 10 * k + n) for n in range(2)]
        for k, mm in enumerate(DEPTHS_MM)
    ]


def check(frames: list[list[LineFrames]]) -> None:
    require_still(RIG, [plane_at(mm) for mm in DEPTHS_MM], NAMES, lambda k, n: frames[k][n])


@pytest.mark.parametrize("slip_mm", [0.0, 3.0, -3.0])
def test_the_zero_order_is_as_far_away_as_the_plane_puts_it(slip_mm: float) -> None:
    found, std = zero_moved(RIG, plane_at(900.0), seen(900.0, 900.0 + slip_mm))
    pixels = torch.arange(SIZE[0] * SIZE[1])
    there, here = (
        zero_order(RIG, pixels, torch.as_tensor(plane_at(900.0 + mm).depth_mm(RIG).ravel()))[0].numpy()
        for mm in (slip_mm, 0.0)
    )
    assert found == pytest.approx(float(np.nanmean(there - here)), abs=0.02)
    assert std < 0.01
    assert abs(found) > 0.15 or slip_mm == 0


def test_a_plane_that_stood_still_passes() -> None:
    check(captures({}))


@pytest.mark.parametrize("slipped", [{(1, 1): 3.0}, {(1, 1): -3.5, (1, 0): -3.0}])
def test_a_plane_that_moved_before_a_filter_is_named(slipped: dict[tuple[int, int], float]) -> None:
    with pytest.raises(CalibrationError, match=r"900 mm, filter of 540 nm: the zero order is [+-]0\.\d+ col"):
        check(captures(slipped))


def test_captures_without_a_zero_order_say_nothing() -> None:
    dark = [
        [replace(each, radiance=each.radiance * 0 + np.float32(0.1)) for each in row] for row in captures({})
    ]
    assert np.isnan(zero_moved(RIG, plane_at(600.0), dark[0][0])[0])
    check(dark)
    some = captures({(0, 0): 3.0})
    some[1] = dark[1]
    with pytest.raises(CalibrationError, match="600 mm, filter of 450 nm"):
        check(some)


def test_saturated_values_are_left_out() -> None:
    frames = seen(600.0, 600.0)
    bright = frames.radiance > np.quantile(frames.radiance, 0.99)
    saturated = replace(
        frames,
        radiance=np.where(bright, np.float32(0.5), frames.radiance),
        std=np.where(bright, np.float32(np.inf), frames.std),
    )
    found, _ = zero_moved(RIG, plane_at(600.0), saturated)
    assert found == pytest.approx(0.0, abs=0.02)
