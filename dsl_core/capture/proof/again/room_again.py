"""What black, captured again, says of the light of the room: by how much it has changed, and whether alike.

A lamp of the room adds to each surface what that reflects, a black level that drifts the same everywhere.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Mosaic = NDArray[np.uint16]

#: Parts of white by which black differs: one that matters by itself, and one that does where nothing else has
#: changed; of that, at least so many DN, which the black level of a camera may drift by.
LEAST_ROOM, SLIGHT_ROOM, SLIGHT_DN = 0.03, 0.003, 4.0
#: Tiles of the picture, each way, that tell a lamp from a level: their changes scatter by this share of the
#: mean, at least, if it is a lamp.
TILES, UNEVEN = 8, 0.1


def said_of_room(darks_dn: tuple[float, float], white_dn: float) -> str:
    """That black has changed by a part of white that matters; empty if it has not.

    ``darks_dn`` are how far black was and is above the camera's level, and ``white_dn`` is white above black.
    """
    before, now = darks_dn
    if abs(now - before) <= LEAST_ROOM * white_dn:
        return ""
    return (
        f"The light of the room has changed: without the projector the picture is at {now:.0f} DN above its"
        f" black level, and was at {before:.0f} DN when the scan began. Keep the room as it was."
    )


def said_of_slight_change(before: Mosaic, now: Mosaic, white_dn: float) -> str:
    """The same of a smaller change, which spoils first orders as they are faint; empty without one.

    ``before`` and ``now`` are black pictures, raw mosaics (rows, columns).
    """
    change_dn = _tiles(now) - _tiles(before)
    mean_dn = float(change_dn.mean())
    if abs(mean_dn) <= max(SLIGHT_ROOM * white_dn, SLIGHT_DN):
        return ""
    is_lamp = float(change_dn.std()) > UNEVEN * abs(mean_dn)
    what = "The light of the room" if is_lamp else "The light of the room, or the black level of the camera,"
    advice = "Keep the room as it was" + ("." if is_lamp else ", and let the camera warm up.")
    return (
        f"{what} has changed: without the projector the picture has {mean_dn:+.0f} DN against when the scan"
        f" began. {advice}"
    )


def _tiles(black: Mosaic) -> NDArray[np.float64]:
    """Means of a picture over tiles, (n,), DN."""
    rows = np.array_split(black, min(TILES, black.shape[0]), axis=0)
    return np.array(
        [
            float(tile.mean(dtype=np.float64))
            for row in rows
            for tile in np.array_split(row, min(TILES, black.shape[1]), axis=1)
        ]
    )
