"""Who looks at the frames of a scan while they are stored."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.overexposure import ExposureWatch, full_scale_dn
from dsl_core.capture.proof.report import SeenFrames
from dsl_core.capture.proof.verifier import FrameProof
from dsl_core.capture.sentinels import SentinelWatch
from dsl_core.capture.sink import Watch, WatchedSink
from dsl_core.devices.base import DeviceRig
from dsl_core.model.frames import FrameSink, FrameSource
from dsl_core.model.plan import CapturePlan, Shot


@dataclass(frozen=True)
class ScanWatches:
    """Exposure, unless white was measured before; the rest only where a scan is to be proved.

    Measured white says more: exposures matched to it let it saturate where lines, which are darker, do not.
    """

    exposure: ExposureWatch | None = None
    proof: FrameProof | None = None
    sentinels: SentinelWatch | None = None
    seen: SeenFrames | None = None

    @classmethod
    def of(cls, rig: DeviceRig, plan: CapturePlan, prove: bool, is_metered: bool) -> ScanWatches:
        """Watches for a scan of which they have seen nothing yet."""
        exposure = None if is_metered else ExposureWatch(plan, full_scale_dn(rig), rig.camera.info.bayer)
        if not prove:
            return cls(exposure)
        camera, sensor = rig.camera.info, rig.calibration.sensor if rig.calibration else None
        proof = FrameProof(plan, rig.calibration, camera.bit_depth, camera.bayer)
        return cls(exposure, proof, SentinelWatch(plan, sensor, camera.bit_depth), SeenFrames(plan))

    def learn(self, sink: FrameSink, stored: FrameSource) -> None:
        """Let sentinels look at what earlier runs stored; what the ``sink`` misses is not read."""
        if self.sentinels is not None:
            missing = {shot.index for shot in sink.missing()}
            there = (shot for shot in stored.plan.shots() if shot.index not in missing)
            self.sentinels.learn(stored, there)

    def over(self, sink: FrameSink) -> FrameSink:
        """The sink, shown to all of them."""
        looks = [] if self.exposure is None else [self.exposure.add]
        looks += [] if self.sentinels is None else [self.sentinels.add]
        looks += [] if self.seen is None else [self.seen.keep]
        for look in looks:
            sink = WatchedSink(sink, _pixels_to(look))
        return sink


def _pixels_to(look: Callable[[Shot, NDArray[np.uint16]], None]) -> Watch:
    return lambda shot, frame: look(shot, frame.seen)
