"""A measured line spread: its zero, width and blur."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError

from dsl_core.model.projector.line_spread import LineSpread, zero_std_px
from dsl_core.model.rig import ProjectorResponse

STEP_PX = 0.125
PLACES = np.arange(-48, 49) * STEP_PX


def gaussian(width_px: float, middle_px: float = 0.0) -> LineSpread:
    return LineSpread.of(np.exp(-0.5 * ((PLACES - middle_px) / width_px) ** 2), STEP_PX)


def test_a_curve_is_moved_until_half_of_its_light_is_on_either_side() -> None:
    centred = gaussian(0.5, middle_px=1.3)
    assert centred.centres_px @ centred.shares == pytest.approx(0, abs=1e-6)
    skewed = LineSpread.of(np.where(PLACES >= 0, np.exp(-PLACES / 0.6), 0.0), STEP_PX)
    # The mean of an exponential is farther along its tail than its median.
    assert skewed.lean_px == pytest.approx(0.6 * (1 - np.log(2)), abs=0.02)
    # As of a place that is anywhere between minus and plus the lean.
    assert zero_std_px(-skewed.lean_px) == pytest.approx(skewed.lean_px / np.sqrt(3))


def test_the_width_is_that_of_shares_and_core() -> None:
    assert gaussian(0.5).rms_px == pytest.approx(np.hypot(0.5, STEP_PX), rel=1e-3)
    assert gaussian(0.5).blurred(0.4).rms_px == pytest.approx(np.sqrt(0.25 + STEP_PX**2 + 0.16), rel=1e-3)


def test_shares_that_do_not_add_up_or_lie_beside_zero_are_rejected() -> None:
    with pytest.raises(ValidationError, match="add up to 1"):
        LineSpread(first_px=0.0, step_px=0.1, core_px=0.1, shares=(0.7,))
    with pytest.raises(ValidationError, match="add up to 1"):
        LineSpread(first_px=-0.1, step_px=0.1, core_px=0.1, shares=(-0.2, 1.4, -0.2))
    with pytest.raises(ValidationError, match="move first_px"):
        LineSpread(first_px=0.3, step_px=0.1, core_px=0.1, shares=(1.0,))


def test_a_response_keeps_width_and_curve_together() -> None:
    spread = gaussian(0.5)
    response = ProjectorResponse(blur_px=0.6).with_spread(spread)
    assert response.line_spread == spread
    assert response.blur_px == spread.rms_px
    assert response.blurred(0.4).blur_px == pytest.approx(spread.blurred(0.4).rms_px)
    assert response.with_gaussian(0.7).line_spread == 0.7
    wider = response.of_width(0.7)
    assert wider.blur_px == pytest.approx(0.7)
    assert wider.spread == spread.stretched(0.7 / spread.rms_px)
    assert ProjectorResponse(blur_px=0.6).of_width(0.7).line_spread == 0.7
    assert ProjectorResponse(blur_px=0.3).blurred(0.4).line_spread == pytest.approx(0.5)
    assert ProjectorResponse.model_validate_json(response.model_dump_json()) == response
    with pytest.raises(ValidationError, match="blur_px must be the rms width"):
        ProjectorResponse(blur_px=0.6, spread=spread)
