"""What happens on the way to digital numbers: room light, blur, noise, rounding and saturation."""

from __future__ import annotations

from types import MappingProxyType

import numpy as np

from dsl_core.model.rig import BayerPattern
from dsl_core.optics.sensor import bayer_channels, raw_variance
from dsl_core.simulation.effects.base import Effect, Image, Limits, PatternView, Signal
from dsl_core.simulation.effects.tolerance import EffectBound

#: Normal noise beyond so many standard deviations comes about once in 10^15 pixels, a million scans.
TAIL_SIGMAS = 8.0
#: So many electrons make a DN that shot noise vanishes; so many bits that nothing saturates.
_MANY_ELECTRONS, _CONTAINER_BITS = 1e12, 16


class Ambient(Effect):
    """Light of the room."""

    name = "ambient"
    summary = "ambient light"
    ideal = MappingProxyType({"ambient_dn_per_ms": 0.0})

    def bound(self, limits: Limits) -> EffectBound:
        """That of the longest exposure."""
        ambient = limits.path.ambient_dn_per_ms
        reason = f"the room adds {ambient:.2g} DN/ms" if ambient else "the room is dark"
        return limits.of_dn(ambient * limits.demand.exposure_ms, reason)


class Defocus(Effect):
    """A camera lens set wrongly: the same blur everywhere."""

    name = "defocus"
    summary = "camera out of focus"
    ideal = MappingProxyType({"defocus_px": 0.0})

    def bound(self, limits: Limits) -> EffectBound:
        """Any pixel may turn from black to white."""
        if limits.path.defocus_px == 0:
            return limits.of_dn(0.0, "the camera is focused")
        return limits.of_share(1.0, "edges in the image turn from soft to hard")


def out_of_focus(view: PatternView, image: Image, sigma_px: float, bayer: BayerPattern) -> Signal:
    """Signal (rows, columns) of a pattern through a lens that blurs each colour before the mosaic."""
    from scipy.ndimage import gaussian_filter

    planes = gaussian_filter(view.planes(image), (0, sigma_px, sigma_px), mode="nearest")
    mosaic = bayer_channels(bayer, *planes.shape[1:])
    return np.asarray(np.take_along_axis(planes, mosaic[None], 0)[0])


class ShotNoise(Effect):
    """Light comes in quanta."""

    name = "shot-noise"
    summary = "shot noise"
    ideal = MappingProxyType({"rig.sensor.electrons_per_dn": _MANY_ELECTRONS})
    ns_per_pixel = 2.0

    def bound(self, limits: Limits) -> EffectBound:
        """Eight standard deviations at the brightest signal that does not saturate."""
        sensor = limits.path.rig.sensor
        signal = min(limits.most_dn, sensor.full_scale_dn - sensor.black_level_dn)
        noise_dn = float(np.sqrt(signal / sensor.electrons_per_dn))
        return limits.of_dn(TAIL_SIGMAS * noise_dn, f"its standard deviation is up to {noise_dn:.2g} DN")


class ReadNoise(Effect):
    """Noise of the electronics."""

    name = "read-noise"
    summary = "read noise"
    ideal = MappingProxyType({"rig.sensor.read_noise_dn": 0.0})
    ns_per_pixel = 2.0

    def bound(self, limits: Limits) -> EffectBound:
        """Eight standard deviations."""
        noise_dn = limits.path.rig.sensor.read_noise_dn
        reason = f"its standard deviation is {noise_dn:.2g} DN" if noise_dn else "the sensor has none"
        return limits.of_dn(TAIL_SIGMAS * noise_dn, reason)


class Saturation(Effect):
    """Numbers end at full scale; without it, at what the container holds."""

    name = "saturation"
    summary = "saturation of the sensor"
    ideal = MappingProxyType({"rig.sensor.bit_depth": _CONTAINER_BITS})

    def bound(self, limits: Limits) -> EffectBound:
        """What the brightest signal and its noise exceed full scale by."""
        sensor = limits.path.rig.sensor
        noise_dn = float(np.sqrt(raw_variance(sensor, np.array(limits.most_dn))))
        brightest = limits.most_dn + TAIL_SIGMAS * noise_dn
        excess = max(brightest + sensor.black_level_dn - sensor.full_scale_dn, 0.0)
        reason = (
            f"white would read up to {brightest:.3g} DN above black"
            if excess
            else "no pattern reaches full scale"
        )
        return EffectBound(excess, excess / limits.floor_dn, reason)


class Quantisation(Effect):
    """Frames hold whole steps of the sensor."""

    name = "quantisation"
    summary = "rounding to whole numbers"
    needed = True

    def bound(self, limits: Limits) -> EffectBound:
        """Half a step."""
        return limits.of_dn(limits.path.rig.sensor.step_dn / 2, "frames contain whole numbers")
