"""Ocean's driver with a stand-in for a spectrometer: radiance by the calibration, refusals, saturation."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.devices.base import Spectroradiometer
from dsl_core.devices.conformance import SpectroradiometerConformance
from dsl_core.devices.drivers.ocean import OceanSettings, OceanSpectrometer, open_ocean
from dsl_core.errors import CalibrationError, DeviceError
from dsl_core.model.spectral import SpectralCurve

NM = np.linspace(340.0, 1020.0, 300)
#: Radiance of one count a second.
FACTOR = 2e-6
RATE = 30_000.0 * np.exp(-0.5 * ((NM - 550) / 80) ** 2)


class SeaError(Exception):
    pass


class Spectrometer:
    """Counts with an offset of the electronics, up to 65,535; ``light`` multiplies its rate."""

    max_intensity = 65_535.0
    integration_time_micros_limits = (1000, 10_000_000)

    def __init__(self, light: float = 1.0, fault: str = "") -> None:
        self.light, self.fault, self.exposure_us, self.closed = light, fault, 0, 0

    def wavelengths(self) -> NDArray[np.float64]:
        return NM

    def integration_time_micros(self, exposure_us: int) -> None:
        self.exposure_us = exposure_us

    def intensities(self) -> NDArray[np.float64]:
        if self.fault == "lost":
            raise SeaError("Data transfer error")
        counts = 1500.0 + self.light * RATE * self.exposure_us * 1e-6
        counts = np.minimum(counts, self.max_intensity)
        return counts[:-5] if self.fault == "short" else counts

    def close(self) -> None:
        self.closed += 1


def spectrometer(device: Spectrometer, low: float = 380.0, high: float = 780.0) -> OceanSpectrometer:
    calibration = SpectralCurve.of([low, high], [FACTOR, FACTOR], unit="W/(sr m2 nm)")
    settings = OceanSettings(calibration="mine.csv", average=2)
    return OceanSpectrometer(device, settings, calibration, SeaError)


class TestOcean(SpectroradiometerConformance):
    def open_spectroradiometer(self) -> Spectroradiometer:
        return spectrometer(Spectrometer())


@pytest.mark.parametrize("light", [0.001, 1.0, 500.0])
def test_radiance_does_not_depend_on_exposure_nor_offset(light: float) -> None:
    with spectrometer(Spectrometer(light)) as opened:
        curve = opened.measure()
    np.testing.assert_allclose(curve.at(550.0), 30_000 * light * FACTOR, rtol=2e-3)
    assert curve.wavelengths_nm[0] >= 380
    assert curve.wavelengths_nm[-1] <= 780


@pytest.mark.parametrize(
    ("device", "low", "told"),
    [
        (Spectrometer(1e6), 380.0, "saturated at its shortest exposure"),
        (Spectrometer(fault="lost"), 380.0, "does not answer .Data transfer error"),
        (Spectrometer(fault="short"), 380.0, "delivered 295 counts for 300 pixels"),
        (Spectrometer(), 500.0, "share 500|430 to 660 nm are needed"),
        (Spectrometer(), 770.0, "430 to 660 nm are needed"),
    ],
)
def test_what_cannot_be_measured_is_told(device: Spectrometer, low: float, told: str) -> None:
    with pytest.raises(DeviceError, match=told):
        spectrometer(device, low).measure()


def test_without_a_calibration_or_the_library_nothing_opens(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "mine.csv"
    with pytest.raises(CalibrationError, match="cannot be read"):
        open_ocean(OceanSettings(calibration=str(path)))
    rows = [f"{nm};{FACTOR * 1000}" for nm in range(380, 781, 10)]
    path.write_text("\n".join(["nm;mW/(sr m2 nm) per count/s", *rows]))
    monkeypatch.setitem(sys.modules, "seabreeze", None)
    with pytest.raises(DeviceError, match=r"dsl-scan\[ocean\]"):
        open_ocean(OceanSettings(calibration=str(path)))
    device = Spectrometer()
    library, part = ModuleType("seabreeze"), ModuleType("seabreeze.spectrometers")
    part.SeaBreezeError = SeaError  # type: ignore[attr-defined]
    part.Spectrometer = SimpleNamespace(from_first_available=lambda: device)  # type: ignore[attr-defined]
    library.spectrometers = part  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "seabreeze", library)
    monkeypatch.setitem(sys.modules, "seabreeze.spectrometers", part)
    with open_ocean(OceanSettings(calibration=str(path))) as opened:
        np.testing.assert_allclose(opened.measure().at(550.0), 30_000 * FACTOR, rtol=2e-3)
    assert device.closed == 1
