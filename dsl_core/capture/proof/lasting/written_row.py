"""Whether the first row of a picture holds numbers: cameras write time, gain and a counter into it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.raster import BESIDE, Counts, Raster

#: A number differs from the mean of its neighbours of one colour by this share of full scale: a dark picture
#: has no such pixels but hot ones, and light, however steep, fades more evenly.
APART = 0.05
#: So many pixels of the first row, and of the next one of its colours no more than this share of them.
FEWEST, MOST_BELOW = 6, 0.25
#: No camera writes more than so many pixels.
LONGEST_PX = 128


@dataclass(frozen=True)
class WrittenRow:
    """Numbers in the first row up to a column of the camera."""

    last_column: int

    @property
    def sentence(self) -> str:
        """What is wrong, and what to do."""
        return (
            f"The first row of black holds numbers up to column {self.last_column}, which no light makes: the"
            " camera writes time, gain or a counter into its pictures (embedded image information). Nothing"
            " is measured there, and pictures may seem to show another pattern. Switch that off, and scan"
            " again."
        )


def written_row(black: Counts, noise: Noise, raster: Raster) -> WrittenRow | None:
    """Numbers in the first row of ``black``, a raster; None where there are none."""
    beside = np.flatnonzero(raster.rows == BESIDE)
    if not beside.size:
        return None
    longest = min(LONGEST_PX // raster.step_px, raster.shape[1])
    rows = black.reshape(raster.shape)[[0, beside[0]], :longest].astype(np.float32)
    # Colours of a mosaic alternate from pixel to pixel.
    around = (rows[:, 4:] + rows[:, :-4]) / 2
    first, below = np.abs(rows[:, 2:-2] - around) > APART * noise.sensor.full_scale_dn
    if int(first.sum()) < FEWEST or int(below.sum()) > MOST_BELOW * int(first.sum()):
        return None
    return WrittenRow((int(np.flatnonzero(first)[-1]) + 2) * raster.step_px)
