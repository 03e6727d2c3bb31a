"""Lenses and pose of camera and projector from files of any program, by the names that are in use.

XML, YAML and JSON, of OpenCV or with nested lists. Names are compared without case, underscores
and what they are nested in, so that ``Camera.K``, ``cam_K`` and ``camera_matrix`` are the same. Distortion
that is absent is zero; a rotation of three numbers is a vector of Rodrigues.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from dsl_core.errors import CalibrationError
from dsl_core.io.published.stereo import Size, Stereo, five_coefficients, lens_of
from dsl_core.io.published.tree_file import read_nodes
from dsl_core.model.base import problems_in_words
from dsl_core.model.geometry import Pose
from dsl_core.model.rig import Provenance, Rig

_CAMERA, _PROJECTOR = "(?:camera|cam|c|1)", "(?:projector|proj|prj|p|2)"
_MATRIX = "(?:matrix|mtx|int|intrinsics?|intrinsicmatrix|k|m|cameramatrix)"
_DISTORTION = "(?:distortion|dist|distcoeffs?|distortioncoefficients|coeffs|kc|d)"
#: Names of each part, without case and punctuation: the device comes first or last.
_NAMES = {
    "camera matrix": rf"{_CAMERA}{_MATRIX}|{_MATRIX}{_CAMERA}|cameramatrix",
    "camera distortion": rf"{_CAMERA}{_DISTORTION}|{_DISTORTION}{_CAMERA}|distcoeffs",
    "projector matrix": rf"{_PROJECTOR}{_MATRIX}|{_MATRIX}{_PROJECTOR}",
    "projector distortion": rf"{_PROJECTOR}{_DISTORTION}|{_DISTORTION}{_PROJECTOR}",
    "rotation": r"(?:stereo|extrinsics?|pose)?(?:r|rot|rotation|roration|rmat|rvec|rotationmatrix)",
    "translation": r"(?:stereo|extrinsics?|pose)?(?:t|trans|translation|tvec|tmat|translationvector)",
}
_SIZES = {"matrix": {9}, "rotation": {3, 9}, "translation": {3}}
#: Depths between these multiples of the distance of camera and projector are believed.
NEAREST, FARTHEST = 0.5, 50.0


@dataclass(frozen=True)
class FoundStereo:
    """Lenses and pose, the name that each part has in the file, and what was assumed."""

    stereo: Stereo
    names: dict[str, str]
    assumed: tuple[str, ...]


def load_any_stereo(
    path: Path, camera_size_px: Size, projector_size_px: Size, unit_mm: float = 1.0
) -> FoundStereo:
    """Read lenses and pose from any file that names them; lengths are in units of ``unit_mm``.

    Raises `CalibrationError` that says which parts are missing, what they may be called, and which names the
    file has.
    """
    nodes = read_nodes(path)
    found = {
        name: np.asarray(value, np.float64).ravel() for name, value in nodes.items() if value is not None
    }
    numbers = {name: values for name, values in found.items() if np.isfinite(values).all()}
    names = {part: name for part in _NAMES if (name := _name_of(part, numbers)) is not None}
    lacking = [part for part in _NAMES if part not in names and not part.endswith("distortion")]
    if lacking:
        has = ", ".join(sorted(nodes)[:12]) or "nothing"
        raise CalibrationError(
            f"{path} lacks {' and '.join(lacking)}; it has {has}. Name them like cam_K, proj_K, R and T"
            " (3 x 3, 3 x 3, 3 x 3 and 3 numbers), from camera to projector."
        )
    values = {part: numbers[name] for part, name in names.items()}
    assumed = [f"no {part}" for part in _NAMES if part not in names]
    try:
        camera, projector = (
            lens_of(values[f"{who} matrix"].reshape(3, 3), _distortion(values, names, who, path), size)
            for who, size in (("camera", camera_size_px), ("projector", projector_size_px))
        )
        pose = Pose(
            rotation=tuple(map(tuple, _rotation(values["rotation"]).tolist())),  # type: ignore[arg-type]
            translation_mm=tuple((values["translation"] * unit_mm).tolist()),
        )
    except ValidationError as error:
        raise CalibrationError(
            f"{path} is not a valid calibration: {problems_in_words(error)}. Correct the file."
        ) from error
    return FoundStereo(Stereo(camera=camera, projector=projector, pose=pose), names, tuple(assumed))


def lenses_on(base: Rig, found: FoundStereo, source: str) -> Rig:
    """A rig for depth: these lenses and pose; film, curves and scales of ``base`` mean nothing."""
    stereo = found.stereo
    distance = float(np.linalg.norm(stereo.pose.vector_mm))
    assumed = f"; assumed: {', '.join(found.assumed)}" if found.assumed else ""
    return Rig(
        name=source,
        camera=stereo.camera,
        projector=stereo.projector,
        pose=stereo.pose,
        film=base.film,
        response=base.response,
        emission=base.emission,
        efficiency=base.efficiency,
        white_scale=base.white_scale,
        depth_range_mm=(NEAREST * distance, FARTHEST * distance),
        provenance=Provenance(
            source=f"lenses and pose of {source}",
            notes=f"film, curves and scales from {base.name!r}: for depth alone{assumed}",
        ),
    )


def _name_of(part: str, numbers: dict[str, NDArray[np.float64]]) -> str | None:
    wanted = next((sizes for key, sizes in _SIZES.items() if key in part), None)
    for name, values in numbers.items():
        plain = re.sub(r"[^a-z0-9]", "", name.lower())
        if re.fullmatch(_NAMES[part], plain) and (wanted is None or values.size in wanted):
            return name
    return None


def _distortion(
    values: dict[str, NDArray[np.float64]], names: dict[str, str], who: str, path: Path
) -> NDArray[np.float64]:
    part = f"{who} distortion"
    return five_coefficients(values[part], names[part], path) if part in values else np.zeros(5)


def _rotation(values: NDArray[np.float64]) -> NDArray[np.float64]:
    import cv2

    return values.reshape(3, 3) if values.size == 9 else np.asarray(cv2.Rodrigues(values)[0], np.float64)
