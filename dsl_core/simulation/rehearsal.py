"""Small pictures of the twin, taken early, so that what renders them is compiled before it is waited for."""

from __future__ import annotations

import numpy as np

from dsl_core.simulation.sim_devices import open_twin

#: Seconds of compiling are the same for any size.
SIZE = "32x21"


def rehearse() -> None:
    """Take a picture of white, as a live view begins with, and one of stripes, as a scan does."""
    with open_twin({"size": SIZE}) as rig:
        info = rig.projector.info
        white = np.full((info.height_px, info.width_px, 3), 255, np.uint8)
        stripes = white * (np.arange(info.width_px) // 2 % 2 == 0).astype(np.uint8)[:, None]
        for image in (white, stripes):
            rig.projector.show(image)
            rig.camera.snap()
