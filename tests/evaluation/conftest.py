"""A small result with errors that are known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
import xarray as xr

from dsl_core.evaluation.summary import Truth
from dsl_core.model.result import Flag, build_result

GRID = np.arange(430.0, 661.0, 5.0)
ROWS, COLUMNS = 40, 80


@dataclass(frozen=True)
class Known:
    """A result and its truth: two materials side by side, a shadow in the last ten columns."""

    result: xr.Dataset
    truth: Truth


@pytest.fixture
def known() -> Known:
    random = np.random.default_rng(7)
    ramp = 0.2 + 0.6 * (GRID - 430) / 230
    narrow = 0.8 / (1 + (2 * np.abs(GRID - 550) / 10) ** 6)
    material = np.zeros((ROWS, COLUMNS), np.int32)
    material[:, 40:] = 1
    material[:4] = -1
    spectra = np.stack([ramp, narrow])
    lit = np.ones((ROWS, COLUMNS), bool)
    lit[:, 70:] = False
    depth = 700.0 + np.zeros((ROWS, COLUMNS))
    depth[:4] = np.nan
    cube = spectra[np.maximum(material, 0)].transpose(2, 0, 1) * np.where(material == 0, 0.9, 1.0)
    measured = cube + random.normal(0, 0.01, cube.shape)
    dark = ~lit | (material < 0)
    measured[:, dark] = np.nan
    share = np.ones(cube.shape)
    # Where the prior decides, the answer is far off and says it is exact.
    share[:5], measured[:5] = 0.1, measured[:5] + np.where(material == 1, 0.3, 0.0)
    found = depth + 0.25 + random.normal(0, 0.5, depth.shape)
    found[dark] = np.nan
    arrays = {
        "depth_mm": found,
        "depth_std_mm": np.where(dark, np.nan, 0.5),
        "reflectance": measured,
        "reflectance_std": np.full(cube.shape, 0.01),
        "data_share": share,
        "rgb": np.where(dark, np.nan, np.array([0.2, 0.5, 1.0])[:, None, None]),
        "flags": np.where(dark, int(Flag.NO_LIGHT), 0)
        | np.where(material == 1, int(Flag.BANDS_UNREACHED), 0),
    }
    result = build_result(arrays, GRID, {})
    return Known(result, Truth(depth, lit, material, ("ramp", "filter"), spectra))
