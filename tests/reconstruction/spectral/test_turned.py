"""Displaced first orders may be a camera's that has turned: then depth is as unsure as that would make it."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from dsl_core import pipeline
from dsl_core.devices.base import DeviceRig
from dsl_core.evaluation.uncertainty import check_honesty
from dsl_core.model.fit import Fit
from dsl_core.model.options import Options
from dsl_core.model.plan import CapturePlan, GrayCode, ScanLines
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.reconstruction.findings.model_findings import MOVED, TURNED
from dsl_core.reconstruction.spectral.film_motion import PRIOR_STD, FilmMotion, with_film
from dsl_core.reconstruction.spectral.probing.probe import Probe
from dsl_core.reconstruction.spectral.turned import EITHER, IMPLAUSIBLE, SURELY, _belief, _surer, with_pose
from dsl_core.workflows import truths
from tests.cases.twin_scan import MemoryScan, twin_scan

Scanned = tuple[DeviceRig, MemoryScan]
#: A relief at few pixels, whose code has rows as well in the second scan.
SIZE, SCENE = "112x72", "relief"


def _scanned(rows: bool) -> Scanned:
    plan = CapturePlan(code=GrayCode(rows=rows), spectral=ScanLines(width_px=5, step_px=4))
    return twin_scan(plan, size=SIZE, scene=SCENE)


@pytest.fixture(scope="module")
def scanned() -> Scanned:
    return _scanned(rows=False)


def _rig(scanned: Scanned) -> Rig:
    assert scanned[0].calibration is not None
    return scanned[0].calibration


def _judged(scanned: Scanned, rig: Rig) -> tuple[Fit, float, float]:
    """The verdict by a rig's calibration, the share of depths in their bands, and the median deviation."""
    result = pipeline.reconstruct(scanned[1], rig, Options(WavelengthGrid(step_nm=5.0)))
    truth, fit = truths.twin_truth(scanned[0], WavelengthGrid()), Fit.read(result.attrs)
    assert truth is not None
    assert truth.depth_mm is not None
    assert fit is not None
    depth, std = result["depth_mm"].values, result["depth_std_mm"].values
    return fit, check_honesty(depth, truth.depth_mm, std).coverage_95, float(np.nanmedian(std))


@pytest.mark.slow
@pytest.mark.parametrize(
    "turn", [(0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 0.0, 8.0)], ids=["turned by a degree", "8 mm across"]
)
def test_the_calibration_of_another_rig_is_told_before_a_film_that_moved(
    scanned: Scanned, turn: tuple[float, ...]
) -> None:
    fit, held, _ = _judged(scanned, with_pose(_rig(scanned), np.array(turn)))
    assert fit.parts[0] == "geometry"
    assert fit.significant[0].name == TURNED
    assert "another rig" in fit.words
    assert held > 0.9


@pytest.mark.slow
@pytest.mark.parametrize("turn_deg", [-0.05, 0.05])
def test_a_camera_that_turned_a_little_looks_like_a_film_that_moved_and_depth_is_unsure(
    scanned: Scanned, turn_deg: float
) -> None:
    fit, held, _ = _judged(scanned, with_pose(_rig(scanned), np.array([0.0, turn_deg, 0.0, 0.0])))
    assert {found.name for found in fit.significant[:2]} == {MOVED, TURNED}
    assert "Deviations of depth" in fit.words
    assert held > 0.9


@pytest.mark.slow
def test_rows_of_a_code_that_agree_say_that_only_the_film_has_moved() -> None:
    with_rows = _scanned(rows=True)
    rig = _rig(with_rows)
    _, _, usual_mm = _judged(with_rows, rig)
    fit, held, std_mm = _judged(with_rows, with_film(rig, np.array([0.0, 0.0, 0.0, 0.0, 0.5])))
    assert fit.significant[0].name == MOVED
    assert std_mm == pytest.approx(usual_mm, rel=0.05)
    assert held > 0.9


def test_what_frames_fit_better_is_believed_unless_no_film_can_have_moved_so_far() -> None:
    slip = FilmMotion(np.array([0.0, 0.0, 0.0, 0.0, 0.3]), np.full(5, 0.02), 0.1, 0.0)
    assert _belief(slip, 0.0) == (EITHER, False)
    assert _belief(slip, -SURELY - 1) == (0.0, False)
    assert _belief(slip, SURELY + 1) == (1.0, True)
    far = replace(slip, values=1.01 * IMPLAUSIBLE * PRIOR_STD)
    assert _belief(far, -SURELY - 1) == (1.0, True)
    # A dent that the calibration could not record looks like any motion.
    assert _belief(far, -SURELY - 1, dented=True) == (0.0, False)
    assert _belief(far, 0.0, dented=True) == (EITHER, False)
    assert _belief(far, SURELY + 1, dented=True) == (1.0, True)
    assert far.may_be_dent(far.shift_px / 2)
    assert not far.may_be_dent(far.shift_px / 4)
    assert _belief(replace(slip, shift_std_px=0.05), 0.0)[0] == pytest.approx(np.hypot(EITHER, 0.5))


def test_a_pose_has_to_fit_better_than_the_calibration_too_not_only_than_a_wrong_motion() -> None:
    """LEDs 3 nm longer displace orders a little: the film fitted to that fits worse, as the pose does."""
    noise = np.random.default_rng(1).normal(0, 0.05, (3, 200))

    def fits(chi_square: float, index: int) -> Probe:
        return cast(Probe, SimpleNamespace(sound=np.ones(200, bool), chi_square=chi_square + noise[index]))

    film, calibrated = fits(1.3, 0), fits(1.0, 1)
    assert _surer((film, film), fits(1.02, 2)) > SURELY
    assert _surer((film, calibrated), fits(1.02, 2)) < 0
    assert _surer((film, calibrated), fits(0.8, 2)) > SURELY
    assert _surer((film,), None) == 0.0
