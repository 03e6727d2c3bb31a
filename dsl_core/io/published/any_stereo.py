"""Lenses and pose of camera and projector from files of any program, by the names that are in use.

XML, YAML and JSON, of OpenCV or with nested lists. Distortion that is absent is zero; a rotation of three
numbers is a vector of Rodrigues. Whatever a file does not say itself is told to who imports it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from dsl_core.errors import CalibrationError
from dsl_core.io.published.curves import FoundCurves
from dsl_core.io.published.stereo import Size, Stereo, five_coefficients, lens_of
from dsl_core.io.published.stereo_names import Numbers, Parts, parts_of, size_of
from dsl_core.io.published.tree_file import read_nodes
from dsl_core.model.base import problems_in_words
from dsl_core.model.geometry import Pose
from dsl_core.model.rig import Provenance, Rgb, Rig
from dsl_core.model.spectral import SpectralCurve

_PARTS = (
    "camera matrix", "camera distortion", "projector matrix", "projector distortion",
    "rotation", "translation",
)  # fmt: skip
#: Distances of camera and projector, mm, outside of which the unit is doubted; and turns, rad.
_USUAL_MM, _MOST_TURN_RAD = (5.0, 20_000.0), 6.3
#: Skew of a lens, relative to its focal length, that passes for none.
_MOST_SKEW = 1e-3
_CORRECT = {
    "camera": "Correct --camera-size, or calibrate with that size.",
    "projector": "Correct --projector, or calibrate with that size.",
}
_FISHEYE = re.compile(r"(?i)\b(equidistant|fisheye|kannala[_ -]?brandt|omni|mei|double[_ -]?sphere)\b")
#: Parts of a distance below this share of it are not told.
LEAST_SHARE = 0.005
#: Depths between these multiples of the distance of camera and projector are believed.
NEAREST, FARTHEST = 0.5, 50.0


@dataclass(frozen=True)
class FoundStereo:
    """Lenses and pose, the name that each part has in the file, and what was assumed in place of parts.

    ``taken`` says how numbers were understood, ``doubts`` what speaks against that.
    """

    stereo: Stereo
    names: dict[str, str]
    assumed: tuple[str, ...]
    taken: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()


def load_any_stereo(
    path: Path,
    camera_size_px: Size | None = None,
    projector_size_px: Size | None = None,
    unit_mm: float = 1.0,
    inverse: bool = False,
) -> FoundStereo:
    """Read lenses and pose from any file that names them; lengths are in units of ``unit_mm``.

    Sizes (width, height) are those of the file where they are not given; with ``inverse`` its pose leads from
    projector to camera. Raises `CalibrationError` that says which parts are missing, what they may be called,
    and which names the file has, or that sizes differ from those of the file.
    """
    nodes = read_nodes(path)
    _require_pinhole(path)
    found = {name: np.asarray(value, np.float64) for name, value in nodes.items() if value is not None}
    numbers = {name: values for name, values in found.items() if np.isfinite(values).all()}
    parts = parts_of(numbers)
    lacking = [part for part in _PARTS if part not in parts.names and not part.endswith("distortion")]
    if lacking:
        has = ", ".join(sorted(nodes)[:12]) or "nothing"
        raise CalibrationError(
            f"{path} lacks {' and '.join(lacking)}; it has {has}. Name them like cam_K, proj_K, R and T"
            " (3 x 3, 3 x 3, 3 x 3 and 3 numbers), from camera to projector."
        )
    values, names = parts.values, parts.names
    sizes = [_size(path, numbers, *each) for each in
             (("camera", camera_size_px), ("projector", projector_size_px))]  # fmt: skip
    try:
        camera, projector = (
            lens_of(_upper(values[f"{who} matrix"], names, who, path), _distortion(parts, who, path), size)
            for who, size in zip(("camera", "projector"), sizes, strict=True)
        )
        turn, shift = _rotation(values["rotation"], names, path), values["translation"] * unit_mm
        if inverse or parts.is_inverse:
            turn, shift = turn.T, -turn.T @ shift
        pose = Pose(
            rotation=tuple(map(tuple, turn.tolist())),  # type: ignore[arg-type]
            translation_mm=tuple(shift.tolist()),
        )
    except ValidationError as error:
        raise CalibrationError(
            f"{path} is not a valid calibration: {problems_in_words(error)}. Correct the file."
        ) from error
    stereo = Stereo(camera=camera, projector=projector, pose=pose)
    assumed = tuple(f"no {part}" for part in _PARTS if part not in names)
    return FoundStereo(stereo, names, assumed, _taken(parts, unit_mm, inverse), tuple(_doubts(stereo)))


def _require_pinhole(path: Path) -> None:
    model = _FISHEYE.search(path.read_text(encoding="utf-8", errors="replace"))
    if model is not None:
        raise CalibrationError(
            f"{path} describes a lens by the model {model[0]!r}; only a pinhole with the distortion k1 k2 p1"
            " p2 k3 is possible. Calibrate with that model."
        )


def _size(path: Path, numbers: Numbers, device: str, given: Size | None) -> Size:
    stored = size_of(numbers, device)
    option = "--camera-size" if device == "camera" else "--projector"
    if given is None and stored is None:
        raise CalibrationError(f"{path} does not say the size of the {device}. Give {option} WIDTHxHEIGHT.")
    if given is not None and stored is not None and given != stored:
        raise CalibrationError(
            f"{path} is for a {device} of {stored[0]} x {stored[1]} px, not {given[0]} x {given[1]} px."
            f" {_CORRECT[device]}"
        )
    size = given or stored
    assert size is not None
    return size


def _upper(matrix: NDArray[np.float64], names: dict[str, str], who: str, path: Path) -> NDArray[np.float64]:
    """A matrix of focal lengths and a principal point and nothing else; raises `CalibrationError`."""
    name, skew = names[f"{who} matrix"], matrix[0, 1]
    if matrix[1, 0] or matrix[2, :2].any() or matrix[2, 2] != 1 or abs(skew) > _MOST_SKEW * abs(matrix[0, 0]):
        raise CalibrationError(
            f"{path}: {name} is not a matrix of fx, fy, cx, cy with 0 0 1 in its last row and no skew."
            " Calibrate without skew, or correct it."
        )
    return matrix


def _taken(parts: Parts, unit_mm: float, inverse: bool) -> tuple[str, ...]:
    turn: tuple[str, ...] = ()
    if parts.values["rotation"].size == 3:
        turn = (f"{parts.names['rotation']} is a rotation vector in radians",)
    way = "projector to camera" if inverse or parts.is_inverse else "camera to projector"
    one, other = way.split(" to ")
    told = f"by its name, the pose leads from {way}" if parts.is_inverse else (
        f"the pose leads from {way} (x_{other} = R x_{one} + t)"
    )  # fmt: skip
    return (*parts.taken, *turn, told, f"its lengths are in units of {unit_mm:g} mm")


def _doubts(stereo: Stereo) -> Iterator[str]:
    distance = float(np.linalg.norm(stereo.pose.vector_mm))
    if distance == 0:
        yield "camera and projector are at one place, so nothing has a depth"
    elif not _USUAL_MM[0] <= distance <= _USUAL_MM[1]:
        hint = "metres, give --unit-mm 1000" if distance < _USUAL_MM[0] else "a smaller unit, give --unit-mm"
        yield f"the projector would be {distance:.3g} mm from the camera; if lengths are in {hint}"
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


def placed(stereo: Stereo) -> str:
    """Sizes, and where the projector stands as seen by the camera, which a wrong direction shows.

    Right, down and forward, because a camera's axes point there.
    """
    camera, projector = stereo.camera, stereo.projector
    centre = stereo.pose.projector_centre_mm
    distance = float(np.linalg.norm(centre))
    words = (("right", "left"), ("below", "above"), ("before", "behind"))
    where = [
        f"{abs(mm):.4g} mm {names[0] if mm > 0 else names[1]}"
        for names, mm in zip(words, centre, strict=True)
        if abs(mm) > LEAST_SHARE * distance
    ]
    return (
        f"camera {camera.width_px} x {camera.height_px} px, projector {projector.width_px} x"
        f" {projector.height_px} px; the projector is {distance:.4g} mm from the camera"
        f" ({', '.join(where) or 'nowhere else'})"
    )


def lenses_on(
    base: Rig,
    found: FoundStereo,
    source: str,
    camera_curves: FoundCurves | None = None,
    led_curves: FoundCurves | None = None,
) -> Rig:
    """A rig for depth: these lenses and pose; film and scales of ``base`` mean nothing, nor do its curves.

    Curves that are given are relative to the largest of them, and are made as large as those of ``base``.
    """
    stereo = found.stereo
    given = [each.words for each in (camera_curves, led_curves) if each is not None]
    notes = f"film and scales from {base.name!r}; {'; '.join(given)}" if len(given) == 2 else (
        f"film, curves and scales from {base.name!r}: for depth alone{''.join(f'; {each}' for each in given)}"
    )  # fmt: skip
    distance = float(np.linalg.norm(stereo.pose.vector_mm))
    assumed = f"; assumed: {', '.join(found.assumed)}" if found.assumed else ""
    return Rig(
        name=source,
        camera=stereo.camera,
        projector=stereo.projector,
        pose=stereo.pose,
        film=base.film,
        response=_as_large(base.response, camera_curves),
        emission=_as_large(base.emission, led_curves),
        efficiency=base.efficiency,
        white_scale=base.white_scale,
        depth_range_mm=(NEAREST * distance, FARTHEST * distance),
        provenance=Provenance(
            source=f"lenses and pose of {source}",
            notes=f"{notes}{assumed}",
        ),
    )


def _as_large(base: Rgb, found: FoundCurves | None) -> Rgb:
    if found is None:
        return base
    most = max(max(curve.values) for curve in base)
    red, green, blue = (
        SpectralCurve.of(curve.wavelengths_nm, np.multiply(curve.values, most), base[0].unit)
        for curve in found.curves
    )
    return red, green, blue


def _distortion(parts: Parts, who: str, path: Path) -> NDArray[np.float64]:
    part = f"{who} distortion"
    if part not in parts.values:
        return np.zeros(5)
    return five_coefficients(parts.values[part], parts.names[part], path)


def _rotation(values: NDArray[np.float64], names: dict[str, str], path: Path) -> NDArray[np.float64]:
    import cv2

    if values.size == 9:
        return values
    if np.linalg.norm(values) > _MOST_TURN_RAD:
        turn_rad = np.linalg.norm(values)
        raise CalibrationError(
            f"{path}: {names['rotation']} is a rotation of {turn_rad:.1f} rad, more than a turn."
            " Give a rotation vector in radians or a matrix; angles about axes are not understood."
        )
    return np.asarray(cv2.Rodrigues(values)[0], np.float64)
