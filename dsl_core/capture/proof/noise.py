"""What counts of a camera are worth: what its calibration or data sheet says, unless pictures differ."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.proof.raster import Counts, Floats
from dsl_core.model.rig import Sensor
from dsl_core.optics.seen_noise import noisier, usual_sensor
from dsl_core.optics.sensor import end_near_full

#: Pictures whose variance is remembered, as each is compared with several.
_REMEMBERED = 8


@dataclass
class Noise:
    """What a camera's counts are worth: by the ``stated`` sensor, with ``excess`` times its variance."""

    stated: Sensor
    excess: float = field(default=1.0, init=False)
    sensor: Sensor = field(init=False)
    _known: dict[int, tuple[Counts | Floats, Floats]] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    def __post_init__(self) -> None:
        """Believe what is stated."""
        self.sensor = self.stated

    def take(self, excess: float) -> None:
        """Take counts to have ``excess`` times the variance stated from now on."""
        if excess != self.excess:
            self.excess, self.sensor = excess, noisier(self.stated, excess)
            self._known.clear()

    def find_end(self, counts: Counts, channels: NDArray[np.int8]) -> None:
        """Believe what a picture, of these ``channels``, shows of where values end, just below full scale."""
        end = end_near_full(counts, self.stated.full_scale_dn, channels)
        if end == self.stated.full_scale_dn:
            return
        self.stated = self.stated.model_copy(update={"saturation_dn": end})
        self.sensor = self.sensor.model_copy(update={"saturation_dn": end})

    @classmethod
    def of(cls, sensor: Sensor | None, bit_depth: int) -> Noise:
        """Of a known sensor, or else of one like the published camera's with this bit depth."""
        return cls(usual_sensor(bit_depth) if sensor is None else sensor)

    @property
    def least_variance(self) -> float:
        """Variance of counts without any light, DN^2: no pixel has less."""
        return self.sensor.read_noise_dn**2 + 0.1

    def variance(self, counts: Counts | Floats) -> Floats:
        """Variance of counts, DN^2; those of pictures that cannot change are remembered."""
        known = self._known.get(id(counts))
        if known is not None and known[0] is counts:
            return known[1]
        sensor = self.sensor
        found = np.asarray(np.subtract(counts, np.float32(sensor.black_level_dn), dtype=np.float32))
        np.maximum(found, 0, out=found)
        found /= np.float32(sensor.electrons_per_dn)
        found += np.float32(self.least_variance)
        if not counts.flags.writeable:
            found.flags.writeable = False
            if len(self._known) >= _REMEMBERED:
                self._known.pop(next(iter(self._known)))
            self._known[id(counts)] = counts, found
        return found
