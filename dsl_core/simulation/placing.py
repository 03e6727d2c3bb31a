"""The twin's hand: puts targets, film and filters where a calibration asks for them."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass

from dsl_core.errors import DeviceError, PlanError
from dsl_core.model.placement import Placement
from dsl_core.model.spectral import SpectralCurve
from dsl_core.simulation.bandpass_filters import true_transmission
from dsl_core.simulation.scenes.catalogue import make_scene
from dsl_core.simulation.scenes.truth import Scene
from dsl_core.simulation.twin_options import TwinOptions
from dsl_core.simulation.world import World

#: Where a stage stands when nothing is asked.
STAGE_MM = 700.0


@dataclass(frozen=True)
class _Before:
    """What was there before the first target was placed."""

    scene_at: Callable[[float], Scene]
    position_mm: float
    film: bool
    filter: SpectralCurve | None
    noise_key: tuple[int, ...]


@dataclass
class TwinHand:
    """Does for the twin what instructions ask of a person; ``filter_seed`` draws the set of filters."""

    world: World
    filter_seed: int
    mishaps: TwinOptions
    _standing: tuple[str, dict[str, float | str]] | None = None
    _before: _Before | None = None
    _placement: Placement | None = None

    def __call__(self, placement: Placement) -> None:
        """Place a target; raises `DeviceError` or `PlanError` for one that there is not."""
        label = placement.filter_nm
        if label is not None and self.mishaps.wrong_filter_nm is not None:
            label = self.mishaps.wrong_filter_nm
        if self._before is None:
            setup = self.world.setup
            own = self.world.scene_at, self.world.position_mm
            self._before = _Before(*own, setup.film, setup.filter, self.world.noise_key)
        askew = self.mishaps.filter_tilt_deg, self.mishaps.filter_off_nm
        curve = None if label is None else true_transmission(float(label), self.filter_seed, *askew)
        if placement.target != "as it is":
            scene_at, position = self._scene(placement)
            asked = (placement.target, dict(placement.options))
            if asked != self._standing:
                # Made once before anything moves, so that an impossible scene changes nothing.
                scene_at(position)
                self.world.place(scene_at, position)
                self._standing = asked
            self.world.position_mm = position
        self.world.insert(placement.film, curve)
        self.world.noise_key = (zlib.crc32(placement.model_dump_json().encode()),)
        self._placement = placement

    def put_back(self) -> None:
        """Put scene, film and filter back as they were before the first target was placed."""
        if self._before is None:
            return
        self.world.place(self._before.scene_at, self._before.position_mm)
        self.world.insert(self._before.film, self._before.filter)
        self.world.noise_key = self._before.noise_key
        self._before = self._standing = self._placement = None

    def standing(self) -> str:
        """What is before the camera: the twin's scene, or the target of a calibration with its options.

        What is placed "as it is" leaves the scene, and changes film and filter only.
        """
        placed = self._placement
        if placed is None:
            return self.mishaps.scene
        target = self.mishaps.scene if self._standing is None else self._standing[0]
        options = {} if self._standing is None else self._standing[1]
        words = [
            f"{name}={value:g}" if isinstance(value, float) else f"{name}={value}"
            for name, value in options.items()
        ]
        film = [] if placed.film else ["film off"]
        beam = [] if placed.filter_nm is None else [f"filter {placed.filter_nm:g} nm"]
        return ", ".join([" ".join([target, *words]), *film, *beam])

    def _scene(self, placement: Placement) -> tuple[Callable[[float], Scene], float]:
        """The scene at each stage position, and the requested position."""
        options = dict(placement.options)
        match placement.target:
            case "nothing":
                return lambda position_mm: make_scene("plane", depth_mm=5000.0, reflectance=0.0), STAGE_MM
            case "spectralon":
                position = _position_mm(options)
                return lambda position_mm: self._diffuser(position_mm, options), position
            case "color-checker" | "board" if self.mishaps.target_missing:
                return lambda position_mm: make_scene("plane", depth_mm=position_mm), STAGE_MM
            case "color-checker":
                turn = (float(options.pop("roll_deg", 0.0)) + self.mishaps.chart_roll_deg + 180) % 360 - 180
                return lambda position_mm: make_scene("color-checker", roll_deg=turn, **options), STAGE_MM
            case "board":
                position = _position_mm(options)
                printed = {**options, **self._mistaken(options)}
                return lambda mm: make_scene("board", depth_mm=self._carried_to(mm), **printed), position
        raise DeviceError(f"The twin has no target {placement.target!r}.")

    def _mistaken(self, options: dict[str, float | str]) -> dict[str, float]:
        """Options of a board that differ from what was asked."""
        found = {}
        if self.mishaps.board_shift_mm:
            found["x_mm"] = float(options.get("x_mm", 0.0)) + self.mishaps.board_shift_mm
        if self.mishaps.print_scale != 1:
            sizes = [name for name in ("square_mm", "marker_mm") if name in options]
            found |= {name: float(options[name]) * self.mishaps.print_scale for name in sizes}
        return found

    def _diffuser(self, position_mm: float, options: dict[str, float | str]) -> Scene:
        depth = self._carried_to(position_mm)
        if self.mishaps.bow_mm:
            return make_scene("bowed", depth_mm=depth, bow_mm=self.mishaps.bow_mm, **options)
        return make_scene("plane", depth_mm=depth, **options)

    def _carried_to(self, position_mm: float) -> float:
        """Where a stage that says it is at a position really carries its target, mm."""
        return STAGE_MM + (position_mm - STAGE_MM) * self.mishaps.stage_scale


def _position_mm(options: dict[str, float | str]) -> float:
    """Take the depth out of a target's options: where the stage stands at first, mm."""
    depth = options.pop("depth_mm", STAGE_MM)
    try:
        return float(depth)
    except ValueError as error:
        raise PlanError(f"Option depth_mm must be a number of mm, not {depth!r}.") from error
