"""What a camera's counts are worth: what its calibration or data sheet says, unless pictures are noisier.

Every pair of a pattern and its inverse adds up to the same light, so that sums of two pairs differ by noise
alone, unless a picture is wrong. That is told apart by place: noise is in every part of a picture, and
independent from pixel to pixel, while a wrong picture differs smoothly where the surface is smooth.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from dsl_core.capture.proof.raster import Counts, Floats, Raster
from dsl_core.model.rig import Sensor

#: Pictures whose variance is remembered, as each is compared with several.
_REMEMBERED = 8
#: Median of the deviations of a normal distribution.
NORMAL = 0.6745
#: Parts of the picture that are compared, down and across, and the share of them that have less noise.
PARTS, CALM = 8, 0.25
#: Pixels that a part has to have.
FEWEST = 24
#: Deviations over those stated from which on these are not believed, and up to which the others are.
STATED_HOLDS, MOST = 1.5, 8.0
#: Deviations over those stated that no two exposures have.
NO_NOISE = 0.2


@dataclass
class Noise:
    """What a camera's counts are worth."""

    sensor: Sensor
    #: Variance over what the ``sensor`` says; its deviations are known too well to be less than stated.
    excess: float = 1.0
    _known: dict[int, tuple[Counts | Floats, Floats]] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    def take_excess(self, excess: float) -> None:
        """Have variances ``excess`` times as large from now on as the sensor says."""
        if excess != self.excess:
            self.excess = excess
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

    def variance(self, counts: Counts | Floats) -> Floats:
        """Variance of counts, DN^2; those of pictures that cannot change are remembered."""
        known = self._known.get(id(counts))
        if known is not None and known[0] is counts:
            return known[1]
        sensor = self.sensor
        found = np.asarray(np.subtract(counts, np.float32(sensor.black_level_dn), dtype=np.float32))
        np.maximum(found, 0, out=found)
        found /= np.float32(sensor.electrons_per_dn)
        found += np.float32(sensor.read_noise_dn**2 + 0.1)
        if self.excess != 1:
            found *= np.float32(self.excess)
        if not counts.flags.writeable:
            found.flags.writeable = False
            if len(self._known) >= _REMEMBERED:
                self._known.pop(next(iter(self._known)))
            self._known[id(counts)] = counts, found
        return found


def noise_excess(apart: Floats, variance: Floats, raster: Raster) -> float | None:
    """Variance over the one stated, 1 where that holds; None where nothing can be told.

    ``apart`` is the difference of the sums of two pairs, NaN where a picture is saturated or has no light,
    and ``variance`` that of the difference as stated, both flat over the raster. Pixels are compared with the
    next one of their colour in the row, so that what changes slowly over the picture does not count.
    """
    grid, stated = (each.reshape(raster.shape) for each in (apart, variance))
    steps = np.abs(grid[:, 2:] - grid[:, :-2]) / np.sqrt(stated[:, 2:] + stated[:, :-2])
    parts = [
        float(np.median(known)) / NORMAL
        for rows in np.array_split(steps, PARTS, axis=0)
        for part in np.array_split(rows, PARTS, axis=1)
        if (known := part[np.isfinite(part)]).size >= FEWEST
    ]
    if not parts:
        return None
    deviation = min(float(np.quantile(parts, CALM)), MOST)
    if deviation < NO_NOISE:
        return None  # a camera that sent pictures again
    return deviation**2 if deviation > STATED_HOLDS else 1.0
