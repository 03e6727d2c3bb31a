"""What a camera's counts are worth: what its calibration or data sheet says, unless pictures are noisier."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from dsl_core.capture.proof.raster import Counts, Floats
from dsl_core.model.rig import Sensor

#: Pictures whose variance is remembered, as each is compared with several.
_REMEMBERED = 8


@dataclass
class Noise:
    """What a camera's counts are worth."""

    sensor: Sensor
    _known: dict[int, tuple[Counts | Floats, Floats]] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    def take(self, sensor: Sensor) -> None:
        """Count by another sensor from now on."""
        if sensor != self.sensor:
            self.sensor = sensor
            self._known.clear()

    @classmethod
    def of(cls, sensor: Sensor | None, bit_depth: int) -> Noise:
        """Of a known sensor, or else of one like the published camera's with this bit depth."""
        if sensor is not None:
            return cls(sensor)
        share = 2.0 ** (bit_depth - 12)
        usual = Sensor()
        return cls(
            Sensor(
                bit_depth=bit_depth,
                black_level_dn=0.0,
                electrons_per_dn=usual.electrons_per_dn / share,
                read_noise_dn=max(2.0 * share, 0.5),
            )
        )

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
