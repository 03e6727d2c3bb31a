"""Whether single pixels of black, captured again, are far off: bits that change on the way, or hot pixels.

Light falls on neighbours as well, and so does whatever came into the picture; a bit that a bad cable changes,
or a pixel of the sensor that has become hot, is alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.raster import Counts, Raster
from dsl_core.model.plan import CapturePlan, Shot

#: A pixel is far off by so many deviations, and alone if those of its colour beside it are by less than this
#: share of that.
SIGMAS, BESIDE = 12.0, 0.25
#: So many have to be, at least this share of all; nearly all that are far off are alone.
FEWEST, SHARE, NEARLY_ALL = 6, 0.0005, 0.7


@dataclass(frozen=True)
class SinglePixels:
    """How many pixels of the black ``shot`` are far off alone, as a ``share`` of all, and by how much, DN."""

    shot: Shot
    share: float
    most_dn: float

    @property
    def sentence(self) -> str:
        """What is wrong, and what to do."""
        return (
            f"In black, captured again as frame {self.shot.number}, {self.share:.2%} of the pixels are off by"
            f" up to {self.most_dn:.0f} DN, and their neighbours are not: bits change on the way from the"
            " camera, or pixels of its sensor have become hot. Other frames may hold as many. Check cable,"
            " connectors and hub, let the camera cool down, and scan again."
        )


def single_pixels(
    plan: CapturePlan, kept: Mapping[int, Counts], noise: Noise, raster: Raster
) -> SinglePixels | None:
    """The black, of all that were captured again, with most of them; None if none has enough.

    ``kept`` are the rasters of shots, by index.
    """
    found = []
    for shot in plan.shots():
        old = plan.original(shot)
        if shot.role == "sentinel" and old.role == "black" and {shot.index, old.index} <= kept.keys():
            found.append(_compared(shot, kept[old.index], kept[shot.index], noise, raster))
    differ = (one for one in found if one is not None)
    return max(differ, key=lambda one: one.share, default=None)


def _compared(shot: Shot, before: Counts, now: Counts, noise: Noise, raster: Raster) -> SinglePixels | None:
    sigma = np.sqrt(noise.variance(before) + noise.variance(now)).reshape(raster.shape)
    apart = np.abs(now.astype(np.float32) - before).reshape(raster.shape)
    # Two columns further on, a mosaic has the same colour.
    wide = np.pad(apart, ((0, 0), (2, 2)))
    beside = np.maximum(wide[:, :-4], wide[:, 4:])
    far = apart > SIGMAS * sigma
    alone = far & (beside < BESIDE * apart)
    count = int(alone.sum())
    if count < max(FEWEST, SHARE * apart.size) or count < NEARLY_ALL * int(far.sum()):
        return None
    return SinglePixels(shot, count / apart.size, float(apart[alone].max()))
