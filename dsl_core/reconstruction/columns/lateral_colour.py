"""Lateral colour of both lenses as a scan itself shows it.

Neighbours of a row in the colour mosaic see the same lines in other colours. On smooth surfaces the column of
a pixel is half way between those of its neighbours, unless lenses magnify their colours differently: then the
columns of one colour are displaced by a share of the distance from the axes, with the other sign where
colours change places.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.calibration.lateral_colour import SHARES, LateralColour
from dsl_core.model.figure import with_std
from dsl_core.model.fit import FitFinding
from dsl_core.model.rig import Rig
from dsl_core.optics.colour_neighbours import bayer_colours
from dsl_core.optics.lines.line_set import LineSet
from dsl_core.optics.spectra import chain_response
from dsl_core.solve.robust import geman_mcclure_weights, rms, robust_linear

Floats = NDArray[np.float64]
#: Distance of red and blue that matters, rms over the picture, px of the projector.
MOST_APART_PX = 0.004
#: How many deviations it must be away from zero.
SIGMAS = 4.0
#: How much less sure sums are than neighbours' columns seem to be, as each column is in three of them.
SHARED = (8 / 3) ** 0.5
#: Strips of a picture, side by side. Where columns of camera and projector are parallel, all pixels of a
#: column of the picture are wrong together, so that strips, not pixels, say how sure a fit is.
STRIPS = 12
#: How much more than noise of columns (squared) must tell a magnification: where camera and projector look
#: along one axis, columns are as far from both, and noise alone tells one lens from the other.
LEAST_TOLD = 10.0
#: Rows that are looked at have about so many pixels in all; with fewer than the second nobody can tell.
PIXELS, FEWEST = 60_000, 1000
#: A pixel that is farther than this from the middle of its neighbours is at an edge, px.
EDGE_PX = 0.5
#: Deviation of the mean wavelength of one colour between materials, nm.
MATERIAL_NM = 15.0
#: Wavelengths of white light, nm.
_WHITE_NM = np.arange(400.0, 701.0, 5.0)
_GREEN, _BLUE = 1, 2


@dataclass(frozen=True)
class LateralFit:
    """Lateral colour, and the distance of red and blue, rms over the picture, with its deviation (px)."""

    colour: LateralColour
    apart_px: float
    apart_std_px: float

    @property
    def present(self) -> bool:
        """Whether it matters and is not chance."""
        return self.apart_px > max(MOST_APART_PX, SIGMAS * self.apart_std_px)


@dataclass(frozen=True)
class ColumnBends:
    """How far columns are from the middle of their neighbours in a row, px, flat over pixels on surfaces.

    With it the sign, +1 where green is on both sides and -1 where it is between; whether the other colour is
    blue; the distance from the axes of camera and projector in columns, and from the camera's in pixels; and
    the strip of the picture.
    """

    bend_px: Floats
    sign: Floats
    blue: NDArray[np.bool_]
    camera_px: Floats
    projector_px: Floats
    pixels_px: Floats
    strip: NDArray[np.intp]

    @classmethod
    def of(cls, rig: Rig, column_px: Floats) -> ColumnBends | None:
        """Those of a map of columns (rows, columns), NaN where not known; None with too few.

        A monochrome camera has none: neighbours see the same light, and surfaces alone bend its columns.
        """
        height, width = column_px.shape
        pairs = max(height * width // PIXELS, 1)
        rows = np.flatnonzero(np.arange(height) // 2 % pairs == 0)
        q = column_px[rows]
        colours = bayer_colours(rig.sensor.bayer, rows[:, None], np.arange(width)[None])
        own, other = colours[:, 1:-1], colours[:, :-2]
        bend, slope = q[:, 1:-1] - 0.5 * (q[:, :-2] + q[:, 2:]), 0.5 * (q[:, 2:] - q[:, :-2])
        with np.errstate(invalid="ignore"):
            good = (np.abs(bend) < EDGE_PX) & (own != other)
        if np.count_nonzero(good) < FEWEST:
            return None
        x = np.broadcast_to(np.arange(1, width - 1), bend.shape)
        pixels = x - rig.camera.cx_px
        sign = np.where(own == _GREEN, -1.0, 1.0)
        blue = (own == _BLUE) | (other == _BLUE)
        projector = q[:, 1:-1] - rig.projector.cx_px
        maps = bend, sign, blue, pixels * slope, projector, pixels, x * STRIPS // width
        return cls(*(each[good] for each in maps))


def own_lateral_colour(
    rig: Rig, lines: LineSet | None, column_px: NDArray[np.floating], refined: NDArray[np.bool_]
) -> LateralFit | None:
    """Lateral colour from columns (rows, columns) where lines refined them; None where too few did.

    Nor is there any of other patterns, nor of a rig whose calibration holds it.
    """
    if lines is None or not lines.single or rig.lateral_colour is not None:
        return None
    seen = ColumnBends.of(rig, np.where(refined, column_px, np.nan).astype(np.float64))
    return None if seen is None else fit_lateral_colour(rig, [seen])


def fit_lateral_colour(rig: Rig, seen: Sequence[ColumnBends]) -> LateralFit:
    """Lateral colour from the columns of one picture or of several.

    Unknown are the camera's magnifications of red and of blue against green, and the projector's per nm.
    """
    white = white_nm(rig)
    bend_px, sign, blue, camera_px, projector_px, pixels_px, strip = (
        np.concatenate([getattr(part, field.name) for part in seen]) for field in fields(ColumnBends)
    )
    strip = strip + STRIPS * np.repeat(np.arange(len(seen)), [part.strip.size for part in seen])
    step_nm = np.where(blue, white[_BLUE] - white[_GREEN], white[0] - white[_GREEN])
    design = sign[:, None] * np.stack([-camera_px * ~blue, -camera_px * blue, projector_px * step_nm], 1)
    # A bend has the noise of a column 1.5 times, a slope a half of it (squared).
    error = np.stack([pixels_px * ~blue, pixels_px * blue, step_nm * 2**0.5], 1) / 3**0.5
    noise = np.sqrt(np.mean(error**2, 0)) * rms(bend_px) + 1e-12
    found, covariance = _told(design, noise, bend_px, strip)
    apart = np.stack([-camera_px, camera_px, projector_px * (white[0] - white[_BLUE])], 1)
    variance = float(np.mean(np.einsum("np,pq,nq->n", apart, covariance, apart)))
    square = float(np.mean((apart @ found) ** 2))
    green = -SHARES[0] * found[0] - SHARES[2] * found[1]
    colour = LateralColour(
        camera=(float(found[0] + green), float(green), float(found[1] + green)),
        projector_per_nm=float(found[2]),
        white_nm=white,
    )
    return LateralFit(colour, max(square - variance, 0.0) ** 0.5, variance**0.5)


def _told(design: Floats, noise: Floats, bend_px: Floats, strip: NDArray[np.intp]) -> tuple[Floats, Floats]:
    """What bends (n,) tell by a design (n, 3) with some ``noise`` (3,), and its covariance.

    It is as unsure as pixels or strips say, whichever say more.
    """
    scaled = design / noise
    told, directions = np.linalg.eigh(scaled.T @ scaled / len(scaled))
    basis = directions[:, told > LEAST_TOLD] / noise[:, None]
    design = design @ basis
    found, inverse, scatter = robust_linear(design, bend_px)
    residual = bend_px - design @ found
    pull = design * (residual * geman_mcclure_weights(residual, scatter))[:, None]
    pulls = np.stack([np.bincount(strip, of_one) for of_one in pull.T], 1)
    by_pixels, by_strips = inverse * (SHARED * scatter) ** 2, inverse @ pulls.T @ pulls @ inverse
    normal = design.T @ design
    covariance = max(by_pixels, by_strips, key=lambda each: float(np.sum(each * normal)))
    return basis @ found, basis @ covariance @ basis.T


def white_nm(rig: Rig) -> tuple[float, float, float]:
    """Mean wavelength of the projector's white as each colour of the camera sees it, nm."""
    light = chain_response(rig, 0, _WHITE_NM).sum(1)
    red, green, blue = (light @ _WHITE_NM / light.sum(1)).tolist()
    return red, green, blue


def material_std_px(rig: Rig, column_px: NDArray[np.floating]) -> NDArray[np.float64]:
    """How far a column may be displaced as the colour of a material is not that of white, px."""
    known = rig.lateral_colour
    per_nm = 0.0 if known is None else known.projector_per_nm
    return np.asarray(np.abs(per_nm * (column_px - rig.projector.cx_px)) * MATERIAL_NM, np.float64)


def lateral_finding(found: LateralFit) -> FitFinding:
    """What the scan says about the lateral colour of its lenses."""
    return FitFinding(
        part="lateral colour",
        name="red and blue light apart",
        value=found.apart_px,
        std=found.apart_std_px,
        unit="px",
        limit=MOST_APART_PX,
        significant=found.present,
        sentence=(
            f"Red and blue light of a line lie {with_std(found.apart_px, found.apart_std_px, 4)} columns"
            " apart: lenses magnify colours differently. Depth and spectra of this result are corrected for"
            " it."
        ),
        advice="Use lenses with less lateral colour, or the middle of the picture.",
    )
