"""What the projector does to a pattern: blur, halo in the film, black level, gamma, and LEDs in turn."""

from __future__ import annotations

from types import MappingProxyType

from dsl_core.simulation.effects.base import Effect, Limits
from dsl_core.simulation.effects.tolerance import EffectBound

#: A blur that no sample of the twin shows.
_SHARP_PX = 1e-3


class Blur(Effect):
    """Blur of the projected pixels where they are in focus."""

    name = "blur"
    summary = "blur of the projector"
    ideal = MappingProxyType(
        {"rig.projector_response.spread": None, "rig.projector_response.blur_px": _SHARP_PX}
    )

    def bound(self, limits: Limits) -> EffectBound:
        """At the edge of a line all of its light."""
        return limits.of_share(1.0, "edges of lines turn from soft to hard")


class Halo(Effect):
    """Light of the zero order that the film scatters sideways."""

    name = "halo"
    summary = "halo of the zero order"
    ideal = MappingProxyType({"rig.projector_response.halo_peak_per_px": 0.0})

    def bound(self, limits: Limits) -> EffectBound:
        """Its share of white."""
        if limits.halo == 0:
            return limits.of_dn(0.0, "there is no film, or it does not scatter")
        share = limits.halo / (1 + limits.halo)
        return limits.of_share(
            share, f"it contains {100 * limits.halo:.2g} % of the light of a white pattern"
        )


class BlackLevel(Effect):
    """Light of a projector that shows black."""

    name = "black-level"
    summary = "light of a dark projector"
    ideal = MappingProxyType({"rig.projector_response.black_fraction": 0.0})

    def bound(self, limits: Limits) -> EffectBound:
        """Its share of white over the longest exposure."""
        black = limits.path.rig.projector_response.black_fraction
        reason = f"black is {100 * black:.2g} % of white" if black else "the projector has a perfect black"
        return limits.of_dn(black * limits.ceiling * limits.demand.exposure_ms, reason)


class Gamma(Effect):
    """Radiance as a power of the drive level, or as a curve was measured; without it, it is proportional."""

    name = "gamma"
    summary = "gamma of the projector"
    ideal = MappingProxyType({"rig.projector_response.gamma": 1.0, "rig.projector_response.tone": None})

    def bound(self, limits: Limits) -> EffectBound:
        """The largest difference of radiance up to the level of each setting."""
        response = limits.path.rig.projector_response
        gamma = response.gamma
        reason = "the projector is linear" if gamma == 1 else f"radiance rises with a power of {gamma:.3g}"
        if response.tone is not None:
            reason = "radiance rises with a curve that was measured"
        return limits.of_dn(limits.demand.bent_ms * limits.ceiling, reason)


class LedCycle(Effect):
    """LEDs that flash one after the other, so that exposures catch more of one than of another."""

    name = "led-cycle"
    summary = "LEDs that flash in turn"
    ideal = MappingProxyType({"led_cycle_ms": None})

    def bound(self, limits: Limits) -> EffectBound:
        """The largest deviation of an LED's light in an exposure, whenever it starts."""
        if limits.path.led_cycle_ms is None:
            return limits.of_dn(0.0, "the LEDs shine steadily")
        worst_ms = limits.demand.uneven_ms
        reason = "exposures are not whole numbers of cycles" if worst_ms else "exposures are whole cycles"
        return limits.of_dn(worst_ms * limits.ceiling, reason)
