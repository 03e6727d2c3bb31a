"""Light of a first order through a bandpass filter: its passband, its paths to a plane, and what is seen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from dsl_core.calibration.common.tiles import tile_of_pixels
from dsl_core.errors import CalibrationError
from dsl_core.model.plan import ScanLines
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.correspondence import Correspondence, zero_order
from dsl_core.optics.sensor import bayer_channels, relative_gain
from dsl_core.optics.shading import Plane, plane_shading
from dsl_core.optics.spectra import chain_response

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Half window of derivatives over wavelength, nm.
NEAR_NM = 4.0
#: Light must come from this far inside the projector's frame (px), so that no part of the profile is cut.
COLUMN_MARGIN_PX, ROW_MARGIN_PX = 8.0, 3.0
#: Pixels used of one capture at most, and pixels that a tile needs.
MAX_PIXELS, MIN_PIXELS = 140_000, 6
#: Fine grid for integrals over a filter, nm.
STEP_NM = 0.5
#: Light below this share of the brightest wavelength is left out of a filter's extent.
EXTENT_SHARE = 0.01


@dataclass(frozen=True)
class LineFrames:
    """Lines on a plane, at some flat pixel indices (P,): radiance and its deviation, (frames, P).

    Radiance is in DN per ms; its deviation is infinite where it is saturated.
    """

    lines: ScanLines
    pixels: Ints
    radiance: NDArray[np.float32]
    std: NDArray[np.floating]


@dataclass(frozen=True)
class Paths:
    """How light of one order reaches those pixels whose light comes from inside the projector's frame.

    All arrays are (n,): ``at`` are indices into the frames' pixels, ``column_px`` the model's columns at the
    passband's centroid, ``per_nm`` and ``per_nm2`` their derivatives over wavelength, ``zero_px`` the
    columns of the zero order.
    """

    at: Ints
    pixels: Ints
    tiles: Ints
    colour: Ints
    depth_mm: Floats
    shading: Floats
    zero_px: Floats
    column_px: Floats
    per_nm: Floats
    per_nm2: Floats
    middle: tuple[Ints, Ints]

    def wavelength(self, sample: Ints, off_px: Floats) -> Floats:
        """How many nm from the centroid the light is that reaches a pixel from ``off_px`` columns away."""
        first = off_px / self.per_nm[sample]
        return np.asarray(first - 0.5 * (self.per_nm2 / self.per_nm)[sample] * first**2)


@dataclass(frozen=True)
class LineValues:
    """Values near the columns of the model, flat: index into `Paths`, line centre (px), value, variance."""

    sample: Ints
    line_px: Floats
    value: Floats
    variance: Floats

    def only(self, keep: NDArray[np.bool_]) -> LineValues:
        """The values where ``keep`` is true."""
        return LineValues(self.sample[keep], self.line_px[keep], self.value[keep], self.variance[keep])


def thinned(size_px: tuple[int, int]) -> Ints:
    """Flat indices of pixels evenly over an image, whole cells of the mosaic, at most `MAX_PIXELS`."""
    width, height = size_px
    skip = max(int(np.ceil(np.sqrt(width * height / MAX_PIXELS))), 1)
    rows, columns = (np.flatnonzero((np.arange(n) // 2) % skip == 0) for n in (height, width))
    return np.asarray((rows[:, None] * width + columns).ravel(), np.int64)


def tile_count(rig: Rig) -> int:
    """Tiles of the camera's image."""
    return int(tile_of_pixels((rig.camera.width_px, rig.camera.height_px)).max()) + 1


def trace_paths(rig: Rig, plane: Plane, pixels: Ints, passband: Passband, model: Correspondence) -> Paths:
    """The paths of an order to pixels of a plane, by a model of the film."""
    width = rig.camera.width_px
    light = plane_shading(rig, plane) * relative_gain(rig)
    depth, shade = (image.ravel()[pixels] for image in (plane.depth_mm(rig), light))
    z, where = torch.as_tensor(depth), torch.as_tensor(pixels)
    nm = passband.centroid_nm
    wavelengths = np.array([nm - NEAR_NM, nm, nm + NEAR_NM, *passband.extent_nm])
    traced = model.trace(where, z, passband.order, wavelengths)
    columns, rows = traced.columns.numpy(), traced.rows.numpy()
    inside = (columns > COLUMN_MARGIN_PX) & (columns < rig.projector.width_px - 1 - COLUMN_MARGIN_PX)
    inside &= (rows > ROW_MARGIN_PX) & (rows < rig.projector.height_px - 1 - ROW_MARGIN_PX)
    at = np.flatnonzero(inside.all(0) & np.isfinite(depth) & (np.nan_to_num(shade) > 0))
    before, here, after = columns[:3, at]
    tiles = tile_of_pixels((width, rig.camera.height_px)).ravel()[pixels[at]]
    return Paths(
        at=at,
        pixels=pixels[at],
        tiles=tiles,
        colour=bayer_channels(rig.sensor.bayer, rig.camera.height_px, width).ravel()[pixels[at]],
        depth_mm=depth[at],
        shading=shade[at],
        zero_px=zero_order(rig, where, z)[0].numpy()[at],
        column_px=here,
        per_nm=(after - before) / (2 * NEAR_NM),
        per_nm2=(after - 2 * here + before) / NEAR_NM**2,
        middle=_middles(tiles, pixels[at], width),
    )


def reach_px(lines: ScanLines, paths: Paths, passband: Passband) -> float:
    """How far from its column a line's profile reaches."""
    dispersion = float(np.abs(paths.per_nm).mean()) if len(paths.at) else 0.5
    widest = max(abs(end - passband.centroid_nm) for end in passband.extent_nm)
    return lines.width_px / 2 + widest * dispersion


def values_near(frames: LineFrames, paths: Paths, within_px: float) -> LineValues:
    """All known values of lines within a distance of the model's columns."""
    lines = frames.lines
    first = (lines.width_px - 1) / 2
    nearest = np.rint((paths.column_px - first) / lines.step_px).astype(np.int64)
    most = int(within_px / lines.step_px) + 1
    number = nearest[None] + np.arange(-most, most + 1)[:, None]
    centre = number * lines.step_px + first
    usable = (number >= 0) & (number < len(frames.radiance))
    which, sample = np.nonzero(usable & (np.abs(centre - paths.column_px) <= within_px))
    frame, pixel = number[which, sample], paths.at[sample]
    value, std = (part[frame, pixel].astype(float) for part in (frames.radiance, frames.std))
    every = LineValues(sample, np.asarray(centre[which, sample], float), value, std**2 + 1e-30)
    return every.only(np.isfinite(std) & np.isfinite(value))


def _middles(tiles: Ints, pixels: Ints, width: int) -> tuple[Ints, Ints]:
    """Tiles with enough pixels, and for each the index of the pixel nearest to their middle."""
    if not len(tiles):
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    found, at, counts = np.unique(tiles, return_inverse=True, return_counts=True)
    y, x = np.divmod(pixels, width)
    middle_x, middle_y = (np.bincount(at, values) / counts for values in (x, y))
    ranked = np.lexsort((np.hypot(x - middle_x[at], y - middle_y[at]), at))
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    enough = counts >= MIN_PIXELS
    return found[enough], ranked[starts][enough]


@dataclass(frozen=True)
class Passband:
    """Light of one order through one filter, for each colour of the camera.

    ``density`` (3, wavelengths) integrates to one for each colour, ``cumulative`` is its running integral and
    ``signal`` (3,) what was divided out, DN per ms. ``centroid_nm`` is that of all colours together.
    """

    order: int
    centroid_nm: float
    extent_nm: tuple[float, float]
    wavelengths_nm: Floats
    density: Floats
    cumulative: Floats
    signal: Floats

    def between(self, start_nm: Floats, stop_nm: Floats, colour: NDArray[np.int64]) -> tuple[Floats, Floats]:
        """Light between two wavelengths, and the density at the second less that at the first."""
        light, slope = np.zeros(start_nm.shape), np.zeros(start_nm.shape)
        nm = self.wavelengths_nm
        for c in range(3):
            mine = colour == c
            a, b = start_nm[mine], stop_nm[mine]
            light[mine] = np.interp(b, nm, self.cumulative[c]) - np.interp(a, nm, self.cumulative[c])
            slope[mine] = np.interp(b, nm, self.density[c], 0, 0) - np.interp(a, nm, self.density[c], 0, 0)
        return light, slope


def filter_passband(
    rig: Rig, transmission: SpectralCurve, order: int, dispersion_px_per_nm: float
) -> Passband:
    """The light of a line through a filter: transmission x response x emission x efficiency, blurred.

    The centroid of that product is the effective wavelength, not the filter's nominal centre. The
    projector's blur is put into the spectrum, by the dispersion. Raises `CalibrationError` when the chain has
    no light at all there.
    """
    from scipy.ndimage import gaussian_filter1d

    nm = np.arange(transmission.wavelengths_nm[0] - 20, transmission.wavelengths_nm[-1] + 20, STEP_NM)
    passed = np.interp(nm, transmission.wavelengths_nm, transmission.values, 0, 0)
    spectrum = chain_response(rig, order, nm).sum(1) * passed
    total = spectrum.sum()
    if not total > 0:
        raise CalibrationError(
            f"According to the calibration so far, no light of order {order:+d} passes the filter from"
            f" {transmission.wavelengths_nm[0]:g} to {transmission.wavelengths_nm[-1]:g} nm. Check the"
            " filter's curve."
        )
    centroid = float((spectrum.sum(0) * nm).sum() / total)
    lit = nm[spectrum.sum(0) > EXTENT_SHARE * spectrum.sum(0).max()]
    sigma = rig.projector_response.blur_px / dispersion_px_per_nm / STEP_NM
    signal = spectrum.sum(1) * STEP_NM
    # A colour that is blind to this filter has the profile of all of them, with no light.
    shape = np.where((signal > 1e-6 * signal.max())[:, None], spectrum, spectrum.sum(0))
    density = gaussian_filter1d(
        shape / (shape.sum(1, keepdims=True) * STEP_NM), sigma, axis=1, mode="constant"
    )
    middle = 0.5 * (density[:, 1:] + density[:, :-1]) * STEP_NM
    cumulative = np.concatenate([np.zeros((3, 1)), np.cumsum(middle, 1)], 1)
    return Passband(order, centroid, (float(lit[0]), float(lit[-1])), nm, density, cumulative, signal)
