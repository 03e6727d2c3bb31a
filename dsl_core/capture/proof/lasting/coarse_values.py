"""Whether a camera's values come in steps that are larger than its noise: of less bits than it says."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from dsl_core.capture.proof.raster import Counts
from dsl_core.model.rig import Sensor
from dsl_core.optics.sensor import step_of


def coarse_values(pictures: Iterable[Counts], sensor: Sensor) -> str:
    """That values of pictures come in steps that hide light, as a sentence; empty if they do not.

    Noise carries light across smaller steps; across larger ones, dark pixels of two pictures differ by a step
    or by nothing.
    """
    step_dn = step_of(np.bincount(np.concatenate(list(pictures))))
    if step_dn <= sensor.step_dn or not sensor.model_copy(update={"step_dn": step_dn}).rounds_light:
        return ""
    bits = sensor.bit_depth - round(np.log2(step_dn))
    return (
        f"Values of the camera come in steps of {step_dn} DN, as in pictures of {bits} bits, and it has"
        f" {sensor.bit_depth}: light fainter than a step appears and vanishes as a whole. Set its pixel"
        " format to raw values of all bits, as when it was calibrated, and scan again."
    )
