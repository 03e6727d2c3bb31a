"""Flags, bands and probed pixels become findings where they are not normal; only what is wrong is named."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from dsl_core.devices.base import DeviceRig
from dsl_core.model.fit import Fit, FitFinding, Part
from dsl_core.model.plan import CapturePlan, GrayCode, ScanLines
from dsl_core.model.result import Flag, Reach
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.optics.correspondence import correspondence
from dsl_core.reconstruction.fit_findings import (
    SpectralCounts,
    _film,
    _profile,
    band_findings,
    cause_findings,
    count_spectra,
    line_width_nm,
    share_findings,
)
from dsl_core.reconstruction.spectral.causes import MOST_SHIFT_PX, Causes
from dsl_core.reconstruction.spectral.film_motion import FilmMotion
from dsl_core.reconstruction.spectral.probing.probe import Probe, probe
from dsl_core.reconstruction.spectral.spectra import SpectralReconstruction
from dsl_core.simulation.published_rig import published_rig
from tests.cases.twin_scan import MemoryScan, solver_input, twin_scan

SHAPE = (20, 20)
GRID = WavelengthGrid(step_nm=10.0)


def counted(data_share: np.ndarray, reach: np.ndarray) -> SpectralCounts:
    black = np.zeros_like(data_share)
    return count_spectra(np.zeros(SHAPE, np.uint16), data_share, reach, black, black)


def judged(
    made: np.ndarray[tuple[int, ...], np.dtype[np.uint16]], reflectance: float = 1.5, std: float = 0.0
) -> list[FitFinding]:
    """What is said of flags and of even spectra that reach nothing."""
    nothing = np.zeros((1, *SHAPE), np.uint8)
    even, deviation = np.full(nothing.shape, reflectance), np.full(nothing.shape, std)
    return list(share_findings(made, count_spectra(made, nothing.astype(float), nothing, even, deviation)))


def scattered(flag: Flag, share: float) -> np.ndarray[tuple[int, ...], np.dtype[np.uint16]]:
    made = flags(flag, share).ravel()
    return np.random.default_rng(2).permutation(made).reshape(SHAPE)


def flags(flag: Flag, share: float) -> np.ndarray[tuple[int, ...], np.dtype[np.uint16]]:
    values = np.zeros(SHAPE, np.uint16)
    values.ravel()[: round(share * values.size)] = int(flag)
    return values


@pytest.mark.parametrize(
    ("flag", "limit", "part"),
    [
        (Flag.POOR_FIT, 0.4, "mixed pixels"),
        (Flag.AT_BOUND, 0.1, "light"),
        (Flag.CODES_DISAGREE, 0.1, "coverage"),
        (Flag.OUT_OF_RANGE, 0.1, "coverage"),
        (Flag.UNUSUAL_PEAK, 0.02, "profile"),
    ],
)
def test_a_flag_is_told_from_the_share_that_is_not_normal(flag: Flag, limit: float, part: str) -> None:
    below, above = (Fit.of(judged(scattered(flag, limit + d))) for d in (-0.01, 0.02))
    assert below.parts == ()
    assert above.parts == (part,)
    assert f"{limit + 0.02:.0%}" in above.words


@pytest.mark.parametrize(
    ("flag", "part", "words"),
    [(Flag.POOR_FIT, "surfaces", "fluorescent"), (Flag.NOT_REFINED, "profile", "too dark, translucent")],
)
def test_whole_areas_are_told_though_they_are_a_small_part_of_the_picture(
    flag: Flag, part: Part, words: str
) -> None:
    area, lines = np.zeros(SHAPE, np.uint16), np.zeros(SHAPE, np.uint16)
    area[5:14, 3:14] = lines[::4] = int(flag)
    found = Fit.of(judged(area))
    assert found.parts == (part,)
    assert words in found.words
    # Seen edges of so many pixels more are no areas, and neither are pixels that something else explains.
    assert part not in Fit.of(judged(lines)).parts
    assert Fit.of(judged(flags(Flag.SATURATED | Flag.NOT_REFINED, 0.3))).parts == ()


def test_a_small_translucent_patch_is_told_and_pixels_along_an_edge_are_not() -> None:
    patch, edge = np.zeros((2, 60, 60), np.uint16)
    patch[20:28, 20:28] = edge[:, 30] = int(Flag.UNUSUAL_PEAK)
    told = Fit.of(share_findings(patch, None))
    assert told.parts == ("profile",)
    assert "light leaves a translucent surface elsewhere" in told.words
    assert Fit.of(share_findings(edge, None)).parts == ()
    assert Fit.of(share_findings(patch, None, blurred=True)).parts == ()


def test_pixels_that_are_lost_to_overexposure_are_told_by_themselves() -> None:
    bright = flags(Flag.SATURATED | Flag.CODE_UNSURE, 0.3)
    fit = Fit.of(judged(bright))
    assert fit.parts == ("exposure",)
    assert "30% of the lit pixels" in fit.words
    assert "darker setting" in fit.words
    assert Fit.of(judged(flags(Flag.SATURATED, 0.3))).parts == (), "these have a depth"
    assert Fit.of(judged(bright | np.flip(flags(Flag.OUT_OF_RANGE, 0.2)))).parts == ("exposure", "coverage")


def test_a_background_beyond_the_calibrated_depths_is_not_blamed_on_motion_alone() -> None:
    far, unsure = flags(Flag.OUT_OF_RANGE, 0.3), np.flip(flags(Flag.CODES_DISAGREE, 0.2))
    assert "if they show a background" in Fit.of(judged(far | unsure)).words
    assert "surfaces that light each other" in Fit.of(judged(unsure)).words
    assert "background" not in Fit.of(judged(flags(Flag.OUT_OF_RANGE, 0.1) | unsure)).words


def test_lines_of_another_shape_are_no_news_where_the_camera_is_out_of_focus() -> None:
    made = flags(Flag.UNUSUAL_PEAK, 0.3)
    assert Fit.of(share_findings(made, None)).parts == ("profile",)
    assert Fit.of(share_findings(made, None, blurred=True)).parts == ()


def test_spectra_at_a_bound_that_fit_poorly_say_nothing_of_the_light() -> None:
    both = scattered(Flag.POOR_FIT, 0.3) | scattered(Flag.AT_BOUND, 0.35)
    assert Fit.of(judged(both)).parts == ()
    assert Fit.of(judged(both | scattered(Flag.AT_BOUND, 0.45))).parts == ("light",)


@pytest.mark.parametrize(
    ("reflectance", "std", "told"),
    # Noise takes dark surfaces to 0. The least that a band holds one of whose nodes is 1.5 is 1.
    [(0.0, 0.008, False), (0.9, 0.0, False), (1.0, 0.0, True), (1.5, 0.2, True), (1.3, 0.2, False)],
)
def test_spectra_at_a_bound_by_their_noise_say_nothing_of_the_light(
    reflectance: float, std: float, told: bool
) -> None:
    found = judged(flags(Flag.AT_BOUND, 0.5), reflectance, std)
    assert (Fit.of(found).parts == ("light",)) == told


@pytest.mark.parametrize(("pixels", "told"), [(49, ()), (50, ("bands", "exposure", "profile", "surfaces"))])
def test_fewer_than_fifty_pixels_say_nothing(pixels: int, told: tuple[str, ...]) -> None:
    made = np.full(SHAPE, int(Flag.NO_LIGHT), np.uint16)
    made.ravel()[:pixels] = int(Flag.POOR_FIT | Flag.UNUSUAL_PEAK)
    lost = np.where(made == int(Flag.NO_LIGHT), made, int(Flag.SATURATED | Flag.CODE_UNSURE))
    counts = SpectralCounts(reached=pixels, undecided=pixels)
    found = [*share_findings(lost, None), *share_findings(made, counts), *band_findings(5, 11.0, counts)]
    assert tuple(sorted(Fit.of(found).parts)) == told


def test_pixels_in_shadow_are_not_lost_and_depth_alone_has_no_spectra_to_judge() -> None:
    assert Fit.of(judged(flags(Flag.NO_LIGHT, 0.8))).parts == ()
    assert Fit.of(share_findings(flags(Flag.POOR_FIT, 0.8), None)).parts == ()


def test_counts_of_rows_add_up_to_those_of_the_picture() -> None:
    made, rng = flags(Flag.POOR_FIT, 0.3), np.random.default_rng(0)
    share, reach = rng.uniform(0, 1, (3, *SHAPE)), rng.integers(1, 5, (3, *SHAPE))
    made |= flags(Flag.AT_BOUND, 0.6)
    dark, std = rng.uniform(0, 0.04, (3, *SHAPE)), np.full((3, *SHAPE), 0.002)
    parts = (
        count_spectra(made[each], share[:, each], reach[:, each], dark[:, each], std[:, each])
        for each in (slice(0, 7), slice(7, 20))
    )
    assert sum(parts, SpectralCounts()) == count_spectra(made, share, reach, dark, std)


@pytest.mark.parametrize(("step_nm", "share", "words"), [(20, 0.9, "coarse"), (1, 0.2, "fine"), (5, 0.9, "")])
def test_bands_are_judged_by_the_lines_and_by_the_data(step_nm: float, share: float, words: str) -> None:
    cube = (3, *SHAPE)
    found = Fit.of(
        band_findings(step_nm, 11.0, counted(np.full(cube, share), np.full(cube, int(Reach.PLUS_ONE))))
    )
    assert bool(found.parts) == bool(words)
    assert words in found.words


def test_bands_that_no_line_reaches_are_not_blamed_on_their_width() -> None:
    cube = (3, *SHAPE)
    zero_only = np.full(cube, int(Reach.ZERO_ONLY))
    assert Fit.of(band_findings(5, 11.0, counted(np.full(cube, 0.1), zero_only))).parts == ()


def test_a_line_of_the_published_rig_is_about_ten_nanometres_wide() -> None:
    rig, grid = published_rig(), WavelengthGrid()
    depth = np.full((rig.camera.height_px, rig.camera.width_px), 700.0)
    wide, narrow = (
        line_width_nm(rig, CapturePlan(spectral=ScanLines(width_px=w, step_px=2)), grid, depth)
        for w in (5, 2)
    )
    assert wide is not None
    assert narrow == pytest.approx(0.4 * wide)
    assert 8 < wide < 14
    assert line_width_nm(rig, CapturePlan(), grid, np.full_like(depth, np.nan)) is None


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


def less_blur(rig: Rig) -> Rig:
    response = rig.projector_response
    return rig.model_copy(
        update={"projector_response": response.model_copy(update={"blur_px": 0.9 * response.blur_px})}
    )


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
    ("both", "told"), [((0.127, 0.061), True), ((0.1, 0.03), False), ((0.1, -0.1), False)]
)
def test_uneven_lines_are_a_cause_only_where_both_orders_lie_to_the_same_side(
    both: tuple[float, float], told: bool
) -> None:
    causes = cast(Causes, SimpleNamespace(mean_px=both, rms_px=0.1, rms_std_px=0.008))
    found = _film(causes, cast(Probe, SimpleNamespace(nm_per_px=1.9, step_nm=5.0)))
    assert "film has moved or is bent otherwise" in found.sentence
    assert ("less even" in found.sentence) == told


def test_a_blur_that_lines_do_not_show_is_not_told() -> None:
    assert _profile("blur", 0.4, 0.09).significant
    assert not _profile("blur", 0.4, 0.13).significant, "lines side by side before wax"
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
    assert "level of the light" in fit.words
