"""The film follows from columns of its first orders: exact, noisy, or wrong."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dsl_core.calibration.film.filter_angle import columns_per_share, seen_straight
from dsl_core.calibration.film.fit import (
    COMMON_PX,
    _common_offsets,
    fit_film,
    require_plausible,
    with_geometry,
)
from dsl_core.calibration.film.form import FIELDS, SLOPE_STD, FilmForm
from dsl_core.calibration.film.order_samples import grating_columns
from dsl_core.errors import CalibrationError
from dsl_core.model.rig import SHAPE_POWERS, Film, FilmShape, Rig
from dsl_core.optics.filters import SIGNIFICANT, FilterAngle
from dsl_core.optics.shading import Plane
from tests.cases.film_samples import (
    DEPTHS_MM,
    NOISE_PX,
    mounted,
    samples_of,
    shift_of_filters,
    small_rig,
)


def test_exact_columns_give_the_exact_film() -> None:
    rig = small_rig()
    found = fit_film(mounted(rig), samples_of(rig, 0.0), Film()).film
    # The mounting's prior pulls by less than a thousandth of a pixel.
    samples = samples_of(rig, 0.0)
    again = grating_columns(rig.model_copy(update={"film": found}), samples)
    assert np.abs(again - samples.column_px).max() < 1e-3
    assert found.lines_per_mm == pytest.approx(487.0, abs=0.01)
    assert found.roll_deg == pytest.approx(0.2, abs=0.005)


@pytest.mark.parametrize("seed", range(3))
def test_stated_deviations_cover_the_film(seed: int) -> None:
    rig = small_rig()
    samples = samples_of(rig, NOISE_PX, seed=seed)
    draw, off = np.random.default_rng(100 + seed), np.zeros(len(samples))
    for name, order in np.ndindex(samples.filter.max() + 1, 2):
        mine = (samples.filter == name) & (samples.order == 2 * order - 1)
        across = samples.pixel % rig.camera.width_px / rig.camera.width_px
        off += mine * COMMON_PX * (draw.normal() + draw.normal() * np.sqrt(12) * (across - 0.5))
    fit = fit_film(mounted(rig), replace(samples, column_px=samples.column_px + off), Film())
    errors = np.array([getattr(fit.film, name) - getattr(rig.film, name) for name in FIELDS])
    whitened = errors @ np.linalg.inv(fit.covariance) @ errors
    assert 0.3 < whitened < 20  # chi-square of six numbers


@pytest.mark.slow
def test_a_fifth_of_wrong_samples_does_no_harm() -> None:
    rig, samples = small_rig(), samples_of(small_rig(), NOISE_PX)
    samples.column_px[::5] += 15.0
    found = rig.model_copy(update={"film": fit_film(mounted(rig), samples, Film()).film})
    off = grating_columns(found, samples) - grating_columns(rig, samples)
    assert np.sqrt(np.mean(off**2)) < 0.02


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_filters_seen_at_an_angle_do_not_bend_the_film(seed: int) -> None:
    # Index 1.9 and a tilt of 3 degrees: 4 nm at the side of the picture.
    rig, samples = small_rig(), samples_of(small_rig(), NOISE_PX, seed=seed)
    shift = shift_of_filters(rig, samples.pixel, 1.9, 3.0)
    assert 550 * np.ptp(shift) > 4.0
    askew = replace(samples, column_px=samples.column_px + columns_per_share(rig, samples) * shift)
    bent = fit_film(mounted(rig), askew, Film())
    assert abs(bent.film.bend_per_mm - rig.film.bend_per_mm) > 1e-3
    found = fit_film(mounted(rig), askew, Film(), angled=True)
    density = FIELDS.index("lines_per_mm")
    assert found.angle.index is not None
    assert found.angle.index[0] == pytest.approx(1.9, abs=max(0.02, 4 * found.angle.index[1]))
    fitted = rig.model_copy(update={"film": found.film})
    off = grating_columns(fitted, samples) - grating_columns(rig, samples)
    assert np.sqrt(np.mean(off**2)) < 0.02
    # That of the tilt alone is 0.04 %: it is no other density of the film's lines.
    sure = np.sqrt(found.covariance[density, density])
    assert found.film.lines_per_mm == pytest.approx(rig.film.lines_per_mm, abs=2.5 * sure)
    assert sure < 1.5e-4 * rig.film.lines_per_mm
    straight = seen_straight(fitted, askew, found.angle)
    assert np.abs(straight.column_px - samples.column_px).max() < 0.05


def twisted(rig: Rig) -> Rig:
    """A rig with a film that is as steep as 0.04 in the corners by a twist and at the sides by an S."""
    middle_mm = FilmForm.of(rig.projector, Film(), shaped=True).middle_mm  # what tilts are counted from
    shape = FilmShape(middle_mm=middle_mm, factors=(0.0075, 0.0, 0.00015, 0.0, 0.0, 0.0))
    return rig.model_copy(update={"film": rig.film.model_copy(update={"shape": shape})})


@pytest.mark.slow
def test_a_film_of_another_shape_is_not_taken_for_one_that_is_tilted() -> None:
    rig = twisted(small_rig())
    samples = samples_of(rig, NOISE_PX)
    cylinder = fit_film(mounted(rig), samples, Film())
    assert cylinder.scatter_px > 5 * NOISE_PX
    # What no cylinder says is alike in neighbouring samples: it turns no film, and all is less sure.
    assert abs(cylinder.film.tilt_x_deg - rig.film.tilt_x_deg) < cylinder.std["tilt_x_deg"]
    assert cylinder.std["tilt_x_deg"] > 1.0
    found = fit_film(mounted(rig), samples, Film(), shaped=True)
    errors = {name: getattr(found.film, name) - getattr(rig.film, name) for name in FIELDS}
    assert all(abs(error) < 3 * found.std[name] for name, error in errors.items())
    assert found.scatter_px == pytest.approx(NOISE_PX, rel=0.1)
    assert found.film.shape is not None
    assert found.film.shape.factors[0] == pytest.approx(0.0075, abs=2e-4)
    assert found.film.shape.factors[2] == pytest.approx(0.00015, abs=1e-5)


@pytest.mark.slow
def test_a_dent_that_no_shape_says_leaves_the_film_where_it_is() -> None:
    rig = twisted(small_rig())
    samples = samples_of(rig, NOISE_PX)
    rows, columns = np.divmod(samples.pixel, rig.camera.width_px)
    across, down = columns / rig.camera.width_px - 0.6, rows / rig.camera.height_px - 0.4
    dent = np.exp(-(across**2 + down**2) / 0.03) * samples.order
    found = fit_film(mounted(rig), replace(samples, column_px=samples.column_px + dent), Film(), shaped=True)
    assert found.scatter_px > 3 * NOISE_PX
    # No shape says it, so that errors are a few deviations, and not tens of them.
    errors = {name: getattr(found.film, name) - getattr(rig.film, name) for name in FIELDS}
    assert all(abs(error) < 5 * found.std[name] for name, error in errors.items())
    assert abs(errors["tilt_x_deg"]) < 1.5


@pytest.mark.slow
def test_the_shape_of_a_film_does_not_explain_a_wrong_filter() -> None:
    rig = small_rig()
    samples = samples_of(rig, NOISE_PX)
    wrong = samples.filter == 1
    shifted = replace(samples, column_px=samples.column_px + 2.0 * samples.order * wrong)
    found = fit_film(mounted(rig), shifted, Film(), shaped=True)
    left = shifted.column_px - grating_columns(rig.model_copy(update={"film": found.film}), shifted)
    assert np.median(left[wrong] * samples.order[wrong]) > 1.0


def test_a_film_is_as_steep_as_its_shape_in_the_corner_of_the_frame() -> None:
    rig = small_rig()
    form = FilmForm.of(rig.projector, rig.film, shaped=True)
    side, top = form.half_mm
    assert (side, top) == pytest.approx((28.2 * 320 / 983, 28.2 * 180 / 983), rel=1e-3)
    for i, (across, along) in enumerate(SHAPE_POWERS):
        factors = tuple(np.eye(len(SHAPE_POWERS))[i] * form.std[i])
        film = rig.film.model_copy(update={"shape": FilmShape(factors=factors)})
        assert form.steepest(film) == pytest.approx(SLOPE_STD)
        power = side**across * top**along
        assert max(across / side, along / top) * power * form.std[i] == pytest.approx(SLOPE_STD)
    assert form.steepest(rig.film) == 0.0
    assert len(FilmForm.of(rig.projector, rig.film, shaped=False).std) == 0


def test_filters_that_shift_nothing_have_no_index() -> None:
    found = fit_film(mounted(small_rig()), samples_of(small_rig(), NOISE_PX), Film(), angled=True)
    assert not found.angle.is_of_filters
    assert found.angle.index is None


@pytest.mark.parametrize(("index", "is_of_filters"), [(1.9, True), (1.25, False), (5.9, False)])
def test_a_shift_that_no_filter_has_is_not_taken_for_one(index: float, is_of_filters: bool) -> None:
    """An S-bent film shifts colours over the picture as a filter of index 5.9 would."""
    angle = FilterAngle((index**-2, 0.0, 0.0), (0.001, 0.001, 0.001))
    assert angle.is_of_filters is is_of_filters
    assert (angle.index is not None) is is_of_filters


def test_a_film_that_cannot_be_mounted_is_refused_with_what_was_found_and_wanted() -> None:
    require_plausible(Film(tilt_x_deg=4.0, lines_per_mm=510.0, bend_per_mm=0.02), Film())
    film = Film(tilt_x_deg=56.0, distance_mm=60.0)
    with pytest.raises(
        CalibrationError, match=r"tilt about x 56°, mounted at 0°, plausible within ± 10°"
    ) as told:
        require_plausible(film, Film())
    assert "distance from the projector 60 mm" in str(told.value)
    assert "roll" not in str(told.value)


def test_too_few_samples_are_refused() -> None:
    samples = samples_of(small_rig(), NOISE_PX)
    with pytest.raises(CalibrationError, match="found in only 50 tiles"):
        fit_film(small_rig(), samples.only(np.arange(len(samples)) < 50), Film())


def test_filters_are_askew_beyond_doubt_or_not_at_all() -> None:
    askew = FilterAngle((0.25, 0.0, 0.0), (0.25 / (1.01 * SIGNIFICANT), 0.1, 0.1))
    assert askew.is_of_filters
    assert askew.index == pytest.approx((2.0, 0.5 * 8 * askew.std[0]))
    doubtful = FilterAngle((0.25, 9.0, 9.0), (0.25 / (0.99 * SIGNIFICANT), 0.1, 0.1))
    assert not doubtful.is_of_filters
    assert doubtful.index is None
    assert not FilterAngle().is_of_filters


@pytest.mark.parametrize(
    ("name", "off"), list(zip(FIELDS, (10.0, 10.0, 10.0, 0.05, 50.0, 20.0), strict=True))
)
@pytest.mark.parametrize("sign", [1, -1])
def test_a_film_is_plausible_within_degrees_centimetres_and_percents(
    name: str, off: float, sign: int
) -> None:
    mounting = Film(distance_mm=40.0)
    at = getattr(mounting, name)
    require_plausible(mounting.model_copy(update={name: at + 0.99 * sign * off}), mounting)
    with pytest.raises(CalibrationError, match="none that can be mounted"):
        require_plausible(mounting.model_copy(update={name: at + 1.01 * sign * off}), mounting)


@pytest.mark.parametrize("name", ["lines_per_mm", "distance_mm"])
def test_a_film_of_no_lines_or_behind_the_projector_is_no_answer(name: str) -> None:
    """No rounds at all leave the film that the fit began with."""
    rig = mounted(small_rig())
    gone = rig.model_copy(update={"film": rig.film.model_copy(update={name: -1e-3})})
    with pytest.raises(CalibrationError, match="did not converge"):
        fit_film(gone, samples_of(small_rig(), NOISE_PX), Film(), rounds=0)


def test_filters_that_shift_nothing_do_so_beyond_doubt() -> None:
    assert FilterAngle() == FilterAngle((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def test_samples_of_a_filter_and_order_have_an_offset_and_two_ramps_in_common() -> None:
    rig, samples = small_rig(), samples_of(small_rig(), 0.0)
    found = _common_offsets(rig, samples) / COMMON_PX
    groups = sorted(set(zip(samples.filter.tolist(), samples.order.tolist(), strict=True)))
    assert found.shape == (len(samples), 3 * len(groups))
    rows, columns = np.divmod(samples.pixel, rig.camera.width_px)
    for number, (name, order) in enumerate(groups):
        mine = (samples.filter == name) & (samples.order == order)
        own = found[:, 3 * number : 3 * number + 3]
        assert not own[~mine].any()
        assert own[mine, 0] == pytest.approx(1.0)
        assert own[mine, 1] == pytest.approx(3**0.5 * (columns[mine] / (rig.camera.width_px / 2) - 1))
        assert own[mine, 2] == pytest.approx(3**0.5 * (rows[mine] / (rig.camera.height_px / 2) - 1))


def test_what_the_geometry_leaves_open_adds_to_the_deviations_of_the_film() -> None:
    rig, samples = small_rig(), samples_of(small_rig(), NOISE_PX)
    fit = fit_film(mounted(rig), samples, Film())
    planes = tuple(Plane(np.array([0.0, 0.0, 1 / depth])) for depth in DEPTHS_MM)
    same = with_geometry(fit, rig, samples, [(rig, planes)])
    assert same.covariance == pytest.approx(fit.covariance, rel=1e-6)
    nearer = tuple(Plane(plane.inverse * (1 + 1e-3)) for plane in planes)
    here, there = (
        grating_columns(rig.model_copy(update={"film": fit.film}), replace(samples, depth_mm=depth_mm))
        for depth_mm in (samples.depth_mm, samples.depth_mm / (1 + 1e-3))
    )
    moved = fit.gain @ (here - there)
    assert np.abs(moved).max() > 0
    found = with_geometry(fit, rig, samples, [(rig, nearer), (rig, nearer)])
    added = found.covariance - fit.covariance
    assert added == pytest.approx(2 * np.outer(moved, moved), rel=1e-3, abs=1e-3 * np.abs(added).max())
    assert found.film == fit.film
