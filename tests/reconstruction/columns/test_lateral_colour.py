"""Lateral colour found from the columns of neighbouring colours, and depth that is corrected for it."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from dsl_core import pipeline
from dsl_core.model.calibration.lateral_colour import SHARES, LateralColour
from dsl_core.model.figure import with_std
from dsl_core.model.fit import Fit
from dsl_core.model.plan import CapturePlan, GrayCode, ScanLines
from dsl_core.model.rig import Rig
from dsl_core.optics.correspondence import triangulate, zero_order
from dsl_core.optics.lines.line_set import LineSet
from dsl_core.reconstruction.columns import lateral_colour
from dsl_core.reconstruction.columns.lateral_colour import (
    ColumnBends,
    LateralFit,
    fit_lateral_colour,
    lateral_finding,
    material_std_px,
    own_lateral_colour,
    white_nm,
)
from dsl_core.simulation.sim_devices import open_twin
from dsl_core.solve.robust import robust_linear
from dsl_core.workflows import truths
from tests.cases.twin_scan import capture

LINES = LineSet.of(CapturePlan(spectral=ScanLines(width_px=5, step_px=2)))
NOISE_PX = 0.01


@pytest.fixture(scope="module")
def rig() -> Rig:
    found = open_twin({"size": "112x72"}).calibration
    assert found is not None
    return found


def coloured(rig: Rig, strength: float) -> Rig:
    colour = LateralColour(
        camera=(strength, -strength / 2, 0.0), projector_per_nm=strength / 80, white_nm=white_nm(rig)
    )
    return rig.model_copy(update={"lateral_colour": colour})


def columns(rig: Rig) -> np.ndarray:
    """Columns over a slanted plane, with noise and a step."""
    height, width = rig.camera.height_px, rig.camera.width_px
    y, x = np.mgrid[:height, :width]
    depth = 700 + 0.5 * x - 0.3 * y + 40 * (x > 70)
    found = zero_order(rig, torch.arange(depth.size), torch.as_tensor(depth.ravel()))[0].numpy()
    noise = np.random.default_rng(0).normal(0, NOISE_PX, depth.size)
    return np.asarray((found + noise).reshape(depth.shape))


def test_magnifications_of_both_lenses_are_told_apart(rig: Rig) -> None:
    true = coloured(rig, 8e-4)
    seen = columns(true)
    found = own_lateral_colour(rig, LINES, seen, np.ones(seen.shape, bool))
    assert found is not None
    assert true.lateral_colour is not None
    assert found.present
    assert found.colour.camera == pytest.approx(true.lateral_colour.camera, abs=2e-4)
    assert found.colour.projector_per_nm == pytest.approx(1e-5, rel=0.2)
    assert np.dot(SHARES, found.colour.camera) == pytest.approx(0, abs=1e-12)
    assert np.dot(SHARES, found.colour.projector_of_white) == pytest.approx(0, abs=1e-12)


def test_lenses_without_it_are_left_alone(rig: Rig) -> None:
    seen = columns(rig)
    found = own_lateral_colour(rig, LINES, seen, np.ones(seen.shape, bool))
    assert found is not None
    assert not found.present
    assert found.apart_px < 4 * found.apart_std_px
    assert own_lateral_colour(rig, None, seen, np.ones(seen.shape, bool)) is None
    assert own_lateral_colour(rig, LINES, seen, np.zeros(seen.shape, bool)) is None
    assert own_lateral_colour(coloured(rig, 1e-3), LINES, seen, np.ones(seen.shape, bool)) is None


def test_triangulation_undoes_what_lenses_do_to_colours(rig: Rig) -> None:
    true = coloured(rig, 1e-3)
    depth = torch.full((500,), 730.0, dtype=torch.float64)
    pixels = torch.arange(500) * 13
    column = zero_order(true, pixels, depth)[0]
    assert triangulate(true, pixels, column)[0].numpy() == pytest.approx(730, abs=1e-4)
    assert np.ptp(triangulate(rig, pixels, column)[0].numpy()) > 0.5


def test_columns_are_unsure_by_the_colours_of_materials(rig: Rig) -> None:
    at = np.array([rig.projector.cx_px, rig.projector.cx_px - 100.0])
    assert material_std_px(rig, at) == pytest.approx([0, 0])
    assert material_std_px(coloured(rig, 8e-4), at) == pytest.approx([0, 0.015])


@pytest.mark.slow
def test_a_scan_through_such_lenses_is_corrected_and_says_so() -> None:
    plan = CapturePlan(code=GrayCode(rows=False), spectral=ScanLines(width_px=5, step_px=2))
    devices = open_twin({"size": "64x48", "scene": "color-checker", "foreign": "lateral-colour"})
    scan, truth = capture(devices, plan), truths.twin_truth(devices, pipeline.Options().grid)
    assert devices.calibration is not None
    assert truth is not None
    assert truth.depth_mm is not None
    errors = {}
    for as_calibrated in (True, False):
        options = pipeline.Options(spectra=False, as_calibrated=as_calibrated)
        result = pipeline.reconstruct(scan, devices.calibration, options)
        error = np.abs(result["depth_mm"].values - truth.depth_mm)
        errors[as_calibrated] = float(np.nanmedian(error))
        fit = Fit.read(result.attrs)
        assert fit is not None
        assert ("lateral colour" in fit.parts) is not as_calibrated
        known = np.isfinite(error)
        held = float(np.mean(error[known] < 1.96 * result["depth_std_mm"].values[known]))
        assert (held > 0.92) is not as_calibrated
    assert errors[False] < 0.9 * errors[True]


def test_a_bend_is_how_far_a_column_is_from_the_middle_of_its_neighbours(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(4)
    seen = np.cumsum(rng.uniform(0.5, 0.9, (8, 30)), 1) + 200
    seen[3, 10], seen[2, 20] = np.nan, seen[2, 20] + 2
    monkeypatch.setattr(lateral_colour, "FEWEST", 10)
    for pixels, rows in ((60_000, range(8)), (120, (0, 1, 4, 5))):
        monkeypatch.setattr(lateral_colour, "PIXELS", pixels)
        found = ColumnBends.of(rig, seen)
        assert found is not None
        wanted = []
        for y in rows:
            for x in range(1, 29):
                bend = seen[y, x] - (seen[y, x - 1] + seen[y, x + 1]) / 2
                if abs(bend) < 0.5:
                    # Rows of red and green, and rows of green and blue; green is at odd places of even rows.
                    green = (x + y) % 2 == 1
                    slope = (seen[y, x + 1] - seen[y, x - 1]) / 2
                    away, projector = x - rig.camera.cx_px, seen[y, x] - rig.projector.cx_px
                    sign, strip = -1 if green else 1, int(x / 30 * lateral_colour.STRIPS)
                    wanted.append((bend, sign, y % 2 == 1, away * slope, projector, away, strip))
        assert rig.sensor.bayer == "RGGB"
        for got, values in zip(vars(found).values(), zip(*wanted, strict=True), strict=True):
            assert got == pytest.approx(values)
    monkeypatch.setattr(lateral_colour, "FEWEST", len(wanted))
    assert ColumnBends.of(rig, seen) is not None
    monkeypatch.setattr(lateral_colour, "FEWEST", len(wanted) + 1)
    assert ColumnBends.of(rig, seen) is None


def test_magnifications_are_a_linear_fit_of_bends_and_as_sure_as_those_are_shared(rig: Rig) -> None:
    seen = columns(coloured(rig, 8e-4))
    found = own_lateral_colour(rig, LINES, seen, np.ones(seen.shape, bool))
    bends = ColumnBends.of(rig, seen)
    assert found is not None
    assert bends is not None
    bend, sign, blue, camera, projector, _, strip = vars(bends).values()
    red_nm, green_nm, blue_nm = white_nm(rig)
    assert red_nm > green_nm + 30 > blue_nm + 60
    rows = [
        (0.0, -c, p * (blue_nm - green_nm)) if b else (-c, 0.0, p * (red_nm - green_nm))
        for b, c, p in zip(blue, camera, projector, strict=True)
    ]
    values, inverse, scatter = robust_linear(sign[:, None] * np.array(rows), bend)
    green = -SHARES[0] * values[0] - SHARES[2] * values[1]
    assert found.colour.camera == pytest.approx((values[0] + green, green, values[1] + green))
    assert found.colour.projector_per_nm == pytest.approx(values[2])
    assert found.colour.white_nm == white_nm(rig)
    apart = np.stack([-camera, camera, projector * (red_nm - blue_nm)], 1)
    # Each column is in three bends, so that sums scatter by eight thirds more than they seem to. Strips of
    # the picture, each with its own errors, may scatter more.
    design = sign[:, None] * np.array(rows)
    left = bend - design @ values
    weighted = design * (left / (1 + (left / (3 * scatter)) ** 2) ** 2)[:, None]
    pulls = np.array([weighted[strip == each].sum(0) for each in range(lateral_colour.STRIPS)])
    by_pixels, by_strips = inverse * scatter**2 * 8 / 3, inverse @ pulls.T @ pulls @ inverse
    noise = max(np.mean(((apart @ each) * apart).sum(1)) for each in (by_pixels, by_strips))
    assert found.apart_std_px == pytest.approx(np.sqrt(noise))
    assert found.apart_px == pytest.approx(np.sqrt(np.mean((apart @ values) ** 2) - noise))


def parallel(rig: Rig) -> tuple[Rig, np.ndarray]:
    """A rig whose columns run along those of the picture, with the columns of a plane and their noise."""
    height, width = 200, 112
    seen = rig.projector.cx_px + 3.0 * (np.arange(width) - rig.camera.cx_px)
    return rig, seen + np.random.default_rng(3).normal(0, NOISE_PX, (height, width))


def test_pixels_of_a_column_of_the_picture_that_are_wrong_together_are_no_lateral_colour(rig: Rig) -> None:
    for seed in range(8):
        random = np.random.default_rng(seed)
        _, seen = parallel(rig)
        wrong = np.where(random.uniform(size=seen.shape[1]) < 0.3, random.normal(0, 0.15, seen.shape[1]), 0.0)
        found = own_lateral_colour(rig, LINES, seen + wrong, np.ones(seen.shape, bool))
        assert found is not None
        assert not found.present


def test_noise_does_not_tell_one_lens_from_the_other_where_both_look_along_one_axis(rig: Rig) -> None:
    _, seen = parallel(rig)
    # Beside an edge, by less than an edge is known by.
    seen[:, 5:7] += np.random.default_rng(0).normal(0, 0.3, (len(seen), 2))
    found = own_lateral_colour(rig, LINES, seen, np.ones(seen.shape, bool))
    assert found is not None
    assert not found.present
    assert np.abs(found.colour.camera).max() < 1e-4


def test_a_monochrome_camera_tells_nothing_of_colours(rig: Rig) -> None:
    mono = rig.model_copy(update={"sensor": rig.sensor.model_copy(update={"bayer": "MONO"})})
    seen = columns(rig) + 1e-3 * np.arange(rig.camera.width_px) ** 2
    assert own_lateral_colour(mono, LINES, seen, np.ones(seen.shape, bool)) is None


def test_several_pictures_are_fitted_as_one(rig: Rig) -> None:
    seen = [ColumnBends.of(rig, columns(coloured(rig, strength))) for strength in (4e-4, 12e-4)]
    assert seen[0] is not None
    assert seen[1] is not None
    twice, once = fit_lateral_colour(rig, [seen[0], seen[0]]), fit_lateral_colour(rig, [seen[0]])
    assert twice.colour.camera == pytest.approx(once.colour.camera)
    assert twice.apart_std_px == pytest.approx(once.apart_std_px / 2**0.5)
    both = fit_lateral_colour(rig, [seen[0], seen[1]]).colour
    assert both.projector_per_nm == pytest.approx(1e-5, rel=0.2), "half way between those of the two"


@pytest.mark.parametrize(
    ("apart", "std", "present"),
    [(0.0041, 0.0, True), (0.0039, 0.0, False), (0.041, 0.01, True), (0.039, 0.01, False)],
)
def test_lateral_colour_counts_where_it_matters(apart: float, std: float, present: bool) -> None:
    colour = LateralColour(camera=(0.0, 0.0, 0.0), projector_per_nm=0.0, white_nm=(600.0, 540.0, 460.0))
    found = LateralFit(colour, apart, std)
    assert found.present == present
    finding = lateral_finding(found)
    assert (finding.value, finding.std, finding.limit, finding.significant) == (apart, std, 0.004, present)
    assert f" lie {with_std(apart, std, 4)} columns apart" in finding.sentence
