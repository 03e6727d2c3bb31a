"""How much light one setting had, compared with another: the same pattern was shown to both."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.rig import Sensor
from dsl_core.optics.sensor import raw_variance
from dsl_core.reconstruction.hdr import BlackFrame

#: Counts of the brighter setting that are compared, as shares of full scale.
USED = (0.01, 0.9)
#: Rows of a picture that are looked at, and pixels that a comparison needs.
ROWS, FEWEST = 145, 12


@dataclass(frozen=True)
class Ratio:
    """Logarithm of the light at a setting over that at the last one, and its deviation."""

    log: float
    std: float


def compared_rows(height: int) -> NDArray[np.intp]:
    """Rows of a picture of a height that are looked at."""
    return np.unique(np.linspace(0, height - 1, min(height, ROWS)).astype(np.intp))


def compare_settings(
    raws: Sequence[NDArray[np.unsignedinteger]],
    blacks: Sequence[BlackFrame],
    gains_ms: Sequence[float],
    sensor: Sensor,
) -> tuple[Ratio | None, ...]:
    """The light of each mosaic of one pattern relative to the last one's; None where too little is seen."""
    rows = compared_rows(raws[0].shape[0])
    pictures = [raw[rows].astype(np.float32) for raw in raws]
    light = [each - black.mean[rows] for each, black in zip(pictures, blacks, strict=True)]
    found: list[Ratio | None] = []
    for i in range(len(raws) - 1):
        low, high = (share * sensor.full_scale_dn for share in USED)
        # The fainter setting is fitted as a multiple of the brighter one, whose noise hardly matters.
        faint, bright = (i, -1) if gains_ms[i] <= gains_ms[-1] else (-1, i)
        used = (light[bright] > low) & (pictures[i] < high) & (pictures[-1] < high)
        x, y = (light[j][used].astype(np.float64) for j in (bright, faint))
        scale = gains_ms[faint] / gains_ms[bright]
        # Of the frame and of the black taken off it.
        weight = 1 / (raw_variance(sensor, scale * x) + raw_variance(sensor, 0 * x))
        power = float((weight * (x**2 - raw_variance(sensor, x))).sum())
        factor = float((weight * x * y).sum()) / power if power > 0 else 0.0
        if int(used.sum()) < FEWEST or factor <= 0:
            found.append(None)
            continue
        log = np.log(factor / scale)
        std = 1 / np.sqrt(power) / factor
        found.append(Ratio(float(log if faint == i else -log), float(std)))
    return (*found, Ratio(0.0, 0.0))
