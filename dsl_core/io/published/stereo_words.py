"""How a calibration of another program was understood, in words, and what speaks against that."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from dsl_core.io.published.stereo import Stereo
from dsl_core.io.published.stereo_names import Parts

#: Distances of camera and projector, mm, outside of which the unit is doubted.
USUAL_MM = (5.0, 20_000.0)
#: Focal lengths outside of these multiples of the picture's side are doubted.
USUAL_FOCAL = (0.2, 20.0)
#: Parts of a distance below this share of it are not told.
LEAST_SHARE = 0.005


def understood(parts: Parts, unit_mm: float, inverse: bool) -> tuple[str, ...]:
    """How the numbers of a file were understood, a phrase for each; lengths are in units of ``unit_mm``.

    With ``inverse``, or where a name says so, its pose leads from the projector to the camera.
    """
    turn: tuple[str, ...] = ()
    if parts.values["rotation"].size == 3:
        turn = (f"{parts.names['rotation']} is a rotation vector in radians",)
    way = "projector to camera" if inverse or parts.is_inverse else "camera to projector"
    one, other = way.split(" to ")
    told = f"by its name, the pose leads from {way}" if parts.is_inverse else (
        f"the pose leads from {way} (x_{other} = R x_{one} + t)"
    )  # fmt: skip
    return (*parts.taken, *turn, told, f"its lengths are in units of {unit_mm:g} mm")


def doubts(stereo: Stereo) -> Iterator[str]:
    """What speaks against how a file was understood, a phrase for each."""
    distance = float(np.linalg.norm(stereo.pose.vector_mm))
    if distance == 0:
        yield "camera and projector are at one place, so nothing has a depth"
    elif not USUAL_MM[0] <= distance <= USUAL_MM[1]:
        hint = "metres, give --unit-mm 1000" if distance < USUAL_MM[0] else "a smaller unit, give --unit-mm"
        yield f"the projector would be {distance:.3g} mm from the camera; if lengths are in {hint}"
    if stereo.columns_only:
        yield (
            "only columns of the projector were seen: its rows (fy, cy and ty) are assumed, so depth holds,"
            " but spectra through a film do not; calibrate with rows before you measure these"
        )
    for device, lens in (("camera", stereo.camera), ("projector", stereo.projector)):
        shares = lens.fx_px / lens.width_px, lens.fy_px / lens.height_px
        if min(shares) < USUAL_FOCAL[0] or max(shares) > USUAL_FOCAL[1]:
            yield (
                f"the {device}'s focal lengths ({lens.fx_px:.3g}, {lens.fy_px:.3g} px) are not those of"
                f" {lens.width_px} x {lens.height_px} px; check that its matrix is in px, and its size"
            )
    lens = stereo.camera
    if not (0 < lens.cx_px < lens.width_px and 0 < lens.cy_px < lens.height_px):
        yield (
            f"the camera's principal point ({lens.cx_px:.0f}, {lens.cy_px:.0f} px) is outside its"
            f" {lens.width_px} x {lens.height_px} px; check its size"
        )
    lens = stereo.projector
    # Projectors often throw their picture upwards, so that only the columns tell.
    if not 0 < lens.cx_px < lens.width_px:
        yield (
            f"the projector's principal point ({lens.cx_px:.0f}, {lens.cy_px:.0f} px) is left or right of its"
            f" {lens.width_px} x {lens.height_px} px; check its size"
        )


def sizes(stereo: Stereo) -> str:
    """The sizes of both devices."""
    camera, projector = stereo.camera, stereo.projector
    return (
        f"camera {camera.width_px} x {camera.height_px} px, projector {projector.width_px} x"
        f" {projector.height_px} px"
    )


def placed(stereo: Stereo) -> str:
    """Where the projector stands as seen by the camera, which a wrong direction shows.

    Right, down and forward, because a camera's axes point there.
    """
    centre = stereo.pose.projector_centre_mm
    distance = float(np.linalg.norm(centre))
    words = (("right", "left"), ("below", "above"), ("in front", "behind"))
    where = [
        f"{abs(mm):.4g} mm {names[0] if mm > 0 else names[1]}"
        for names, mm in zip(words, centre, strict=True)
        if abs(mm) > LEAST_SHARE * distance
    ]
    there = ", ".join(where) or "at the same place"
    return f"the projector is {distance:.4g} mm from the camera ({there})"
