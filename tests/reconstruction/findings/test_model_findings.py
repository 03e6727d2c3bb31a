"""Probed pixels name the part of the model that is wrong, and no other."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from dsl_core.devices.base import DeviceRig
from dsl_core.model.calibration.accepted import HELD_OUT_ORDERS, CalibrationNote
from dsl_core.model.figure import Figure
from dsl_core.model.fit import Fit, Part
from dsl_core.model.plan import CapturePlan, GrayCode, ScanLines
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.optics.correspondence import correspondence
from dsl_core.reconstruction.findings.model_findings import _film, _profile, cause_findings
from dsl_core.reconstruction.spectral.causes import MOST_SHIFT_PX, Causes
from dsl_core.reconstruction.spectral.film_motion import FilmMotion, orders_off_px
from dsl_core.reconstruction.spectral.probing.probe import Probe, probe
from dsl_core.reconstruction.spectral.spectra import SpectralReconstruction
from dsl_core.reconstruction.spectral.turned import Turn
from tests.cases.twin_scan import MemoryScan, solver_input, twin_scan

GRID = WavelengthGrid(step_nm=10.0)


@pytest.fixture(scope="module")
def scanned() -> tuple[DeviceRig, MemoryScan]:
    plan = CapturePlan(code=GrayCode(rows=False), spectral=ScanLines(width_px=5, step_px=4))
    return twin_scan(plan, size="112x72", scene="color-checker")


def probed(rig: Rig, scan: MemoryScan) -> Probe:
    stack, pixels = solver_input(rig, scan)
    data = (rig, scan.plan, GRID, correspondence(rig), stack.radiance, stack.std, pixels)
    found = probe(SpectralReconstruction(*data).probed)
    assert found is not None
    return found


def own(rig: Rig) -> Rig:
    return rig


def shifted_film(rig: Rig) -> Rig:
    return rig.model_copy(update={"film": rig.film.model_copy(update={"tilt_y_deg": 0.5})})


def bent_film(rig: Rig) -> Rig:
    bend = rig.film.bend_per_mm + 0.002
    return rig.model_copy(update={"film": rig.film.model_copy(update={"bend_per_mm": bend})})


def one_order_brighter(rig: Rig) -> Rig:
    curve = rig.efficiency[1]
    brighter = curve.model_copy(update={"values": tuple(1.08 * value for value in curve.values)})
    return rig.model_copy(update={"efficiency": {**rig.efficiency, 1: brighter}})


def other_gamma(rig: Rig) -> Rig:
    response = rig.projector_response
    return rig.model_copy(
        update={"projector_response": response.model_copy(update={"gamma": response.gamma + 0.05})}
    )


def wavy_curves(rig: Rig) -> Rig:
    """Curves of the camera as a data sheet might give them."""
    curves = []
    for phase, curve in enumerate(rig.response):
        nm = np.array(curve.wavelengths_nm)
        curves.append(
            curve.model_copy(
                update={"values": tuple(np.array(curve.values) * (1 + 0.05 * np.sin(nm / 11 + 2 * phase)))}
            )
        )
    red, green, blue = curves
    return rig.model_copy(update={"response": (red, green, blue)})


def white_balanced(rig: Rig) -> Rig:
    """A calibration from before automatic white balance gave red 8 % and blue 15 % more."""
    curves = [
        curve.model_copy(update={"values": tuple(value / gain for value in curve.values)})
        for curve, gain in zip(rig.response, (1.08, 1.0, 1.15), strict=True)
    ]
    red, green, blue = curves
    return rig.model_copy(update={"response": (red, green, blue)})


def less_blur(rig: Rig) -> Rig:
    response = rig.projector_response
    return rig.model_copy(
        update={"projector_response": response.model_copy(update={"blur_px": 0.9 * response.blur_px})}
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("wrong", "part"),
    [
        (own, None),
        (shifted_film, "film"),
        (bent_film, "film"),
        (one_order_brighter, "orders"),
        (other_gamma, "response"),
        (wavy_curves, "curves"),
        (less_blur, "profile"),
    ],
)
def test_the_part_that_is_wrong_is_named(
    scanned: tuple[DeviceRig, MemoryScan], wrong: Callable[[Rig], Rig], part: Part | None
) -> None:
    devices, scan = scanned
    assert devices.calibration is not None
    fit = Fit.of(cause_findings(probed(wrong(devices.calibration), scan)))
    assert fit.parts[:1] == (() if part is None else (part,)), fit.words


@pytest.mark.parametrize(
    ("both", "too"),
    [((0.127, 0.061), "less even"), ((0.1, 0.03), ""), ((-0.44, 0.471), "night mode"), ((0.1, -0.03), "")],
)
def test_the_side_to_which_orders_lie_says_what_else_than_a_film_may_be_the_cause(
    both: tuple[float, float], too: str
) -> None:
    causes = cast(Causes, SimpleNamespace(mean_px=both, rms_px=0.1, rms_std_px=0.008))
    found = _film(causes, cast(Probe, SimpleNamespace(nm_per_px=1.9, step_nm=5.0)))
    assert "film has moved or is bent otherwise" in found.sentence
    assert [word for word in ("less even", "night mode") if word in found.sentence] == ([too] if too else [])


def test_a_blur_that_lines_do_not_show_is_not_told() -> None:
    assert _profile("blur", 0.4, 0.05).significant
    assert not _profile("blur", 0.4, 0.07).significant, "lines side by side on an overexposed plane"
    assert _profile("tail", 0.4, 0.13).significant


def test_bands_must_be_narrow_to_tell_a_small_displacement(scanned: tuple[DeviceRig, MemoryScan]) -> None:
    devices, scan = scanned
    assert devices.calibration is not None
    found = probed(shifted_film(devices.calibration), scan)
    limits = [
        next(f.limit for f in cause_findings(replace(found, step_nm=step_nm)) if "place of" in f.name)
        for step_nm in (2.5, 5.0, 10.0)
    ]
    np.testing.assert_allclose(limits, [MOST_SHIFT_PX, MOST_SHIFT_PX, 4 * MOST_SHIFT_PX])


def test_colours_that_disagree_about_light_which_changes_fast_tell_of_wide_bands(
    scanned: tuple[DeviceRig, MemoryScan],
) -> None:
    devices, scan = scanned
    assert devices.calibration is not None
    found = probed(wavy_curves(devices.calibration), scan)
    fit = Fit.of(cause_findings(replace(found, steepness=2 * found.steepness)))
    assert fit.parts[:1] == ("bands",)
    assert "Reconstruct with bands of at most 5 nm." in fit.words


def test_white_balance_that_is_on_is_told_by_what_colours_say_of_each_other(
    scanned: tuple[DeviceRig, MemoryScan],
) -> None:
    devices, scan = scanned
    assert devices.calibration is not None
    for rig, wanted in ((devices.calibration, 0.0), (white_balanced(devices.calibration), 0.07)):
        seen = probed(rig, scan)
        assert seen.colour_gains is not None
        value, std = seen.colour_gains.apart
        assert value == pytest.approx(wanted, abs=3 * std)
        assert std < 0.02
        found = next(f for f in cause_findings(seen) if "camera's colours" in f.name)
        assert found.significant == (wanted > 0)
    assert "Against red, the camera weighs blue by +" in found.sentence
    assert "white balance" in found.advice


def test_the_gain_of_an_order_is_found_by_its_size(scanned: tuple[DeviceRig, MemoryScan]) -> None:
    devices, scan = scanned
    assert devices.calibration is not None
    found = {f.name: f for f in cause_findings(probed(one_order_brighter(devices.calibration), scan))}
    difference = found["difference between the gains of the orders"]
    assert difference.std is not None
    assert difference.value == pytest.approx(1 / 1.08 - 1, abs=3 * difference.std)
    assert difference.std < 0.03
    assert np.isfinite([f.value for f in found.values()]).all()


def test_gains_that_make_no_frame_fit_better_are_not_a_finding(
    scanned: tuple[DeviceRig, MemoryScan],
) -> None:
    devices, scan = scanned
    assert devices.calibration is not None
    found = probed(one_order_brighter(devices.calibration), scan)
    said = {taken: Fit.of(cause_findings(found, taken)) for taken in (True, False)}
    assert said[True].parts[:1] == ("orders",)
    assert "corrected for it" in said[True].words
    assert "orders" not in said[False].parts


def test_a_film_that_was_followed_is_said_to_have_moved_and_by_how_much(
    scanned: tuple[DeviceRig, MemoryScan],
) -> None:
    devices, scan = scanned
    assert devices.calibration is not None
    std = np.array([0.1, 0.01, 0.02, 2e-5, 0.02])
    motion = FilmMotion(np.array([0.0, 0.0, 0.0, 0.0, 0.1]), std, 0.05, 0.01)
    fit = Fit.of(cause_findings(probed(devices.calibration, scan), motion=motion))
    assert fit.parts == ("film",)
    assert "away from the projector by +0.10 ± 0.02 mm" in fit.words
    assert "tilted" not in fit.words
    assert "The level and the colour of the light may have changed, too" in fit.words
    perhaps = Fit.of(cause_findings(probed(devices.calibration, scan), motion=replace(motion, sure=False)))
    assert perhaps.parts == ()
    assert any("may have moved" in found.sentence for found in perhaps.findings)
    by_light = replace(motion, sure=False, by_light=True)
    coloured = Fit.of(cause_findings(probed(devices.calibration, scan), motion=by_light))
    assert coloured.parts == ()
    assert any("changed its colour, which looks alike" in found.sentence for found in coloured.findings)


@pytest.mark.parametrize(
    ("believed", "instead", "depth_share", "told"),
    [
        (0.7, False, 0.009, ("film", "geometry")),
        (1.0, True, 0.009, ("geometry", "film")),
        (0.0, False, 0.009, ("film",)),
        (0.7, False, 0.001, ("film",)),
    ],
)
def test_where_nothing_says_whether_the_film_has_moved_or_the_camera_turned_both_are_named(
    scanned: tuple[DeviceRig, MemoryScan],
    believed: float,
    instead: bool,
    depth_share: float,
    told: tuple[str, ...],
) -> None:
    devices, scan = scanned
    assert devices.calibration is not None
    seen, numbers = probed(devices.calibration, scan), np.array([0.0, 0.0, 0.0, 0.0, 0.3])
    motion = FilmMotion(numbers, np.full(5, 0.02), 0.1, 0.02)
    turn = Turn(devices.calibration, believed, instead, depth_share)
    fit = Fit.of(cause_findings(seen, motion=motion, turn=turn))
    assert fit.parts == told
    may_be_either = "Nothing in the scan says which" in fit.words
    assert may_be_either == (told == ("film", "geometry"))
    unsure = replace(motion, sure=False)
    slight = Fit.of(cause_findings(seen, motion=unsure, turn=replace(turn, instead=False)))
    assert slight.parts == ()
    or_turned = any("turned instead" in found.sentence for found in slight.findings)
    assert or_turned == (believed * depth_share > 0.001)


def test_a_film_calibrated_no_better_than_it_moved_may_have_another_shape(
    scanned: tuple[DeviceRig, MemoryScan],
) -> None:
    devices, scan = scanned
    assert devices.calibration is not None
    seen, numbers = probed(devices.calibration, scan), np.array([0.0, 0.0, 0.0, 0.0, 0.1])
    motion = FilmMotion(numbers, np.full(5, 0.02), 0.45, 0.06)
    told = {px: Fit.of(cause_findings(seen, motion=motion, calibrated_px=px)) for px in (0.0, 0.1, 0.2)}
    assert {px: fit.parts for px, fit in told.items()} == dict.fromkeys(told, ("film",))
    assert "which left first orders 0.20 px (rms) from their places" in told[0.2].words
    assert all("shape is none that a calibration can record" not in told[px].words for px in (0.0, 0.1))


def test_what_the_last_film_calibration_left_of_first_orders_is_taken_from_the_rig(
    scanned: tuple[DeviceRig, MemoryScan],
) -> None:
    rig = scanned[0].calibration
    assert rig is not None
    assert orders_off_px(rig.model_copy(update={"calibrations": ()})) == 0.0
    notes = tuple(
        CalibrationNote(
            name="depth-stage",
            title="Depth stage",
            accepted="",
            figures=(Figure(name=HELD_OUT_ORDERS, value=px, unit="px"),),
        )
        for px in (0.3, 0.2)
    )
    assert orders_off_px(rig.model_copy(update={"calibrations": notes})) == 0.2
