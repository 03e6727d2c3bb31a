"""Poses of a board before a known camera and projector, as exact corners with noise, or as small pictures."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.geometry.bundle import rotation_of
from dsl_core.calibration.geometry.projector_corners import PoseObservation
from dsl_core.model.board import Checkerboard, corner_positions_mm
from dsl_core.model.calibration.pose_frames import PoseFrames
from dsl_core.model.geometry import Lens, Pose
from dsl_core.model.plan import GrayCode
from dsl_core.optics.pinhole import project
from tests.cases.code_frames import code_images

BOARD = Checkerboard(columns=9, rows=7, square_mm=30.0)
CAMERA_PX, PROJECTOR_PX = (890, 580), (640, 360)
CAMERA = Lens(
    width_px=890, height_px=580, fx_px=1761.0, fy_px=1764.0, cx_px=428.9, cy_px=294.8,
    distortion=(-0.234, 0.102, -0.0019, -0.0009, 0.3),
)  # fmt: skip
PROJECTOR = Lens(
    width_px=640, height_px=360, fx_px=983.0, fy_px=982.5, cx_px=337.8, cy_px=394.9,
    distortion=(-0.022, 0.1, -0.0006, 0.0029, -0.1),
)  # fmt: skip
TURN = rotation_of(np.array([0.2, 0.07, -0.03]))
POSE = Pose(rotation=tuple(map(tuple, TURN.tolist())), translation_mm=(-55.0, -20.0, 22.0))  # type: ignore[arg-type]
TILTS = ((0.0, 0.0), (0.5, 0.0), (-0.5, 0.1), (0.1, 0.5), (0.0, -0.5), (0.4, 0.4), (-0.4, 0.4), (0.3, -0.4))

Floats = NDArray[np.float64]


def pose_seen(
    tilt: tuple[float, float], index: int, noise_px: float, rng: np.random.Generator
) -> PoseObservation:
    """One pose; a wrong camera corner is looked up at a wrong place, so that both errors go together."""
    board = corner_positions_mm(BOARD)
    turn = rotation_of(np.array([*tilt, 0.3 * (index % 3 - 1)]))
    shift = np.array([40.0 * (index % 3 - 1), 20.0 * (index % 2) - 10, 900.0 + 40 * index])
    points = (board - board.mean(0)) @ turn.T + shift
    camera = np.stack(project(CAMERA, *points.T), 1)
    projector = np.stack(project(PROJECTOR, *(points @ POSE.matrix.T + POSE.vector_mm).T), 1)
    error = rng.normal(0, noise_px, camera.shape)
    code = 0.5 * error + rng.normal(0, noise_px / 2, camera.shape)
    return PoseObservation(f"pose_{index}", np.arange(len(board)), board, camera + error, projector + code)


def poses_seen(noise_px: float = 0.05, seed: int = 0, tilts: Any = TILTS) -> list[PoseObservation]:
    """Poses with other tilts, turns and distances."""
    rng = np.random.default_rng(seed)
    return [pose_seen(tilt, index, noise_px, rng) for index, tilt in enumerate(tilts)]


SMALL_BOARD = Checkerboard(columns=5, rows=4, square_mm=30.0)
SMALL_PROJECTOR_PX = (128, 96)
_MAP = np.array([[0.5, 0.03, 8.0], [-0.02, 0.45, 6.0], [1e-4, 5e-5, 1.0]])


def board_frames(name: str = "pose_0", turn: float = 0.1, board: bool = True) -> PoseFrames:
    """Pictures of 240 x 180 px of a plane with (or without) a small board."""
    fine = 4
    y, x = (np.mgrid[: 180 * fine, : 240 * fine] + 0.5) / fine - 0.5
    u = (np.cos(turn) * (x - 120) + np.sin(turn) * (y - 90)) / 30 + 3
    v = (-np.sin(turn) * (x - 120) + np.cos(turn) * (y - 90)) / 30 + 2.5
    inside = (u > 0) & (u < 6) & (v > 0) & (v < 5)
    dark = inside & ((np.floor(u) + np.floor(v)) % 2 == 0)
    albedo = np.where(dark & board, 0.1, 0.9)
    column, row = (np.rint(value).astype(int) for value in on_projector(np.stack([x, y], -1)))
    pictures = []
    for pattern in code_images(GrayCode(), SMALL_PROJECTOR_PX):
        lit = albedo * pattern[row.clip(0, 95), column.clip(0, 127)] * 0.8 + 4
        pictures.append(lit.reshape(180, fine, 240, fine).mean((1, 3)).round().astype(np.uint8))
    return PoseFrames(name, pictures[:-2], pictures[-2], pictures[-1])


def on_projector(camera_px: Floats) -> tuple[Floats, Floats]:
    """Column and row of the projector that light camera pixels (..., 2)."""
    mapped = np.concatenate([camera_px, np.ones_like(camera_px[..., :1])], -1) @ _MAP.T
    return mapped[..., 0] / mapped[..., 2], mapped[..., 1] / mapped[..., 2]


def with_code(seen: PoseObservation, projector_px: Floats) -> PoseObservation:
    """The pose with other projector coordinates."""
    return replace(seen, projector_px=projector_px)
