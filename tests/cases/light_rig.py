"""A small camera that looks straight at a projector's picture, both with faults to switch on.

Formulas only, so that the self-test is held against something that shares no code with it.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from dsl_core.devices.base import Camera, CameraInfo, DeviceRig, Projector, ProjectorInfo
from dsl_core.model.conditions import BayerPattern
from dsl_core.model.frames import Frame
from dsl_core.simulation.published_rig import published_rig

WIDTH, HEIGHT, SCALE = 160, 96, 4
#: Colour of each LED (rows) in the camera's channels, DN per ms.
MIX = np.array([[165.0, 44.0, 6.0], [40.0, 307.0, 73.0], [8.0, 32.0, 206.0]])
#: The same in the colour of each pixel, (LEDs, rows, columns); the last rows see beside the picture.
SEEN = MIX[:, np.array([[0, 1], [1, 2]])[np.arange(HEIGHT)[:, None] % 2, np.arange(WIDTH) % 2]]
SEEN[:, -16:] = 0
#: What pixels without a filter see of each LED.
PLAIN = np.where(SEEN > 0, np.array([90.0, 140.0, 96.0])[:, None, None], 0.0)
ELECTRONS_PER_DN, BLACK_DN = published_rig().sensor.electrons_per_dn, published_rig().sensor.black_level_dn


@dataclass
class LightWorld:
    """What is true; times in ms. ``cycle_hz`` None is steady light."""

    seed: int = 0
    cycle_hz: float | None = None
    gamma: tuple[float, float, float] = (2.2, 2.2, 2.2)
    srgb: bool = False
    black: float = 0.0005
    ambient: float = 0.002
    brightness: float = 1.0
    blocking_ms: float = 30.0
    late_ms: float = 0.0
    stamps: bool = True
    stale: bool = False
    ignores_exposure: bool = False
    longest_ms: float = 10_000.0
    connected: bool = True
    bend: float = 0.0
    drop: int = 256
    clip_dn: float = 4095.0
    step_dn: int = 1
    hot: int = 0
    drift_dn: float = 0.0
    longer_ms: float = 0.0
    filtered: bool = False
    fades: float = 0.0
    bands: float = 0.0
    row_noise_dn: float = 0.0
    mosaic_off: int = 0
    monochrome: bool = False
    bits: int = 12
    jitter_ms: float = 0.0
    now_ms: float = 0.0
    shown: list[tuple[float, NDArray[np.float64]]] = field(default_factory=list)

    def light(self, picture: NDArray[np.uint8]) -> NDArray[np.float64]:
        """What each LED brings of a picture in a ms, (LEDs, rows, columns), DN."""
        levels = np.arange(256)
        level = np.where(levels >= self.drop, 0.8, 1.0) * levels / 255
        light = level ** np.array(self.gamma)[:, None]
        if self.srgb:
            light = np.tile(
                np.where(level <= 0.04045, level / 12.92, ((level + 0.055) / 1.055) ** 2.4), (3, 1)
            )
        light = self.black + (1 - self.black) * light
        seen = PLAIN if self.monochrome else SEEN
        return np.asarray(np.stack([light[led][picture[..., led]] for led in range(3)]) * seen)

    def drive(self, start_ms: float, stop_ms: float) -> NDArray[np.float64]:
        """Light over an exposure, (rows, columns), DN."""
        edges = [*(time for time, _ in self.shown if start_ms < time < stop_ms), stop_ms]
        total = np.zeros((HEIGHT, WIDTH))
        for edge in edges:
            before = [light for time, light in self.shown if time <= start_ms]
            dark = not (before and self.connected)
            light = self.light(np.zeros((HEIGHT, WIDTH, 3), np.uint8)) if dark else before[-1]
            total += np.tensordot(self.on(start_ms, edge), light, 1)
            start_ms = edge
        return total

    def on(self, start_ms: float, stop_ms: float) -> NDArray[np.float64]:
        """For how long each LED was on, times three."""
        if self.cycle_hz is None:
            return np.full(3, stop_ms - start_ms)
        x = np.array([start_ms, stop_ms])[:, None] * self.cycle_hz / 1000 - np.arange(3) / 3
        done = np.floor(x) + np.clip(3 * (x - np.floor(x)), 0, 1)
        return np.asarray((done[1] - done[0]) * 1000 / self.cycle_hz)


class LightCamera(Camera):
    """Adds noise, rounding and clipping; unannounced faults come from the world."""

    def __init__(self, world: LightWorld) -> None:
        self.world, self.exposure_ms, self.number = world, 1.0, 0
        self.shot, self.attempt = 0, 0
        self.before: NDArray[np.uint16] | None = None
        self.faded: NDArray[np.float64] | None = None

    @property
    def info(self) -> CameraInfo:
        mosaic: BayerPattern = "MONO" if self.world.monochrome else "RGGB"
        return CameraInfo(
            "light", "L-C", WIDTH, HEIGHT, mosaic, self.world.bits, (0.02, self.world.longest_ms)
        )

    def configure(self, exposure_ms: float) -> float:
        self.exposure_ms = 10.0 if self.world.ignores_exposure else exposure_ms
        return exposure_ms

    def prepare(self, shot_index: int, attempt: int = 0) -> None:
        self.shot, self.attempt = shot_index, attempt

    def snap(self, timeout_ms: float = 5000.0) -> Frame:
        world = self.world
        rng = np.random.default_rng((world.seed, self.shot, self.attempt))
        start = world.now_ms + world.jitter_ms * rng.random()
        signal = world.drive(start, start + self.exposure_ms + world.longer_ms) * world.brightness
        rows = np.arange(HEIGHT)[:, None] / HEIGHT
        signal = signal * (1 + world.bands * np.sin(2 * np.pi * (3 * rows + rng.random())))
        signal = signal - world.bend * np.minimum(signal, 4095) ** 2 / 4095 + world.ambient * self.exposure_ms
        signal = signal + rng.standard_normal(signal.shape) * np.sqrt(
            np.maximum(signal, 0) / ELECTRONS_PER_DN + 1
        )
        if world.row_noise_dn:
            signal = signal + world.row_noise_dn * rng.standard_normal((HEIGHT, 1))
        if world.filtered:
            for row, column in np.ndindex(2, 2):
                signal[row::2, column::2] = median_filter(signal[row::2, column::2], 3)
        if world.fades and self.faded is not None and np.abs(self.faded - signal).mean() < 50:
            signal = (1 - world.fades) * signal + world.fades * self.faded
        self.faded = signal.copy()
        signal.flat[: world.hot * 7 : 7] += 300
        signal = np.roll(signal, world.mosaic_off, 1) + world.drift_dn * self.number
        pixels = np.clip(np.rint(signal + BLACK_DN), 0, world.clip_dn).astype(np.uint16)
        pixels -= pixels % world.step_dn
        delivered = self.before if world.stale and self.before is not None else pixels
        self.before = pixels
        world.now_ms += self.exposure_ms
        self.number += 1
        return Frame(delivered, self.exposure_ms, world.now_ms / 1000 if world.stamps else 0.0, self.number)


class LightProjector(Projector):
    """Returns after the blocking time; the picture comes later still by ``late_ms``."""

    def __init__(self, world: LightWorld) -> None:
        self.world = world

    @property
    def info(self) -> ProjectorInfo:
        return ProjectorInfo("light", "L-P", WIDTH * SCALE, HEIGHT * SCALE, 30.0, 1000 / 60)

    def show(self, image: NDArray[np.uint8]) -> None:
        colour = image if image.ndim == 3 else np.repeat(image[..., None], 3, 2)
        self.world.now_ms += self.world.blocking_ms
        small = colour[::SCALE, ::SCALE]
        self.world.shown = [
            *self.world.shown[-3:],
            (self.world.now_ms + self.world.late_ms, self.world.light(small)),
        ]


def light_rig(world: LightWorld) -> DeviceRig:
    """The devices of a world, on its clock."""

    def sleep(seconds: float) -> None:
        world.now_ms += 1000 * seconds

    return DeviceRig("light", LightCamera(world), LightProjector(world), nominal=published_rig(), sleep=sleep)
