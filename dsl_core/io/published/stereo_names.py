"""How programs call the parts of a calibration of two devices, and which of their numbers is which part.

Names are compared without case, punctuation and what they are nested in, so that ``Camera.K``, ``cam_K`` and
``camera_matrix`` are the same; sizes tell apart what differs by case alone, such as ``Kc`` and ``kc``.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Numbers = Mapping[str, NDArray[np.float64]]
#: Names of camera and projector, the usual ones first; other pairs are cameras of which one stands for it.
_PAIRS = (
    ("camera|cam|c", "projector|proj|prj|p|dlp"),
    ("(?:cam|camera)0", "(?:cam|camera)1"),
    ("(?:cam|camera|cameraparameters)?1", "(?:cam|camera|cameraparameters)?2"),
    ("left|l", "right|r"),
)
_MATRIX = r"(?:camera)?(?:matrix|mtx|mat|int|ins?trinsics?|ins?trinsicmatrix|k|kk|m|a)"
_DISTORTION = r"(?:camera)?(?:distortion|dist|dist(?:ortion)?coeff?(?:icient)?s?|coeffs|kc|k|d)"
_OF_POSE = r"(?:stereo|extrinsics?|pose|projector|proj|relative|s)?"
_TO_PROJECTOR = r"(?:cam|camera|c)(?:2|to)(?:proj|projector|p)"
_TO_CAMERA = r"(?:proj|projector|p)(?:2|to)(?:cam|camera|c)"
_TURN = r"(?:r|rot|rotation|roration|rmat|rvec|rotationmatrix|rotationvector|om|rp|rotationofcamera2)"
_SHIFT = r"(?:t|trans|translation|tvec|tmat|translationvector|tp|translationofcamera2)"
_BOTH = (
    r"(?:tcncnm1|cam1tcncnm1|transform(?:ation)?(?:matrix)?|extrinsics?(?:matrix)?|rt|pose|posecamera2[at])"
)
#: Sizes with such names are counted in squares or corners.
_OF_TARGET = re.compile(r"(?i)board|pattern|target|grid|corner|square")
#: Names that are neither of a matrix nor of a distance.
_SURE = r"(?:camera)?(?:distortion|dist(?:ortion)?coeff?(?:icient)?s?|kc)"
#: Whatever has such names is no result, if there is the same without.
_ASIDE = re.compile(
    rf"{_OF_TARGET.pattern}|chess|std|sigma|deviation|error|uncertain|covarian|initial|rectif|[rt]vec"
)
#: Values of one part that differ by less than this share of the largest are the same, rounded.
_ROUNDED = 1e-3
#: Names of what says the unit of lengths, and what says that of something else.
_UNIT = r"(?:world|length|distance|translation|baseline|board|square|target|pattern|size|pose|t)?units?"
_OTHER_UNIT = re.compile(
    r"(?i)pixel|sensor|focal|angle|rotation|image|\A(?:px|deg(?:rees?)?|rad(?:ians?)?|)\Z"
)
_UNITS_MM = {
    "um|µm|micrometers?|micrometres?|microns?": 0.001, "mm|millimeters?|millimetres?": 1.0,
    "cm|centimeters?|centimetres?": 10.0, "dm|decimeters?|decimetres?": 100.0, "m|meters?|metres?": 1000.0,
    "in|inch|inches": 25.4, "ft|foot|feet": 304.8,
}  # fmt: skip
#: Any other lengths are those of a distortion that has to be refused, if not of a matrix or a lone distance.
_COEFFICIENTS = set(range(2, 100)) - {9}
#: What numbers of a lens may be nested in.
_WITHIN = "(?:intrinsics?)?"
#: Focal lengths and principal point: a name for each number, or for two as in MATLAB and its toolboxes.
_LENGTHS = ("fx", "fy", "(?:cx|ppx)", "(?:cy|ppy)")
_PAIRS_OF_LENGTHS = ("(?:fc|focallength)", "(?:cc|principalpoint)")
#: Coefficients that have a name each, in OpenCV's order.
_TERMS = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")


@dataclass
class Parts:
    """Numbers by what they are, the names that they have in a file, and what was taken for granted.

    Matrices are (3, 3), distortions flat, ``turn`` (3, 3) or (3,), ``shift`` (3,). ``is_inverse`` says that a
    name tells the pose to lead from the projector to the camera. ``both_placed`` names the poses of camera
    and projector where a file has one of each, so that neither leads from one device to the other. ``rivals``
    are two names of one part that have different values. ``has_transposed``: of a matrix of a lens.
    """

    values: dict[str, NDArray[np.float64]] = field(default_factory=dict)
    names: dict[str, str] = field(default_factory=dict)
    taken: list[str] = field(default_factory=list)
    is_inverse: bool = False
    both_placed: tuple[str, str] | None = None
    rivals: tuple[str, str] | None = None
    has_transposed: bool = False

    def find(self, numbers: Numbers, words: str, sizes: set[int]) -> str | None:
        """The name of a part that is one of these words, no side result and the least nested."""
        names = _all_named(numbers, words, sizes)
        names = [name for name in names if not _ASIDE.search(name)] or names
        least = min((name.count(".") for name in names), default=0)
        names = [name for name in names if name.count(".") == least]
        for other in names[1:]:
            if not _are_same(numbers[names[0]], numbers[other]):
                self.rivals = self.rivals or (names[0], other)
        return names[0] if names else None

    def add(self, part: str, name: str, values: NDArray[np.float64]) -> None:
        """Note a part and its name."""
        self.values[part], self.names[part] = values, name


def parts_of(numbers: Numbers) -> Parts:
    """What a file with these numbers says of two devices; parts that it lacks are absent."""
    best = max((_of_pair(numbers, *pair) for pair in _PAIRS), key=lambda each: len(each.values))
    _add_pose(best, numbers)
    best.both_placed = _both_placed(best, numbers)
    return best


def size_of(numbers: Numbers, device: str) -> tuple[int, int] | None:
    """Width and height in px that a file gives for the camera or the projector; None if it does not."""
    numbers = {name: values for name, values in numbers.items() if not _OF_TARGET.search(name)}
    is_camera = device == "camera"
    who = "(?:camera|cam|cam0|cameraparameters1|frame|image|img)?" if is_camera else (
        "(?:projector|proj|cam1|cameraparameters2|screen|screenres)"
    )  # fmt: skip
    for rows_first, words in ((False, "(?:imagesize|resolution|size|sizepx)"), (True, "(?:img|image)shape")):
        name = _named(numbers, rf"{who}{_WITHIN}{words}", {2})
        if name is not None:
            first, second = (int(each) for each in numbers[name].ravel())
            swapped = rows_first or "cameraparameters" in _plain(name)
            return (second, first) if swapped else (first, second)
    sides = [
        _named(numbers, rf"{who}(?:image|frame)?{words}", {1}) for words in ("(?:width|x)", "(?:height|y)")
    ]
    if None in sides:
        return None
    width, height = (int(numbers[name].ravel()[0]) for name in sides if name is not None)
    return width, height


def units_of(texts: Mapping[str, str]) -> dict[str, float | None]:
    """Units of lengths that a file states by their names, mm; None for words that are no unit of length."""
    stated: dict[str, float | None] = {}
    for name, text in texts.items():
        is_other = any(_OTHER_UNIT.search(each) for each in (name, text.strip()))
        if not is_other and re.fullmatch(_UNIT, _plain(name.split(".")[-1])):
            fits = (mm for words, mm in _UNITS_MM.items() if re.fullmatch(words, text.strip(" .").lower()))
            stated[name] = next(fits, None)
    return stated


def _of_pair(numbers: Numbers, camera: str, projector: str) -> Parts:
    """The lenses that a file has under one pair of names."""
    found, is_told = Parts(), (camera, projector) == _PAIRS[0]
    # Next to a projector with a name, coefficients of nobody are the camera's.
    _add_lens(found, numbers, "camera", f"(?:{camera})", "|distcoeffs" if is_told else "")
    _add_lens(found, numbers, "projector", f"(?:{projector})")
    if not is_told and len(found.values) > 1:
        one, other = found.names.get("camera matrix"), found.names.get("projector matrix")
        found.taken.append(f"{one} is the camera's, {other} the projector's")
    return found


def _add_lens(found: Parts, numbers: Numbers, device: str, who: str, alone: str = "") -> None:
    """Matrix and distortion of a device that is called ``who``; ``alone`` adds names of its distortion."""
    lengths = {name: values for name, values in numbers.items() if _are_lengths(values)}
    words = f"{who}{_MATRIX}|{_MATRIX}{who}"
    name = found.find(numbers, words, {9}) or found.find(lengths, words, {4})
    if name is not None:
        _add_matrix(found, f"{device} matrix", name, numbers[name].ravel())
    else:
        _add_lengths(found, numbers, f"{device} matrix", f"{who}(?:{_MATRIX})?", who)
    _add_distortion(found, {n: v for n, v in numbers.items() if n not in lengths}, device, who, alone)


def _add_lengths(found: Parts, numbers: Numbers, part: str, own: str, who: str) -> None:
    """Focal lengths and principal point that have names of their own, one or two numbers each."""
    sets = [[found.find(numbers, f"{own}{term}|{term}{who}", {1}) for term in _LENGTHS]]
    sets += [[found.find(numbers, f"{own}{term}|{term}{who}", {2}) for term in _PAIRS_OF_LENGTHS]]
    names = next(([name for name in each if name] for each in sets if None not in each), None)
    if names is None:
        return
    values = np.concatenate([numbers[name].ravel() for name in names])
    fx, fy, cx, cy = values
    # A toolbox states the slope of the axes instead of the skew in px.
    ways = (("skew", 1.0), ("alphac", fx))
    skews = [(found.find(numbers, f"{own}{term}|{term}{who}", {1}), unit) for term, unit in ways]
    skew = next((numbers[name].item() * unit for name, unit in skews if name), 0.0)
    # MATLAB counts pixels from 1.
    first = float("cameraparameters" in _plain(names[0]))
    found.add(part, ", ".join(names), np.array([[fx, skew, cx - first], [0, fy, cy - first], [0, 0, 1]]))
    if first:
        found.taken.append(f"{names[-1]} is written as in MATLAB: with pixels from 1")


def _are_lengths(values: NDArray[np.float64]) -> bool:
    """Whether four numbers are fx, fy, cx, cy in px, not coefficients of the same name in another case."""
    return values.size == 4 and bool((values > 1).all())


def _add_distortion(found: Parts, numbers: Numbers, device: str, who: str, alone: str) -> None:
    """Coefficients in OpenCV's order, as many as there are; up to three are radial, with tangential ones."""
    part, words = f"{device} distortion", f"{who}{_WITHIN}{_DISTORTION}|{_DISTORTION}{who}{alone}"
    name = (
        found.find(numbers, f"{who}{_WITHIN}radialdistortion", {1, 2, 3})
        or found.find(numbers, words, _COEFFICIENTS)
        or found.find(numbers, f"{who}{_SURE}|{_SURE}{who}{alone}", {1, 9})
    )
    if name is None:
        # A letter follows a term: "k11" is a place in a matrix.
        ways = f"{who}{_WITHIN}(?:{_DISTORTION})?{{0}}|{{0}}(?=[a-z]){who}"
        terms = [found.find(numbers, ways.format(term), {1}) for term in _TERMS]
        named = ", ".join(each for each in terms if each)
        if named:
            found.add(part, named, np.array([numbers[each].item() if each else 0.0 for each in terms]))
        return
    values = numbers[name].ravel()
    if values.size < 4:
        tangential = found.find(numbers, f"{who}{_WITHIN}tangentialdistortion", {2})
        if tangential is None:
            found.taken.append(f"{name} is without tangential distortion")
        k, p = (
            np.pad(values, (0, 3 - values.size)),
            numbers[tangential].ravel() if tangential else np.zeros(2),
        )
        values = np.r_[k[:2], p, k[2:]]
    found.add(part, name, values)


def _add_matrix(found: Parts, part: str, name: str, values: NDArray[np.float64]) -> None:
    if values.size == 4:
        fx, fy, cx, cy = values
        found.add(part, name, np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]]))
        found.taken.append(f"{name} is fx, fy, cx, cy")
        return
    matrix = _upright(values)
    # MATLAB counts pixels from 1.
    transposed = not np.array_equal(matrix, values.reshape(3, 3))
    found.has_transposed |= transposed
    if transposed or "cameraparameters" in _plain(name):
        matrix = matrix - np.array([[0, 0, 1], [0, 0, 1], [0, 0, 0]])
        how = "transposed, with pixels from 1" if transposed else "with pixels from 1"
        found.taken.append(f"{name} is written as in MATLAB: {how}")
    found.add(part, name, matrix)


def _upright(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """A matrix (3, 3) of a lens as it multiplies columns; MATLAB's multiplies rows, but for a later ``K``."""
    matrix = values.reshape(3, 3)
    return matrix.T if not matrix[:2, 2].any() and matrix[2, :2].any() else matrix


def _add_pose(found: Parts, numbers: Numbers) -> None:
    for part, words, size in (("rotation", _TURN, 9), ("rotation", _TURN, 3), ("translation", _SHIFT, 3)):
        ways = f"{_OF_POSE}{words}|{words}{_TO_PROJECTOR}|{_TO_PROJECTOR}{words}"
        back = f"{words}{_TO_CAMERA}|{_TO_CAMERA}{words}"
        for each, is_inverse in ((ways, False), (back, True)):
            name = None if part in found.values else found.find(numbers, each, {size})
            if name is not None:
                values = numbers[name]
                values = values.reshape(3, 3) if values.size == 9 else values.ravel()
                # MATLAB multiplies rows from the left.
                turned = values.T if _plain(name).endswith("rotationofcamera2") else values
                if turned is values and values.size == 9 and found.has_transposed:
                    found.taken.append(f"{name} is not transposed, unlike the matrices of the lenses")
                found.add(part, name, turned)
                found.is_inverse |= is_inverse
    if "rotation" in found.values or "translation" in found.values:
        return
    ways = f"(?:projector|proj|stereo)?{_BOTH}|t?{_TO_PROJECTOR}"
    for words, is_inverse in ((ways, False), (f"t?{_TO_CAMERA}", True)):
        name = found.find(numbers, words, {12, 16})
        if name is not None and "rotation" not in found.values:
            values = numbers[name]
            matrix = values if values.shape == (4, 3) else values.reshape(-1, 4)
            if _is_of_rows(matrix):
                matrix = matrix.T
                found.taken.append(f"{name} is written for rows, as in MATLAB and DirectX: transposed")
            found.add("rotation", name, matrix[:3, :3])
            found.add("translation", name, matrix[:3, 3])
            found.is_inverse |= is_inverse


def _is_of_rows(pose: NDArray[np.float64]) -> bool:
    """Whether a pose multiplies rows from the right, so that its translation is in the last row."""
    last = [0, 0, 0, 1]
    if pose.shape == (4, 4):
        return np.array_equal(pose[:, 3], last) and not np.array_equal(pose[3], last)
    return pose.shape == (4, 3)


def _both_placed(found: Parts, numbers: Numbers) -> tuple[str, str] | None:
    """Names of a pose of the camera, and of the projector's taken for the one between them; else None."""
    camera, projector = "(?:camera|cam)", "(?:projector|proj)"
    for part, words, sizes, still in (
        ("rotation", _TURN, {9, 3}, (np.eye(3), np.zeros(3))),
        ("translation", _SHIFT, {3}, (np.zeros(3),)),
        ("rotation", _BOTH, {12, 16}, (np.eye(4), np.eye(3, 4))),
    ):
        taken = found.names.get(part, "")
        if not any(re.fullmatch(rf"{projector}{words}|[rt]p", each) for each in _endings(taken)):
            continue
        name = _named(numbers, f"{camera}{words}|{words}(?:{camera}|c)", sizes)
        if name is not None and not any(_is_nearly(numbers[name].ravel(), s.ravel()) for s in still):
            return name, taken
    return None


def _is_nearly(values: NDArray[np.float64], still: NDArray[np.float64]) -> bool:
    """Whether a camera is at the origin, looking along z, up to rounding; then both poses are the same."""
    return values.shape == still.shape and np.allclose(values, still, rtol=0, atol=1e-6)


def _named(numbers: Numbers, words: str, sizes: set[int]) -> str | None:
    return next(iter(_all_named(numbers, words, sizes)), None)


def _all_named(numbers: Numbers, words: str, sizes: set[int]) -> list[str]:
    """The names that are one of these words and have one of these sizes, with all that they are nested in."""
    return [
        name
        for name, values in numbers.items()
        if values.size in sizes and any(re.fullmatch(words, each) for each in _endings(name))
    ]


def _are_same(one: NDArray[np.float64], other: NDArray[np.float64]) -> bool:
    """Whether two values of a part agree, one of them perhaps shorter or a transposed matrix of a lens."""
    flat = [(_upright(each) if each.size == 9 else each).ravel() for each in (one, other)]
    longest = max(each.size for each in flat)
    first, second = (np.pad(each, (0, longest - each.size)) for each in flat)
    return np.allclose(first, second, rtol=0, atol=_ROUNDED * float(np.abs(first).max()))


def _endings(name: str) -> Iterator[str]:
    """A name with all that it is nested in, then with less; devices are never left out."""
    levels = name.split(".")
    for start in range(len(levels)):
        if start and re.match(r"(?i)cam|proj|left|right", levels[start - 1]):
            return
        yield _plain(".".join(levels[start:]))


def _plain(name: str) -> str:
    return re.sub(r"[^a-z0-9]", "", name.lower())
