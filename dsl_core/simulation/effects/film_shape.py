"""In what the film is not ideal: bend, tilt, and another period than its data sheet's."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

from dsl_core.simulation.effects.base import Effect
from dsl_core.simulation.effects.bound import EffectBound
from dsl_core.simulation.effects.limits import Limits
from dsl_core.simulation.effects.orders import FIRST, SECOND
from dsl_core.simulation.effects.path import LightPath
from dsl_core.simulation.rendering.spectral_tables import NM


@dataclass(frozen=True)
class FilmShape(Effect):
    """A deviation of the film; ``ideal`` are the values of its fields without it."""

    name: str
    summary: str
    ideal: Mapping[str, float]

    def parameters(self, path: LightPath) -> dict[str, str]:
        """See `Effect`."""
        return {field: f"{getattr(path.rig.film, field):g}" for field in self.ideal}

    def bound(self, limits: Limits) -> EffectBound:
        """Moved columns change all dispersed light, however little they move; never the zero order."""
        film = limits.path.rig.film
        if not limits.path.film or all(getattr(film, field) == value for field, value in self.ideal.items()):
            return limits.of_dn(0.0, "the film is ideal in this, or there is none")
        reflectance = limits.path.truth.materials.at(NM)
        dispersed = limits.white(reflectance, (*FIRST, *SECOND))
        share = dispersed / limits.from_orders(reflectance, limits.path.orders)
        return limits.of_share(float(share.max()), "it moves the columns of all dispersed light")

    def leave_out(self, path: LightPath) -> LightPath:
        """See `Effect`."""
        film = path.rig.film.model_copy(update=dict(self.ideal))
        return replace(path, rig=path.rig.model_copy(update={"film": film}))


FILM_BEND = FilmShape("film-bend", "bend of the film", MappingProxyType({"bend_per_mm": 0.0}))
FILM_TILT = FilmShape(
    "film-tilt",
    "tilt and roll of the film",
    MappingProxyType({"tilt_x_deg": 0.0, "tilt_y_deg": 0.0, "roll_deg": 0.0}),
)
FILM_PERIOD = FilmShape(
    "film-period", "period other than 500 lines/mm", MappingProxyType({"lines_per_mm": 500.0})
)
