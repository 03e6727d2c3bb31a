"""Factors of the chain are as unsure as frames and places make them, each told from the other."""

from __future__ import annotations

from functools import reduce
from operator import add

import numpy as np
import pytest

from dsl_core.calibration.light.chain_deviation import LeftOut, Part
from dsl_core.solve.smooth_functions import Equations, solve_given

#: Scans, and rows and columns of parts; deviation of what one part tells.
SCANS, ROWS, COLUMNS, STD = 6, 3, 8, 1e-4


def left_out(told: np.ndarray) -> LeftOut:
    """Of scans whose parts tell a factor (scans, rows, columns) in the second of two unknowns."""
    parts = []
    for (scan, row, column), value in np.ndenumerate(told):
        design = np.array([[1.0, 0.0], [0.0, 1.0]])
        equations = Equations.of(design, np.array([0.5, value]), np.array([1.0, STD]))
        parts.append(Part(scan, row, column, equations))
    total = reduce(add, (part.equations for part in parts))
    return LeftOut(solve_given(total, np.eye(2), 1.0), total, parts)


PRODUCT = np.array([[0.0, 1.0], [0.0, 2.0]])


def test_what_frames_have_in_common_is_an_error_of_the_mean_and_of_no_place() -> None:
    light = 0.02 * np.random.default_rng(1).standard_normal((SCANS, 1, COLUMNS))
    found = left_out(np.broadcast_to(light, (SCANS, ROWS, COLUMNS)))
    mean = light.var(ddof=1) / light.size
    assert found.variance_of_mean(PRODUCT) == pytest.approx([mean, 4 * mean], rel=0.05)
    assert found.variance_of_place(PRODUCT)[0] < 0.15 * light.var()


def test_what_places_differ_by_in_every_scan_is_told_of_places() -> None:
    rng = np.random.default_rng(2)
    place = 0.02 * rng.standard_normal((1, ROWS, COLUMNS))
    told = place + 0.005 * rng.standard_normal((SCANS, 1, COLUMNS))
    variance = left_out(told).variance_of_place(PRODUCT)
    assert variance == pytest.approx([place.var(), 4 * place.var()], rel=0.15)


def test_a_single_scan_tells_what_parts_differ_by_beyond_their_noise() -> None:
    place = 0.02 * np.random.default_rng(3).standard_normal((1, ROWS, COLUMNS))
    assert left_out(place).variance_of_place(PRODUCT)[0] == pytest.approx(place.var(), rel=0.1)
    noise = STD * np.random.default_rng(4).standard_normal((1, ROWS, COLUMNS))
    assert left_out(noise).variance_of_place(PRODUCT)[0] < 2 * STD**2
