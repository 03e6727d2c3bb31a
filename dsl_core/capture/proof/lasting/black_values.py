"""What values of black show that no light explains: a level below the sensor's, and rows without noise."""

from __future__ import annotations

import numpy as np

from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.raster import Counts, Raster
from dsl_core.model.rig import Sensor

#: Light only adds to black. What the level may have fallen by since its calibration, as a share and DN.
BELOW, LEAST_DN = 0.1, 3.0
#: This share of the rows has noise, if a row without any is to say something.
NOISY = 0.9


def low_black(black: Counts, noise: Noise) -> str:
    """That black, a raster, lies below the sensor's black level, as a sentence; empty if it does not."""
    found_dn = float(black.mean(dtype=np.float64))
    return below_level(f"Black is at {found_dn:.0f} DN on average", found_dn, noise.sensor)


def below_level(what: str, found_dn: float, sensor: Sensor) -> str:
    """That counts lie below a sensor's black level, as a sentence that begins with ``what``; empty if not."""
    level_dn = sensor.black_level_dn
    if found_dn > level_dn - max(BELOW * level_dn, LEAST_DN):
        return ""
    return (
        f"{what}, below the camera's black level of {level_dn:.0f} DN by its self-test, though light only"
        " adds to it: bit depth, pixel format or offset of the camera were changed since, and every value is"
        " off. Set them as they were, or repeat the self-test; then scan again."
    )


def filled_rows(black: Counts, noise: Noise, raster: Raster) -> str:
    """That rows at an end of black, a raster, all have one value, as a sentence; empty if they have noise."""
    rows = black.reshape(raster.shape)
    is_flat = np.ptp(rows, axis=1) == 0
    if not (is_flat[0] or is_flat[-1]) or float((~is_flat).mean()) < NOISY:
        return ""
    which, value = ("last", int(rows[-1, 0])) if is_flat[-1] else ("first", int(rows[0, 0]))
    # Dark pixels of a camera without an offset have nothing but zeros.
    if not 0 < value < noise.sensor.full_scale_dn:
        return ""
    return (
        f"The {which} rows of black all have the value {value} DN, and others have noise: the camera delivers"
        " a smaller picture that its driver fills up, so that places in it may be off by as many rows. Set"
        " region of interest, binning and size of its picture as they were when it was calibrated; then scan"
        " again."
    )
