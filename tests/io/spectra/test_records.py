"""Wavelengths of a spectrum rise within what an instrument resolves, or the file is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dsl_core.errors import CalibrationError
from dsl_core.io.spectra.records import rising

HERE = Path("x.csv")


def test_rising_wavelengths_stay_and_falling_ones_are_turned() -> None:
    fine, values = np.array([500.0, 500.25, 501.0]), np.array([1.0, 2.0, 3.0])
    for nm, wanted in ((fine, values), (fine[::-1], values[::-1])):
        found, turned = rising(HERE, nm, values)
        assert found.tolist() == fine.tolist()
        assert turned.tolist() == wanted.tolist()


@pytest.mark.parametrize(
    ("nm", "said"),
    [
        ([500.0, 510.0, 510.0], "510 comes after 510 nm"),
        ([500.0, 510.0, 505.0, 520.0], "505 comes after 510 nm"),
        ([520.0, 510.0, 515.0], "510 comes after 520 nm"),
        ([500.0, 500.5, 510.0, 505.0], "505 comes after 510 nm"),
    ],
)
def test_other_orders_are_refused_with_their_place(nm: list[float], said: str) -> None:
    with pytest.raises(CalibrationError, match=said):
        rising(HERE, np.array(nm), np.zeros(len(nm)))


@pytest.mark.parametrize(
    ("nm", "is_light"),
    [
        ([150.0, 50_000.0], True), ([149.9, 500.0], False), ([500.0, 50_001.0], False), ([500.0], True),
        ([], False),
    ],
)  # fmt: skip
def test_wavelengths_are_those_of_light(nm: list[float], is_light: bool) -> None:
    values = np.ones(len(nm))
    if is_light:
        assert rising(HERE, np.array(nm), values)[0].tolist() == nm
    else:
        with pytest.raises(CalibrationError):
            rising(HERE, np.array(nm), values)
