"""The film: zero and first orders, which everything rests on, second orders, and where it is not ideal."""

from __future__ import annotations

from dataclasses import replace
from operator import attrgetter
from types import MappingProxyType

import numpy as np

from dsl_core.simulation.effects.base import Effect, LightPath, Limits
from dsl_core.simulation.effects.tolerance import EffectBound
from dsl_core.simulation.rendering.spectral_tables import NM

FIRST, SECOND = (1, -1), (2, -2)
#: Pixels at which orders are traced, across and down, and how far columns in between may be off, px.
_RASTER, _MARGIN_PX = (25, 17), 20.0


class Orders(Effect):
    """Zero and first orders: what the method measures."""

    name = "orders"
    summary = "zero and first orders of the film"
    needed = True

    def bound(self, limits: Limits) -> EffectBound:
        """All light there is."""
        return limits.of_share(1.0, "they are what is measured")


class SecondOrders(Effect):
    """Light through the second orders: faint, and mostly outside the projector's frame."""

    name = "second-orders"
    summary = "second orders of the film"
    ns_per_pixel = 12.0

    def bound(self, limits: Limits) -> EffectBound:
        """All their light if any of it comes from inside the projector's frame."""
        if not limits.path.film:
            return limits.of_dn(0.0, "there is no film")
        if not reaches(limits.path, SECOND):
            return limits.of_dn(0.0, "their columns are outside the projector's frame")
        reflectance = limits.path.truth.materials.at(NM)
        share = limits.share(limits.white(reflectance, SECOND), reflectance)
        return limits.of_share(share, "their columns reach into the projector's frame")

    def leave_out(self, path: LightPath) -> LightPath:
        """See `Effect`."""
        return replace(path, orders=tuple(m for m in path.orders if m not in SECOND))


def reaches(path: LightPath, orders: tuple[int, ...]) -> bool:
    """Whether any pixel sees light of some orders from inside the projector's frame, or nearly.

    Traced on a raster of pixels; columns vary so smoothly that the margin covers what is between.
    """
    import torch

    from dsl_core.optics.correspondence import GratingModel

    lens, depth = path.rig.camera, path.truth.depth_mm
    across, down = (
        np.linspace(0, size - 1, count).round().astype(int)
        for size, count in zip((lens.width_px, lens.height_px), _RASTER, strict=True)
    )
    known = depth[np.isfinite(depth)]
    if not len(known):
        return False
    flat = torch.as_tensor((down[:, None] * lens.width_px + across).ravel())
    grating, width = GratingModel(path.rig), path.rig.projector.width_px
    for z_mm in (known.min(), known.max()):
        at = torch.full((len(flat),), float(z_mm), dtype=torch.float64)
        for order in orders:
            columns = grating.exact(flat, at, order, NM[[0, -1]]).columns
            low, high = columns.amin(0), columns.amax(0)
            if ((high > -0.5 - _MARGIN_PX) & (low < width - 0.5 + _MARGIN_PX)).any():
                return True
    return False


class FilmShape(Effect):
    """A deviation of the film from its ideal values."""

    def bound(self, limits: Limits) -> EffectBound:
        """Moved columns change all dispersed light, however little they move; never the zero order."""
        path = limits.path
        if not path.film or all(attrgetter(name)(path) == value for name, value in self.ideal.items()):
            return limits.of_dn(0.0, "the film is ideal in this respect, or there is none")
        reflectance = path.truth.materials.at(NM)
        dispersed = limits.white(reflectance, (*FIRST, *SECOND))
        return limits.of_share(
            limits.share(dispersed, reflectance), "it moves the columns of all dispersed light"
        )


class FilmBend(FilmShape):
    """A film that is not flat."""

    name = "film-bend"
    summary = "bend of the film"
    ideal = MappingProxyType({"rig.film.bend_per_mm": 0.0, "rig.film.shape": None})


class FilmTilt(FilmShape):
    """A film that is not square to the projector's axis, or whose lines are not upright."""

    name = "film-tilt"
    summary = "tilt and roll of the film"
    ideal = MappingProxyType(
        {"rig.film.tilt_x_deg": 0.0, "rig.film.tilt_y_deg": 0.0, "rig.film.roll_deg": 0.0}
    )


class FilmPeriod(FilmShape):
    """A film whose lines are closer together, or further apart, than it says."""

    name = "film-period"
    summary = "period other than 500 lines/mm"
    ideal = MappingProxyType({"rig.film.lines_per_mm": 500.0})
