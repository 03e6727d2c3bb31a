"""What a bracket of settings makes of a radiance: variance, saturation and the noise of its black frames."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dsl_core.model.plan import CapturePlan
from dsl_core.model.rig import Rig, Sensor
from dsl_core.optics.sensor import bayer_channels
from dsl_core.reconstruction.hdr import setting_gains_ms

#: As the merger of brackets: a raw value counts as saturated this close to full scale.
SATURATED = 0.98


@dataclass(frozen=True)
class Bracket:
    """Gains (ms at full drive) and the sensor of a plan's settings; radiances are in DN per ms."""

    gains_ms: tuple[float, ...]
    sensor: Sensor

    @classmethod
    def of(cls, rig: Rig, plan: CapturePlan) -> Bracket:
        """The bracket of a plan on a rig."""
        return cls(tuple(setting_gains_ms(plan.settings, rig.projector_response).tolist()), rig.sensor)

    @property
    def floor(self) -> float:
        """Variance of a raw value without light, DN^2: read noise and rounding."""
        return self.sensor.read_noise_dn**2 + 1 / 12

    def information(self, radiance: Tensor) -> Tensor:
        """Inverse variance of each setting's own estimate, (settings, ...); zero where saturated."""
        limit = SATURATED * self.sensor.full_scale_dn - self.sensor.black_level_dn
        parts = []
        for gain in self.gains_ms:
            signal = (radiance * gain).clip(min=0)
            parts.append((signal < limit) * gain**2 / (self.floor + signal / self.sensor.electrons_per_dn))
        return torch.stack(parts)

    def variance(self, radiance: Tensor) -> Tensor:
        """Variance of the merged radiance, same shape; infinite where every setting is saturated."""
        return 1 / self.information(radiance).sum(0)

    def black_weights(self, radiance: Tensor) -> Tensor:
        """How much a DN of each setting's black frame lowers the merged radiance, (settings, ...)."""
        information = self.information(radiance)
        share = information / information.sum(0).clip(min=1e-30)
        gains = torch.tensor(self.gains_ms).to(radiance)
        return share / gains.reshape(-1, *(1,) * radiance.ndim)


def demosaic_factors(rig: Rig, pixels: NDArray[np.int64]) -> NDArray[np.float64]:
    """Variance of each colour at pixels relative to that of a sample of the mosaic, (pixels, 3).

    A sample measured there counts once; bilinear means of two or four samples have a half or a quarter.
    """
    return _by_neighbours(rig, pixels, own=1.0, cross=0.25, beside=0.5, below=0.5, diagonal=0.25)


def sideways_shares(rig: Rig, pixels: NDArray[np.int64]) -> NDArray[np.float64]:
    """Share of each colour at pixels that bilinear means take from the columns beside, (pixels, 3)."""
    return _by_neighbours(rig, pixels, own=0.0, cross=0.5, beside=1.0, below=0.0, diagonal=1.0)


def _by_neighbours(
    rig: Rig,
    pixels: NDArray[np.int64],
    *,
    own: float,
    cross: float,
    beside: float,
    below: float,
    diagonal: float,
) -> NDArray[np.float64]:
    """A value for each colour at pixels by where its nearest samples lie, (pixels, 3)."""
    tile = bayer_channels(rig.sensor.bayer, 2, 2)
    y, x = np.divmod(pixels, rig.camera.width_px)
    found = np.empty((len(pixels), 3))
    for colour in range(3):
        here = tile[y % 2, x % 2] == colour
        across = tile[y % 2, (x + 1) % 2] == colour
        down = tile[(y + 1) % 2, x % 2] == colour
        cases = [here, across & down, across, down]
        found[:, colour] = np.select(cases, [own, cross, beside, below], diagonal)
    return found


def own_channel(rig: Rig, pixels: NDArray[np.int64]) -> NDArray[np.int64]:
    """Colour that each pixel of the mosaic measures, (pixels,)."""
    y, x = np.divmod(pixels, rig.camera.width_px)
    return np.asarray(bayer_channels(rig.sensor.bayer, 2, 2)[y % 2, x % 2])
