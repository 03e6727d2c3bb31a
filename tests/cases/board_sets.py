"""Small pictures of a board in several poses before a known camera and projector, under several codes."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.geometry.bundle import rotation_of
from dsl_core.model.board import Checkerboard
from dsl_core.model.captured_code import CapturedCode, Phases
from dsl_core.model.plan import GrayCode
from dsl_core.patterns.captured_code import captured_levels
from tests.cases.code_frames import code_images

BOARD = Checkerboard(columns=6, rows=5, square_mm=30.0)
CAMERA_PX, PROJECTOR_PX = (240, 180), (128, 96)
#: Focal lengths of both, px, and where the projector is, mm; neither lens distorts.
CAMERA_FX_PX, PROJECTOR_FX_PX, BASELINE_MM = 300.0, 170.0, 150.0
_TURN = rotation_of(np.array([0.0, 0.2, 0.0]))
_TILTS = ((0.0, 0.0, 0.1), (0.5, 0.1, 0.0), (-0.4, 0.3, -0.1), (0.1, -0.5, 0.2))
_FINE = 2
Floats = NDArray[np.float64]


Pictures = tuple[NDArray[np.uint8], ...]


@cache
def board_set() -> tuple[Pictures, ...]:
    """For each pose all pictures in the order of the Gray code, then white and black."""
    return _set(code_images(GrayCode(), PROJECTOR_PX))


@cache
def columns_set() -> tuple[Pictures, ...]:
    """The same under the Gray code of columns alone."""
    return tuple((*pose[:14], *pose[28:]) for pose in board_set())


@cache
def phase_set(*axes: str) -> tuple[Pictures, ...]:
    """The same under eight steps of sinusoids of 1, 4 and 16 fringes along each of the axes, then lights."""
    sets = {
        axis: (Phases(periods_px=tuple(size / count for count in (1, 4, 16)), steps=8),)
        for axis, size in zip(("columns", "rows"), PROJECTOR_PX, strict=True)
        if axis in axes
    }
    code = CapturedCode(column_sets=sets.get("columns", ()), row_sets=sets.get("rows", ()))
    levels = [captured_levels(code, PROJECTOR_PX, index) for index in range(code.frame_count)]
    lights = [np.full(PROJECTOR_PX[::-1], value) for value in (1.0, 0.0)]
    return _set(np.rint(255 * np.stack([*levels, *lights])).astype(np.uint8))


def _set(patterns: NDArray[np.uint8]) -> tuple[Pictures, ...]:
    return tuple(_pictures(tilt, 520.0 + 20 * k, patterns) for k, tilt in enumerate(_TILTS))


def column_of_wall(depth_mm: float) -> Floats:
    """The projector's column (px) that each camera pixel sees of a wall across the camera's axis."""
    rays = _rays(1)
    return _on_projector(rays * depth_mm)[..., 0]


def _rays(fine: int) -> Floats:
    width, height = CAMERA_PX
    y, x = (np.mgrid[: height * fine, : width * fine] + 0.5) / fine - 0.5
    return np.stack(
        [(x - (width - 1) / 2) / CAMERA_FX_PX, (y - (height - 1) / 2) / CAMERA_FX_PX, np.ones_like(x)], -1
    )


def _on_projector(points_mm: Floats) -> Floats:
    there = points_mm @ _TURN.T + np.array([-BASELINE_MM, 5.0, 10.0])
    middle = np.array([(PROJECTOR_PX[0] - 1) / 2, (PROJECTOR_PX[1] - 1) / 2])
    return np.asarray(PROJECTOR_FX_PX * there[..., :2] / there[..., 2:] + middle)


def _pictures(tilt: tuple[float, float, float], depth_mm: float, patterns: NDArray[np.uint8]) -> Pictures:
    turn, rays = rotation_of(np.array(tilt)), _rays(_FINE)
    centre = np.array([0.0, 0.0, depth_mm])
    points = rays * ((centre @ turn[:, 2]) / (rays @ turn[:, 2]))[..., None]
    u, v = np.moveaxis((points - centre) @ turn[:, :2] / BOARD.square_mm, -1, 0)
    u, v = u + (BOARD.columns + 1) / 2, v + (BOARD.rows + 1) / 2
    inside = (u > 0) & (u < BOARD.columns + 1) & (v > 0) & (v < BOARD.rows + 1)
    albedo = np.where(inside & ((np.floor(u) + np.floor(v)) % 2 == 0), 0.1, 0.9)
    at = np.rint(_on_projector(points)).astype(int)
    width, height = CAMERA_PX
    pictures = []
    for pattern in patterns:
        lit = albedo * pattern[at[..., 1].clip(0, 95), at[..., 0].clip(0, 127)] * 0.8 + 4
        pictures.append(lit.reshape(height, _FINE, width, _FINE).mean((1, 3)).round().astype(np.uint8))
    return tuple(pictures)
