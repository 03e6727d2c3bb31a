"""Pictures as other programs capture them, of a scene whose columns and rows are known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter

from dsl_core.model.captured_code import CapturedCode, Phases, Stripes
from dsl_core.optics.colour import srgb_encode
from dsl_core.patterns.captured_code import captured_levels

PROJECTOR = (128, 96)
CAMERA = (160, 120)
Levels = NDArray[np.float64]


@dataclass(frozen=True)
class Scene:
    """A wall, a box before it and a shadow; ``columns`` and ``rows`` (px) are where its light comes from."""

    columns: Levels
    rows: Levels
    albedo: Levels

    def picture(self, levels: Levels, seed: int, bits: int = 8, noise: float = 0.004) -> NDArray[np.uint16]:
        """The camera's picture of drive levels (height, width), 0..1, with noise and room light."""
        height, width = levels.shape
        inside = (self.columns > -0.5) & (self.columns < width - 0.5)
        inside &= (self.rows > -0.5) & (self.rows < height - 0.5)
        column = np.rint(self.columns).astype(int).clip(0, width - 1)
        row = np.rint(self.rows).astype(int).clip(0, height - 1)
        light = np.where(inside, levels[row, column], 0.0)
        light = 0.8 * light + 0.1 * (np.roll(light, 1, 1) + np.roll(light, -1, 1))
        value = 0.03 + 0.9 * self.albedo * light
        value = value + np.random.default_rng(seed).normal(0, noise, value.shape)
        return np.asarray(np.rint(value.clip(0, 1) * (2**bits - 1)), np.uint16)


def scene(camera: tuple[int, int] = CAMERA, projector: tuple[int, int] = PROJECTOR) -> Scene:
    """The scene for these sizes (width, height)."""
    width, height = camera
    x, y = np.meshgrid(np.arange(width) / width, np.arange(height) / height)
    columns = projector[0] * (0.04 + 0.9 * x + 0.02 * y)
    rows = projector[1] * (0.05 + 0.88 * y + 0.01 * x)
    box = (np.abs(x - 0.55) < 0.17) & (np.abs(y - 0.5) < 0.25)
    columns = np.where(box, columns - 0.07 * projector[0], columns)
    albedo = 0.55 + 0.3 * np.sin(9 * x) * np.cos(7 * y)
    albedo[box] = 0.9
    shadow = (x > 0.72) & (x < 0.78) & (np.abs(y - 0.5) < 0.25)
    albedo[shadow] = 0.0
    return Scene(columns, rows, albedo)


def frames(
    sets: Sequence[tuple[str, Stripes | Phases]],
    bits: int = 8,
    projector: tuple[int, int] = PROJECTOR,
    camera: tuple[int, int] = CAMERA,
    seed: int = 1,
) -> tuple[list[NDArray[np.uint16]], NDArray[np.uint16], NDArray[np.uint16]]:
    """Pictures of sets by axis, in the order of the code, then white and black."""
    seen = scene(camera, projector)
    out: list[NDArray[np.uint16]] = []
    for axis, each in sets:
        code = CapturedCode(column_sets=(each,)) if axis == "columns" else CapturedCode(row_sets=(each,))
        for index in range(each.frame_count):
            levels = captured_levels(code, projector, index)
            out.append(seen.picture(levels, seed + 7 * len(out), bits))
    shape = (projector[1], projector[0])
    white = seen.picture(np.ones(shape), seed + 5000, bits)
    black = seen.picture(np.zeros(shape), seed + 6000, bits)
    return out, white, black


def counted_sinusoids(folder: Path) -> tuple[Path, str]:
    """Ten periods of 16 px that 4 bits count, which tell nobody that they are not 16 of 10 px; the size."""
    sets = (Stripes(bits=4, inverse=False, unit_px=16), Phases(periods_px=(16.0,), steps=4))
    pictures, white, black = frames([("columns", each) for each in sets], projector=(160, 96))
    return write(folder, {f"{i:02d}.png": p for i, p in enumerate([white, black, *pictures])}), "160x96"


def for_screens(picture: NDArray[np.uint16]) -> NDArray[np.uint16]:
    """An 8-bit picture through a lens that mixes the light of stripes, stored in sRGB."""
    return np.asarray(np.rint(srgb_encode(blurred(picture) / 255) * 255), np.uint16)


def blurred(picture: NDArray[np.uint16]) -> NDArray[np.uint16]:
    """A picture through a lens that mixes the light of neighbouring stripes."""
    return np.asarray(np.rint(uniform_filter(picture.astype(float), 5)), np.uint16)


def write(folder: Path, pictures: Mapping[str, NDArray[np.integer]], bits: int = 8) -> Path:
    """Write pictures by their names, in the format of the ending; more than 8 bits need 16."""
    import cv2

    for name, picture in pictures.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        values = picture.astype(np.uint8) if bits == 8 else picture
        if path.suffix == ".npy":
            np.save(path, values)
        else:
            assert cv2.imwrite(str(path), values)
    return folder
