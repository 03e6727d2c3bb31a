"""What a bracket of settings makes of a radiance: variance, saturation and the noise of its black frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dsl_core.model.conditions import colour_sites
from dsl_core.model.plan import Setting
from dsl_core.model.rig import Rig, Sensor
from dsl_core.optics.sensor import bayer_channels, bayer_colours, raw_variance
from dsl_core.reconstruction.hdr import setting_gains_ms

#: As the merger of brackets: a raw value counts as saturated this close to full scale.
SATURATED = 0.98


@dataclass(frozen=True)
class Bracket:
    """Gains (ms at full drive), exposures and the sensor of a plan's settings; radiances are in DN per ms.

    ``black`` is the radiance of the projector's black and of the room, which no level dims: what a black
    frame holds of it is taken off, its shot noise is not. Next to the first orders of a dark setting it is
    most of the light.
    """

    gains_ms: tuple[float, ...]
    exposures_ms: tuple[float, ...]
    sensor: Sensor

    @classmethod
    def of(cls, rig: Rig, settings: Sequence[Setting]) -> Bracket:
        """The bracket of settings on a rig."""
        gains = setting_gains_ms(settings, rig.projector_response).tolist()
        return cls(tuple(gains), tuple(setting.exposure_ms for setting in settings), rig.sensor)

    def floors(self, black: Tensor) -> Tensor:
        """Variance of a raw value of each setting's black frame, DN^2, (settings, ...)."""
        return torch.stack([self._floor(black * exposure_ms) for exposure_ms in self.exposures_ms])

    def _floor(self, black_dn: Tensor) -> Tensor:
        """Read noise, rounding and the shot noise of black."""
        dark = float(raw_variance(self.sensor, np.zeros(())))
        return dark + black_dn / self.sensor.electrons_per_dn

    def information(self, radiance: Tensor, black: Tensor, true: Tensor | None = None) -> Tensor:
        """Inverse variance of each setting's own estimate, (settings, ...); zero where saturated.

        Raw values saturate, not what they are merged to: of noisy radiances, ``true`` ones say which do.
        """
        limit = SATURATED * self.sensor.full_scale_dn - self.sensor.black_level_dn
        parts = []
        for gain, exposure_ms in zip(self.gains_ms, self.exposures_ms, strict=True):
            signal, black_dn = (radiance * gain).clip(min=0), black * exposure_ms
            variance = self._floor(black_dn) + signal / self.sensor.electrons_per_dn
            clean = signal if true is None else true * gain
            parts.append((clean + black_dn < limit) * gain**2 / variance)
        return torch.stack(parts)

    def variance(self, radiance: Tensor, black: Tensor, true: Tensor | None = None) -> Tensor:
        """Variance of the merged radiance, same shape; infinite where every setting is saturated."""
        return 1 / self.information(radiance, black, true).sum(0)

    def black_weights(self, radiance: Tensor, black: Tensor) -> Tensor:
        """How much a DN of each setting's black frame lowers the merged radiance, (settings, ...)."""
        information = self.information(radiance, black)
        share = information / information.sum(0).clip(min=1e-30)
        gains = torch.tensor(self.gains_ms).to(radiance)
        return share / gains.reshape(-1, *(1,) * radiance.ndim)

    @property
    def unrounded(self) -> Bracket:
        """The bracket of a sensor of the same noise that rounds nothing."""
        sensor = self.sensor.model_copy(update={"step_dn": 1e-6})
        return Bracket(self.gains_ms, self.exposures_ms, sensor)

    def rounding(self, radiance: Tensor, black: Tensor) -> Tensor:
        """What rounding of raw values adds to the merged radiance on average over noise, same shape.

        It is the same in every frame and pixel of equal light: no mean takes it out. Noise of a third of a
        step does, as the first term of the mean of rounded normal values has it.
        """
        errors = []
        for gain, exposure_ms in zip(self.gains_ms, self.exposures_ms, strict=True):
            black_dn = black * exposure_ms
            raw_dn = (radiance * gain).clip(min=0) + black_dn
            errors.append(self._rounded_off(raw_dn) - self._rounded_off(black_dn))
        error: Tensor = (self.black_weights(radiance, black) * torch.stack(errors)).sum(0)
        return error

    def _rounded_off(self, light_dn: Tensor) -> Tensor:
        step_dn = self.sensor.step_dn
        steps = (light_dn + self.sensor.black_level_dn) / step_dn
        # The floor holds the variance of rounding itself, which carries no light across steps.
        variance = self._floor(light_dn) / step_dn**2 - 1 / 12
        error: Tensor = (steps.round() - steps) * step_dn * (-2 * torch.pi**2 * variance.clip(min=0)).exp()
        return error


def demosaic_factors(rig: Rig, pixels: NDArray[np.int64]) -> NDArray[np.float64]:
    """Variance of each colour at pixels relative to that of a sample of the mosaic, (pixels, 3).

    A sample measured there counts once; bilinear means of two or four samples have a half or a quarter. Where
    there is no mosaic, every colour is the pixel's own sample.
    """
    if rig.sensor.bayer == "MONO":
        return np.ones((len(pixels), 3))
    return _by_neighbours(rig, pixels, own=1.0, cross=0.25, sideways=0.5, below=0.5, diagonal=0.25)


def sideways_shares(rig: Rig, pixels: NDArray[np.int64]) -> NDArray[np.float64]:
    """Share of each colour at pixels that bilinear means take from neighbouring columns, (pixels, 3)."""
    if rig.sensor.bayer == "MONO":
        return np.zeros((len(pixels), 3))
    return _by_neighbours(rig, pixels, own=0.0, cross=0.5, sideways=1.0, below=0.0, diagonal=1.0)


def measured_colours(rig: Rig) -> NDArray[np.bool_]:
    """Which of R, G and B are measurements of their own, (3,): without a mosaic there is one, as green."""
    return np.isin(np.arange(3), colour_sites(rig.sensor.bayer))


def _by_neighbours(
    rig: Rig,
    pixels: NDArray[np.int64],
    *,
    own: float,
    cross: float,
    sideways: float,
    below: float,
    diagonal: float,
) -> NDArray[np.float64]:
    """A value for each colour at pixels by where its nearest samples are, (pixels, 3)."""
    tile = bayer_channels(rig.sensor.bayer, 2, 2)
    y, x = np.divmod(pixels, rig.camera.width_px)
    found = np.empty((len(pixels), 3))
    for colour in range(3):
        here = tile[y % 2, x % 2] == colour
        across = tile[y % 2, (x + 1) % 2] == colour
        down = tile[(y + 1) % 2, x % 2] == colour
        cases = [here, across & down, across, down]
        found[:, colour] = np.select(cases, [own, cross, sideways, below], diagonal)
    return found


def own_channel(rig: Rig, pixels: NDArray[np.int64]) -> NDArray[np.int64]:
    """Colour that each pixel of the mosaic measures, (pixels,)."""
    y, x = np.divmod(pixels, rig.camera.width_px)
    return np.asarray(bayer_colours(rig.sensor.bayer, y, x), np.int64)
