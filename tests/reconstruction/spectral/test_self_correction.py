"""Spectra follow a film that has slipped or lost light since the calibration, as the scan shows it."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from dsl_core.devices.base import DeviceRig
from dsl_core.model.fit import FitFinding
from dsl_core.model.plan import CapturePlan, GrayCode, LineComb, ScanLines
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.optics.correspondence import correspondence
from dsl_core.reconstruction.calibration_age import CHANGED_REL_STD
from dsl_core.reconstruction.findings.fit import fit_of
from dsl_core.reconstruction.findings.model_findings import MISFIT, SECONDS, cause_findings
from dsl_core.reconstruction.spectral import self_correction, spectra
from dsl_core.reconstruction.spectral.colour_sites import MOSAIC
from dsl_core.reconstruction.spectral.film_motion import FilmMotion, with_film
from dsl_core.reconstruction.spectral.self_correction import fits_better
from dsl_core.reconstruction.spectral.spectra import COMB_LIGHT, SpectralReconstruction
from dsl_core.reconstruction.spectral.spectral_maps import SpectralMaps
from tests.cases.twin_scan import MemoryScan, solver_input, twin_scan

#: Most of these tests need no finer ones.
GRID = WavelengthGrid(step_nm=10.0)
SLIPS = np.array([0.0, 0.3, 0.0, 0.0, 0.3])


@pytest.fixture(scope="module")
def scanned() -> tuple[Rig, MemoryScan]:
    plan = CapturePlan(code=GrayCode(rows=False), spectral=ScanLines(width_px=5, step_px=4))
    devices: DeviceRig
    devices, scan = twin_scan(plan, size="112x72", scene="color-checker")
    assert devices.calibration is not None
    return devices.calibration, scan


def solved(rig: Rig, scan: MemoryScan, as_calibrated: bool, grid: WavelengthGrid = GRID) -> SpectralMaps:
    stack, pixels = solver_input(rig, scan)
    data = (rig, scan.plan, grid, correspondence(rig), stack.radiance, stack.std, pixels)
    return SpectralReconstruction(*data, as_calibrated=as_calibrated).run()


@pytest.fixture(scope="module")
def right(scanned: tuple[Rig, MemoryScan]) -> SpectralMaps:
    return solved(*scanned, as_calibrated=True)


def error(found: SpectralMaps, right: SpectralMaps) -> float:
    return float(np.sqrt(np.nanmedian((found.reflectance - right.reflectance) ** 2)))


def one_order_brighter(rig: Rig) -> Rig:
    curve = rig.efficiency[1]
    brighter = curve.model_copy(update={"values": tuple(1.08 * value for value in curve.values)})
    return rig.model_copy(update={"efficiency": {**rig.efficiency, 1: brighter}})


@pytest.mark.slow
def test_most_of_the_error_of_a_darker_order_is_taken_back(
    scanned: tuple[Rig, MemoryScan], right: SpectralMaps
) -> None:
    rig, scan = scanned
    left, taken = (solved(one_order_brighter(rig), scan, as_calibrated) for as_calibrated in (True, False))
    assert left.followed is not None
    assert left.followed.balanced is None
    assert taken.followed is not None
    assert taken.followed.balanced
    assert error(taken, right) < 0.5 * error(left, right)


@pytest.fixture(scope="module")
def combs() -> tuple[Rig, MemoryScan]:
    plan = CapturePlan(code=GrayCode(rows=False), spectral=LineComb(width_px=6, step_px=4, period_px=96))
    devices, scan = twin_scan(plan, size="112x72", scene="color-checker")
    assert devices.calibration is not None
    return devices.calibration, scan


def said_of_seconds(found: SpectralMaps) -> FitFinding | None:
    assert found.followed is not None
    of_model = cause_findings(found.followed.probe, found.followed.balanced)
    return next((each for each in of_model if each.name == SECONDS), None)


@pytest.mark.slow
@pytest.mark.parametrize("factor", [0.3, 2.0])
def test_combs_tell_how_bright_second_orders_are(combs: tuple[Rig, MemoryScan], factor: float) -> None:
    rig, scan = combs
    curves = {
        order: curve.model_copy(update={"values": tuple(factor * value for value in curve.values)})
        if abs(order) == 2
        else curve
        for order, curve in rig.efficiency.items()
    }
    share = rig.efficiency[2].at(545.0) / rig.efficiency[1].at(545.0)
    right, taken = (
        solved(each, scan, False, WavelengthGrid())
        for each in (rig, rig.model_copy(update={"efficiency": curves}))
    )
    usual, told = said_of_seconds(right), said_of_seconds(taken)
    assert usual is not None
    assert not usual.significant
    assert right.error is not None
    assert right.error.relative.min() >= COMB_LIGHT
    assert told is not None
    assert told.significant
    assert told.value == pytest.approx((1 - factor) * share, rel=0.25)
    assert "corrected for it" in told.sentence
    assert taken.followed is not None
    assert not taken.followed.has_changed
    assert error(taken, right) < 0.003


@pytest.mark.slow
def test_single_lines_say_nothing_of_second_orders(scanned: tuple[Rig, MemoryScan]) -> None:
    assert said_of_seconds(solved(*scanned, as_calibrated=False)) is None


@pytest.mark.slow
def test_combs_tell_of_a_film_that_has_slipped(combs: tuple[Rig, MemoryScan]) -> None:
    (rig, scan), fine = combs, WavelengthGrid()
    right, taken = (solved(each, scan, False, fine) for each in (rig, with_film(rig, -SLIPS)))
    assert right.followed is not None
    assert right.followed.motion is None
    assert taken.followed is not None
    motion = taken.followed.motion
    assert motion is not None
    assert motion.sure
    assert np.abs(motion.values - SLIPS)[[1, 4]].max() < 0.05


@pytest.mark.slow
def test_a_film_that_has_slipped_is_put_where_it_is(scanned: tuple[Rig, MemoryScan]) -> None:
    (rig, scan), fine = scanned, WavelengthGrid()
    right, left = (solved(each, scan, True, fine) for each in (rig, with_film(rig, -SLIPS)))
    taken = solved(with_film(rig, -SLIPS), scan, False, fine)
    assert taken.followed is not None
    motion = taken.followed.motion
    assert motion is not None
    assert (np.abs(motion.values - SLIPS) < 4 * motion.std).all()
    assert (motion.values[[1, 4]] > 3 * motion.std[[1, 4]]).all()
    assert error(taken, right) < 0.5 * error(left, right)


@pytest.mark.slow
def test_by_wide_bands_its_motion_is_known_less_well(scanned: tuple[Rig, MemoryScan]) -> None:
    """What spectra curve along them displaces the orders, like a film that has come closer."""
    rig, scan = scanned
    taken = solved(with_film(rig, -SLIPS), scan, False)
    assert taken.followed is not None
    motion = taken.followed.motion
    assert motion is not None
    assert (np.abs(motion.values - SLIPS) < 4 * motion.std).all()
    assert motion.values[1] > 3 * motion.std[1]


@pytest.mark.slow
def test_a_film_as_calibrated_changes_nothing(scanned: tuple[Rig, MemoryScan], right: SpectralMaps) -> None:
    found = solved(*scanned, as_calibrated=False)
    assert found.followed is not None
    assert found.followed.motion is None
    assert not found.followed.balanced
    assert np.array_equal(found.reflectance, right.reflectance, equal_nan=True)


def test_a_model_is_taken_only_if_frames_fit_it_better(
    scanned: tuple[Rig, MemoryScan], right: SpectralMaps
) -> None:
    assert right.followed is not None
    before = right.followed.probe
    scatter = 0.3 * np.random.default_rng(0).normal(size=len(before.chi_square))
    less, same = (replace(before, chi_square=before.chi_square + scatter - fall) for fall in (0.2, 0.0))
    assert fits_better(before, less)
    assert not fits_better(before, same)
    assert not fits_better(less, before)


@pytest.mark.parametrize(("pixels", "is_enough"), [(0, False), (1, False), (2, True)])
def test_two_pixels_that_agree_say_whether_frames_fit_better(pixels: int, is_enough: bool) -> None:
    sound = np.arange(4) < pixels
    before, after = (
        cast("Any", SimpleNamespace(sound=sound, chi_square=np.full(4, fit))) for fit in (1.3, 1.1)
    )
    assert fits_better(before, after) == is_enough


@pytest.mark.slow
def test_what_both_orders_share_is_left_to_the_responses(
    scanned: tuple[Rig, MemoryScan], right: SpectralMaps
) -> None:
    rig, scan = scanned
    brighter = {
        order: curve.model_copy(update={"values": tuple(1.05 * value for value in curve.values)})
        for order, curve in rig.efficiency.items()
    }
    found = solved(rig.model_copy(update={"efficiency": brighter}), scan, as_calibrated=False)
    assert found.followed is not None
    assert not found.followed.balanced


@pytest.mark.slow
def test_light_of_orders_that_frames_fit_no_better_is_found_and_not_taken_over(
    scanned: tuple[Rig, MemoryScan], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(self_correction, "fits_better", lambda *_: False)
    found = solved(one_order_brighter(scanned[0]), scanned[1], as_calibrated=False).followed
    assert found is not None
    assert (found.balanced, found.motion) == (False, None)
    assert found.left is found.probe


def test_what_has_changed_may_have_changed_the_level_of_its_light_as_well(
    scanned: tuple[Rig, MemoryScan], right: SpectralMaps, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert right.followed is not None
    perhaps = FilmMotion(np.array([0.0, 0.0, 0.0, 0.0, 0.1]), np.full(5, 0.02), 0.03, 0.01, sure=False)
    said = replace(right.followed, motion=perhaps)
    monkeypatch.setattr(spectra, "follow", lambda *_: said)
    found = solved(*scanned, as_calibrated=False)
    # The difference of larger deviations is lost in their last digits.
    bright = (right.reflectance > 0.5) & (right.std < 0.1)
    assert bright.any()
    more = np.sqrt(found.std[bright] ** 2 - right.std[bright] ** 2) / right.reflectance[bright]
    assert np.allclose(more, CHANGED_REL_STD, rtol=0.05)
    depth, flags = np.full((72, 112), 700.0), np.zeros((72, 112), np.uint16)
    given = scanned[0], scanned[1].plan, GRID, depth, flags, None
    fits = [fit_of(*given, each) for each in (right.followed, said)]
    assert [fit.level_rel_std for fit in fits] == [0.0, CHANGED_REL_STD]
    assert "may have moved" in fits[1].unseen
    assert fits[1].parts == fits[0].parts
    other = FitFinding.judged("response", MOSAIC, 1.0, "1", 0.01, "Other colours.", "Set them.")
    fits.append(fit_of(*given, said, earlier=[other]))
    told = [any(each.name == MISFIT for each in fit.findings) for fit in fits]
    assert told == [True, True, False], "with other colours, nothing else is looked for"


@pytest.mark.parametrize(("colour_changed", "by_light"), [(0.0, False), (0.03, False), (0.2, True)])
def test_light_that_changed_its_colour_is_not_taken_for_a_film_that_moved(
    scanned: tuple[Rig, MemoryScan], colour_changed: float, by_light: bool
) -> None:
    """The film moves by 0.7 nm. No change of colour by 3 % displaces light by so much."""
    rig, scan = scanned
    stack, pixels = solver_input(rig, scan)
    slipped = with_film(rig, -SLIPS)
    data = (slipped, scan.plan, WavelengthGrid(), correspondence(slipped), stack.radiance, stack.std, pixels)
    solver = SpectralReconstruction(*data, colour_changed=colour_changed)
    places = solver.model
    solver.learn()
    assert solver.followed is not None
    motion = solver.followed.motion
    assert motion is not None
    assert (motion.sure, motion.by_light) == (not by_light, by_light)
    assert (solver.model is places) == by_light
