"""Figures of instruments that cannot be are errors at once."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.devices.plausible import require_grid
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
