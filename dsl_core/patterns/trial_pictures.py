"""Pictures to try a projector with: fields, a crosshair, the finest checker, one line, a name."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import PlanError

PictureKind = Literal[
    "white", "black", "grey", "red", "green", "blue", "crosshair", "checker", "line", "ramp"
]
KINDS: tuple[PictureKind, ...] = get_args(PictureKind)
_COLOURS = {"white": (1, 1, 1), "grey": (1, 1, 1), "red": (1, 0, 0), "green": (0, 1, 0), "blue": (0, 0, 1)}
#: Width of the crosshair's lines and of the single line, px.
CROSS_PX, LINE_PX = 3, 5


def trial_picture(
    kind: PictureKind, size_px: tuple[int, int], level: float = 1.0, column_px: int = 0
) -> NDArray[np.uint8]:
    """Drive levels, shape (height, width, 3), of a picture for a projector of (width, height).

    ``level`` (0..1) is the drive of the lit parts; ``column_px`` the first column of ``line``. ``checker``
    alternates from pixel to pixel, which any scaling on the way to the light turns into stripes or grey.
    ``ramp`` holds all 256 levels from left to right. Raises `PlanError` for an unknown kind or a
    level outside 0..1.
    """
    if kind not in KINDS:
        raise PlanError(f"There is no trial picture {kind!r}; choose one of {', '.join(KINDS)}.")
    if not 0 <= level <= 1:
        raise PlanError(f"The level must be between 0 and 1, not {level:g}.")
    width, height = size_px
    lit = np.zeros((height, width), bool)
    match kind:
        case "black":
            pass
        case "crosshair":
            half = CROSS_PX // 2
            lit[height // 2 - half : height // 2 + half + 1] = True
            lit[:, width // 2 - half : width // 2 + half + 1] = True
        case "checker":
            lit = np.indices((height, width)).sum(0) % 2 == 0
        case "line":
            lit[:, max(column_px, 0) : max(column_px + LINE_PX, 0)] = True
        case "ramp":
            drive = np.round(np.linspace(0, 255 * level, width)).astype(np.uint8)
            return np.broadcast_to(drive[None, :, None], (height, width, 3)).copy()
        case _:
            lit[:] = True
    colour = np.round(255 * level * np.array(_COLOURS.get(kind, (1, 1, 1)))).astype(np.uint8)
    return np.asarray(lit[..., None] * colour, np.uint8)
