"""How surfaces stand in the light: shading and cast shadow."""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType

import numpy as np

from dsl_core.simulation.effects.base import SLACK, Effect, LightPath, Limits
from dsl_core.simulation.effects.tolerance import EffectBound
from dsl_core.simulation.rendering.shading import surface_shading


class Shading(Effect):
    """Cosine of incidence and inverse square of the distance."""

    name = "shading"
    summary = "cosine of incidence and distance"
    ideal = MappingProxyType({"shaded": False})

    def bound(self, limits: Limits) -> EffectBound:
        """The largest deviation from the light on a surface that faces the projector at 700 mm."""
        path = limits.path
        shaded, flat = (surface_shading(path.rig, path.truth, how) for how in (True, False))
        most = float(np.abs(shaded - flat).max())
        reason = (
            f"light on the surfaces differs by up to {100 * most:.3g} % of that at the reference distance"
        )
        return limits.of_light(SLACK * most * limits.brightest * limits.amplification, reason)


class Shadow(Effect):
    """Points that something hides from the projector."""

    name = "shadow"
    summary = "cast shadow"

    def bound(self, limits: Limits) -> EffectBound:
        """The light on the brightest point that is hidden."""
        hidden = self._hidden(limits.path)
        if not hidden.any():
            return limits.of_dn(0.0, "the projector lights everything that the camera images")
        path = self.leave_out(limits.path)
        # Not less than without shading, so that the two may be left out together.
        shading = np.maximum(
            surface_shading(path.rig, path.truth), surface_shading(path.rig, path.truth, False)
        )
        most = float(limits.per_pixel(np.where(hidden, shading, 0.0)).max())
        reason = f"{100 * float(hidden.mean()):.2g} % of the pixels are in shadow"
        return limits.of_light(SLACK * most * limits.amplification, reason)

    def leave_out(self, path: LightPath) -> LightPath:
        """See `Effect`."""
        return replace(path, truth=replace(path.truth, lit=np.isfinite(path.truth.depth_mm)))

    def _hidden(self, path: LightPath) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
        return np.asarray(np.isfinite(path.truth.depth_mm) & ~path.truth.lit)
