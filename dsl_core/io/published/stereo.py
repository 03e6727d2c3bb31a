"""Lenses and pose of a camera and a projector in OpenCV's XML or YAML, in three dialects of names.

``dsl``: the published calibration (``rotation``, with fundamental and essential matrix, the latter under the
name ``epipolar``). ``procam``: kamino410/procam-calibration, which spells the rotation ``roration``.
``moreno-taubin``: ``cam_K``, ``cam_kc``, ..., without any image size. All map camera to projector
coordinates, ``x_p = R x_c + t``; the unit of ``t`` is that of the calibration board, mm is assumed.
"""

from __future__ import annotations

import difflib
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from dsl_core.errors import CalibrationError, StoreError
from dsl_core.io.published.tree_file import Node, read_nodes
from dsl_core.io.staging import staged
from dsl_core.model.base import Record, problems_in_words
from dsl_core.model.calibration.geometry import GeometryCalibration
from dsl_core.model.geometry import Lens, Pose

#: Node of a calibration from columns alone.
COLUMNS_ONLY = "columns_only"
#: Skew of a lens, relative to its focal length, that passes for none.
_MOST_SKEW = 1e-3
Dialect = Literal["dsl", "procam", "moreno-taubin"]
Size = tuple[int, int]

_PROCAM = {
    "camera matrix": "cam_int",
    "camera distortion": "cam_dist",
    "projector matrix": "proj_int",
    "projector distortion": "proj_dist",
    "rotation": "roration",
    "translation": "translation",
}
_NODES: dict[Dialect, dict[str, str]] = {
    "dsl": {**_PROCAM, "rotation": "rotation"},
    "procam": _PROCAM,
    "moreno-taubin": {
        "camera matrix": "cam_K",
        "camera distortion": "cam_kc",
        "projector matrix": "proj_K",
        "projector distortion": "proj_kc",
        "rotation": "R",
        "translation": "T",
    },
}
_SHAPES = {
    "camera matrix": (3, 3),
    "projector matrix": (3, 3),
    "rotation": (3, 3),
    "translation": (3,),
}


class Stereo(Record):
    """What a calibration file says of camera and projector; ``rms_px`` is the reprojection error.

    ``columns_only``: what it says of the projector's rows is assumed, see `GeometryCalibration`.
    """

    camera: Lens
    projector: Lens
    pose: Pose
    rms_px: float | None = None
    columns_only: bool = False
    dialect: Dialect = "dsl"


def load_stereo(path: Path, projector_size_px: Size, camera_size_px: Size | None = None) -> Stereo:
    """Read any of the dialects; no dialect holds the projector's size, one not the camera's either.

    Sizes are (width, height). Raises `CalibrationError` that names the node that is missing or wrong.
    """
    nodes = read_nodes(path)
    dialect = _dialect_of(nodes, path)
    values = {part: _shaped(nodes, node, part, path) for part, node in _NODES[dialect].items()}
    size = _camera_size(nodes, camera_size_px, path)
    try:
        return Stereo(
            camera=lens_of(values["camera matrix"], values["camera distortion"], size),
            projector=lens_of(values["projector matrix"], values["projector distortion"], projector_size_px),
            pose=Pose(
                rotation=tuple(map(tuple, values["rotation"].tolist())),  # type: ignore[arg-type]
                translation_mm=tuple(values["translation"].tolist()),
            ),
            rms_px=_rms(nodes),
            columns_only=COLUMNS_ONLY in nodes,
            dialect=dialect,
        )
    except ValidationError as error:
        raise CalibrationError(
            f"{path} is not a valid calibration: {problems_in_words(error)}."
            " Calibrate again or correct the file."
        ) from error


def stereo_of(found: GeometryCalibration) -> Stereo:
    """Lenses and pose of a geometric calibration in the published dialect."""
    return Stereo(
        camera=found.camera,
        projector=found.projector,
        pose=found.pose,
        rms_px=found.rms_px,
        columns_only=found.columns_only,
    )


def save_stereo(stereo: Stereo, path: Path, *, overwrite: bool = False) -> Path:
    """Write a calibration in its dialect (``.xml``, or ``.yml`` as Moreno and Taubin do); return the path.

    Raises `StoreError` when the file already exists (unless ``overwrite``) or cannot be written.
    """
    import cv2

    if path.suffix.lower() not in {".xml", ".yml", ".yaml"}:
        raise StoreError(f"{path.name!r} does not end in .xml or .yml. Add the ending to the name.")
    with staged([path], overwrite=overwrite) as (draft,):
        # OpenCV does not say when a disk is full: the text is made in memory and written here.
        file = cv2.FileStorage(draft.name, cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)
        for name, value in _nodes_of(stereo).items():
            file.write(name, value)
        draft.write_bytes(file.releaseAndGetString().encode())
    return path


def _nodes_of(stereo: Stereo) -> dict[str, Any]:
    """Nodes in the order the dialect writes them."""
    camera, projector, pose = stereo.camera, stereo.projector, stereo.pose
    parts: dict[str, NDArray[np.float64]] = {
        "camera matrix": camera.matrix,
        "camera distortion": np.array([camera.distortion]),
        "projector matrix": projector.matrix,
        "projector distortion": np.array([projector.distortion]),
        "rotation": pose.matrix,
        "translation": pose.vector_mm[:, None],
    }
    nodes: dict[str, Any] = {_NODES[stereo.dialect][part]: value for part, value in parts.items()}
    nodes |= {COLUMNS_ONLY: 1.0} if stereo.columns_only else {}
    rms = {} if stereo.rms_px is None else {"rms": stereo.rms_px}
    if stereo.dialect == "moreno-taubin":
        return nodes | ({} if stereo.rms_px is None else {"stereo_error": stereo.rms_px})
    shape = np.array([[camera.height_px], [camera.width_px]], float)
    nodes = {"img_shape": shape, **rms, **nodes}
    if stereo.dialect == "dsl":
        nodes |= {"fundamental": fundamental_matrix(stereo), "epipolar": essential_matrix(pose)}
    return nodes


def essential_matrix(pose: Pose) -> NDArray[np.float64]:
    """``E = [t]x R`` with ``x_p' E x_c = 0`` (Hartley and Zisserman 2004, section 9.6), shape (3, 3)."""
    return np.cross(pose.vector_mm, pose.matrix, axisb=0, axisc=0)


def fundamental_matrix(stereo: Stereo) -> NDArray[np.float64]:
    """``F = Kp^-T E Kc^-1`` (Hartley and Zisserman 2004, section 9.6), scaled to ``F[2, 2] = 1``."""
    inverse_c, inverse_p = np.linalg.inv(stereo.camera.matrix), np.linalg.inv(stereo.projector.matrix)
    fundamental: NDArray[np.float64] = inverse_p.T @ essential_matrix(stereo.pose) @ inverse_c
    last = fundamental[2, 2]
    return fundamental / last if last else fundamental


def _dialect_of(nodes: dict[str, Node], path: Path) -> Dialect:
    """The dialect all of whose nodes are there; otherwise say what the closest one lacks."""
    lacking = {d: [n for n in names.values() if nodes.get(n) is None] for d, names in _NODES.items()}
    best: Dialect = min(lacking, key=lambda d: len(lacking[d]))
    if not lacking[best]:
        return best
    problems = []
    for name in lacking[best]:
        if name in nodes:
            problems.append(f"{name} is not a number or a complete matrix")
            continue
        near = difflib.get_close_matches(name, set(nodes) - set(_NODES[best].values()), n=1, cutoff=0.6)
        problems.append(f"{name} is missing" + (f" (is {near[0]!r} misnamed?)" if near else ""))
    raise CalibrationError(
        f"{path} is not a complete calibration in a known dialect; the closest is {best!r}:"
        f" {', '.join(problems)}. Correct the file, or export the calibration again."
    )


def _shaped(nodes: dict[str, Node], node: str, part: str, path: Path) -> NDArray[np.float64]:
    values = np.asarray(nodes[node], np.float64)
    if part == "translation":
        values = values.ravel()
    shape = _SHAPES.get(part)
    if shape is not None and values.shape != shape:
        raise CalibrationError(f"{path}: {node} has shape {values.shape}, {shape} is needed for the {part}.")
    if not np.isfinite(values).all():
        raise CalibrationError(f"{path}: {node} contains numbers that are not finite. Calibrate again.")
    if shape is None:
        return five_coefficients(values.ravel(), node, path)
    if part.endswith("matrix"):
        require_lens_matrix(values, node, path)
    return values


def require_lens_matrix(matrix: NDArray[np.float64], node: str, path: Path) -> None:
    """Raise `CalibrationError` for a matrix (3, 3) of more than focal lengths and a principal point."""
    skew = matrix[0, 1]
    if matrix[1, 0] or matrix[2, :2].any() or matrix[2, 2] != 1 or abs(skew) > _MOST_SKEW * abs(matrix[0, 0]):
        raise CalibrationError(
            f"{path}: {node} is not a matrix of fx, fy, cx, cy with 0 0 1 in its last row and no skew."
            " Calibrate without skew, or correct it."
        )


def five_coefficients(values: NDArray[np.float64], node: str, path: Path) -> NDArray[np.float64]:
    """OpenCV's k1 k2 p1 p2 [k3 [...]]; the model ends at k3, so anything further must be zero.

    Padded with zeros to shape (5,). Raises `CalibrationError` that names the ``node`` of the file.
    """
    if len(values) < 4 or np.any(values[5:]):
        raise CalibrationError(
            f"{path}: {node} has {len(values)} distortion coefficients; 4 or 5 are needed (k1 k2 p1 p2 k3),"
            " further ones only as zeros. Calibrate without the rational, thin prism or tilted model."
        )
    return np.pad(values[:5], (0, max(0, 5 - len(values))))


def lens_of(matrix: NDArray[np.float64], distortion: NDArray[np.float64], size_px: Size) -> Lens:
    """A lens from a matrix (3, 3), five coefficients and the image size (width, height)."""
    return Lens(
        width_px=size_px[0],
        height_px=size_px[1],
        fx_px=matrix[0, 0],
        fy_px=matrix[1, 1],
        cx_px=matrix[0, 2],
        cy_px=matrix[1, 2],
        distortion=tuple(distortion.tolist()),
    )


def _camera_size(nodes: dict[str, Node], given: Size | None, path: Path) -> Size:
    stored = nodes.get("img_shape")
    if stored is None:
        if given is None:
            raise CalibrationError(
                f"{path} does not contain the camera's image size. Give it (width and height)."
            )
        return given
    shape = np.asarray(stored, float).ravel()
    if len(shape) < 2:
        raise CalibrationError(
            f"{path}: img_shape contains {len(shape)} number(s), rows and columns are needed."
        )
    if not np.isfinite(shape[:2]).all():
        raise CalibrationError(
            f"{path}: img_shape contains {shape[:2].tolist()}, rows and columns are needed."
        )
    size = (int(shape[1]), int(shape[0]))
    if given is not None and given != size:
        raise CalibrationError(
            f"{path} was made with camera images of {size[0]} x {size[1]} px, but {given[0]} x {given[1]} px"
            " are needed. Use the calibration made with the scan's binning and crop."
        )
    return size


def _rms(nodes: dict[str, Node]) -> float | None:
    value = nodes.get("rms", nodes.get("stereo_error"))
    return float(value) if isinstance(value, int | float) else None
