"""Reflectance spectra of classic colour charts, from tables of the resources."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from dsl_core.optics.colour import read_columns

#: Rows and columns of the classic chart; its patches are named in reading order.
CHART_SHAPE = (4, 6)


_FILES = {"BabelColor Average": "babelcolor_average", "ISO 17321-1": "iso_17321_1"}


@cache
def _tables(name: str) -> dict[str, tuple[NDArray[np.float64], NDArray[np.float64]]]:
    return read_columns(f"colour/{_FILES[name]}.csv")


def chart_names() -> tuple[str, ...]:
    """Names of the tables that hold the classic 24 patches over 400 to 700 nm."""
    return tuple(_FILES)


def chart_reflectance(
    wavelengths_nm: NDArray[np.float64], name: str = "BabelColor Average"
) -> dict[str, NDArray[np.float64]]:
    """The 24 patches of a classic chart at the given wavelengths (nm), by name, in reading order.

    "BabelColor Average" (30 charts, 10 nm) and "ISO 17321-1" (5 nm) cover 400 to 700 nm; between samples
    the monotone cubic of Fritsch and Carlson adds no overshoot.
    """
    from scipy.interpolate import PchipInterpolator

    return {
        patch: np.clip(PchipInterpolator(nm, values)(wavelengths_nm), 0.0, 1.0)
        for patch, (nm, values) in _tables(name).items()
    }
