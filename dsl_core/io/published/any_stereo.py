"""Lenses and pose of camera and projector from files of any program, by the names that are in use.

XML, YAML and JSON, of OpenCV or with nested lists. Distortion that is absent is zero; a rotation of three
numbers is a vector of Rodrigues. Whatever a file does not say itself is told, for a person to judge.
"""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from dsl_core.errors import CalibrationError
from dsl_core.io.published.stereo import (
    COLUMNS_ONLY,
    Size,
    Stereo,
    five_coefficients,
    lens_of,
    require_lens_matrix,
)
from dsl_core.io.published.stereo_names import Numbers, Parts, parts_of, size_of, units_of
from dsl_core.io.published.stereo_words import doubts, understood
from dsl_core.io.published.tree_file import read_nodes, read_text, read_texts
from dsl_core.model.base import problems_in_words
from dsl_core.model.geometry import Pose

_PARTS = (
    "camera matrix", "camera distortion", "projector matrix", "projector distortion",
    "rotation", "translation",
)  # fmt: skip
#: A rotation vector that is longer is none in radians: no turn is more than half of one, either way.
_MOST_TURN_RAD = 1.001 * np.pi
_CORRECT = {
    "camera": "Correct --camera-size, or calibrate with that size.",
    "projector": "Correct --projector, or calibrate with that size.",
}
#: Models of lenses that are none of a pinhole; short names, which may be those of people, only as a model's.
_OTHER_MODEL = re.compile(
    r"(?i)(?:\b(?:equidistant|fisheye|kannala[_ -]?brandt|double[_ -]?sphere)"
    r"|(?<=model)\W{1,6}(?:omni|mei)|(?<=type)\W{1,6}(?:omni|mei))\b(?!\W{1,5}(?:false|no|off|0)\b)"
)


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
    unit_mm: float | None = None,
    inverse: bool = False,
) -> FoundStereo:
    """Read lenses and pose from any file that names them; lengths are in units of ``unit_mm``, or as stated.

    A file that states its unit is read in that. Sizes (width, height) are those of the file where they are
    not given; with ``inverse`` its pose leads from projector to camera. Raises `CalibrationError` that says
    which parts are missing, what they may be called, and which names the file has, or that sizes or units
    differ from those of the file.
    """
    nodes = read_nodes(path)
    _require_pinhole(path)
    stored = {name: np.asarray(value, np.float64) for name, value in nodes.items() if value is not None}
    numbers = {name: values for name, values in stored.items() if np.isfinite(values).all()}
    parts = parts_of(numbers)
    lacking = [part for part in _PARTS if part not in parts.names and not part.endswith("distortion")]
    if lacking:
        has = ", ".join(sorted(nodes)[:12]) or "nothing"
        broken = [name for name in stored if name not in numbers]
        odd = f" (not finite: {', '.join(broken)})" if broken else ""
        raise CalibrationError(
            f"{path} lacks {' and '.join(lacking)}; it has {has}{odd}. Name them like cam_K, proj_K, R and T"
            " (3 x 3, 3 x 3, 3 x 3 and 3 numbers), from camera to projector."
        )
    if parts.rivals is not None:
        raise CalibrationError(
            f"{path} has two values of one part that differ, {' and '.join(parts.rivals)}. Leave only the one"
            " that is meant in the file, and remove or rename the other."
        )
    if parts.both_placed is not None:
        of_camera, of_projector = parts.both_placed
        raise CalibrationError(
            f"{path} has a pose of the camera ({of_camera}) and one of the projector ({of_projector}), so"
            " that neither leads from one to the other. Give one R and T from camera to projector instead:"
            " for poses x = R X + t of points X of the world, R = Rp Rc^T and T = tp - R tc."
        )
    _require_distortions(path, numbers, nodes.keys() - numbers.keys())
    for part in ("camera matrix", "projector matrix"):
        require_lens_matrix(parts.values[part], parts.names[part], path)
    unit_mm = _unit_mm(path, unit_mm)
    given = {"camera": camera_size_px, "projector": projector_size_px}
    try:
        camera, projector = (
            lens_of(parts.values[f"{who} matrix"], _distortion(parts, who, path), size)
            for who, size in [(who, _size(path, numbers, who, size)) for who, size in given.items()]
        )
        turn, shift = _rotation(parts, path), parts.values["translation"] * unit_mm
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
    stereo = Stereo(camera=camera, projector=projector, pose=pose, columns_only=COLUMNS_ONLY in nodes)
    assumed = tuple(f"no {part}" for part in _PARTS if part not in parts.names)
    taken = understood(parts, unit_mm, inverse)
    return FoundStereo(stereo, parts.names, assumed, taken, tuple(doubts(stereo)))


def _require_pinhole(path: Path) -> None:
    found = _OTHER_MODEL.search(read_text(path))
    if found is not None:
        model = re.sub(r"^\W+", "", found[0])
        raise CalibrationError(
            f"{path} describes a lens by the model {model!r}; only a pinhole with the distortion k1 k2 p1"
            " p2 k3 is possible. Calibrate with that model."
        )


def _unit_mm(path: Path, given_mm: float | None) -> float:
    """The unit of lengths that a file states, or the given one, or mm; raises `CalibrationError`."""
    texts = read_texts(path)
    stated = units_of(texts)
    said = ", ".join(f"{name} {texts[name]!r}" for name in stated)
    if None in stated.values() or len(set(stated.values())) > 1:
        raise CalibrationError(
            f"{path} states the unit of its lengths by {said}; one of um, mm, cm, dm, m, in, ft is needed."
            " Correct the file, or remove that from it and give --unit-mm."
        )
    unit_mm = next((each for each in stated.values() if each), given_mm or 1.0)
    if given_mm not in (None, unit_mm):
        raise CalibrationError(
            f"{path} states {said}, which is {unit_mm:g} mm, not {given_mm:g} mm as given. Give no other unit"
            " than the file, or correct that."
        )
    return unit_mm


def _size(path: Path, numbers: Numbers, device: str, given: Size | None) -> Size:
    stored = size_of(numbers, device)
    option = "--camera-size" if device == "camera" else "--projector"
    size = stored if given is None else given
    if size is None:
        raise CalibrationError(f"{path} does not say the size of the {device}. Give {option} WIDTHxHEIGHT.")
    if given is not None and stored is not None and given != stored:
        raise CalibrationError(
            f"{path} is for a {device} of {stored[0]} x {stored[1]} px, not {given[0]} x {given[1]} px."
            f" {_CORRECT[device]}"
        )
    return size


def _require_distortions(path: Path, numbers: Numbers, others: Collection[str]) -> None:
    """Raise `CalibrationError` if one of ``others``, which are no numbers, is named as a distortion."""
    # "K" may be that of a matrix as well.
    for name in sorted(each for each in others if re.search("dist|kc", each, re.IGNORECASE)):
        found = parts_of({**numbers, name: np.zeros(5)}).names
        if any(found.get(part) == name for part in _PARTS if part.endswith("distortion")):
            raise CalibrationError(
                f"{path}: {name} is named as a distortion, but is not all finite numbers. Write k1 k2 p1"
                " p2 k3, or remove it if the lens has no distortion."
            )


def _distortion(parts: Parts, who: str, path: Path) -> NDArray[np.float64]:
    part = f"{who} distortion"
    if part not in parts.values:
        return np.zeros(5)
    return five_coefficients(parts.values[part], parts.names[part], path)


def _rotation(parts: Parts, path: Path) -> NDArray[np.float64]:
    import cv2

    values = parts.values["rotation"]
    if values.size == 9:
        return values
    turn_rad = float(np.linalg.norm(values))
    if turn_rad > _MOST_TURN_RAD:
        raise CalibrationError(
            f"{path}: {parts.names['rotation']} is a rotation of {turn_rad:.1f} rad, more than half a turn."
            " Give a rotation vector in radians or a matrix; angles about axes are not understood."
        )
    return np.asarray(cv2.Rodrigues(values)[0], np.float64)
