"""What the colours of the camera say of the curves of camera and projector: do they agree about one light?

Where two colours see the same wavelengths, their curves say how much each of them should. A curve that is
off shows as a difference between colours that no spectrum, film or profile explains. Only such differences
show: a curve of the projector that is off for all colours looks like another reflectance. But curves from the
same source are off by about as much.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

Floats = NDArray[np.float64]

#: Where each colour's curve may be off by another share, straight lines between, nm.
KNOTS_NM = np.linspace(430.0, 660.0, 9)
#: Differences between colours that are known better than this count.
KNOWN_STD = 0.012
#: What curves seem to be off that are right, as spectra are straight between bands and the light of a band
#: counts as a triangle: of bands of 5 nm, and as the square of their width.
FLOOR, FLOOR_NM = 0.014, 5.0
#: Logarithm by which the light changes along 1 nm in a usual rig, root mean square, where it has at least
#: this share of the brightest. What triangles leave grows with the square of it.
USUAL_STEEPNESS, BRIGHT = 0.068, 0.05
#: Where a colour has less light than that share of its brightest, its curve may be off by as much as this: it
#: is steep there, and light of the neighbouring bands counts for more than its own.
FAINT_STD = 0.3
#: So many shapes, each with this share of the level, are those of many materials (a whole Color Checker has
#: four, three patches of it have three), and second differences of straight spectra.
MANY_SHAPES, LEAST_SHAPE, STRAIGHT = 4, 0.03, 0.05
#: Mean square of straight pieces, relative to that of their ends.
BETWEEN = 2 / 3
#: Fewer differences say nothing.
FEWEST = 6


def tells_of_curves(reflectance: Floats) -> bool:
    """Whether spectra (n, bands) tell of curves: those of many materials, and nearly straight between bands.

    The errors of a few materials' spectra look like those of the curves.
    """
    if len(reflectance) < MANY_SHAPES:
        return False
    bend = np.diff(reflectance, 2, axis=1)
    straight = np.sqrt(np.mean(bend**2) / np.mean(reflectance**2)) < STRAIGHT
    strengths = np.linalg.svd(_shapes(reflectance), compute_uv=False) / np.sqrt(reflectance.size)
    return bool(straight and np.count_nonzero(strengths > LEAST_SHAPE) >= MANY_SHAPES)


def steepness_per_nm(white: Floats, step_nm: float) -> float:
    """Logarithm by which light (..., bands), ``step_nm`` apart, changes along 1 nm where it is bright (rms).

    No less than the usual one.
    """
    lit = white > BRIGHT * white.max(-1, keepdims=True)
    light = np.log(np.where(lit, white, 1.0))
    changes = np.diff(light)[lit[..., 1:] & lit[..., :-1]]
    found = float(np.sqrt(np.mean(changes**2))) / step_nm if changes.size else 0.0
    return max(found, USUAL_STEEPNESS)


def bright_knots(white: Floats, centres_nm: Floats) -> NDArray[np.bool_]:
    """At which knots colours have enough light to tell of their curves, of all colours one after another.

    ``white`` (..., colours, bands) is the light of bands with these centres (bands,), nm.
    """
    light = white.reshape(-1, *white.shape[-2:]).sum(0)
    at_knots = np.stack([np.interp(KNOTS_NM, centres_nm, each) for each in light])
    return np.asarray((at_knots >= BRIGHT * light.max(1, keepdims=True)).ravel())


def variety(reflectance: Floats) -> float:
    """By how much the shapes of spectra (n, bands) differ, as a share of their level: root mean square."""
    return float(np.sqrt(np.nanmean(_shapes(reflectance) ** 2)))


def _shapes(reflectance: Floats) -> Floats:
    """Spectra (n, bands) relative to their levels, less the usual shape."""
    shape = reflectance / np.maximum(reflectance.mean(1, keepdims=True), 0.02)
    return np.asarray(shape - np.nanmedian(shape, 0))


def curve_changes(rows: Tensor, spectra: Tensor, centres_nm: Floats) -> Tensor:
    """What each share of the curve of a sample's own colour adds to the data, (samples, k, knots).

    ``rows`` of the model are (samples, k, bands), ``spectra`` (samples, bands), ``centres_nm`` (bands,).
    """
    hats = np.stack([np.interp(centres_nm, KNOTS_NM, unit) for unit in np.eye(len(KNOTS_NM))], 1)
    return rows @ (spectra[..., None] * torch.as_tensor(hats))


def of_all_curves(values: Tensor, others: int) -> Tensor:
    """Values (n, 3 colours, ..., p + knots) as (n, ..., p + 3 knots): what colours share is added up."""
    return torch.cat([values[..., :others].sum(1), *values[..., others:].unbind(1)], -1)


def normal_of_all_curves(values: Tensor, others: int) -> Tensor:
    """Normal matrices (n, 3 colours, p + knots, p + knots) as (n, p + 3 knots, p + 3 knots)."""
    top = of_all_curves(values[:, :, :others], others)
    count, colours, knots = values.shape[0], values.shape[1], values.shape[3] - others
    corner = values.new_zeros((count, colours, knots, colours, knots))
    for colour in range(colours):
        corner[:, colour, :, colour] = values[:, colour, others:, others:]
    low = torch.cat([top[:, :, others:].mT, corner.flatten(3).flatten(1, 2)], 2)
    return torch.cat([top, low], 1)


@dataclass(frozen=True)
class CurveMisfit:
    """Relative deviation of curves (rms) by which colours disagree, with its deviation.

    ``whole_rms`` holds also what colours disagree by because the light changes faster from band to band than
    in a usual rig: spectra are off by that, too, but no curve is.
    """

    rms: float
    std: float
    whole_rms: float


def of_all_pixels(normal: Floats, score: Floats, weight: Floats) -> tuple[Floats, Floats]:
    """Equations (k, k) and (k,) of all pixels (n, k, k) and (n, k) that have a weight (n,)."""
    used = weight > 0
    return np.tensordot(weight[used], normal[used], 1), weight[used] @ score[used]


def curve_misfit(
    normal: Floats,
    score: Floats,
    weight: Floats,
    prior_std: Floats,
    step_nm: float,
    steepness: float = USUAL_STEEPNESS,
    bright: NDArray[np.bool_] | None = None,
) -> CurveMisfit | None:
    """How far curves are off, from equations of pixels (n, p + c, p + c) and (n, p + c) without the spectrum.

    First come p other parameters, which may take what they explain; ``prior_std`` (p,) is theirs.
    ``step_nm`` is the width of bands, ``steepness`` by how much the logarithm of the light changes along
    1 nm, ``bright`` (c,) where curves count (see `bright_knots`), None for everywhere. None where colours say
    too little.
    """
    information, asked = of_all_pixels(normal, score, weight)
    if bright is not None:
        # What is faint may take what it explains, too.
        first, faint = len(prior_std), np.flatnonzero(~bright)
        order = np.r_[np.arange(first), first + faint, first + np.flatnonzero(bright)]
        information, asked = information[np.ix_(order, order)], asked[order]
        prior_std = np.r_[prior_std, np.full(len(faint), FAINT_STD)]
    others = len(prior_std)
    own = information[:others, :others] + np.diag(1 / prior_std**2)
    taken = np.linalg.solve(own, information[:others, others:]).T
    curves = information[others:, others:] - taken @ information[:others, others:]
    values, vectors = np.linalg.eigh(0.5 * (curves + curves.T))
    known = values > KNOWN_STD**-2
    if np.count_nonzero(known) < FEWEST:
        return None
    found = (vectors[:, known].T @ (asked[others:] - taken @ asked[:others])) / values[known]
    square = float(np.mean(found**2 - 1 / values[known]))
    floor = FLOOR * max(step_nm / FLOOR_NM, 1.0) ** 2
    steep = floor * (steepness / USUAL_STEEPNESS) ** 2
    rms, whole_rms = ((BETWEEN * max(square - each**2, 0.0)) ** 0.5 for each in (steep, floor))
    std = (BETWEEN * max(square, 0.0) / (2 * np.count_nonzero(known))) ** 0.5
    return CurveMisfit(rms, std, whole_rms)
