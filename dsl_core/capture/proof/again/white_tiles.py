"""How the light of white has changed from one part of the picture to another: shade, windows, haze."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.motion import TILES

#: Something stands before tiles of the picture that have lost light to this share, so many, while others have
#: kept it: a tenth of them within so much, and none has gained more than so much.
SHADED, FEWEST_SHADED, ELSEWHERE, GAINED = 0.7, 2, 0.06, 0.15
#: Something lights tiles of white that have so many times their light, while others have kept it.
LIT_UP = 1.3
CAME_IN = (
    "something came into the projected picture (a message, a window, the mouse pointer), or a lamp into view."
    " Take it away and close other programs."
)
#: Light has changed by place if a tenth of the tiles have less, and another tenth more, than this share of
#: all of it apart.
BY_PLACE = 0.15


def light_of_tiles(
    old: NDArray[np.float64], new: NDArray[np.float64], used: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """White less black over what it was in each of `TILES`, flat; NaN where there is little light."""
    down, across = (np.arange(size) * count // size for size, count in zip(old.shape, TILES, strict=True))
    tile = (down[:, None] * TILES[1] + across)[used]
    before, after = (np.bincount(tile, each[used], TILES[0] * TILES[1]) for each in (old, new))
    known = before > max(0.25 * before.max(), 0.0)
    if not known.any():
        return np.ones(before.size)
    return np.asarray(np.divide(after, before, out=np.full(before.size, np.nan), where=known))


def said_of_shade(tiles: NDArray[np.float64], shape: tuple[int, ...]) -> str:
    """That white, less black, has lost light in a part of the picture alone, and where; else empty."""
    lost = tiles < SHADED
    is_kept = abs(float(np.nanquantile(tiles, 0.9)) - 1) < ELSEWHERE and float(np.nanmax(tiles)) < 1 + GAINED
    if int(lost.sum()) < FEWEST_SHADED or not is_kept:
        return ""
    return (
        f"White has lost light in {_place_of(lost, shape)}, and not elsewhere: something"
        " stands in the way of projector, camera or lamps, or something came onto a lens. Take it away."
    )


def said_of_light_up(tiles: NDArray[np.float64], shape: tuple[int, ...]) -> str:
    """That white, less black, has gained light in a part of the picture alone, and where; else empty."""
    gained = tiles > LIT_UP
    usual, least = float(np.nanmedian(tiles)), float(np.nanmin(tiles))
    if not gained.any() or abs(usual - 1) > ELSEWHERE or least < 1 - ELSEWHERE:
        return ""
    return f"White has gained light in {_place_of(gained, shape)}, and not elsewhere: {CAME_IN}"


def _place_of(tiles: NDArray[np.bool_], shape: tuple[int, ...]) -> str:
    """Where tiles of a picture are, in words."""
    rows, columns = np.divmod(np.flatnonzero(tiles), TILES[1])
    spans = [
        (int(at.min()) * size // count, (int(at.max()) + 1) * size // count)
        for at, size, count in zip((columns, rows), shape[::-1], TILES[::-1], strict=True)
    ]
    return "columns {}-{}, rows {}-{} of the picture".format(*spans[0], *spans[1])


def said_of_places(tiles: NDArray[np.float64], light: float) -> str:
    """That parts of the picture have lost or gained more light than others; empty where all have alike."""
    low, high = (float(each) for each in np.nanquantile(tiles, (0.1, 0.9)))
    if high - low < BY_PLACE * light:
        return ""
    return (
        f"The light of white is {low:.2f} times what it was when the scan began in some parts of the picture"
        f" and {high:.2f} times in others: moisture, haze or dust came before a lens, the film or the target,"
        " or a lamp of the room or the projector moved. Clear the way of the light."
    )
