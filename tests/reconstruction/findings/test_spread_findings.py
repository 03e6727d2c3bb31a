"""What is said of the line spread."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from dsl_core.model.projector.spread_field import SpreadField
from dsl_core.model.rig import ProjectorResponse
from dsl_core.optics.spread.field import FieldFit
from dsl_core.optics.spread.fit import SpreadFit
from dsl_core.reconstruction.findings.spread_findings import spread_findings

KNOWN = ProjectorResponse(blur_px=0.6)


def said(coefficients: tuple[float, ...], std: float = 0.002) -> tuple[str, bool]:
    field = SpreadField(centre_px=(320.0, 180.0), half_px=(300.0, 170.0), coefficients=coefficients)
    covariance = np.diag(np.full(6, std**2))
    fit = FieldFit(field, covariance, torch.ones(1), 0.0)
    response = KNOWN.model_copy(update={"field": field})
    found = SpreadFit(response, True, 0.001, 2.0, 1.0, 4000, fit)
    curve, wide = spread_findings(KNOWN, found)
    assert not curve.significant
    assert wide.part == "profile"
    return wide.sentence, wide.significant


@pytest.mark.parametrize(
    ("coefficients", "words"),
    [
        ((0.0, 0.0, 0.0, 0.1, 0.0, 0.1), "22.1 ± 0.3 % in the corners {} in the middle"),
        ((0.0, 0.0, 0.0, -0.1, 0.0, -0.1), "in the middle {} in the corners"),
        ((0.0, 0.1, 0.02, 0.0, 0.0, 0.0), "on the right {} on the left"),
        ((0.0, 0.01, -0.1, 0.0, 0.0, 0.0), "at the top {} at the bottom"),
    ],
)  # fmt: skip
def test_the_sentence_names_where_lines_are_wider(coefficients: tuple[float, ...], words: str) -> None:
    sentence, significant = said(coefficients)
    assert words.format("of the measured part of the projector's frame than") in sentence
    assert "or surfaces there are translucent" in sentence
    assert significant


def test_small_and_uncertain_differences_do_not_matter() -> None:
    assert not said((0.0, 0.0, 0.0, 0.02, 0.0, 0.02))[1]
    assert not said((0.0, 0.1, 0.0, 0.0, 0.0, 0.0), std=0.1)[1]


def test_nothing_is_said_of_a_field_that_was_not_looked_at() -> None:
    found = SpreadFit(KNOWN, False, 0.001, 1.0, 1.0, 4000)
    assert [finding.name for finding in spread_findings(KNOWN, found)] == ["line spread"]


def test_what_the_camera_explains_is_not_the_projectors() -> None:
    found = SpreadFit(KNOWN.with_gaussian(1.0), True, 0.001, 2.0, 1.0, 4000)
    (alone,), (explained,), (half,) = (list(spread_findings(KNOWN, found, spot)) for spot in (0.0, 0.9, 0.5))
    assert alone.significant
    assert explained.value == pytest.approx(0, abs=1e-6)
    assert explained.value < half.value < alone.value
