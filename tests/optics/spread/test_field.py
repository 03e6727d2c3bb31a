"""A line spread that is wider in the corners of the projector's frame."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from dsl_core.model.projector.line_spread import stretched
from dsl_core.model.projector.spread_field import POWERS, SpreadField
from dsl_core.model.rig import ProjectorResponse
from dsl_core.optics.correspondence import zero_order
from dsl_core.optics.lines.profile import LineTable
from dsl_core.optics.spread.equations import Peaks, View, settle
from dsl_core.optics.spread.field import RANGE, FieldFamily, FieldFit, _single, relative_width, widths_at
from dsl_core.optics.spread.fit import SpreadFit, fit_spread
from dsl_core.simulation.published_rig import published_rig
from tests.cases.line_peaks import RUN, STEP_PX, WIDTH_PX
from tests.optics.spread.test_fit import KNOWN, SKEWED

#: 10 % wider in the corners than in the middle by curvature, and 6 % wider on the right than on the left.
FIELD = SpreadField(
    centre_px=(320.0, 180.0), half_px=(300.0, 170.0), coefficients=(-0.1, 0.03, 0.0, 0.08, 0.0, 0.1)
)
FLAT = FIELD.model_copy(update={"coefficients": (0.0,)})


def seen(response: ProjectorResponse, field: SpreadField) -> tuple[Peaks, torch.Tensor, torch.Tensor]:
    """Lines of pixels all over the frame, their columns, and their places (2, P)."""
    random = torch.Generator().manual_seed(5)

    def uniform(low: float, high: float) -> torch.Tensor:
        return low + (high - low) * torch.rand((120, 1), generator=random, dtype=torch.float64)

    column = (uniform(20, 600) + uniform(0.6, 0.9) * torch.arange(RUN)).ravel()
    row = uniform(10, 350).expand(-1, RUN).ravel()
    centres = (column / STEP_PX).round() * STEP_PX + STEP_PX * torch.arange(-4, 5)[:, None]
    widths = relative_width(field, column, row)
    light = LineTable(WIDTH_PX, response, 12.0, column, widths).at(column - centres)[0]
    noise = 2e-3 * torch.randn(light.shape, generator=random, dtype=torch.float64)
    peaks = Peaks(0.8 * light + noise, torch.full_like(light, 4e-6), centres, WIDTH_PX, STEP_PX, RUN)
    return peaks, column, torch.stack([column, row])


def fitted(start: ProjectorResponse, true: ProjectorResponse, field: SpreadField) -> SpreadFit:
    peaks, column, place = seen(true, field)
    found = fit_spread(peaks, column.round(), start, place)
    assert found is not None
    return found


def width_error(found: ProjectorResponse, true: ProjectorResponse, field: SpreadField) -> float:
    """Largest relative error of the rms width over the frame."""
    x, y = torch.meshgrid(torch.linspace(40, 600, 9), torch.linspace(20, 340, 9), indexing="xy")
    own = FLAT if found.field is None else found.field
    ratio = relative_width(own, x, y) / relative_width(field, x, y)
    return float((ratio * (found.blur_px / true.blur_px) - 1).abs().max())


@pytest.mark.parametrize("true", [KNOWN.with_gaussian(0.7), SKEWED])
def test_widths_are_found_all_over_the_frame_and_with_their_deviation(true: ProjectorResponse) -> None:
    found = fitted(KNOWN, true, FIELD)
    assert found.field is not None
    assert width_error(found.response, true, FIELD) < 0.02
    assert found.after < 1.2
    own = found.field.field
    right, std = found.field.contrast(((1, 1),), ((0, 0),))
    ends = torch.tensor([own.centre_px[0], own.centre_px[0] + own.half_px[0]])
    rows = torch.tensor([own.centre_px[1], own.centre_px[1] + own.half_px[1]])
    exact = relative_width(FIELD, ends, rows).log()
    assert 0.001 < std < 0.01
    assert abs(right - float(exact[1] - exact[0])) < 3 * std + 0.002
    # A change of the blur that all pixels share stays one: the shape is the known one.
    assert (found.response.spread is None) == (true.spread is None)


def test_one_width_for_all_stays_one() -> None:
    found = fitted(KNOWN, KNOWN, FLAT)
    assert not found.changed
    assert found.field is None
    assert found.response is KNOWN
    assert fitted(KNOWN, SKEWED, FLAT).field is None


def test_lines_side_by_side_say_nothing_of_widths() -> None:
    """A pixel that sees two such lines has amplitude and column to explain both, whatever the width."""
    random = torch.Generator().manual_seed(6)

    def drawn(low: float, high: float, each: int = 1) -> torch.Tensor:
        return low + (high - low) * torch.rand((160, each), generator=random, dtype=torch.float64)

    column = (drawn(60, 560) + torch.arange(RUN) * drawn(3.5, 4.5)).ravel()
    row = drawn(10, 350).expand(-1, RUN).ravel()
    centres = (column / WIDTH_PX).round() * WIDTH_PX + WIDTH_PX * torch.arange(-1, 2)[:, None]
    distance = column - centres
    light = LineTable(WIDTH_PX, KNOWN, 12.0, column, None).at(distance)[0]
    std = 0.01 * light + 6e-5
    y = light + std * torch.randn(light.shape, generator=random, dtype=torch.float64)
    peaks = Peaks(y, std**2, centres, WIDTH_PX, WIDTH_PX, RUN)
    view = View(peaks, column.round(), column.round(), y.amax(0))
    found = FieldFamily(torch.stack([column, row])).fit(view, KNOWN)
    assert found is not None
    assert found.std > 0.1
    assert not found.matters()


def test_a_known_field_stands_until_lines_say_otherwise() -> None:
    known = KNOWN.model_copy(update={"field": FIELD})
    assert not fitted(known, KNOWN, FIELD).changed
    found = fitted(known, KNOWN, FLAT)
    assert found.field is not None
    assert width_error(found.response, KNOWN, FLAT) < 0.01


def test_a_width_beyond_the_measured_places_stays_and_where_there_is_no_place_it_is_the_usual_one() -> None:
    column = torch.tensor([620.0, 900.0, torch.nan, 320.0, 20.0, -900.0])
    row = torch.tensor([350.0, 5000.0, 10.0, 180.0, 10.0, -900.0])
    right, left = math.exp(0.11), math.exp(0.05)
    assert relative_width(FIELD, column, row).tolist() == pytest.approx(
        [right, right, 1.0, math.exp(-0.1), left, left]
    )
    steep = FIELD.model_copy(update={"coefficients": (5.0,)})
    assert relative_width(steep, column, row).amax() == RANGE[1]


def test_widths_at_pixels_are_those_of_their_places_on_the_projector() -> None:
    rig = published_rig()
    pixels, depth = torch.tensor([1000, 40000]), torch.tensor([750.0, 820.0], dtype=torch.float64)
    column, row = zero_order(rig, pixels, depth)
    assert widths_at(rig, pixels, column) is None
    response = rig.projector_response.model_copy(update={"field": FIELD})
    found = widths_at(rig.model_copy(update={"projector_response": response}), pixels, column)
    assert found is not None
    assert found.tolist() == pytest.approx(relative_width(FIELD, column, row).tolist(), rel=1e-6)


@pytest.mark.parametrize("response", [SKEWED, SKEWED.with_gaussian(0.6)], ids=["measured", "Gaussian"])
def test_each_pixel_has_the_profile_of_its_own_width(response: ProjectorResponse) -> None:
    x = torch.linspace(-5, 5, 41, dtype=torch.float64)
    widths = torch.tensor([0.4, 1.0, 1.3003], dtype=torch.float64)
    together = LineTable(5, response, 6.0, x, widths).at(x[:, None].expand(-1, 3))
    for k, width in enumerate(widths.tolist()):
        own = stretched(response.line_spread, width)
        other = response.with_gaussian(own) if isinstance(own, float) else response.with_spread(own)
        profile, slope = LineTable(5, other, 6.0, x).at(x)
        assert (together[0][:, k] - profile).abs().max() < 1e-4
        assert (together[1][:, k] - slope).abs().max() < 2e-3


def small_fit(width: torch.Tensor, std: float = 0.0) -> FieldFit:
    return FieldFit(FIELD, np.diag([1.0, 4.0, 9.0, 16.0, 25.0, 36.0]), width, std)


def test_widths_matter_from_a_scatter_of_a_hundredth_and_four_deviations_on() -> None:
    sign = torch.tensor([1.0, -1.0] * 20, dtype=torch.float64)
    cases = ((0.0101, 0.0, True), (0.0099, 0.0, False), (0.041, 0.01, True), (0.039, 0.01, False))
    for scatter, std, matters in cases:
        wide = (0.3 + scatter * sign).exp()
        assert small_fit(wide, std).matters() == matters
        known = (0.2 * sign).exp()
        assert small_fit(wide * known, std).matters(known) == matters


def test_a_contrast_is_a_difference_of_means_and_as_sure_as_its_coefficients() -> None:
    # Powers in the order of the coefficients: what differs between two places counts, and no other.
    here, there = ((1, 1), (1, -1)), ((0, 0), (-1, 0))
    powers = np.array([[x**i * y**j for i, j in POWERS[:6]] for x, y in (*here, *there)])
    apart = powers[:2].mean(0) - powers[2:].mean(0)
    value, std = small_fit(torch.ones(1)).contrast(here, there)
    assert value == pytest.approx(apart @ np.array(FIELD.coefficients))
    assert std == pytest.approx(np.sqrt(apart**2 @ [1.0, 4.0, 9.0, 16.0, 25.0, 36.0]))


def test_a_family_spans_the_measured_places_without_their_outermost() -> None:
    rng = np.random.default_rng(3)
    place = torch.as_tensor(rng.uniform([[20], [50]], [[620], [310]], (2, 4001)))
    place[:, 7] = torch.nan
    family = FieldFamily(place)
    known = np.delete(place.numpy(), 7, 1)
    low, high = np.quantile(known, [0.002, 0.998], axis=1)
    assert family._centre.numpy() == pytest.approx((low + high) / 2)
    assert family._half.numpy() == pytest.approx((high - low) / 2)
    x, y = np.clip((place.numpy().T - (low + high) / 2) / ((high - low) / 2), -1, 1).T
    wanted = np.stack([np.nan_to_num(x) ** i * np.nan_to_num(y) ** j for i, j in POWERS[:6]], 1)
    assert family._shapes.numpy() == pytest.approx(wanted)
    assert {i + j for i, j in POWERS[:6]} == {0, 1, 2}
    assert FieldFamily(place * 1e-9)._half.tolist() == [1.0, 1.0]


def test_a_pixel_asks_for_the_width_it_has() -> None:
    peaks, column, _ = seen(KNOWN, FLAT)
    for wider in (0.02, -0.03):
        light = LineTable(WIDTH_PX, KNOWN, 12.0, column, torch.full_like(column, math.exp(wider)))
        exact = replace(peaks, y=0.8 * light.at(column - peaks.centres)[0])
        one = torch.ones_like(column)
        own, amplitude, _ = settle(exact, column, 0.8 * one, KNOWN, one)
        score, information = _single(View(exact, column, own, amplitude), own, amplitude, KNOWN, one)
        assert (score / information).median() == pytest.approx(wider, rel=0.08)
        assert (score / information).numpy() == pytest.approx(wider, abs=0.25 * abs(wider))


def test_pixels_that_see_something_else_hardly_bend_the_field() -> None:
    peaks, column, place = seen(KNOWN, FIELD)
    peaks.y[3, ::25] *= 0.7
    family = FieldFamily(place)
    found = family.fit(View(peaks, column, column.clone(), peaks.y.amax(0)), KNOWN)
    assert found is not None
    exact = relative_width(FIELD, *place)
    off = (found.width / exact).log()
    assert float((off - off.mean()).abs().max()) < 0.02
    assert found.std < 0.004


def test_a_fit_knows_its_deviation_before_it_has_settled(monkeypatch: pytest.MonkeyPatch) -> None:
    peaks, column, place = seen(KNOWN, FIELD)
    view = View(peaks, column, column.clone(), peaks.y.amax(0))
    settled = FieldFamily(place).fit(view, KNOWN)
    monkeypatch.setattr("dsl_core.optics.spread.field.STEPS", 1)
    first = FieldFamily(place).fit(view, KNOWN)
    assert settled is not None
    assert first is not None
    assert first.std == pytest.approx(settled.std, rel=0.25)


def test_what_a_pixel_asks_for_leaves_its_own_amplitude_and_column_free() -> None:
    """Against least squares of the residuals and of the change of width on profile and slope."""
    peaks, column, _ = seen(KNOWN, FLAT)
    peaks = peaks.of(torch.arange(5))
    column, amplitude = column[:5] + 0.05, torch.linspace(0.5, 1.0, 5, dtype=torch.float64)
    peaks.variance[0] = torch.inf
    view = View(peaks, column, column, amplitude)
    score, information = _single(view, column, amplitude, KNOWN, torch.ones_like(column))
    distance = column - peaks.centres
    for p in range(5):
        at = distance[:, [p]]
        g, slope = (
            each.numpy()[:, 0]
            for each in LineTable(WIDTH_PX, KNOWN, 15.0, column, torch.ones(1, dtype=torch.float64)).at(at)
        )
        wide, narrow = (
            LineTable(WIDTH_PX, KNOWN, 15.0, column, torch.full((1,), math.exp(by), dtype=torch.float64))
            .at(at)[0]
            .numpy()[:, 0]
            for by in (0.01, -0.01)
        )
        a = float(amplitude[p])
        root = 1 / np.sqrt(peaks.variance[:, p].numpy() + (0.0015 * a) ** 2)
        own = np.stack([g * root, slope * root], 1)
        change = a * (wide - narrow) / 0.02 * root
        residual = (peaks.y[:, p].numpy() - a * g) * root
        change, residual = (each - own @ np.linalg.lstsq(own, each)[0] for each in (change, residual))
        assert float(information[p]) == pytest.approx(change @ change, rel=1e-2)
        assert float(score[p]) == pytest.approx(change @ residual, rel=1e-2, abs=2e-3 * float(information[p]))
