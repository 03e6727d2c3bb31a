"""Printed calibration boards before a dark wall: a checkerboard, or a ChArUco board with OpenCV's markers."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from dsl_core.errors import PlanError
from dsl_core.model.base import problems_in_words
from dsl_core.model.board import Board, Charuco, Checkerboard
from dsl_core.simulation.scenes import materials as spectra
from dsl_core.simulation.scenes.surfaces import ENDLESS, Paint, tilted, turned, uniform
from dsl_core.simulation.scenes.truth import IMAGE_CENTRE_MM, Materials, Scene, check_range

Floats = NDArray[np.float64]

#: Materials: paper, ink, and the wall behind.
PAPER, INK, WALL = 0, 1, 2
#: The wall stands this far behind the middle of the board.
WALL_MM = 120.0


def board(
    columns: int = 11,
    rows: int = 7,
    square_mm: float = 20.0,
    marker_mm: float = 0.0,
    dictionary: str = "DICT_5X5_100",
    margin_mm: float = 10.0,
    x_mm: float = IMAGE_CENTRE_MM[0],
    y_mm: float = IMAGE_CENTRE_MM[1],
    depth_mm: float = 700.0,
    tilt_x_deg: float = 0.0,
    tilt_y_deg: float = 0.0,
    roll_deg: float = 0.0,
) -> Scene:
    """A printed board of so many inner corners, its middle at x, y and depth; a ChArUco with ``marker_mm``.

    ``roll_deg`` turns the board in its own plane, clockwise as the camera sees it, before the tilts.
    """
    check_range("depth_mm", depth_mm, 300, 2000, "mm")
    for name, turn_deg in (("tilt_x_deg", tilt_x_deg), ("tilt_y_deg", tilt_y_deg)):
        check_range(name, turn_deg, -60, 60, "degrees")
    check_range("roll_deg", roll_deg, -180, 180, "degrees")
    check_range("margin_mm", margin_mm, 0, 500, "mm")
    check_range("columns", columns, 3, 100)
    check_range("rows", rows, 3, 100)
    check_range("square_mm", square_mm, 0.1, 500, "mm")
    check_range("marker_mm", marker_mm, 0, 0.95 * square_mm, "mm")
    printed = printed_board(columns, rows, square_mm, marker_mm, dictionary)
    half = (0.5 * (columns + 1) * square_mm, 0.5 * (rows + 1) * square_mm)
    size = (half[0] + margin_mm, half[1] + margin_mm)
    flat = tilted((x_mm, y_mm, depth_mm), tilt_x_deg, tilt_y_deg, ENDLESS, uniform(PAPER))
    sheet = turned(replace(flat, half_size_mm=size, painter=_painter(printed, half)), roll_deg)
    # Deep enough that no corner of a tilted sheet reaches through the wall.
    reach = float(np.hypot(*sheet.half_size_mm)) * max(
        np.sin(np.radians(abs(tilt_x_deg) + abs(tilt_y_deg))), 0
    )
    wall = tilted((0.0, 0.0, depth_mm + max(WALL_MM, reach + 20.0)), 0.0, 0.0, ENDLESS, uniform(WALL))
    palette = Materials.of(
        {"paper": spectra.flat(0.85), "ink": spectra.flat(0.05), "wall": spectra.flat(spectra.DARK)},
        ("wall",),
    )
    what = "checkerboard" if isinstance(printed, Checkerboard) else "ChArUco board"
    return Scene("board", f"{what} at {depth_mm:g} mm", (sheet, wall), palette, mixed_edges=True)


def printed_board(columns: int, rows: int, square_mm: float, marker_mm: float, dictionary: str) -> Board:
    """A board of ``columns`` x ``rows`` inner corners; a ChArUco when the markers have a size.

    Raises `PlanError` for a board that cannot be.
    """
    if marker_mm == 0:
        return Checkerboard(columns=columns, rows=rows, square_mm=square_mm)
    try:
        return Charuco(
            columns=columns + 1,
            rows=rows + 1,
            square_mm=square_mm,
            marker_mm=marker_mm,
            dictionary=dictionary,
        )
    except ValidationError as error:
        raise PlanError(
            f"The board of the scene cannot be printed: {problems_in_words(error)}. Markers have names of"
            " OpenCV, such as DICT_5X5_100."
        ) from error


@dataclass(frozen=True)
class _Markers:
    """Bits of markers (markers, side, side), 1 for paper; the marker of each square, -1 for black ones."""

    bits: NDArray[np.uint8]
    of_square: NDArray[np.int64]


def _painter(printed: Board, half_mm: tuple[float, float]) -> Paint:
    markers = _markers(printed) if isinstance(printed, Charuco) else None

    def paint(u: Floats, v: Floats) -> NDArray[np.int32]:
        x, y = (u + half_mm[0]) / printed.square_mm, (v + half_mm[1]) / printed.square_mm
        column, row = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
        across, down = (n + 1 for n in printed.corner_grid)
        inside = (column >= 0) & (column < across) & (row >= 0) & (row < down)
        column, row = column.clip(0, across - 1), row.clip(0, down - 1)
        if isinstance(printed, Checkerboard) or markers is None:
            ink = (column + row) % 2 == 0
        else:
            ink = _charuco_ink(printed, markers, (x - column, y - row), markers.of_square[row, column])
        return np.where(inside & ink, INK, PAPER).astype(np.int32)

    return paint


def _charuco_ink(
    printed: Charuco, markers: _Markers, within: tuple[Floats, Floats], marker: NDArray[np.int64]
) -> NDArray[np.bool_]:
    """Whether points are black: ``within`` their square (0..1), whose marker is given."""
    side = markers.bits.shape[1]
    cells = [(0.5 + (part - 0.5) * printed.square_mm / printed.marker_mm) * side for part in within]
    on_marker = np.all([(cell >= 0) & (cell < side) for cell in cells], 0)
    x, y = (np.clip(np.floor(cell), 0, side - 1).astype(np.int64) for cell in cells)
    return np.asarray((marker < 0) | (on_marker & (markers.bits[marker.clip(0), y, x] == 0)))


def _markers(printed: Charuco) -> _Markers:
    """The markers of a board where OpenCV puts them; raises `PlanError` when the dictionary has too few."""
    import cv2

    if not hasattr(cv2.aruco, printed.dictionary):
        raise PlanError(f"OpenCV has no markers {printed.dictionary!r}. Use a name like DICT_5X5_100.")
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, printed.dictionary))
    needed, found = printed.columns * printed.rows // 2, len(dictionary.bytesList)
    if found < needed:
        raise PlanError(
            f"A board of {printed.columns} x {printed.rows} squares needs {needed} markers;"
            f" {printed.dictionary} has {found}. Choose a larger dictionary."
        )
    size = (printed.columns, printed.rows)
    layout = cv2.aruco.CharucoBoard(size, float(printed.square_mm), float(printed.marker_mm), dictionary)
    layout.setLegacyPattern(printed.legacy)
    side = dictionary.markerSize + 2
    of_square = np.full((printed.rows, printed.columns), -1, np.int64)
    bits = np.empty((len(layout.getIds()), side, side), np.uint8)
    for index, (number, corners) in enumerate(
        zip(np.ravel(layout.getIds()), layout.getObjPoints(), strict=True)
    ):
        column, row = np.floor(np.asarray(corners).mean(0)[:2] / printed.square_mm).astype(int)
        of_square[row, column] = index
        bits[index] = dictionary.generateImageMarker(int(number), side) > 0
    return _Markers(bits, of_square)
