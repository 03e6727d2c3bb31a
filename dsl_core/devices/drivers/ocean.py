"""Ocean's spectrometers by seabreeze (MIT). A calibration turns their counts into radiance."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from dsl_core.devices.base import Spectroradiometer
from dsl_core.devices.driver_table import Driver, FoundDevice
from dsl_core.errors import DeviceError
from dsl_core.extras import pip_command
from dsl_core.model.base import Record
from dsl_core.model.spectral import SpectralCurve

BRINGS = f"{pip_command('ocean')} (seabreeze)"
COVERED_NM = 430.0, 660.0
#: Of the largest count: below the first an exposure is made longer, above the second it is saturated.
_FAINT, _SATURATED = 0.3, 0.95
#: Files of spectra are not this layer's business; imported when a calibration is read.
_FILES = "dsl_core.io.spectra.spectrum_file"


class OceanSettings(Record):
    """Which spectrometer, its calibration, and how it exposes."""

    calibration: str = Field(
        min_length=1,
        description="file with nm and W/(sr m2 nm) per count and second, measured with a source of known"
        " radiance through the same optics",
    )
    serial: str = Field(default="", description="serial number; empty: the only one connected")
    longest_ms: float = Field(default=5000.0, gt=0, description="longest exposure that it may choose, ms")
    average: int = Field(default=4, ge=1, le=1000, description="exposures that are averaged")


class OceanSpectrometer(Spectroradiometer):
    """An open spectrometer of seabreeze with the radiance of one count a second at each of its pixels."""

    def __init__(
        self, device: Any, settings: OceanSettings, calibration: SpectralCurve, failure: type[Exception]
    ) -> None:
        """Check that the calibration covers what is needed; raises `DeviceError`."""
        self._device, self._settings, self._failure = device, settings, failure
        self._is_open = True
        nm = np.asarray(self._do(device.wavelengths), np.float64)
        low, high = calibration.wavelengths_nm[0], calibration.wavelengths_nm[-1]
        self._used = (nm >= low) & (nm <= high)
        self._nm = nm[self._used]
        if self._nm.size < 2 or np.any(np.diff(self._nm) <= 0):
            raise DeviceError(
                f"The calibration {settings.calibration} covers {low:g} to {high:g} nm, but the spectrometer"
                f" {nm.min():g} to {nm.max():g} nm. Choose the calibration of this spectrometer."
            )
        if self._nm[0] > COVERED_NM[0] or self._nm[-1] < COVERED_NM[1]:
            raise DeviceError(
                f"Spectrometer and calibration share {self._nm[0]:g} to {self._nm[-1]:g} nm;"
                f" {COVERED_NM[0]:g} to {COVERED_NM[1]:g} nm are needed. Calibrate the whole range."
            )
        self._radiance = calibration.at(self._nm)
        if not (np.isfinite(self._radiance).all() and (self._radiance > 0).all()):
            raise DeviceError(
                f"The calibration {settings.calibration} has values of zero or below. Measure it again."
            )
        shortest_us, longest_us = self._do(lambda: device.integration_time_micros_limits)
        self._shortest_us = int(shortest_us)
        self._longest_us = int(min(longest_us, 1000 * settings.longest_ms))
        if self._longest_us < 2 * self._shortest_us:
            raise DeviceError(
                f"The spectrometer exposes {shortest_us / 1000:g} ms at least; longest_ms is"
                f" {settings.longest_ms:g}. Allow a longer exposure."
            )

    def measure(self) -> SpectralCurve:
        """Radiance, W/(sr m2 nm), from two exposures, whose difference has no offset.

        Raises `DeviceError` for too much light, and for counts that cannot be.
        """
        long_us = self._exposure_us()
        short_us = max(self._shortest_us, long_us // 2)
        counts = self._counts(long_us) - self._counts(short_us)
        per_second = counts / ((long_us - short_us) * 1e-6)
        radiance = per_second[self._used] * self._radiance
        return SpectralCurve.of(self._nm, radiance, unit="W/(sr m2 nm)")

    def close(self) -> None:
        """Release the spectrometer; a second call does nothing."""
        if self._is_open:
            self._is_open = False
            self._device.close()

    def _exposure_us(self) -> int:
        """An exposure that uses the range of counts, or the longest; raises `DeviceError`."""
        exposure_us = min(max(10_000, 2 * self._shortest_us), self._longest_us)
        most = float(self._do(lambda: self._device.max_intensity))
        for _ in range(12):
            share = float(self._take(exposure_us).max()) / most
            if share >= _SATURATED:
                if exposure_us <= 2 * self._shortest_us:
                    break
                exposure_us = max(exposure_us // 4, 2 * self._shortest_us)
            elif share < _FAINT and exposure_us < self._longest_us:
                exposure_us = min(int(exposure_us * min(0.7 / max(share, 0.02), 10.0)), self._longest_us)
            else:
                return exposure_us
        raise DeviceError(
            "The spectrometer is saturated at its shortest exposure, or the light changes while it exposes."
            " Weaken the light, or keep it steady."
        )

    def _counts(self, exposure_us: int) -> NDArray[np.float64]:
        taken = [self._take(exposure_us) for _ in range(self._settings.average)]
        mean: NDArray[np.float64] = np.mean(taken, axis=0)
        return mean

    def _take(self, exposure_us: int) -> NDArray[np.float64]:
        def take() -> Any:
            self._device.integration_time_micros(exposure_us)
            return self._device.intensities()

        counts = np.asarray(self._do(take), np.float64)
        if counts.shape != self._used.shape or not np.isfinite(counts).all() or counts.min() < -1e6:
            raise DeviceError(
                f"The spectrometer delivered {counts.size} counts for {self._used.size} pixels, or values"
                " that no counter has. Disconnect and connect it again."
            )
        return counts

    def _do(self, action: Any) -> Any:
        if not self._is_open:
            raise DeviceError("The spectrometer is closed. Open the rig again.")
        try:
            return action()
        except (self._failure, OSError) as error:
            raise DeviceError(
                f"The spectrometer does not answer ({' '.join(str(error).split())[:200]}). Check its cable,"
                " then open the rig again."
            ) from error


def open_ocean(settings: OceanSettings) -> OceanSpectrometer:
    """Open a spectrometer with its calibration; raises `DeviceError`, and `CalibrationError` for its file."""
    calibration = import_module(_FILES).read_spectrum(Path(settings.calibration), covers_nm=COVERED_NM)
    library, failure = _library()
    try:
        if settings.serial:
            device = library.Spectrometer.from_serial_number(settings.serial)
        else:
            device = library.Spectrometer.from_first_available()
    except (failure, OSError) as error:
        which = f" with serial number {settings.serial}" if settings.serial else ""
        raise DeviceError(
            f"No spectrometer of Ocean{which} can be opened ({error}). Check its cable, that no other program"
            " uses it, and on Linux the rules that 'seabreeze_os_setup' installs."
        ) from error
    try:
        return OceanSpectrometer(device, settings, calibration, failure)
    except BaseException:
        device.close()
        raise


def find_ocean() -> list[FoundDevice]:
    """Spectrometers that are connected; raises `DeviceError`."""
    library, failure = _library()
    try:
        devices = library.list_devices()
    except (failure, OSError) as error:
        raise DeviceError(f"Spectrometers of Ocean cannot be listed ({error}). Check USB.") from error
    return [
        FoundDevice({"serial": each.serial_number}, f"{each.model} {each.serial_number}") for each in devices
    ]


def _library() -> tuple[Any, type[Exception]]:
    try:
        from seabreeze import spectrometers
        from seabreeze.spectrometers import SeaBreezeError
    except ImportError as error:
        raise DeviceError(f"Ocean's spectrometers need seabreeze. Install it with {BRINGS}.") from error
    return spectrometers, SeaBreezeError


DRIVER = Driver(
    "Ocean spectrometers, with a radiometric calibration", OceanSettings, open_ocean, find_ocean, BRINGS
)
