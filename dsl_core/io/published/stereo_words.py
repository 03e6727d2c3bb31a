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
#: Depths between these multiples of the distance of camera and projector are believed.
NEAREST, FARTHEST = 0.5, 50.0
#: So many of them are looked at for light, with so many rays of the camera a side.
_DEPTHS, _RAYS = 60, 15


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
    of_lenses = list(_doubts_of_lenses(stereo))
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
    yield from of_lenses
    # Lenses that are doubted may be all that is wrong.
    if distance and not of_lenses and not lit_at(stereo)[0]:
        yield (
            f"at no depth from {NEAREST * distance:.3g} to {FARTHEST * distance:.3g} mm does the projector"
            " light what the camera sees; check that rotations are in radians, which way the pose leads, and"
            " that x points right, y down and z forward"
        )


def _doubts_of_lenses(stereo: Stereo) -> Iterator[str]:
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


def lit_at(stereo: Stereo) -> tuple[float, float]:
    """The largest share of the camera's picture that the projector can light, and at which depth (mm).

    Lenses are taken to be free of distortion, and camera and projector to be apart.
    """
    camera, projector, pose = stereo.camera, stereo.projector, stereo.pose
    places = (np.arange(_RAYS) + 0.5) / _RAYS
    x, y = np.meshgrid(places * camera.width_px - 0.5, places * camera.height_px - 0.5)
    rays = np.linalg.inv(camera.matrix) @ np.stack([x.ravel(), y.ravel(), np.ones(x.size)])
    depths_mm = np.geomspace(NEAREST, FARTHEST, _DEPTHS) * np.linalg.norm(pose.vector_mm)
    points = pose.matrix @ (depths_mm[:, None, None] * rays) + pose.vector_mm[:, None]
    seen = projector.matrix @ points
    # Behind the projector is nothing lit; there, a pixel would come out as well.
    is_before = seen[:, 2] > 0
    column, row = seen[:, :2].swapaxes(0, 1) / np.where(is_before, seen[:, 2], 1.0)
    inside = (column > -0.5) & (column < projector.width_px - 0.5)
    inside &= (row > -0.5) & (row < projector.height_px - 0.5) & is_before
    shares = inside.mean(axis=1)
    best = int(shares.argmax())
    return float(shares[best]), float(depths_mm[best])


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
    if not where:
        return f"the projector is {distance:.4g} mm from the camera (at the same place)"
    share, depth_mm = lit_at(stereo)
    return (
        f"the projector is {distance:.4g} mm from the camera ({', '.join(where)}) and lights up to"
        f" {share:.0%} of what that sees, at {depth_mm:.2g} mm"
    )
