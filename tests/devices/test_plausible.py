"""Figures of instruments that cannot be are errors at once."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.devices.plausible import require_grid, require_transmission
from dsl_core.errors import DeviceError
from dsl_core.model.spectral import SpectralCurve


def curve(first_nm: float, step_nm: float) -> SpectralCurve:
    nm = first_nm + step_nm * np.arange(40)
    return SpectralCurve.of(nm, np.ones(40), unit="W/(sr m2 nm)")


def test_an_instrument_keeps_its_wavelengths() -> None:
    require_grid(curve(400, 8), curve(400, 8), "The instrument")
    for other in (curve(403, 8), curve(400, 7.9)):
        with pytest.raises(DeviceError, match="other wavelengths than before: 40 from 40"):
            require_grid(other, curve(400, 8), "The instrument")


NM = np.arange(350.0, 1101.0, 5.0)


def bell(centre_nm: float = 550.0) -> np.ndarray:
    return 0.8 * np.exp(-(((NM - centre_nm) / 6) ** 2))


def test_a_filter_may_be_noisy_where_its_light_is_not_used() -> None:
    noise = np.random.default_rng(1).normal(0, 0.008, NM.size)
    for at_nm, value in ((1050, -0.3), (360, 1.2), (430, -0.03), (550, 0.8)):
        require_transmission(SpectralCurve.of(NM, np.where(at_nm == NM, value, bell() + noise)), 550.0)


@pytest.mark.parametrize(
    ("centre_nm", "values", "advice"),
    [
        (550.0, 100 * bell(), "divide percent by 100"),
        (700.0, 100 * bell(700.0), "divide percent by 100"),
        (550.0, bell() - 0.05, "measure it and its dark signal again"),
        (550.0, np.where(NM == 500, -0.5, bell()), "measure it and its dark signal again"),
        (550.0, 0 * NM, "measure it and its dark signal again"),
    ],
)
def test_a_filter_passes_a_share_where_its_light_is_used(
    centre_nm: float, values: np.ndarray, advice: str
) -> None:
    with pytest.raises(
        DeviceError, match=rf"filter of {centre_nm:g} nm passes .* wanted.*\(filters\): {advice}"
    ):
        require_transmission(SpectralCurve.of(NM, values), centre_nm)
