"""Whether a plane stood still while filters changed: where the zero order of each capture is.

Without a filter the zero order says where the plane is; through filters, first orders are taken to come from
that plane. The zero order passes each filter, too, so that a target, stage, camera or projector that moved in
between shows as a zero order beside its place.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import torch
from numpy.typing import NDArray

from dsl_core.calibration.film.order_paths import COLUMN_MARGIN_PX, LineFrames
from dsl_core.errors import CalibrationError
from dsl_core.model.rig import Rig
from dsl_core.optics.correspondence import zero_order
from dsl_core.optics.lines.profile import LineTable
from dsl_core.optics.sensor import bayer_channels, relative_gain
from dsl_core.optics.shading import Plane, plane_shading

Floats = NDArray[np.float64]

#: How far from the edges of a line its light counts, px.
BESIDE_PX = 4.0
#: A zero order of fewer deviations of its brightness says nothing.
STANDS_OUT = 10.0
#: A zero order this far (px) from where those of most captures are has moved, beyond so many deviations.
MOVED_PX, SIGMAS = 0.12, 5.0


def zero_moved(rig: Rig, plane: Plane, frames: LineFrames) -> tuple[float, float]:
    """How far (px) the zero order is from its column on the plane, all pixels together, and its deviation.

    NaN and infinite where no zero order stands out.
    """
    lines, pixels = frames.lines, frames.pixels
    depth, light = (
        image.ravel()[pixels]
        for image in (plane.depth_mm(rig), plane_shading(rig, plane) * relative_gain(rig))
    )
    column = zero_order(rig, torch.as_tensor(pixels), torch.as_tensor(depth))[0].numpy()
    inside = (column > COLUMN_MARGIN_PX) & (column < rig.projector.width_px - 1 - COLUMN_MARGIN_PX)
    inside &= np.isfinite(depth) & (np.nan_to_num(light) > 0)
    colours = bayer_channels(rig.sensor.bayer, rig.camera.height_px, rig.camera.width_px).ravel()[pixels]
    reach = lines.width_px / 2 + BESIDE_PX
    centre = (lines.width_px - 1) / 2 + lines.step_px * np.arange(len(frames.radiance))
    away = column - centre[:, None]
    frame, at = np.nonzero((np.abs(away) < reach) & inside)
    value, std = frames.radiance[frame, at].astype(float), frames.std[frame, at].astype(float)
    known = np.isfinite(std) & np.isfinite(value)
    frame, at, value, std = frame[known], at[known], value[known], std[known]
    table = LineTable(lines.width_px, rig.projector_response, reach + 1, torch.zeros(1, dtype=torch.float64))
    profile, slope = (each.numpy() for each in table.at(torch.as_tensor(away[frame, at])))
    lever, push = 0.0, 0.0
    for colour in range(3):
        mine = colours[at] == colour
        if mine.sum() < 3:
            continue
        # Brightness and dark signal of a colour are alike everywhere; both flanks of lines judge the place.
        design = np.stack([light[at[mine]] * profile[mine], np.ones(int(mine.sum()))], 1) / std[mine, None]
        inverse = np.linalg.pinv(design.T @ design)
        bright, dark = inverse @ (design.T @ (value[mine] / std[mine]))
        if bright < STANDS_OUT * np.sqrt(inverse[0, 0]):
            continue
        left = (value[mine] - bright * light[at[mine]] * profile[mine] - dark) / std[mine]
        steep = bright * light[at[mine]] * slope[mine] / std[mine]
        misfit = max(1.0, float(np.mean(left**2)))
        lever += float(steep @ steep) / misfit
        push += float(steep @ left) / misfit
    return (push / lever, lever**-0.5) if lever > 0 else (np.nan, np.inf)


def require_still(
    rig: Rig,
    planes: Sequence[Plane],
    names: Sequence[Sequence[str]],
    frames: Callable[[int, int], LineFrames],
) -> None:
    """Raise `CalibrationError` that names the capture whose zero order is farthest from its place.

    ``names`` are those of the captures, by position and filter, and ``frames`` reads them. What all captures
    have in common is the line's profile, and no motion.
    """
    found = np.array(
        [
            [zero_moved(rig, plane, frames(k, n)) for n in range(len(names[k]))]
            for k, plane in enumerate(planes)
        ]
    )
    moved, std = found[..., 0], found[..., 1]
    seen = np.isfinite(moved)
    if not seen.any():
        return
    # Where as many moved as stood still, those that are in their place are right.
    common = np.median(np.append(moved[seen], 0.0))
    off = np.where(seen, moved - common, 0.0)
    beyond = np.where(seen, np.abs(off) - np.maximum(MOVED_PX, SIGMAS * std), -np.inf)
    k, n = divmod(int(beyond.argmax()), beyond.shape[1])
    if beyond[k, n] > 0:
        raise CalibrationError(
            f"Position {names[k][n]}: the zero order is {off[k, n]:+.2f} columns from where the plane without"
            " a filter puts it. The target, stage, camera or projector moved, or the stage slipped; capture"
            " all steps of this position again."
        )
