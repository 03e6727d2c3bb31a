"""Whether anything moved or faded between two runs of one scan: old shots, taken again and compared."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.exposure import PatternImage, RetryPolicy, ShotTaker
from dsl_core.devices.base import DeviceRig
from dsl_core.model.frames import FrameSource
from dsl_core.model.plan import Shot
from dsl_core.model.rig import Sensor
from dsl_core.optics.seen_noise import usual_sensor
from dsl_core.optics.sensor import as_if_exposed, raw_variance

#: Pixels are averaged over blocks of this many rows and columns, so that noise does not pass for movement.
BLOCK_PX = 8
#: Changes of brightness or structure that a scan may continue with.
ALLOWED = 0.03
#: Deviations of what noise adds up to that it may have more than expected.
SIGMAS = 3.0


@dataclass(frozen=True)
class MovementReport:
    """How far two takes of the same shots differ.

    ``brightness_ratio`` is new over old light; ``change`` the root mean square difference of block means
    that remains after scaling, noise aside, as a share of their own root mean square, the largest of all
    shots compared.
    """

    shots: tuple[int, ...]
    brightness_ratio: float
    change: float

    @property
    def is_stable(self) -> bool:
        """Whether the scan may continue as one scan."""
        return max(self.change, abs(self.brightness_ratio - 1.0)) <= ALLOWED

    @property
    def message(self) -> str:
        """The finding in a sentence."""
        brightness, structure = 100 * (self.brightness_ratio - 1), 100 * self.change
        seen = f"brightness changed by {brightness:+.1f} %, structure by {structure:.1f} %"
        if self.is_stable:
            return f"Nothing moved since the scan stopped ({seen})."
        return (
            f"The scene, the rig or the light changed since the scan stopped ({seen}, allowed"
            f" {100 * ALLOWED:.1f} %). Start a new scan, or put everything back in place."
        )


def pick_reference_shots(done: Iterable[Shot]) -> list[Shot]:
    """Two old shots that show most: the last white one, if any, and the last of a code.

    The first picture of a code is none of them, as the next one says what is dark in it.
    """
    shots = list(done)
    white = [shot for shot in shots if shot.role == "white"][-1:]
    code = [shot for shot in shots if shot.role == "code" and shot.pattern > 0][-1:]
    return [*code, *white] or shots[-2:]


def pick_dark_shots(done: Iterable[Shot]) -> list[Shot]:
    """Old shots in one of which every pixel is dark: each setting's last black, or its code's first pair."""
    by_setting: dict[int, list[Shot]] = {}
    for shot in done:
        by_setting.setdefault(shot.setting, []).append(shot)
    return [shot for shots in by_setting.values() for shot in _dark_of(shots)]


def _dark_of(shots: list[Shot]) -> list[Shot]:
    black = [shot for shot in shots if shot.role == "black"][-1:]
    pair = [shot for shot in shots if shot.role == "code" and shot.pattern < 2]
    return black or (pair if len(pair) == 2 else [])


def check_movement(
    rig: DeviceRig,
    source: FrameSource,
    shots: Iterable[Shot],
    pattern_image: PatternImage,
    dark: Iterable[Shot] = (),
) -> MovementReport:
    """Take ``shots`` again and compare them with the stored ones; nothing is stored.

    The ``source`` has the exposures in force, ``shots`` those planned. A calibrated rig may expose otherwise.
    Stored shots that are ``dark`` show what a camera that is not calibrated sees without the projector's
    light, which grows with the exposure: those of a setting serve its own shots.

    Raises `DeviceError` when the rig fails, `StoreError` when a stored frame is damaged, ``ValueError``
    without shots.
    """
    chosen = list(shots)
    if not chosen:
        raise ValueError("a check for movement needs at least one shot that was captured before")
    taker = ShotTaker(rig, source.plan, pattern_image, RetryPolicy())
    known = rig.calibration.sensor if rig.calibration else None
    sensor = known or usual_sensor(rig.camera.info.bit_depth)
    # Light of the room is in the darkest pictures, too.
    darkest: dict[int, NDArray[np.uint16]] = {}
    for shot in () if known else dark:
        pixels = source.read(shot)
        darkest[shot.setting] = np.minimum(pixels, darkest.get(shot.setting, pixels))
    black = {setting: _blocks(pixels) for setting, pixels in darkest.items()}
    unknown = np.array(sensor.black_level_dn)

    def light(shot: Shot, pixels: NDArray[np.uint16]) -> NDArray[np.float64]:
        return np.asarray(_blocks(pixels) - black.get(shot.setting, unknown))

    def new_light(shot: Shot) -> NDArray[np.float64]:
        frame = taker.take(shot)
        share = source.plan.settings[shot.setting].exposure_ms / frame.exposure_ms
        return light(shot, as_if_exposed(frame.pixels, share, known) if known else frame.pixels)

    try:
        pairs = [(light(shot, source.read(shot)), new_light(shot)) for shot in chosen]
    finally:
        taker.show_black()
    before, now = (sum(float(each.sum()) for each in every) for every in zip(*pairs, strict=True))
    ratio = now / before if before > 0 else float("inf")
    change = max(_change(*pair, ratio, sensor) for pair in pairs) if np.isfinite(ratio) else float("inf")
    return MovementReport(tuple(shot.index for shot in chosen), ratio, change)


def _blocks(pixels: NDArray[np.uint16]) -> NDArray[np.float64]:
    """Means of blocks of pixels; the rest at the right and lower edge is left out."""
    block = min(BLOCK_PX, *pixels.shape)
    rows, columns = (n // block for n in pixels.shape)
    cut = pixels[: rows * block, : columns * block].astype(np.float64)
    means: NDArray[np.float64] = cut.reshape(rows, block, columns, block).mean(axis=(1, 3))
    return means


def _change(old: NDArray[np.float64], new: NDArray[np.float64], ratio: float, sensor: Sensor) -> float:
    """Root mean square difference from the old signal times ``ratio`` over that of it, less noise.

    Noise counts with `SIGMAS` of what it scatters by, as few blocks tell little.
    """
    size = ratio * float(np.sqrt((old**2).mean()))
    variance = ratio**2 * raw_variance(sensor, old) + raw_variance(sensor, new)
    noise = float(variance.mean()) / BLOCK_PX**2 * (1 + SIGMAS * float(np.sqrt(2 / old.size)))
    left = float(((new - ratio * old) ** 2).mean()) - noise
    return float(np.sqrt(max(left, 0.0))) / size if size > 0 else float("inf")
