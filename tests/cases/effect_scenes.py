"""Small worlds of the twin with effects, and pictures that show what an effect does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.rig import FlatField, Rig
from dsl_core.simulation.effects.base import LightPath, Limits, PatternView, make_view
from dsl_core.simulation.effects.sensor import out_of_focus
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.rendered_scene import EffectRequest, Setup
from dsl_core.simulation.scenes.catalogue import make_scene
from dsl_core.simulation.world import World
from dsl_core.solve.threads import one_kernel_thread

SIZE = (64, 42)
#: Projector px.
WIDTH, HEIGHT = 160, 90
#: A scene for each effect in which it changes some picture by more than a DN.
CALLS_FOR = {
    "second-orders": "plane",
    "film-bend": "plane",
    "film-tilt": "plane",
    "film-period": "plane",
    "distortion": "filters",
    "blur": "plane",
    "halo": "plane",
    "black-level": "plane",
    "gamma": "plane",
    "led-cycle": "plane",
    "shading": "plane",
    "shadow": "sphere",
    "interreflection": "box",
    "subsurface": "wax",
    "specular": "sphere gloss=0.04",
    "glare": "plane",
    "depth-of-field": "steps step_mm=60 depth_mm=600",
    "vignetting": "plane",
    "ambient": "plane",
    "defocus": "filters",
    "shot-noise": "plane",
    "read-noise": "plane",
    "saturation": "plane",
}


def small_rig(size: tuple[int, int] = SIZE) -> Rig:
    """The published rig with a coarse camera and a coarse projector."""
    rig = published_rig()
    return rig.model_copy(
        update={"camera": rig.camera.resized(*size), "projector": rig.projector.resized(WIDTH, HEIGHT)}
    )


def world_of(
    scene: str,
    rig: Rig | None = None,
    request: EffectRequest | None = None,
    noise: bool = True,
    **setup: float | None,
) -> World:
    """A world with a scene like ``steps step_mm=60``; ``setup`` are numbers of its `Setup`."""
    name, *options = scene.split()
    chosen = dict(option.split("=") for option in options)
    return World(
        replace(Setup(rig or small_rig()), **setup),  # type: ignore[arg-type]
        lambda position_mm: make_scene(name, **chosen),
        request=request or EffectRequest(),
        noise=noise,
    )


def troubled_world(scene: str) -> World:
    """A world with what the published rig has not: a dim corner, LEDs in turn, defocus, a bright room."""
    rows, columns = (0.0, SIZE[1] - 1.0), (0.0, SIZE[0] - 1.0)
    uneven = FlatField(rows_px=rows, columns_px=columns, gain=((0.8, 1.0), (1.0, 1.1)))
    rig = small_rig().model_copy(update={"flat_field": uneven})
    return world_of(scene, rig, led_cycle_ms=1000 / 61, defocus_px=0.7, ambient_dn_per_ms=0.01)


def pictures(rng: np.random.Generator) -> list[NDArray[np.uint8]]:
    """Drive levels: a line, stripes along rows, columns of random levels, and white, up to level 0.8."""
    line, stripes = np.zeros((2, HEIGHT, WIDTH), np.uint8)
    start = int(rng.integers(40, 110))
    line[:, start : start + 5] = 204
    stripes[(np.arange(HEIGHT) // int(rng.integers(2, 9))) % 2 == 1] = 204
    columns = np.broadcast_to(rng.integers(0, 205, WIDTH, np.uint8), (HEIGHT, WIDTH)).copy()
    return [line, stripes, columns, np.full((HEIGHT, WIDTH), 204, np.uint8)]


def frame_dn(
    path: LightPath, view: PatternView, image: NDArray[np.uint8], exposure_ms: float
) -> NDArray[np.float32]:
    """What a frame shows without noise and rounding: expected counts, ended at full scale."""
    sensor = path.rig.sensor
    if path.defocus_px:
        signal = out_of_focus(view, image, path.defocus_px, sensor.bayer)
    else:
        signal = view.expected(image)
    signal = signal + np.float32(path.ambient_dn_per_ms)
    value = signal * np.float32(exposure_ms) + np.float32(sensor.black_level_dn)
    return np.asarray(np.minimum(value, sensor.full_scale_dn))


def frames_dn(path: LightPath, images: list[NDArray[np.uint8]], exposure_ms: float) -> NDArray[np.float32]:
    """Frames of some pictures, (pictures, rows, columns)."""
    with one_kernel_thread():
        view = make_view(path)
        return np.stack([frame_dn(path, view, image, exposure_ms) for image in images])


def largest_change(one: LightPath, other: LightPath, images: list[NDArray[np.uint8]]) -> float:
    """The largest difference of any pixel between frames of two paths in the longest exposure, DN."""
    exposure_ms = Limits(one).demand.exposure_ms
    first, second = (frames_dn(path, images, exposure_ms) for path in (one, other))
    return float(np.abs(first - second).max())
