"""The simulated world: a rig, a scene on a stage, a clock, and what the projector shows right now."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.rig import Rig
from dsl_core.optics.sensor import digitise
from dsl_core.simulation.renderer import Renderer
from dsl_core.simulation.truth import Scene, SceneTruth
from dsl_core.solve.threads import one_kernel_thread


@dataclass
class Clock:
    """Simulated time: waiting costs nothing unless ``sleep`` is a real one."""

    now_s: float = 0.0
    sleep: Callable[[float], None] = lambda seconds: None

    def wait(self, seconds: float) -> None:
        """Let time pass."""
        self.now_s += seconds
        self.sleep(seconds)


@dataclass
class World:
    """State shared by the simulated devices.

    ``scene_at`` gives the scene for a stage position (mm). Noise depends only on the seed, the shot and
    the attempt, never on what was captured before, so that an interrupted scan continues bit for bit.
    """

    rig: Rig
    scene_at: Callable[[float], Scene]
    position_mm: float = 700.0
    seed: int = 0
    noise: bool = True
    ambient_dn_per_ms: float = 0.002
    film: bool = True
    device: str = "cpu"
    clock: Clock = field(default_factory=Clock)
    image: NDArray[np.uint8] | None = None
    _truth: SceneTruth | None = None
    _renderer: Renderer | None = None
    _rate: NDArray[np.float32] | None = None

    def show(self, image: NDArray[np.uint8]) -> None:
        """Change what the projector shows."""
        self.image, self._rate = image.copy(), None

    def move_to(self, position_mm: float) -> None:
        """Move the stage; the scene changes with it."""
        if position_mm != self.position_mm:
            self.position_mm, self._truth, self._renderer, self._rate = position_mm, None, None, None

    @property
    def truth(self) -> SceneTruth:
        """Depth, normals, materials and shadow of the scene as it stands."""
        if self._truth is None:
            self._truth = self.scene_at(self.position_mm).render(
                self.rig.camera, self.rig.pose.projector_centre_mm
            )
        return self._truth

    @property
    def renderer(self) -> Renderer:
        """Renderer of the scene as it stands."""
        if self._renderer is None:
            with one_kernel_thread():
                self._renderer = Renderer(self.rig, self.truth, film=self.film, device=self.device)
        return self._renderer

    def rate(self) -> NDArray[np.float32]:
        """Expected signal of the camera for the pattern shown, DN per ms, shape (rows, columns)."""
        if self._rate is None:
            shape = (self.rig.projector.height_px, self.rig.projector.width_px, 3)
            image = np.zeros(shape, np.uint8) if self.image is None else self.image
            with one_kernel_thread():
                self._rate = self.renderer.expected(image) + np.float32(self.ambient_dn_per_ms)
        return self._rate

    def expose(self, exposure_ms: float, shot: int, attempt: int = 0) -> NDArray[np.uint16]:
        """Raw mosaic of one exposure."""
        signal = self.rate() * np.float32(exposure_ms)
        rng = np.random.Generator(np.random.SFC64([self.seed, shot, attempt])) if self.noise else None
        return digitise(self.rig.sensor, signal, rng)
