"""What the line scan of a diffuser says about relative corrections of the spectral chain: its equations."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from dsl_core.model.plan import ScanLines
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.correspondence import Correspondence, Footprint
from dsl_core.optics.lines.profile import ProfileTable, halo_of_line
from dsl_core.optics.pixel_model import MODEL_ERROR
from dsl_core.optics.sensor import bayer_channels
from dsl_core.optics.spectra import ORDERS, chain_response, hat_moments
from dsl_core.solve.robust import robust_std
from dsl_core.solve.smooth_functions import Equations, hat_functions

Floats = NDArray[np.float64]

#: Bands of the forward model.
STEP_NM = 2.0
BANDS_NM = np.arange(400.0, 701.0, STEP_NM)
#: Least relative error of the zero order of a colour: uniformity of light and target.
ZERO_ORDER_ERROR = 5e-4
#: Pixels whose zero order stands this far (robust deviations) from the others' are left out.
OUTLIER_SIGMAS = 6.0
CHUNK = 256
#: Blur and width of a band beyond a line's edge.
REACH_PX = 6.0
#: Relative step of wavelengths for slopes.
STRETCH = 1e-3


@dataclass(frozen=True)
class LineScan:
    """A diffuser under scan lines as a scan reconstructs it, at some pixels.

    ``pixels`` are flat indices into the camera image (P,); ``depth_mm``, ``shading``, ``column_px``,
    ``amplitude`` (zero order in the pixel's own colour, DN per ms) and ``offset`` (dark signal, DN per ms)
    are (P,); ``radiance`` and its deviation ``std`` (infinite: saturated) are (frames, P), DN per ms, of
    the frames from ``first_line`` on. ``bulge_mm`` is how far the target bulges, with its deviation, None
    where nobody asked (see `calibration.common.plane.bulge_mm`).
    """

    lines: ScanLines
    pixels: NDArray[np.int64]
    depth_mm: Floats
    shading: Floats
    column_px: Floats
    amplitude: Floats
    offset: Floats
    radiance: NDArray[np.floating]
    std: NDArray[np.floating]
    first_line: int = 0
    bulge_mm: tuple[float, float] | None = None

    @property
    def centres_px(self) -> Floats:
        """Columns of the lines' centres, (frames,)."""
        lines = self.first_line + np.arange(len(self.radiance))
        return np.asarray((self.lines.width_px - 1) / 2 + self.lines.step_px * lines, np.float64)

    def between(self, low_px: float, high_px: float) -> LineScan:
        """The frames whose lines touch the columns between two limits."""
        reach = self.lines.width_px / 2 + REACH_PX
        near = np.flatnonzero((self.centres_px > low_px - reach) & (self.centres_px < high_px + reach))
        part = slice(near[0], near[-1] + 1) if len(near) else slice(0)
        return replace(
            self,
            radiance=self.radiance[part],
            std=self.std[part],
            first_line=self.first_line + (part.start or 0),
        )

    def at(self, which: NDArray[np.int64] | NDArray[np.bool_]) -> LineScan:
        """The same scan at some of its pixels, given by position."""
        arrays = {name: each for name, each in vars(self).items() if isinstance(each, np.ndarray)}
        some: dict[str, Any] = {name: each[..., which] for name, each in arrays.items()}
        return replace(self, **some)


@dataclass(frozen=True)
class Unknowns:
    """Places of the corrections: efficiency of each order, response of each colour, white scale.

    Behind them equations hold one more unknown, the wavelengths' ``scale``: by which share light is of a
    longer wavelength than the film's fit says, judged by the emission alone.
    """

    nodes_nm: Floats

    @property
    def count(self) -> int:
        """Length of the vector."""
        return self.white + 1

    @property
    def white(self) -> int:
        """Place of the white scale."""
        return (len(ORDERS) + 3) * len(self.nodes_nm)

    @property
    def scale(self) -> int:
        """Place of the wavelengths' scale."""
        return self.count

    def efficiency(self, order: int) -> slice:
        """Correction of an order's efficiency at the nodes."""
        return self._block(ORDERS.index(order))

    def response(self, colour: int) -> slice:
        """Correction of a colour's response at the nodes."""
        return self._block(len(ORDERS) + colour)

    def _block(self, index: int) -> slice:
        n = len(self.nodes_nm)
        return slice(index * n, (index + 1) * n)

    def hats(self, wavelengths_nm: Floats) -> Floats:
        """Linear interpolation from the nodes to wavelengths, (wavelengths, nodes)."""
        return hat_functions(wavelengths_nm, self.nodes_nm)


def zero_order_signals(rig: Rig, reflectance: SpectralCurve) -> Floats:
    """Zero-order signal (DN per ms and nm) of white light at unit shading, (3, wavelengths of 1 nm)."""
    nm = np.arange(BANDS_NM[0], BANDS_NM[-1] + 1)
    return np.asarray(chain_response(rig, 0, nm).sum(1) * reflectance.at(nm))


def zero_order_ratios(rig: Rig, scan: LineScan, reflectance: SpectralCurve) -> Floats:
    """Measured over expected zero order of each pixel, (P,)."""
    expected = zero_order_signals(rig, reflectance).sum(-1)[colours_of(rig, scan)]
    return np.asarray(scan.amplitude / (scan.shading * expected))


def colours_of(rig: Rig, scan: LineScan) -> NDArray[np.int64]:
    """Colour (0 R, 1 G, 2 B) of each pixel of a scan."""
    camera = rig.camera
    return bayer_channels(rig.sensor.bayer, camera.height_px, camera.width_px).ravel()[scan.pixels]


def without_outliers(rig: Rig, scan: LineScan, reflectance: SpectralCurve) -> LineScan:
    """The scan at pixels whose zero order agrees with that of the others of their colour."""
    ratio, colours = zero_order_ratios(rig, scan, reflectance), colours_of(rig, scan)
    good = np.isfinite(ratio)
    for colour in range(3):
        of_colour = good & (colours == colour)
        if of_colour.any():
            middle = np.median(ratio[of_colour])
            spread = robust_std(ratio[of_colour] - middle)
            good[of_colour] = np.abs(ratio[of_colour] - middle) <= OUTLIER_SIGMAS * spread + 1e-9
    return scan.at(good)


def zero_order_equations(
    rig: Rig, ratio: Floats, std: Floats, reflectance: SpectralCurve, unknowns: Unknowns
) -> Equations:
    """The colours' mean ``ratio`` (3,) of measured over expected zero order, with its deviation."""
    signals = zero_order_signals(rig, reflectance)
    nm = np.arange(BANDS_NM[0], BANDS_NM[-1] + 1)
    share = signals / signals.sum(-1, keepdims=True)
    # All wavelengths together: their scale plays no part.
    design = np.zeros((3, unknowns.count + 1))
    for colour in range(3):
        design[colour, unknowns.response(colour)] = share[colour] @ unknowns.hats(nm)
    design[:, unknowns.white] = 1
    return Equations.of(design, ratio - 1, std)


def first_order_equations(
    rig: Rig,
    scan: LineScan,
    ratio: Floats,
    model: Correspondence,
    reflectance: SpectralCurve,
    unknowns: Unknowns,
) -> Equations:
    """The first orders of a scan, whose zero orders are ``ratio`` (3,) times what the rig expects."""
    size = unknowns.count + 1
    total = Equations(np.zeros((size, size)), np.zeros(size), 0.0, 0)
    colours = colours_of(rig, scan)
    expected = zero_order_signals(rig, reflectance).sum(-1) * ratio
    for order in ORDERS:
        moments, centroids = hat_moments(rig, order, BANDS_NM, STEP_NM)
        white = moments.sum(1) * reflectance.at(centroids)
        hats, steep = unknowns.hats(centroids), steepness(rig, order, BANDS_NM, STEP_NM)
        for colour, which in _chunks(colours, scan.column_px):
            part = scan.at(which)
            footprint = _trace(model, part, order, centroids)
            usable = _usable(footprint, rig)
            if not usable.any():
                continue
            columns = footprint.columns[:, torch.as_tensor(usable)]
            part = part.at(usable).between(float(columns.min()), float(columns.max()))
            total = total + _of_colour(
                rig,
                part,
                _light(rig, part, columns),
                part.amplitude / expected[colour],
                white[colour],
                np.column_stack([hats, steep[colour]]),
                unknowns,
                order,
                colour,
            )
    return total


def _chunks(colours: NDArray[np.int64], column_px: Floats) -> Iterator[tuple[int, NDArray[np.int64]]]:
    """Pixels of one colour with neighbouring columns, so that few frames light them."""
    for colour in range(3):
        which = np.flatnonzero(colours == colour)
        which = which[np.argsort(column_px[which])]
        for start in range(0, len(which), CHUNK):
            yield colour, which[start : start + CHUNK]


def _trace(model: Correspondence, scan: LineScan, order: int, nm: Floats) -> Footprint:
    return model.trace(torch.as_tensor(scan.pixels), torch.as_tensor(scan.depth_mm), order, nm)


def _usable(footprint: Footprint, rig: Rig) -> NDArray[np.bool_]:
    """Pixels that some wavelength reaches, all through rows inside the frame."""
    columns, rows = footprint.columns.numpy(), footprint.rows.numpy()
    reached = (columns > -0.5) & (columns < rig.projector.width_px - 0.5)
    outside = reached & ((rows < 0) | (rows > rig.projector.height_px - 1))
    return np.asarray(reached.any(0) & ~outside.any(0))


def _light(rig: Rig, scan: LineScan, columns: torch.Tensor) -> tuple[NDArray[np.bool_], Floats]:
    """Which lines light a pixel, (P, frames), and the light of each of those on all bands, (lit, bands).

    ``columns`` (bands, P) rise or fall with the wavelength, so that a line lights a few bands in a row.
    """
    slope = float((columns[-1] - columns[0]).abs().median()) / float(BANDS_NM[-1] - BANDS_NM[0])
    spread = rig.projector_response.line_spread
    table = ProfileTable(scan.lines.width_px, spread, slope * STEP_NM, columns.device, columns.dtype)
    bands, rises = len(columns), bool(columns[-1].mean() > columns[0].mean())
    places = (columns if rises else columns.flip(0)).T.contiguous()
    centres = torch.as_tensor(scan.centres_px).to(columns.dtype).expand(len(places), -1)
    first, end = (
        torch.searchsorted(places, (centres + by).contiguous())
        for by in (-table.support_px, table.support_px)
    )
    near = first[..., None] + torch.arange(int((end - first).max()))
    inside, near = near < end[..., None], near.clip_(max=bands - 1)
    light = table.at(places.gather(1, near.flatten(1)).reshape(near.shape) - centres[..., None]) * inside
    lit = (light > 0).any(-1)
    near = near if rises else bands - 1 - near
    of_bands = light.new_zeros((int(lit.sum()), bands)).scatter_add_(1, near[lit], light[lit])
    return lit.numpy(), of_bands.numpy()


def _of_colour(
    rig: Rig,
    scan: LineScan,
    light: tuple[NDArray[np.bool_], Floats],
    scale: Floats,
    white: Floats,
    changes: Floats,
    unknowns: Unknowns,
    order: int,
    colour: int,
) -> Equations:
    """Equations of the pixels of one colour through one order; ``light`` as of `_light`.

    ``scale`` (P,) is the shading of the light, ``changes`` (bands, nodes + 1) are relative changes of the
    bands by the nodes and by the scale.
    """
    lit, of_bands = light
    pixel, frame = np.nonzero(lit)
    known = np.isfinite(scan.std[frame, pixel])
    pixel, frame = pixel[known], frame[known]
    expected = of_bands[known] * white * scale[pixel, None]
    predicted = expected.sum(-1)
    direct = scan.radiance - scan.offset - scan.amplitude * _halo(rig, scan)
    std = np.hypot(scan.std[frame, pixel], MODEL_ERROR * predicted)
    part = Equations.of(expected @ changes, direct[frame, pixel] - predicted, std)
    # Efficiency, response and white scale act alike on these signals.
    nodes = changes.shape[1] - 1
    spread = np.zeros((nodes + 1, unknowns.count + 1))
    spread[:nodes, unknowns.efficiency(order)] = spread[:nodes, unknowns.response(colour)] = np.eye(nodes)
    spread[:nodes, unknowns.white] = 1
    spread[nodes, unknowns.scale] = 1
    return Equations(spread.T @ part.normal @ spread, spread.T @ part.right, part.square, part.count)


def _halo(rig: Rig, scan: LineScan) -> Floats:
    """Halo of each line at each pixel relative to the zero order, (frames, P)."""
    distance = torch.as_tensor(scan.column_px - scan.centres_px[:, None])
    return halo_of_line(distance, scan.lines.width_px, rig.projector_response).numpy()


def steepness(rig: Rig, order: int, bands_nm: Floats, step_nm: float) -> Floats:
    """Relative change of white light in each band for a relative shift of the emission, (3, bands).

    Efficiency and response are measured through filters, so that they share the filters' wavelengths; the
    emission has those of the spectroradiometer.
    """
    towards_red, towards_blue = (
        hat_moments(stretched(rig, 1 + sign * STRETCH), order, bands_nm, step_nm)[0].sum(1)
        for sign in (1, -1)
    )
    middle = 0.5 * (towards_red + towards_blue)
    change = (towards_blue - towards_red) / (2 * STRETCH)
    return np.asarray(np.where(middle > 0, change / np.where(middle > 0, middle, 1.0), 0.0))


def stretched(rig: Rig, factor: float) -> Rig:
    """The rig with its emission at wavelengths ``factor`` times as long."""
    red, green, blue = (
        curve.model_copy(update={"wavelengths_nm": tuple(factor * nm for nm in curve.wavelengths_nm)})
        for curve in rig.emission
    )
    return rig.model_copy(update={"emission": (red, green, blue)})
