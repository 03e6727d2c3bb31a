"""How bright black frames are: what the projector's black and the room add to every frame."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.frames import FrameSource
from dsl_core.model.rig import Sensor
from dsl_core.optics.sensor import bayer_colours
from dsl_core.reconstruction.light.setting_ratios import compared_rows

#: Black frames whose middle is this close to full scale say only that there is more light.
SATURATED = 0.98


def mean_black(source: FrameSource, sensor: Sensor, seen: NDArray[np.bool_]) -> tuple[float, ...]:
    """Mean light of black frames in ``seen`` pixels (rows, columns) of R, G and B, DN per ms.

    It is 0 for a colour of which no pixel is seen. Raises `StoreError` where frames cannot be read.
    """
    rows = compared_rows(len(seen))
    colours = bayer_colours(sensor.bayer, rows[:, None], np.arange(seen.shape[1]))[seen[rows]]
    blacks = [shot for shot in source.plan.shots() if shot.role == "black"]
    rate = np.zeros(colours.shape)
    # In a long exposure, what the black level is off by counts least.
    for shot in sorted(blacks, key=lambda shot: shot.exposure_ms):
        raw = source.read(shot)[rows][seen[rows]].astype(np.float64)
        if raw.size and np.median(raw) < SATURATED * sensor.full_scale_dn:
            rate = (raw - sensor.black_level_dn) / shot.exposure_ms
    counts = np.bincount(colours, minlength=3)
    return tuple((np.bincount(colours, rate, minlength=3) / counts.clip(min=1)).tolist())
