"""Honest, boastful and shy uncertainties."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.errors import DecodeError
from dsl_core.evaluation.uncertainty import check_honesty

RANDOM = np.random.default_rng(4)
ERROR = RANDOM.normal(0, 1, (40, 5000)) * RANDOM.uniform(0.5, 2.0, (40, 1))
TRUTH = RANDOM.uniform(0, 1, (40, 1))
STD = np.abs(ERROR).mean(axis=1, keepdims=True) * np.sqrt(np.pi / 2)


def test_honest_deviations_cover_what_they_promise() -> None:
    found = check_honesty(TRUTH + ERROR, TRUTH, STD)
    assert found.coverage_95 == pytest.approx(0.95, abs=0.005)
    assert found.spread == pytest.approx(1.0, abs=0.01)
    for promised, observed in found.curve:
        assert observed == pytest.approx(promised, abs=0.01)
    assert found.count == ERROR.size
    assert found.share == 1.0


def test_deviations_of_half_the_size_are_found_out() -> None:
    found = check_honesty(TRUTH + ERROR, TRUTH, STD / 2)
    assert found.spread == pytest.approx(2.0, abs=0.02)
    assert found.coverage_95 == pytest.approx(0.673, abs=0.01)


def test_only_decided_and_finite_values_count() -> None:
    values = TRUTH + ERROR
    decided = np.zeros(values.shape, bool)
    decided[:10] = True
    values[10:] = 99.0
    values[0, :100] = np.nan
    found = check_honesty(values, TRUTH, STD, decided)
    assert found.coverage_95 == pytest.approx(0.95, abs=0.01)
    assert found.count == 10 * 5000 - 100
    assert found.share == pytest.approx(found.count / (40 * 5000 - 100))


def test_nothing_decided_is_an_error() -> None:
    with pytest.raises(DecodeError, match="data_share"):
        check_honesty(TRUTH + ERROR, TRUTH, STD, np.zeros(ERROR.shape, bool))
