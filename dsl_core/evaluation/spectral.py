"""Reflectance spectra against truth or a reference: errors with and without a free scale, widths of peaks."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import DecodeError
from dsl_core.model.spectral import SpectralCurve, at_bands, band_widths_nm
from dsl_core.optics.colour import delta_e_2000, hold_colour, reflectance_to_lab

Floats = NDArray[np.float64]
Value = TypeVar("Value", float, Floats)


@dataclass(frozen=True)
class SpectralErrors(Generic[Value]):
    """Errors of spectra, a number for one or an array (n,) for n; ``scaled`` are left after a free scale.

    ``rmse`` over bands on the reflectance scale; ``angle_rad`` does not depend on scale; ``delta_e`` is
    CIEDE2000 under D65; ``scale`` is the factor that brings the measurement closest to the truth.
    """

    rmse: Value
    angle_rad: Value
    delta_e: Value
    scale: Value
    rmse_scaled: Value
    delta_e_scaled: Value


def first_of(errors: SpectralErrors[Floats]) -> dict[str, float]:
    """Those of the first spectrum, by name."""
    return {name: float(values[0]) for name, values in vars(errors).items()}


def known_of_first(errors: SpectralErrors[Floats], bands_nm: Floats) -> dict[str, float]:
    """As `first_of`, with NaN for colours of which bands (bands,), nm, hold too little."""
    return first_of(errors) | _unknown_colours(bands_nm)


def _unknown_colours(bands_nm: Floats) -> dict[str, float]:
    return {} if hold_colour(bands_nm) else dict.fromkeys(("delta_e", "delta_e_scaled"), float("nan"))


def spectral_errors(measured: Floats, truth: Floats, wavelengths_nm: Floats) -> SpectralErrors[Floats]:
    """Compare spectra (bands, n) with truth (bands, n) or (bands, 1).

    Raises `DecodeError` for shapes that do not fit or values that are not finite.
    """
    bands = len(wavelengths_nm)
    if measured.ndim != 2 or len(measured) != bands or truth.shape[0] != bands:
        raise DecodeError(
            f"Spectra of shape {measured.shape} and truth of shape {truth.shape} do not fit {bands} bands;"
            " resample the truth to the bands of the result."
        )
    if not (np.isfinite(measured).all() and np.isfinite(truth).all()):
        raise DecodeError("A spectrum to compare contains values that are not finite; leave such pixels out.")
    measured, truth = np.broadcast_arrays(np.asarray(measured, np.float64), np.asarray(truth, np.float64))
    # einsum, because products of all pixels and bands would need as much memory as the cube.
    product = np.einsum("bn,bn->n", measured, truth)
    power, truth_power = np.einsum("bn,bn->n", measured, measured), np.einsum("bn,bn->n", truth, truth)
    # A spectrum that is zero has no direction: its angle is a right one, its best scale is 1.
    norm = np.sqrt(power * truth_power)
    cosine = np.divide(product, norm, out=np.zeros_like(product), where=norm > 0)
    scale = np.divide(product, power, out=np.ones_like(product), where=power > 0)
    lab = reflectance_to_lab(truth, wavelengths_nm)
    return SpectralErrors(
        rmse=_rmse(measured, truth),
        angle_rad=np.arccos(np.clip(cosine, -1.0, 1.0)),
        delta_e=delta_e_2000(reflectance_to_lab(measured, wavelengths_nm), lab),
        scale=scale,
        rmse_scaled=_rmse(measured * scale, truth),
        delta_e_scaled=delta_e_2000(reflectance_to_lab(measured * scale, wavelengths_nm), lab),
    )


def _rmse(measured: Floats, truth: Floats) -> Floats:
    return np.asarray(np.sqrt(np.mean((measured - truth) ** 2, axis=0)))


@dataclass(frozen=True)
class Peak:
    """A peak of a spectrum; ``complete`` is false when one flank ends at the edge of the bands."""

    centre_nm: float
    height: float
    fwhm_nm: float
    complete: bool


def peak_width(wavelengths_nm: Floats, values: Floats) -> Peak:
    """Full width at half maximum above a baseline, linear between samples, both arrays of shape (bands,).

    The maximum is that of the samples, nothing is fitted. The baseline is the median of all samples, which is
    right for peaks narrower than half the bands. Where a flank does not come
    down to half height, the other one counts twice and ``complete`` is false. Raises `DecodeError` for
    values that are not finite or a curve without a peak.
    """
    curve = np.asarray(values, np.float64)
    if not np.isfinite(curve).all():
        raise DecodeError("A spectrum with values that are not finite has no width; leave such pixels out.")
    floor = float(np.median(curve))
    top = int(curve.argmax())
    half = (curve[top] + floor) / 2.0
    left = _half_width(wavelengths_nm[top::-1], curve[top::-1], half)
    right = _half_width(wavelengths_nm[top:], curve[top:], half)
    flanks = [flank for flank in (left, right) if flank is not None]
    if curve[top] <= floor or not flanks:
        raise DecodeError("The spectrum does not fall to half its maximum, so it has no width.")
    low, high = flanks[0], flanks[-1]
    centre = float(wavelengths_nm[top]) + (high - low) / 2
    return Peak(centre, float(curve[top]), low + high, len(flanks) == 2)


def _half_width(wavelengths_nm: Floats, values: Floats, level: float) -> float | None:
    """Distance in nm from the first sample to where the values have come down to a level."""
    below = np.flatnonzero(values <= level)
    if below.size == 0 or below[0] == 0:
        return None
    i = int(below[0])
    share = (values[i - 1] - level) / (values[i - 1] - values[i])
    crossing = wavelengths_nm[i - 1] + share * (wavelengths_nm[i] - wavelengths_nm[i - 1])
    return float(abs(crossing - wavelengths_nm[0]))


#: Fewer common bands than this say nothing about a spectrum.
MIN_BANDS = 5


@dataclass(frozen=True)
class SpectrumComparison(SpectralErrors[float]):
    """How a spectrum differs from a reference over the bands they share.

    ``std`` has one standard deviation of each figure, and ``noise`` what each but the scale is of equal
    spectra whose bands deviate as stated: no figure comes to zero, however equal spectra are. Both are None
    where no deviation of a band is known. Differences of colour are NaN where these bands hold too little of
    one.
    """

    bands: int
    range_nm: tuple[float, float]
    std: SpectralErrors[float] | None = None
    noise: SpectralErrors[float] | None = None


def compare(
    spectrum: NDArray[np.floating],
    wavelengths_nm: NDArray[np.floating],
    reference: SpectralCurve,
    std: NDArray[np.floating] | None = None,
    correlation: Floats | None = None,
    width_nm: float | None = None,
) -> SpectrumComparison:
    """Compare a spectrum (bands,) with a reference, averaged by `at_bands`, where both have values.

    ``std`` (bands,) are the deviations of the spectrum and ``correlation`` (bands, bands) says how its bands
    err together, not at all if it is not given; a reference has its own deviations, shared alike. The bands
    are ``width_nm`` wide; as far as they are apart, unless it is known. Raises `DecodeError` when they share
    too few bands.
    """
    nm = np.asarray(reference.wavelengths_nm)
    shared = (wavelengths_nm >= nm[0]) & (wavelengths_nm <= nm[-1]) & np.isfinite(spectrum)
    count = int(shared.sum())
    if count < MIN_BANDS:
        raise DecodeError(
            f"Spectrum and reference ({nm[0]:g} to {nm[-1]:g} nm) share {count} bands;"
            f" {MIN_BANDS} are needed."
        )
    bands = np.asarray(wavelengths_nm[shared], np.float64)
    known = at_bands(reference, bands, band_widths_nm(wavelengths_nm, width_nm)[shared])
    wanted = known.values[:, None]
    measured = np.asarray(spectrum[shared], np.float64)[:, None]
    found = spectral_errors(measured, wanted, bands)
    together = np.eye(count) if correlation is None else _root(correlation[np.ix_(shared, shared)])
    stds = (
        None if std is None else np.asarray(std[shared], np.float64),
        None if reference.std is None else known.std,
    )
    steps = [_steps(each, together) for each in stds]
    equal = spectral_errors(measured, measured, bands)
    return SpectrumComparison(
        **known_of_first(found, bands),
        bands=count,
        range_nm=(float(bands[0]), float(bands[-1])),
        std=_deviations(measured, wanted, bands, found, steps),
        noise=_deviations(measured, measured, bands, equal, steps),
    )


def _root(correlation: Floats) -> Floats:
    """Steps (bands, steps) whose squares add to a correlation (bands, bands)."""
    sizes, axes = np.linalg.eigh(correlation)
    return np.asarray(axes * np.sqrt(np.maximum(sizes, 0)))


def _steps(std: Floats | None, root: Floats) -> Floats | None:
    """The steps for deviations (bands,), whose squares add to their covariance; None unless all are known."""
    if std is None or not np.isfinite(std).all():
        return None
    return np.asarray(root * std[:, None])


def _deviations(
    measured: Floats,
    truth: Floats,
    bands_nm: Floats,
    found: SpectralErrors[Floats],
    steps: list[Floats | None],
) -> SpectralErrors[float] | None:
    """Deviations of ``found``, from spectra that are one of the ``steps`` of either away.

    Next to zero such figures have no slope, while these spectra still say how far each may reach.
    """
    squares = dict.fromkeys((field.name for field in fields(SpectralErrors)), 0.0)
    for place, each in enumerate(steps):
        if each is None:
            continue
        moves = np.concatenate([each, -each], axis=1)
        moved = [measured, truth]
        moved[place] = moved[place] + moves
        first, second = np.broadcast_arrays(*moved)
        errors = spectral_errors(first, second, bands_nm)
        for name in squares:
            squares[name] += float(((getattr(errors, name) - getattr(found, name)) ** 2).sum() / 2)
    if all(each is None for each in steps):
        return None
    deviations = {name: float(np.sqrt(square)) for name, square in squares.items()}
    return SpectralErrors(**deviations | _unknown_colours(bands_nm))
