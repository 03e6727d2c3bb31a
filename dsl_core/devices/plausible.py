"""What devices deliver, held against what they promise: a figure that cannot be is an error at once."""

from __future__ import annotations

import math
from collections.abc import Mapping
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsl_core.devices.base import CameraInfo
from dsl_core.errors import DeviceError
from dsl_core.model.frames import Frame
from dsl_core.model.spectral import SpectralCurve

#: A camera may round the exposure it is asked for by this share.
EXPOSURE_TOLERANCE = 0.05
#: Wavelengths that every spectrum has to cover, and those that can be meant at all, nm.
COVERED_NM, POSSIBLE_NM = (430.0, 660.0), (150.0, 3000.0)
#: A larger share of pixels than this is not dead.
DEAD = 1e-3
#: Samples that a spectrum has at least; as many equal ones at its very peak are clipped.
FEWEST_SAMPLES, CLIPPED_SAMPLES = 16, 6
#: Peaks that fall by more than so many steps of rounding are no smooth ones; digits of rounded values.
STEEP_STEPS, MOST_DIGITS = 10.0, 6
#: A spectrum of light may fall below zero by this share of its peak.
NEGATIVE_SHARE = 0.1
#: What the measured transmission of a filter may be where light is used, or so near its nominal centre, nm:
#: noise takes it a little beyond 0 and 1, and up to this percentage of it further below.
TRANSMISSIONS, NEAR_NM, NOISIEST, NOISY_PERCENT = (-0.02, 1.05), 40.0, -0.1, 5
#: Unit of a spectroradiometer's curves.
RADIANCE = "W/(sr m2 nm)"


def require_frame(frame: object, camera: CameraInfo, exposure_ms: float | None) -> None:
    """Raise `DeviceError` unless a frame is what ``camera`` promises, exposed for ``exposure_ms``.

    None stands for an exposure that nobody has set yet.
    """
    name = f"The camera {camera.model}"
    if not isinstance(frame, Frame) or not isinstance(frame.pixels, np.ndarray):
        what = type(frame).__name__ if not isinstance(frame, Frame) else type(frame.pixels).__name__
        raise DeviceError(f"{name} delivered {what} instead of a picture. Update its driver.")
    said: dict[str, object] = {
        "exposure": frame.exposure_ms,
        "time": frame.timestamp_s,
        "number": frame.frame_id,
    }
    for what, value in said.items():
        # A frame without a time says nan; a number that is none, or that no clock reaches, is a fault.
        if not isinstance(value, Real) or not _is_float(value) or (what == "number" and value != value // 1):
            raise DeviceError(
                f"{name} says that the {what} of a frame is {repr(value)[:40]}. Update its driver."
            )
    require_mosaic(frame.pixels, (camera.width_px, camera.height_px), name)
    brightest, most = int(frame.pixels.max()), 2**camera.bit_depth - 1
    if brightest > most:
        raise DeviceError(
            f"{name} delivered a value of {brightest}; with {camera.bit_depth} bits, {most} is the largest."
            " Check its pixel format: values belong in the lower bits."
        )
    if not (math.isfinite(frame.exposure_ms) and frame.exposure_ms > 0):
        raise DeviceError(f"{name} says that it exposed for {frame.exposure_ms:g} ms. Update its driver.")
    if exposure_ms is not None:
        require_exposure(frame.exposure_ms, exposure_ms, name)


def _is_float(value: Real) -> bool:
    try:
        float(value)
    except OverflowError:
        return False
    return True


def has_dark(pixels: NDArray[np.uint16]) -> bool:
    """Whether rows with counts have pixels without any, as of a camera without black level where it is dark.

    Some pixels may be dead, and a transfer that is cut ends within a row.
    """
    if pixels.min() > 0:
        return False
    none, empty = pixels == 0, pixels.max(axis=1) == 0
    cut = np.flatnonzero(~empty[:-1] & empty[1:])
    none[cut] &= ~np.logical_and.accumulate(none[cut, ::-1], axis=1)[:, ::-1]
    return bool(np.count_nonzero(none[~empty]) > DEAD * none[~empty].size)


def require_whole(pixels: NDArray[np.uint16], name: str) -> None:
    """Raise `DeviceError` for rows without any count where all others have a black level: a cut transfer."""
    empty = pixels.max(axis=1) == 0
    if empty.any() and not empty.all() and not has_dark(pixels):
        raise DeviceError(
            f"{name} delivered {int(empty.sum())} of {empty.size} rows empty. Check its cable; on a slow"
            " connection lower its frame rate."
        )


def require_mosaic(pixels: NDArray[np.uint16], size_px: tuple[int, int], name: str) -> None:
    """Raise `DeviceError` unless pixels are a raw mosaic of this width and height."""
    if pixels.ndim != 2:
        raise DeviceError(
            f"{name} delivered a picture with colours ({' × '.join(map(str, pixels.shape))} numbers) instead"
            " of the raw one, which has one number per pixel. Choose a raw pixel format, such as BayerRG12 or"
            " Mono12."
        )
    if pixels.shape != (size_px[1], size_px[0]):
        raise DeviceError(
            f"{name} delivered a picture of {pixels.shape[1]} × {pixels.shape[0]} px instead of"
            f" {size_px[0]} × {size_px[1]} px. Check its region of interest and binning."
        )
    if pixels.dtype != np.uint16:
        raise DeviceError(
            f"{name} delivered a picture in {pixels.dtype} instead of uint16, the raw counts. Check its pixel"
            " format."
        )


def require_exposure(actual_ms: float, wanted_ms: float, name: str) -> None:
    """Raise `DeviceError` when a camera exposes for another time than it was asked for."""
    # Written so that a figure that is no number is refused as well.
    if not abs(actual_ms - wanted_ms) <= EXPOSURE_TOLERANCE * wanted_ms:
        raise DeviceError(
            f"{name} exposes for {actual_ms:g} ms instead of {wanted_ms:g} ms. Switch off its automatic"
            " exposure, or choose an exposure that it supports."
        )


def require_position(
    asked_mm: float, reached_mm: float, read_mm: float, tolerance_mm: float, name: str
) -> None:
    """Raise `DeviceError` unless a stage is where it was sent, by what it returned and by what it reads."""
    for value, what in ((reached_mm, "says that it went to"), (read_mm, "then says that it is at")):
        if not abs(value - asked_mm) <= tolerance_mm:
            raise DeviceError(
                f"{name} was sent to {asked_mm:g} mm and {what} {value:g} mm; {tolerance_mm:g} mm are"
                " tolerated. Check that nothing blocks it, and let it find its reference again."
            )


def require_spectrum(curve: object, name: str) -> None:
    """Raise `DeviceError` unless a curve can be the spectral radiance of something, dark or bright."""
    if not isinstance(curve, SpectralCurve):
        raise DeviceError(
            f"{name} delivered {type(curve).__name__} instead of a spectrum. Update its driver."
        )
    fault = _fault_of(np.array(curve.wavelengths_nm, float), np.array(curve.values, float), curve.unit)
    if fault:
        raise DeviceError(
            f"{name} delivered a spectrum that cannot be: {fault}. Check the instrument and measure again."
        )


def require_light(curve: SpectralCurve, others: Mapping[Any, SpectralCurve], what: str, name: str) -> None:
    """Raise `DeviceError` unless a curve shows light, and other light than the curves measured before.

    ``what`` names the light, as the keys of ``others`` name theirs. Noise makes every reading differ.
    """
    nm, values = np.array(curve.wavelengths_nm), np.array(curve.values)
    # Instruments are noisy at the ends of their range, which nothing uses.
    values = values[(nm >= COVERED_NM[0]) & (nm <= COVERED_NM[1])]
    lowest, peak = float(values.min()), float(values.max())
    fault = ""
    if peak <= 0:
        fault = "no value is above zero"
    elif -lowest > NEGATIVE_SHARE * peak:
        fault = f"it goes down to {lowest:g}, with a peak of {peak:g}"
    same = [known for known, other in others.items() if other.values == curve.values]
    if same:
        fault = f"it is the spectrum of {same[0]}, value by value"
    if fault:
        raise DeviceError(
            f"{name} delivered no spectrum of {what}: {fault}. Check that it sees the target and that the"
            " projector follows, then measure again."
        )


def require_transmission(curve: SpectralCurve, filter_nm: float) -> None:
    """Raise `DeviceError` unless a curve can be what the filter of a nominal centre passes, as a share."""
    # Instruments are noisy at the ends of their range, which nothing uses.
    low_nm, high_nm = min(COVERED_NM[0], filter_nm - NEAR_NM), max(COVERED_NM[1], filter_nm + NEAR_NM)
    values = curve.at(np.arange(low_nm, high_nm + 1))
    least, usual, most = np.percentile(values, (0, NOISY_PERCENT, 100))
    # Written so that a figure that is no number is refused as well.
    if not (least >= NOISIEST and TRANSMISSIONS[0] <= usual and 0 < most <= TRANSMISSIONS[1]):
        what = "divide percent by 100" if most > TRANSMISSIONS[1] else "measure it and its dark signal again"
        raise DeviceError(
            f"The rig says that from {low_nm:g} to {high_nm:g} nm the filter of {filter_nm:g} nm passes"
            f" {least:g} to {most:g} of the light; a share from 0 to 1 is wanted. Correct its measured"
            f" transmission in the rig's driver (filters): {what}."
        )


def require_grid(curve: SpectralCurve, first: SpectralCurve, name: str) -> None:
    """Raise `DeviceError` unless a curve has the wavelengths of the first one that was measured."""
    if curve.wavelengths_nm != first.wavelengths_nm:
        said = (f"{len(c.wavelengths_nm)} from {c.wavelengths_nm[0]:g} nm" for c in (curve, first))
        now, before = said
        raise DeviceError(
            f"{name} now measures at other wavelengths than before: {now}, not {before}. Its settings or its"
            " calibration changed: restart it, and read all spectra again."
        )


def _fault_of(nm: NDArray[np.float64], value: NDArray[np.float64], unit: str) -> str:
    if unit != RADIANCE:
        return f"its unit is {unit!r} instead of {RADIANCE!r}"
    if not (np.isfinite(nm).all() and np.isfinite(value).all()):
        return f"{int((~np.isfinite(value)).sum())} of its {value.size} values are infinite or missing"
    if nm[0] < POSSIBLE_NM[0] or nm[-1] > POSSIBLE_NM[1]:
        return f"its wavelengths are {nm[0]:g} to {nm[-1]:g}, not those of light in nm"
    if nm[0] > COVERED_NM[0] or nm[-1] < COVERED_NM[1]:
        return f"it covers {nm[0]:g} to {nm[-1]:g} nm instead of {COVERED_NM[0]:g} to {COVERED_NM[1]:g} nm"
    if nm.size < FEWEST_SAMPLES:
        return f"it has {nm.size} samples; {FEWEST_SAMPLES} are the fewest"
    peak = float(value.max())
    if value.min() == peak and peak != 0:
        return f"every value is {peak:g}"
    start, end = _longest_run(value == peak)
    if peak > 0 and end - start >= CLIPPED_SAMPLES and _ends_steeply(value, start, end):
        return f"{end - start} neighbouring values are {peak:g}, its largest: it is saturated"
    return ""


def _longest_run(where: NDArray[np.bool_]) -> tuple[int, int]:
    """Start and end (exclusive) of the longest run."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], where.astype(np.int8), [0])))).reshape(-1, 2)
    start, end = edges[int((edges[:, 1] - edges[:, 0]).argmax())]
    return int(start), int(end)


def _ends_steeply(value: NDArray[np.float64], start: int, end: int) -> bool:
    """Whether what is beside the largest values falls off faster than a smooth peak that was rounded.

    A parabola whose top is flat after rounding falls by 4 steps of it over as many samples as are flat.
    """
    beside = value[max(2 * start - end, 0)], value[min(2 * end - start - 1, value.size - 1)]
    return bool(value[start] - min(beside) > STEEP_STEPS * _rounding_step(value))


def _rounding_step(value: NDArray[np.float64]) -> float:
    """The decimal step of which large values are multiples; 0 where they have too many digits to tell."""
    first = math.floor(math.log10(value.max()))
    # Smaller ones may have as many digits, and a finer step.
    large = value[value >= 10.0**first]
    for digits in range(1, MOST_DIGITS + 1):
        step = 10.0 ** (first - digits + 1)
        if np.abs(large / step - np.rint(large / step)).max() < 1e-3:
            return float(step)
    return 0.0
