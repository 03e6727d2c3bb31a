"""Whether white is overexposed in every setting of a plan: there codes are unsure and columns unrefined."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.devices.base import CameraInfo, DeviceRig
from dsl_core.model.plan import CapturePlan, Shot
from dsl_core.model.rig import BayerPattern, Sensor
from dsl_core.optics.sensor import bayer_channels, end_near_full

#: Share of the picture from which on a person is told; highlights and a wall behind an object are usual.
MOST_OVEREXPOSED = 0.5


def full_scale_dn(rig: DeviceRig) -> int:
    """The number of a saturated pixel, as the calibration says, or else the camera's number of bits."""
    known = rig.calibration
    return (1 << rig.camera.info.bit_depth) - 1 if known is None else known.sensor.full_scale_dn


def black_level_dn(rig: DeviceRig) -> float:
    """The number of a pixel without light, by the calibration or data sheets of such a camera; else 0."""
    known = rig.calibration or rig.nominal
    return 0.0 if known is None else black_level_of(known.sensor, rig.camera.info)


def black_level_of(sensor: Sensor, camera: CameraInfo) -> float:
    """The black level stated of a sensor; 0 where the camera counts in another number of bits."""
    return sensor.black_level_dn if sensor.bit_depth == camera.bit_depth else 0.0


def by_colour(pixels: NDArray[np.unsignedinteger]) -> NDArray[np.unsignedinteger]:
    """The pixels of each cell of a raw mosaic (rows, columns), DN, shape (4, rows // 2, columns // 2)."""
    rows, columns = (2 * (length // 2) for length in pixels.shape)
    return np.stack([pixels[i:rows:2, j:columns:2] for i in (0, 1) for j in (0, 1)])


class ExposureWatch:
    """Takes the frames of a scan in their order; ``found`` says how much of white is overexposed, if much."""

    def __init__(self, plan: CapturePlan, full_scale_dn: int, bayer: BayerPattern) -> None:
        """Pixels that reach ``full_scale_dn``, or where white ends just below it, are saturated."""
        self._bayer: BayerPattern = bayer
        self._waits_for = {shot.index for shot in plan.shots() if shot.role == "white"}
        self._full_scale_dn = full_scale_dn
        self._always: NDArray[np.bool_] | None = None
        self.found = ""

    def add(self, shot: Shot, pixels: NDArray[np.unsignedinteger]) -> None:
        """Look at a frame (rows, columns), DN."""
        if not self._waits_for or shot.role not in ("white", "code"):
            return
        # White may saturate all over, so that nothing in it tells where values end; stripes are dark, too.
        channels = bayer_channels(self._bayer, *pixels.shape)
        self._full_scale_dn = end_near_full(pixels, self._full_scale_dn, channels)
        if shot.index not in self._waits_for:
            return
        self._waits_for.discard(shot.index)
        # One colour is enough to tell a code and to find a line.
        saturated = by_colour(pixels).min(axis=0) >= self._full_scale_dn
        self._always = saturated if self._always is None else self._always & saturated
        share = float(self._always.mean())
        if not self._waits_for and share >= MOST_OVEREXPOSED:
            self.found = (
                f"White is overexposed in {share:.0%} of the picture in every setting of the plan: codes are"
                " unsure there, depth is lost where lines are overexposed too, and wrong pictures hardly"
                " show. Expose for a shorter time or with a lower level, or choose a plan that has a darker"
                " setting as well, like coarse."
            )
