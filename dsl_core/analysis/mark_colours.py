"""Colours of what is marked on a result, and of the classes made from it, by the index that each keeps."""

from __future__ import annotations

import colorsys
from typing import Literal

#: What colours are seen on: white paper and light windows, or dark windows.
Ground = Literal["light", "dark"]
#: Told apart by people with any colour vision (after Okabe and Ito), with a contrast of 3 to 1 on the ground.
FIRST: dict[Ground, tuple[str, ...]] = {
    "light": (
        "#0072b2", "#d55e00", "#009e73", "#b8568a", "#7a6a00", "#1787bd", "#5b3fa0", "#a02020",
    ),
    "dark": (
        "#56b4e9", "#e69f00", "#2fc79a", "#e59ac2", "#f0e442", "#5c9dff", "#b39ddb", "#ff8a80",
    ),
}  # fmt: skip
#: Saturation and values of further hues, each as far as possible from those before it.
_SECOND, _GOLDEN = 0.33, 0.61803398875
_FURTHER: dict[Ground, tuple[float, tuple[float, ...]]] = {
    "light": (0.9, (0.5, 0.36, 0.43)),
    "dark": (0.5, (0.98, 0.75, 0.87)),
}


def mark_colour(index: int, ground: Ground = "light") -> str:
    """The colour ``#rrggbb`` of an index from 0 on (a negative one counts as 0); no two are the same.

    >>> mark_colour(0), mark_colour(0, "dark")
    ('#0072b2', '#56b4e9')
    """
    first, index = FIRST[ground], max(index, 0)
    if index < len(first):
        return first[index]
    further = index - len(first)
    saturation, values = _FURTHER[ground]
    levels = colorsys.hsv_to_rgb((_SECOND + further * _GOLDEN) % 1, saturation, values[further % len(values)])
    return "#" + "".join(f"{round(255 * level):02x}" for level in levels)
