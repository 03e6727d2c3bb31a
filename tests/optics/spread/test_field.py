"""A line spread that is wider in the corners of the projector's frame."""

from __future__ import annotations

import math

import pytest
import torch

from dsl_core.model.line_spread import stretched
from dsl_core.model.rig import ProjectorResponse
from dsl_core.model.spread_field import SpreadField
from dsl_core.optics.correspondence import zero_order
from dsl_core.optics.lines.profile import LineTable
from dsl_core.optics.spread.equations import Peaks
from dsl_core.optics.spread.field import RANGE, relative_width, widths_at
from dsl_core.optics.spread.fit import SpreadFit, fit_spread
from dsl_core.simulation.published_rig import published_rig
from tests.optics.spread.test_fit import KNOWN, RUN, SKEWED, STEP_PX, WIDTH_PX

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


def test_a_known_field_stands_until_lines_say_otherwise() -> None:
    known = KNOWN.model_copy(update={"field": FIELD})
    assert not fitted(known, KNOWN, FIELD).changed
    found = fitted(known, KNOWN, FLAT)
    assert found.field is not None
    assert width_error(found.response, KNOWN, FLAT) < 0.01


def test_a_width_beyond_the_measured_places_stays_and_where_there_is_no_place_it_is_the_usual_one() -> None:
    column = torch.tensor([620.0, 900.0, torch.nan, 320.0])
    row = torch.tensor([350.0, 5000.0, 10.0, 180.0])
    assert relative_width(FIELD, column, row).tolist() == pytest.approx(
        [math.exp(0.11), math.exp(0.11), 1.0, math.exp(-0.1)]
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
