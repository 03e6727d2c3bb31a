"""The line spread from lines at many sub-pixel places."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from dsl_core.model.projector.line_spread import LineSpread
from dsl_core.model.projector.spread_field import SpreadField
from dsl_core.model.rig import ProjectorResponse
from dsl_core.optics.spread import fit
from dsl_core.optics.spread.curves import density
from dsl_core.optics.spread.equations import MIN_PIXELS, Normal
from dsl_core.optics.spread.field import FieldFamily, FieldFit
from dsl_core.optics.spread.fit import PULLS, STRETCHES, SpreadFit, _choose, _Family, _is_astray, fit_spread
from tests.cases.line_peaks import RUN, seen

PLACES = np.arange(-48, 49) / 8
KNOWN = ProjectorResponse(blur_px=0.6, halo_peak_per_px=6e-4, halo_decay_px=31.0)


def shape(values: np.ndarray) -> ProjectorResponse:
    return KNOWN.with_spread(LineSpread.of(values, 0.125))


TAILED = shape(np.exp(-2 * PLACES**2 / 0.5**2) + 0.04 * np.exp(-0.5 * (PLACES / 1.5) ** 2))
SQUARE = shape((np.abs(PLACES) < 1.0).astype(float))
SKEWED = shape(np.exp(-0.5 * (PLACES / np.where(PLACES < 0, 0.35, 0.85)) ** 2))


def off(found: ProjectorResponse, true: ProjectorResponse) -> float:
    """Share of the light of a line that falls elsewhere."""
    places = np.arange(-8, 8, 0.01)
    curves = [density(response.line_spread, places) for response in (found, true)]
    return 0.5 * float(np.abs(curves[0] - curves[1]).sum()) * 0.01


def test_the_known_spread_stays_where_it_is_the_true_one() -> None:
    peaks, column = seen(KNOWN)
    found = fit_spread(peaks, column.round(), KNOWN)
    assert found is not None
    assert not found.changed
    assert found.response is KNOWN
    measured = fit_spread(*seen(TAILED), TAILED)
    assert measured is not None
    assert measured.response is TAILED


def coarser(values: np.ndarray) -> ProjectorResponse:
    return KNOWN.with_spread(LineSpread.of(values, 0.25))


#: Curves that other programs might store: on a coarser grid, and reaching farther than lines tell.
OTHERS = (
    coarser(np.exp(-0.5 * ((np.arange(-16, 17) / 4) / 0.5) ** 2)),
    coarser((1 + ((np.arange(-80, 81) / 4) / 0.8) ** 2) ** -1.5),
)


@pytest.mark.parametrize("known", OTHERS, ids=["coarse", "far"])
def test_a_measured_spread_of_any_grid_and_reach_stays_where_it_is_the_true_one(
    known: ProjectorResponse,
) -> None:
    peaks, column = seen(known)
    found = fit_spread(peaks, column.round(), known)
    assert found is not None
    assert not found.changed
    assert found.after < 1.2


def test_light_farther_out_than_lines_tell_is_kept_while_the_rest_is_stretched() -> None:
    known, family = OTHERS[1].spread, _Family(OTHERS[1])
    assert family.fixed is not None
    found = family.response(1.1).spread
    assert found is not None
    assert known is not None

    def light(spread: LineSpread, low_px: float, high_px: float) -> float:
        places = np.arange(low_px, high_px, 0.01)
        return float((density(spread, places) + density(spread, -places)).sum()) * 0.01

    assert light(known, 7, 30) > 0.003
    assert light(found, 7, 30) == pytest.approx(light(known, 7, 30), rel=0.02)
    assert light(found, 0, 1) < 0.98 * light(known, 0, 1)


@pytest.mark.parametrize("blur_px", [0.5, 0.63, 0.8])
def test_another_blur_is_found_to_its_deviation_and_stays_a_gaussian(blur_px: float) -> None:
    peaks, column = seen(KNOWN.with_gaussian(blur_px))
    found = fit_spread(peaks, column.round(), KNOWN)
    assert found is not None
    assert found.changed
    assert found.response.spread is None
    assert 0 < found.rms_std_px < 0.003
    assert abs(found.response.blur_px - blur_px) < 4 * found.rms_std_px + 1e-3
    assert found.after < 1.2 < found.before


def test_a_curve_that_is_not_found_in_time_leaves_the_simpler_one(monkeypatch: pytest.MonkeyPatch) -> None:
    def never(*_: object, maxiter: int) -> None:
        raise RuntimeError(f"not found in {maxiter} steps")

    monkeypatch.setattr(fit, "nnls", never)
    peaks, column = seen(TAILED)
    found = fit_spread(peaks, column.round(), KNOWN.with_gaussian(TAILED.blur_px))
    assert found is not None
    assert found.response.spread is None


def test_lines_side_by_side_of_a_camera_with_a_gamma_do_not_make_a_spread_that_no_lens_has() -> None:
    """Values to the power 1.03: dim flanks read less, as if lines were far sharper than they are."""
    peaks, column = seen(KNOWN, step_px=5, noise=2e-4, beside=1, pitch_px=(4.0, 6.0))
    peaks = replace(peaks, y=peaks.y.clip(1e-9) ** 1.03)
    found = fit_spread(peaks, column.round(), KNOWN)
    assert found is not None
    assert found.response is KNOWN
    assert 0 < found.rms_std_px <= KNOWN.blur_px


@pytest.mark.parametrize("true", [TAILED, SQUARE, SKEWED])
def test_any_shape_is_found(true: ProjectorResponse) -> None:
    peaks, column = seen(true)
    known = KNOWN.with_gaussian(true.blur_px)
    found = fit_spread(peaks, column.round(), known)
    assert found is not None
    assert found.response.spread is not None
    assert off(found.response, true) < 0.35 * off(known, true)
    assert off(found.response, true) < 0.06
    assert found.after < 1.2
    assert found.response.blur_px == pytest.approx(true.blur_px, rel=0.05)


@pytest.mark.slow
def test_a_skirt_is_found_where_lines_lie_side_by_side_and_pixels_far_apart() -> None:
    # Three lines a pixel, whose column and amplitude are its own: a free shape goes astray with columns.
    core, skirt = (np.exp(-0.5 * (PLACES / width) ** 2) / width for width in (0.6, 1.8))
    true = shape(0.87 * core + 0.13 * skirt)
    peaks, column = seen(true, runs=120, noise=4e-4, step_px=5, beside=1, pitch_px=(4.5, 6.5))
    found = fit_spread(peaks, column.round(), KNOWN)
    assert found is not None
    assert found.changed
    assert off(found.response, true) < 0.02
    assert found.after < 1.2 < found.before
    # A wider Gaussian explains its own lines and gets no skirt.
    peaks, column = seen(
        KNOWN.with_gaussian(0.8), runs=120, noise=4e-4, step_px=5, beside=1, pitch_px=(4.5, 6.5)
    )
    wider = fit_spread(peaks, column.round(), KNOWN)
    assert wider is not None
    assert wider.response.spread is None


def test_pixels_with_a_second_light_do_not_count() -> None:
    peaks, column = seen(KNOWN)
    peaks.y[6:, ::5] += 0.3
    found = fit_spread(peaks, column.round(), KNOWN)
    assert found is not None
    assert off(found.response, KNOWN) < 0.01


def test_too_few_pixels_give_no_answer() -> None:
    peaks, column = seen(KNOWN, runs=MIN_PIXELS // RUN - 1)
    assert fit_spread(peaks, column.round(), KNOWN) is None


@pytest.mark.parametrize("factor", [0.8, 1.0, 1.3])
def test_a_family_is_the_known_curve_with_all_its_distances_stretched(factor: float) -> None:
    family = _Family(SKEWED)
    known = SKEWED.line_spread
    assert isinstance(known, LineSpread)
    shares = family.stretched(factor)
    assert shares.sum() == pytest.approx(1.0)
    assert family.centres_px @ shares == pytest.approx(factor * known.lean_px)
    spread = (family.centres_px**2 @ shares) ** 0.5
    assert spread == pytest.approx(factor * (known.centres_px**2 @ known.shares) ** 0.5, rel=8e-3)
    assert family.response(factor).blur_px == pytest.approx(factor * SKEWED.blur_px, rel=0.02)
    # A Gaussian stays one; the narrow ones that it consists of have a width of their own.
    own = _Family(KNOWN)
    width = (own.centres_px**2 @ own.stretched(factor)) ** 0.5
    assert width == pytest.approx(((factor * 0.6) ** 2 - 0.125**2) ** 0.5, rel=1e-6)
    assert own.response(factor).blur_px == pytest.approx(factor * 0.6)
    assert own.response(factor).spread is None
    assert np.diff(own.centres_px) == pytest.approx(0.125)
    assert (own.centres_px[0], own.centres_px[-1]) == (-6.0, 6.0)


def quadratic(best: float, count: int = 1000) -> Normal:
    """Squares of a thousand values that grow as the square of the distance from a stretched curve."""
    wanted = _Family(KNOWN).stretched(best)
    size = 1e5 * np.eye(len(wanted))
    return Normal(size, size @ wanted, float(wanted @ size @ wanted) + count, count, 500)


def test_the_best_factor_is_the_least_of_squares_and_as_sure_as_they_are_narrow() -> None:
    family = _Family(KNOWN)
    for factor in (0.55, 1.0, 1.37):
        assert family.best(quadratic(factor)) == pytest.approx(factor, abs=4e-4)
    normal = quadratic(1.1)
    costs = [normal.cost(family.stretched(1.1 * by)) for by in (0.98, 1.0, 1.02)]
    curvature = (costs[0] + costs[2] - 2 * costs[1]) / 0.02**2
    assert family.std(normal, 1.1, 1.7) == pytest.approx((2 * 1.7 / curvature) ** 0.5)


def test_half_of_the_pixels_judges_what_the_other_half_asks_for() -> None:
    family = _Family(KNOWN)
    same = _choose([quadratic(1.0), quadratic(1.0)], family, shapes=False)
    assert not same.changed
    assert same.before == same.after == pytest.approx(1.0)
    assert same.pixels == 1000
    wider = _choose([quadratic(1.2), quadratic(1.2)], family, shapes=False)
    assert wider.changed
    assert wider.response.blur_px == pytest.approx(0.72, rel=1e-3)
    assert wider.after == pytest.approx(1.0, rel=1e-3)
    cost = 2 * quadratic(1.2).cost(family.stretched(1.0))
    assert wider.before == pytest.approx(cost / 2000)
    # Halves that contradict each other ask for nothing.
    assert not _choose([quadratic(1.2), quadratic(0.83)], family, shapes=False).changed


@pytest.mark.parametrize(
    ("pixels", "wider", "counts"), [(990, 1.0, True), (970, 1.0, False), (990, 1.5, False)]
)
def test_a_field_that_leaves_pixels_out_or_more_of_their_lines_explains_nothing(
    pixels: int, wider: float, counts: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    peaks, column = seen(KNOWN, runs=40)
    width = torch.full_like(column, wider)
    field = SpreadField(centre_px=(300.0, 100.0), half_px=(300.0, 100.0), coefficients=(0.0,) * 6)
    fields = iter([FieldFit(field, np.eye(6), width, 0.01)] * 2)
    curves = iter(
        [SpreadFit(KNOWN, False, 0.01, 1.0, after, n, None) for after, n in ((1, 1000), (0.8, pixels))]
    )
    matter = iter([True, False])
    monkeypatch.setattr(fit, "_fit_curve", lambda view, family: next(curves))
    monkeypatch.setattr(FieldFamily, "fit", lambda *given: next(fields))
    monkeypatch.setattr(FieldFit, "matters", lambda *given: next(matter))
    found = fit.fit_spread(peaks, column, KNOWN, torch.stack([column, column]))
    assert found is not None
    assert (found.field is not None) == found.changed == counts
    assert found.pixels == (pixels if counts else 1000)


@pytest.mark.parametrize(("step_px", "counts"), [(2, True), (5, False)])
def test_another_blur_that_columns_make_up_for_is_not_taken(
    step_px: int, counts: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Lines of five columns in steps of five show no blur: its search ends anywhere."""
    narrow = KNOWN.with_gaussian(0.45)
    peaks, column = seen(narrow, runs=100, step_px=step_px)
    found = SpreadFit(narrow, True, 0.01, 9.0, 1.0, 800)
    monkeypatch.setattr(fit, "_search", lambda view, family: found)
    taken = fit.fit_spread(peaks, column.round(), KNOWN)
    assert taken is not None
    assert (taken is found) == counts
    if not counts:
        assert (taken.response, taken.changed) == (KNOWN, False)
        # In the measure of the other one: even the true blur explains such lines no better.
        assert taken.before == taken.after == pytest.approx(found.after, rel=0.1)


@pytest.mark.parametrize(("pixels", "counts"), [(990, True), (970, False)])
def test_a_shape_that_leaves_pixels_out_explains_nothing(
    pixels: int, counts: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    peaks, column = seen(TAILED, runs=40)
    one = SpreadFit(KNOWN, False, 0.01, 1.0, 1.0, 1000)
    other = SpreadFit(TAILED, True, 0.01, 1.0, 0.8, 1000)
    last = replace(other, pixels=pixels)
    chosen = iter([one, one, other, *[last] * fit.ROUNDS])
    monkeypatch.setattr(fit, "_choose", lambda halves, family, shapes: next(chosen))
    monkeypatch.setattr(fit, "_skirted", lambda view, family, found: found)
    found = fit.fit_spread(peaks, column, KNOWN)
    assert found is (last if counts else one)


def test_a_shape_that_has_once_gone_astray_is_not_taken_when_it_comes_back(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    peaks, column = seen(KNOWN, runs=40)
    one = SpreadFit(KNOWN, False, 0.01, 1.0, 1.0, 1000)
    other = SpreadFit(TAILED, True, 0.01, 1.0, 0.8, 1000)
    astray = replace(other, after=1.01 * fit.WORSE * other.after)
    chosen = iter([one, one, other, astray, *[other] * fit.ROUNDS])
    monkeypatch.setattr(fit, "_choose", lambda halves, family, shapes: next(chosen))
    assert fit.fit_spread(peaks, column, KNOWN) is one


def test_pulls_are_decades_and_stretches_reach_from_two_fifths_to_their_inverse() -> None:
    assert np.log10(PULLS).tolist() == pytest.approx([-7, -6, -5, -4, -3, -2, -1])
    assert (STRETCHES[0], STRETCHES[-1]) == pytest.approx((0.4, 2.5))
    assert STRETCHES[len(STRETCHES) // 2] == pytest.approx(1.0)
    assert np.diff(np.log(STRETCHES)) == pytest.approx(np.log(6.25) / 24)


def test_a_known_curve_narrower_than_a_step_stays_half_a_step_wide() -> None:
    # (0.5 * 0.1)^2 less the own width of a step is below nothing; a neighbour is two such widths away.
    shares = _Family(KNOWN.with_gaussian(0.1)).stretched(0.5)
    middle = len(shares) // 2
    assert shares[middle + 1] / shares[middle] == pytest.approx(np.exp(-2))


@pytest.mark.parametrize(
    ("first", "after", "simple", "astray"),
    [
        (0.5, 0.59, 0.9, False),  # by less than a fifth
        (0.5, 0.61, 0.9, True),
        (0.5, 0.61, 5.0, False),  # little of what it explains better
        (0.26, 0.32, 11.0, False),
        (0.26, 0.9, 11.0, True),
    ],
)
def test_a_shape_has_gone_astray_when_it_loses_what_it_promised(
    first: float, after: float, simple: float, astray: bool
) -> None:
    def fitted(chi_square: float) -> SpreadFit:
        return SpreadFit(ProjectorResponse(), True, 0.01, 20.0, chi_square, 1000)

    assert _is_astray(fitted(after), fitted(first), fitted(simple)) is astray
