"""Documents of IES TM-27 say what they hold; what is damaged is refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from dsl_core.errors import CalibrationError
from dsl_core.io.spectra.formats.tm27 import read_tm27
from tests.cases import spectra_files as made


@pytest.mark.parametrize(
    ("stated", "quantity", "scaled"),
    [
        ("Reflectance", "reflectance", True),
        ("irradiance", "irradiance", False),
        ("relative", "unstated", False),
    ],
)
def test_the_quantity_is_the_one_that_is_stated(
    tmp_path: Path, stated: str, quantity: str, scaled: bool
) -> None:
    (found,) = read_tm27(made.write(tmp_path / "a.spdx", made.tm27(stated)))
    assert (found.name, found.quantity, found.scaled) == ("leaf", quantity, scaled)
    assert found.nm == pytest.approx(made.NM)
    assert found.values == pytest.approx(made.SHARE, abs=1e-6)


@pytest.mark.parametrize("damage", [('"500.0"', '"five"'), ("SpectralData", "Datum")])
def test_damaged_values_are_refused(tmp_path: Path, damage: tuple[str, str]) -> None:
    path = made.write(tmp_path / "a.spdx", made.tm27().replace(*damage))
    with pytest.raises(CalibrationError, match=r"a\.spdx has \d+ readable values"):
        read_tm27(path)
