"""Which flag of a pixel counts, and its name and colour in every picture: on screen, in reports and files."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.result import Flag

#: What each flag is called below a picture.
FLAG_NAMES: dict[Flag, str] = {flag: str(flag.name).lower().replace("_", " ") for flag in Flag}
#: One colour per flag, in the order of `Flag`; told apart by the common kinds of colour blindness
#: (after P. Tol, "Colour schemes", 2021, bright and muted).
FLAG_COLOURS: dict[Flag, str] = dict(
    zip(
        Flag,
        (
            "#332288", "#cc3311", "#aa4499", "#882255", "#ddcc77",
            "#999933", "#88ccee", "#44aa99", "#ee7733", "#555555",
            "#117733",
        ),
        strict=True,
    )
)  # fmt: skip
#: From the gravest to the mildest: as declared, except for those that leave no depth and came later.
_GRAVEST = (Flag.NON_FINITE, Flag.CODES_DISAGREE)
GRAVITY = (*_GRAVEST, *(flag for flag in Flag if flag not in _GRAVEST))


def gravest_flag(flags: NDArray[np.integer]) -> NDArray[np.uint8]:
    """1 + index in `Flag` of each pixel's gravest flag, 0 where nothing is wrong."""
    order = list(Flag)
    classes = np.zeros(flags.shape, np.uint8)
    for flag in reversed(GRAVITY):
        classes[(flags & int(flag)) != 0] = 1 + order.index(flag)
    return classes
