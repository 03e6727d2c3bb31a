"""What lenses and poses of cameras and projectors can be: a fit that ends elsewhere is of something else."""

from __future__ import annotations

import numpy as np

from dsl_core.model.calibration.geometry import GeometryCalibration
from dsl_core.model.geometry import Lens

#: Focal lengths in widths of the picture: views from 120 to 6 degrees.
FOCAL_WIDTHS = (0.3, 10.0)
#: How far outside the picture, in its sizes, the principal point may be: projectors shift theirs by half of
#: the picture, and some by a little more.
OUTSIDE = 0.5
#: What the distortion may move a corner of the picture by, as a share of its distance from the middle: more
#: is that of a fisheye, or polynomials that bend where no corner was seen.
CORNER_SHARE = 0.5
#: Distances (mm) at which camera and projector can be mounted.
BASELINE_MM = (5.0, 5000.0)


def implausible(found: GeometryCalibration) -> list[str]:
    """A sentence for everything that no camera or projector is like: found, wanted and what to do."""
    sentences = [
        sentence
        for what, lens in (("camera", found.camera), ("projector", found.projector))
        for sentence in _of_lens(what, lens)
    ]
    distance = float(np.linalg.norm(found.pose.translation_mm))
    if not BASELINE_MM[0] <= distance <= BASELINE_MM[1]:
        sentences.append(
            f"The fit puts camera and projector {distance:.0f} mm apart; {BASELINE_MM[0]:g} to"
            f" {BASELINE_MM[1]:g} mm are plausible. Check the printed size of the board, and that camera and"
            " projector saw the same poses."
        )
    return sentences


def _of_lens(what: str, lens: Lens) -> list[str]:
    sentences = []
    focal = lens.fx_px / lens.width_px
    if not FOCAL_WIDTHS[0] <= focal <= FOCAL_WIDTHS[1]:
        sentences.append(
            f"The focal length of the {what} came out as {focal:.2g} widths of its picture;"
            f" {FOCAL_WIDTHS[0]:g} to {FOCAL_WIDTHS[1]:g} are plausible. Check the {what}'s size in pixels,"
            " and add poses with more tilt."
        )
    place = lens.cx_px / lens.width_px, lens.cy_px / lens.height_px
    if not all(-OUTSIDE <= share <= 1 + OUTSIDE for share in place):
        sentences.append(
            f"The axis of the {what}'s lens came out at {place[0]:.0%} of its picture's width and"
            f" {place[1]:.0%} of its height; {-OUTSIDE:.0%} to {1 + OUTSIDE:.0%} are plausible. Add poses"
            " with the board tilted in all directions."
        )
    moved = _corner_share(lens)
    if moved > CORNER_SHARE:
        sentences.append(
            f"The distortion of the {what} moves a corner of its picture by {moved:.0%} of its distance from"
            f" the middle; at most {CORNER_SHARE:.0%} are plausible. Add poses with the board near the edges."
        )
    return sentences


def _corner_share(lens: Lens) -> float:
    """Largest relative radial distortion at the corners of the picture."""
    k1, k2, _, _, k3 = lens.distortion
    across = np.array([lens.cx_px, lens.width_px - 1 - lens.cx_px]) / lens.fx_px
    down = np.array([lens.cy_px, lens.height_px - 1 - lens.cy_px]) / lens.fy_px
    square = (across[:, None] ** 2 + down[None] ** 2).ravel()
    return float(np.abs(k1 * square + k2 * square**2 + k3 * square**3).max())
