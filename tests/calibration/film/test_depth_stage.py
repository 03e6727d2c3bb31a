"""The film follows from lines on known planes, and a capture that does not fit is named."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from dsl_core.calibration.film.depth_stage import StageData, StageFilter, fit_first_orders
from dsl_core.calibration.film.fit import grating_columns
from dsl_core.calibration.film.order_paths import LineFrames
from dsl_core.errors import CalibrationError
from dsl_core.model.rig import Film
from dsl_core.optics.filters import nominal_filter
from dsl_core.progress import NoProgress
from tests.cases.order_lines import SIZE, TRUE_FILM, line_frames, plane_at, rig_with

DEPTHS_MM, FILTERS_NM = (600.0, 850.0), (480.0, 540.0, 620.0)
PLANES = [plane_at(depth) for depth in DEPTHS_MM]
TRUTH = rig_with(TRUE_FILM)


def stage_data(wrong: dict[tuple[int, int], float | None] | None = None) -> StageData:
    """Lines at two positions through three filters; ``wrong`` captures have another filter, or no light."""

    def frames(position: int, number: int) -> LineFrames:
        really = (wrong or {}).get((position, number), FILTERS_NM[number])
        if really is not None:
            return captured(position, number, really)
        lit = captured(position, number, FILTERS_NM[number])
        noise = 0.01 * np.random.default_rng(0).standard_normal(lit.radiance.shape)
        return replace(lit, radiance=noise.astype(np.float32))

    filters = tuple(StageFilter(nm, nominal_filter(nm), True) for nm in FILTERS_NM)
    return StageData(DEPTHS_MM, 0.01, (), filters, frames, 6)


@cache
def captured(position: int, number: int, really_nm: float) -> LineFrames:
    """The lines of one capture, made once for all tests."""
    return line_frames(TRUTH, PLANES[position], FILTERS_NM[number], 10 * position + number, really_nm, skip=2)


def test_the_film_is_found_from_its_data_sheet() -> None:
    fit, samples = fit_first_orders(rig_with(Film()), PLANES, stage_data(), NoProgress())
    assert set(zip(samples.position.tolist(), samples.filter.tolist(), strict=True)) == set(np.ndindex(2, 3))
    off = grating_columns(rig_with(fit.film), samples) - grating_columns(TRUTH, samples)
    before = grating_columns(rig_with(Film()), samples) - grating_columns(TRUTH, samples)
    assert np.sqrt(np.mean(before**2)) > 1.0
    assert np.sqrt(np.mean(off**2)) < 0.03
    assert fit.film.lines_per_mm == pytest.approx(TRUE_FILM.lines_per_mm, abs=5 * fit.std["lines_per_mm"])
    assert (samples.pixel < SIZE[0] * SIZE[1]).all()


def test_a_wrong_filter_is_named_with_its_wavelength() -> None:
    with pytest.raises(CalibrationError, match=r"850 mm, filter of 540 nm.*about \+1\d"):
        fit_first_orders(rig_with(Film()), PLANES, stage_data({(1, 1): 555.0}), NoProgress())


def test_a_capture_without_first_orders_is_named() -> None:
    with pytest.raises(CalibrationError, match="600 mm, filter of 620 nm: no first orders were found"):
        fit_first_orders(rig_with(Film()), PLANES, stage_data({(0, 2): None}), NoProgress())
