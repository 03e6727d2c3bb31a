"""Pictures in OpenEXR, as renderers and cameras of high dynamic range write them: values linear in light.

Layers and parts are named as https://openexr.com/en/latest/TechnicalIntroduction.html says: ``diffuse.R`` is
the red of a layer ``diffuse``.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsl_core.io.reading import require_plain

#: Layers of a renderer that hold what its camera sees, in lower case; others are depth, normals and the like.
_SEEN = ("", "combined", "beauty", "rgba", "rgb", "image", "color", "colour")
#: Values of all channels of a file: a renderer's layers for a large sensor, 1 GB.
_MOST_VALUES = 1 << 28


def read_exr(path: Path, most_px: int) -> NDArray[np.float32]:
    """What a file's camera saw, (rows, columns) or (rows, columns, 3) in the order R, G, B.

    What a file leaves out at its edges is black. Raises ``ValueError`` where it is no such file, is damaged,
    has more than ``most_px`` pixels, or holds nothing that a camera sees, and `OSError` as `require_plain`.
    """
    import OpenEXR

    require_plain(path)
    try:
        heads = [part.header for part in OpenEXR.File(str(path), header_only=True).parts]
        number, names = _chosen([[channel.name for channel in head["channels"]] for head in heads])
        shown, held = (_window(heads[number][name]) for name in ("displayWindow", "dataWindow"))
        for _, rows, columns in (shown, held):
            if not 0 < rows * columns <= most_px:
                raise ValueError(f"it claims {columns} x {rows} px")
        if sum(_values(head) for head in heads) > _MOST_VALUES:
            raise ValueError("its layers are larger than those of any camera's picture")
        channels = OpenEXR.File(str(path), separate_channels=True).parts[number].channels
        planes = [np.asarray(channels[name].pixels, np.float32) for name in names]
    except (RuntimeError, KeyError, IndexError, TypeError) as error:
        raise ValueError(f"OpenEXR says: {error}") from error
    if any(plane.shape != held[1:] for plane in planes):
        raise ValueError("it holds colours at fewer pixels than its brightness")
    picture = np.stack([_placed(plane, held[0], shown) for plane in planes], axis=-1)
    return picture if len(names) == 3 else picture[..., 0]


def _chosen(parts: list[list[str]]) -> tuple[int, list[str]]:
    """The part and the channels that hold what the camera saw; raises ``ValueError``."""
    found = [
        (_rank(layer), number, channels)
        for number, names in enumerate(parts)
        for layer in dict.fromkeys(name.rpartition(".")[0] for name in names)
        if (channels := _colours(layer, names))
    ]
    if not found:
        listed = ", ".join(sorted({name for names in parts for name in names})) or "none"
        raise ValueError(f"it has no channels R, G and B, nor Y; its channels are {listed[:200]}")
    _, number, channels = min(found, key=lambda each: each[:2])
    return number, channels


def _rank(layer: str) -> int:
    last = layer.rpartition(".")[2].lower()
    return _SEEN.index(last) if last in _SEEN else len(_SEEN)


def _colours(layer: str, names: Iterable[str]) -> list[str]:
    """Red, green and blue of a layer, or its brightness, or else its only channel."""
    within = [name for name in names if name.rpartition(".")[0] == layer]
    by_last = {name.rpartition(".")[2].upper(): name for name in within}
    if {"R", "G", "B"} <= by_last.keys():
        return [by_last[colour] for colour in "RGB"]
    if "Y" in by_last:
        return [by_last["Y"]]
    return within if len(within) == 1 and by_last.keys().isdisjoint("ZA") else []


def _window(box: Any) -> tuple[tuple[int, int], int, int]:
    """First row and column of a window, and how many rows and columns it has."""
    (left, top), (right, bottom) = (map(int, corner) for corner in box)
    return (top, left), bottom - top + 1, right - left + 1


def _values(head: Any) -> int:
    _, rows, columns = _window(head["dataWindow"])
    return rows * columns * len(head["channels"])


def _placed(
    plane: NDArray[np.float32], at: tuple[int, int], shown: tuple[tuple[int, int], int, int]
) -> NDArray[np.float32]:
    """A plane whose first pixel is ``at`` a row and column, in the window that is shown."""
    (top, left), rows, columns = shown
    if plane.shape == (rows, columns) and at == (top, left):
        return plane
    whole = np.zeros((rows, columns), np.float32)
    y, x = at[0] - top, at[1] - left
    inside = plane[max(-y, 0) : max(rows - y, 0), max(-x, 0) : max(columns - x, 0)]
    whole[max(y, 0) :, max(x, 0) :][: inside.shape[0], : inside.shape[1]] = inside
    return whole
