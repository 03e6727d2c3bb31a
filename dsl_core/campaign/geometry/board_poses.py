"""Where to hold a board: poses that together determine lenses and pose of camera and projector."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from dsl_core.campaign.common.depths import depths_mm
from dsl_core.errors import CalibrationError
from dsl_core.model.board import Board, Charuco
from dsl_core.model.geometry import Lens
from dsl_core.model.placement import Placement
from dsl_core.model.rig import Rig
from dsl_core.optics.pinhole import pixel_rays, project

Floats = NDArray[np.float64]

#: The squares stay this far inside both pictures, as a share of their width.
CLEARANCE = 0.015
#: Steps in which a board is moved to the middle until both devices see all of it.
SHARES = np.linspace(1, 0, 11)
#: Places each way of the camera's view at which a board is tried that does not fit anywhere near its middle.
PLACES = 41
#: Boards stand between these shares of the rig's depth range: in the middle of it, as far as they fit.
NEAR, FAR = 0.2, 0.7
#: Cells each way of the camera's picture by which is asked how much of it the projector lights.
_CELLS = 40
#: Devices of which less is common see little of each other, however small the board is.
_FEW_COMMON = 0.6


@dataclass(frozen=True)
class BoardPose:
    """Middle of the board in camera coordinates (mm), tilts about x and y and roll (degrees)."""

    x_mm: float
    y_mm: float
    depth_mm: float
    tilt_x_deg: float
    tilt_y_deg: float
    roll_deg: float

    def placement(self, board: Board) -> Placement:
        """The placement for a rig that places targets itself, film off."""
        columns, rows = board.corner_grid
        options: dict[str, float | str] = {
            "columns": columns,
            "rows": rows,
            "square_mm": board.square_mm,
            **{name: round(value, 1) for name, value in vars(self).items()},
        }
        if isinstance(board, Charuco):
            options |= {"marker_mm": board.marker_mm, "dictionary": board.dictionary}
        return Placement(target="board", film=False, options=options)

    def instruction(self, rig: Rig) -> str:
        """The pose in a sentence for a person."""
        column, row = project(rig.camera, *np.array([[self.x_mm], [self.y_mm], [self.depth_mm]]))
        place = _place(float(column[0]) / rig.camera.width_px, float(row[0]) / rig.camera.height_px)
        turns = [
            f"{what} about {abs(angle):.0f}°"
            for angle, what in (
                (self.tilt_x_deg, f"its {'lower' if self.tilt_x_deg > 0 else 'upper'} edge tilted away by"),
                (self.tilt_y_deg, f"its {'right' if self.tilt_y_deg > 0 else 'left'} edge turned away by"),
                (self.roll_deg, f"rolled {'clockwise' if self.roll_deg > 0 else 'anticlockwise'} by"),
            )
            if abs(angle) >= 1
        ]
        how = ", ".join(turns) or "facing the camera"
        return (
            f"Film off. Hold the board still about {round(self.depth_mm / 10, 1):g} cm in front of the"
            f" camera, {place}, {how}. All of it must be in view and lit by the projector; nothing may"
            " move while it is captured."
        )


def _place(across: float, down: float) -> str:
    words = [
        low if share < 0.45 else high if share > 0.55 else ""
        for share, low, high in ((down, "upper", "lower"), (across, "left", "right"))
    ]
    named = " ".join(word for word in words if word)
    return f"in the {named} part of the picture" if named else "in the middle of the picture"


#: Place in what is free of the view (-1 to 1 each way), depth (0 near, 1 far), tilts x and y, roll (degrees).
#: Tilts in all directions determine focal lengths (30 degrees left depths 0.14 mm off on one of five drawn
#: rigs, 42 at most 0.04 mm), corners of the view the distortion; rolls even out the print.
_WISHES = (
    (0.0, 0.0, 0.1, 0.0, 0.0, 3.0),
    (-1.0, -1.0, 0.6, 35.0, -28.0, 8.0),
    (1.0, -1.0, 0.6, 35.0, 28.0, -6.0),
    (-1.0, 1.0, 0.5, -39.0, -31.0, -10.0),
    (1.0, 1.0, 0.5, -39.0, 31.0, 12.0),
    (0.0, -1.0, 0.3, 42.0, 0.0, 0.0),
    (0.0, 1.0, 0.3, -42.0, 7.0, 180.0),
    (-1.0, 0.0, 0.4, 6.0, -42.0, 4.0),
    (1.0, 0.0, 0.4, -6.0, 42.0, -4.0),
    (0.3, 0.3, 1.0, 17.0, 17.0, 90.0),
    (-1.0, 1.0, 1.0, 17.0, -17.0, 174.0),
    (1.0, -1.0, 1.0, -17.0, 20.0, -7.0),
)
MOST_POSES = len(_WISHES)


def default_poses(board: Board, rig: Rig, count: int) -> tuple[BoardPose, ...]:
    """The first ``count`` poses, moved to where camera and projector of ``rig`` see the whole board.

    ``rig`` may be nominal. Raises `CalibrationError` when the board is too large to be seen as a whole.
    """
    if not 3 <= count <= MOST_POSES:
        raise CalibrationError(
            f"The geometry calibration needs 3 to {MOST_POSES} poses of the board, not {count}."
        )
    poses = []
    for wish in _WISHES[:count]:
        pose = _fitted(board, rig, wish)
        if pose is None:
            raise CalibrationError(_too_large(board, rig))
        poses.append(pose)
    return tuple(poses)


def _too_large(board: Board, rig: Rig) -> str:
    """Why a board is not seen as a whole, and what to do about it."""
    near, far = depths_mm(rig, NEAR, FAR)
    width, height = ((n + 1) * board.square_mm for n in board.corner_grid)
    size, at = f"A board of {width:.0f} x {height:.0f} mm", f"at {near:.0f} to {far:.0f} mm"
    common = common_share(rig, (near + far) / 2)
    if common < _FEW_COMMON:
        return (
            f"{size} does not fit into the view of camera and projector {at}: as the rig is described, the"
            f" projector lights {common:.0%} of the camera's picture there. If in truth it lights more,"
            " correct the pose, the principal points (lens shift) or depth_range_mm of the rig's nominal"
            " figures; if not, print smaller squares."
        )
    return (
        f"{size} is too large: it does not fit into the view of camera and projector {at}. Print smaller"
        " squares, or correct depth_range_mm of the rig's nominal figures if there is more room."
    )


def common_share(rig: Rig, depth_mm: float) -> float:
    """Share of the camera's picture that the projector lights on a plane at a depth, 0 to 1."""
    rays = pixel_rays(rig.camera)
    step = max(1, rig.camera.width_px // _CELLS)
    points = rays[:, ::step, ::step].reshape(3, -1) * depth_mm
    return float(_within(rig.projector, rig.pose.matrix @ points + rig.pose.vector_mm[:, None], 0.0).mean())


def _fitted(board: Board, rig: Rig, wish: tuple[float, ...]) -> BoardPose | None:
    """The pose nearest to a wish whose squares are all in view, farther away if necessary; None for none."""
    across, down, far, *turns = wish
    nearest, farthest = depths_mm(rig, NEAR + far * (FAR - NEAR), FAR)
    depths = np.linspace(nearest, farthest, 6)
    for depth in depths:
        low, high = _view_mm(rig.camera, float(depth))
        middle, half = (low + high) / 2, (high - low) / 2
        for shares in sorted(product(SHARES, SHARES), key=sum, reverse=True):
            x, y = middle + np.array(shares) * half * (across, down)
            pose = BoardPose(float(x), float(y), float(depth), *turns)
            if in_view(pose, board, rig):
                return pose
    # What both see need not contain the middle of the camera's picture.
    found = (_aside(BoardPose(across, down, float(depth), *turns), board, rig) for depth in depths)
    return next((pose for pose in found if pose is not None), None)


def _aside(wish: BoardPose, board: Board, rig: Rig) -> BoardPose | None:
    """The pose wherever both devices see all squares, its place (-1 to 1 each way) among all of these.

    None where there is no such place at the depth of the wish.
    """
    low, high = _view_mm(rig.camera, wish.depth_mm)
    places = np.array(list(product(*np.linspace(low, high, PLACES).T)))
    outline = outline_mm(replace(wish, x_mm=0.0, y_mm=0.0), board)
    points = (outline[:, None] + np.pad(places.T, ((0, 1), (0, 0)))[..., None]).reshape(3, -1)
    in_projector = rig.pose.matrix @ points + rig.pose.vector_mm[:, None]
    views = (rig.camera, points), (rig.projector, in_projector)
    seen = np.all([_within(lens, each, CLEARANCE * lens.width_px) for lens, each in views], 0)
    possible = places[seen.reshape(len(places), -1).all(1)]
    if not len(possible):
        return None
    low, high = possible.min(0), possible.max(0)
    wanted = (low + high) / 2 + (high - low) / 2 * (wish.x_mm, wish.y_mm)
    x, y = possible[np.linalg.norm(possible - wanted, axis=1).argmin()]
    return replace(wish, x_mm=float(x), y_mm=float(y))


def _view_mm(lens: Lens, depth_mm: float) -> tuple[Floats, Floats]:
    """Least and largest x and y that a camera sees at a depth."""
    rays = pixel_rays(lens)[:2].reshape(2, -1) * depth_mm
    return rays.min(1), rays.max(1)


def in_view(pose: BoardPose, board: Board, rig: Rig) -> bool:
    """Whether both devices see all squares."""
    points = outline_mm(pose, board)
    in_projector = rig.pose.matrix @ points + rig.pose.vector_mm[:, None]
    return _inside(rig.camera, points) and _inside(rig.projector, in_projector)


def _inside(lens: Lens, points: Floats) -> bool:
    return bool(_within(lens, points, CLEARANCE * lens.width_px).all())


def _within(lens: Lens, points: Floats, edge_px: float) -> NDArray[np.bool_]:
    """Which points, (3, n) mm, a lens sees at least this far inside its picture."""
    column, row = project(lens, *points)
    inside = (column > edge_px) & (column < lens.width_px - 1 - edge_px)
    return np.asarray(inside & (row > edge_px) & (row < lens.height_px - 1 - edge_px) & (points[2] > 0))


def outline_mm(pose: BoardPose, board: Board) -> Floats:
    """The corners of the squared area in camera coordinates, shape (3, 4), mm."""
    half_x, half_y = (0.5 * (n + 1) * board.square_mm for n in board.corner_grid)
    u, v = np.array([[-half_x, half_x, half_x, -half_x], [-half_y, -half_y, half_y, half_y]])
    a, b, c = np.radians([pose.tilt_x_deg, pose.tilt_y_deg, pose.roll_deg])
    across, down = np.cos(c) * u - np.sin(c) * v, np.sin(c) * u + np.cos(c) * v
    return np.stack(
        [
            pose.x_mm + across * np.cos(b) - down * np.sin(a) * np.sin(b),
            pose.y_mm + down * np.cos(a),
            pose.depth_mm + across * np.sin(b) + down * np.sin(a) * np.cos(b),
        ]
    )
