"""Whether stripes of a code are softer than projector and pixels make them: something is out of focus.

The finer stripes are, the more of their contrast a blur takes. What it leaves of each pair of a pattern and
its inverse, as a share of white less black, tells the width of the blur.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from dsl_core.capture.proof.code.code_pairs import Pair
from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.raster import Counts, Raster
from dsl_core.model.plan import BinaryCode
from dsl_core.model.rig import Rig
from dsl_core.patterns.binary_code import stripes_across

#: A blur is told that is so many times the usual one, and so many columns wider. Clean scans of all scenes,
#: those of rigs unlike ours among them, are within a quarter of the usual one.
TIMES, WIDER = 1.5, 0.4
#: The part of the picture that is sharper than this share of it decides: translucent and tilted surfaces
#: soften stripes as well.
SHARPEST = 0.75
#: A pixel counts with a contrast of so many deviations, and a block of the raster if so many of its do.
LIT_SIGMAS, MOST = 12.0, 0.5
#: Blocks and pairs that are needed.
FEWEST_BLOCKS, FEWEST_PAIRS = 16, 3
#: The share of the squared contrast that is left of wide stripes at least.
LEAST_OWN = 0.25
#: Widths of blur that are tried, columns.
WIDTHS = np.geomspace(0.25, 64.0, 81)


@dataclass(frozen=True)
class SoftStripes:
    """The rms width of the blur of stripes, and that which the calibration expects, columns."""

    blur: float
    usual: float

    @property
    def sentence(self) -> str:
        """What is wrong, and what to do."""
        return (
            f"Stripes of the code are blurred by about {self.blur:.1f} columns (rms) wherever one looks, and"
            f" {self.usual:.1f} are usual with this calibration: camera or projector is out of focus, a lens"
            " is dirty or moist, or all surfaces are translucent. Focus both on the object, as they were when"
            " the rig was calibrated, and scan again."
        )


def soft_stripes(
    code: BinaryCode,
    pairs: Mapping[int, Pair],
    ends: tuple[Counts, Counts],
    rig: Rig,
    noise: Noise,
    raster: Raster,
) -> SoftStripes | None:
    """How soft stripes are; None if they are not, or if too little is lit.

    ``pairs`` are rasters of a pattern and its inverse by their number, ``ends`` those of white and black.
    Raises `PlanError`.
    """
    size_px = rig.projector.width_px, rig.projector.height_px
    left, profiles = [], []
    for number, pair in pairs.items():
        stripes = stripes_across(code, size_px, 2 * number)
        share = None if stripes is None else _share_left(pair, ends, noise, raster)
        if stripes is not None and share is not None:
            left.append(share)
            profiles.append(np.where(stripes, 1.0, -1.0))
    if len(left) < FEWEST_PAIRS:
        return None
    blur = _width(np.array(left), profiles)
    usual = usual_blur(rig)
    return SoftStripes(blur, usual) if blur > TIMES * usual + WIDER else None


def usual_blur(rig: Rig) -> float:
    """What projector and pixels blur by, rms columns."""
    pixel = rig.projector.fx_px / rig.camera.fx_px
    return float(np.hypot(rig.projector_response.blur_px, pixel / np.sqrt(12)))


def _share_left(pair: Pair, ends: tuple[Counts, Counts], noise: Noise, raster: Raster) -> float | None:
    """What is left of the squared contrast of a pair where the picture is sharpest; None if too dark."""
    white, black = ends
    contrast = np.maximum(white.astype(np.float32) - black, 1)
    variance = noise.variance(white) + noise.variance(black)
    lit = (contrast > LIT_SIGMAS * np.sqrt(variance)) & (white < noise.sensor.full_scale_dn)
    apart = pair[0].astype(np.float32) - pair[1]
    # Noise adds to a square.
    square = (apart**2 - noise.variance(pair[0]) - noise.variance(pair[1])) / contrast**2
    count = raster.pool(lit.astype(np.float32))
    share = raster.pool(np.where(lit, square, 0).astype(np.float32)) / np.maximum(count, 1e-6)
    told = share[count >= MOST]
    return float(np.quantile(told, SHARPEST)) if told.size >= FEWEST_BLOCKS else None


def _width(left: NDArray[np.float64], profiles: list[NDArray[np.float64]]) -> float:
    """The width of a Gaussian that leaves these shares of patterns, columns.

    Light that surfaces and the film's orders spread widely takes another share of them all.
    """
    rows = np.array(profiles)
    expected = np.array(
        [np.mean(gaussian_filter1d(rows, width, axis=1, mode="nearest") ** 2, axis=1) for width in WIDTHS]
    )
    scale = np.clip(expected @ left / np.square(expected).sum(axis=1), LEAST_OWN, 1)
    return float(WIDTHS[int(np.square(scale[:, None] * expected - left).sum(axis=1).argmin())])
