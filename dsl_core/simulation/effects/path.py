"""What light goes through on its way from the projector to the camera's numbers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.rig import Rig
from dsl_core.model.spectral import SpectralCurve
from dsl_core.simulation.rendering.renderer import ORDERS
from dsl_core.simulation.scenes.truth import Scene, SceneTruth

Image = NDArray[np.uint8]
Signal = NDArray[np.float32]


class View(Protocol):
    """What the camera sees of any pattern, DN per ms above black, without ambient light."""

    def expected(self, image: Image) -> Signal:
        """Signal of the mosaic (rows, columns) for drive levels (height, width, 3) or (height, width)."""

    def planes(self, image: Image) -> Signal:
        """Signal as without a mosaic, (3, rows, columns)."""

    def through(self, transmission: SpectralCurve | None) -> View:
        """The same view through a filter before the camera."""


class Stage(Protocol):
    """What an effect does to a picture of the direct light."""

    def apply(self, signal: Signal, image: Image) -> Signal:
        """The picture with the effect: the mosaic as (1, rows, columns), or (3, rows, columns) of colours."""

    def through(self, transmission: SpectralCurve | None) -> Stage:
        """The same behind a filter before the camera."""


class Extra(Protocol):
    """An effect that the plain renderer does not have."""

    @property
    def name(self) -> str:
        """Name of the effect."""

    def needs_colours(self, path: LightPath) -> bool:
        """Whether it mixes light of neighbouring pixels, so that each must be known in all colours."""

    def stage(self, path: LightPath) -> Stage:
        """Its rendering in a path."""


@dataclass(frozen=True)
class LightPath:
    """A rig before a scene, with everything that is to be rendered.

    ``extras`` are the effects beyond the plain renderer, in the order in which light meets them. Leaving an
    effect out gives another path.
    """

    rig: Rig
    scene: Scene
    truth: SceneTruth
    film: bool = True
    device: str = "cpu"
    orders: tuple[int, ...] = ORDERS
    shaded: bool = True
    ambient_dn_per_ms: float = 0.0
    led_cycle_ms: float | None = None
    defocus_px: float = 0.0
    extras: tuple[Extra, ...] = ()

    def extra(self, name: str) -> Extra | None:
        """An effect beyond the plain renderer, if the path has it."""
        return next((effect for effect in self.extras if effect.name == name), None)
