"""How far parts of a picture have moved since another one, in fractions of a pixel.

Least squares on the gradient of the older picture, tile by tile, with the brightness of each tile left free
(B. D. Lucas and T. Kanade, "An Iterative Image Registration Technique with an Application to Stereo Vision",
IJCAI 1981); a shift common to all tiles is found first, so that it may be larger than a pixel.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

#: Steps of the least squares, and the furthest that tiles are followed beyond the common shift, px.
STEPS, FURTHEST_PX = 4, 2.5
#: After a step as short as this, the next one would change nothing that matters, px.
SHORT_PX = 0.02
#: Pixels with less than this share of the greatest weight are clipped; tiles whose gradients are all noise
#: keep this share of their energy.
CLIPPED, NO_STRUCTURE = 1e-6, 1e-6
#: What the noise of a pixel seems to tell of a shift: a quarter, and a fifth more, as sums of many scatter.
OF_NOISE = 0.3
#: A shift of the whole picture leaves less by more than chance does: six deviations of what differences of
#: two sums of squares scatter by, times the root of the number of pixels.
BY_CHANCE = 12.0


@dataclass(frozen=True)
class TileShifts:
    """Shifts of tiles, each array (tiles down, tiles across): along x and y with their deviations, px.

    ``change`` is the rms of what no shift and no brightness explains, as a share of the tile's light, less
    noise; ``gain`` the brightness. ``better`` is by how much chi-square is lower than without any shift,
    brightness left free, and ``explained`` is that as a share of all that noise does not explain. Tiles
    without structure have infinite deviations.
    """

    x: Floats
    y: Floats
    x_std: Floats
    y_std: Floats
    change: Floats
    gain: Floats
    better: Floats
    explained: Floats

    @property
    def length(self) -> Floats:
        """How far each tile moved, px."""
        return np.hypot(self.x, self.y)

    @property
    def sigmas(self) -> Floats:
        """The same in deviations; 0 where nothing is known.

        Where light fades evenly, a shift and a change of brightness look alike, and steps may end at either:
        no more deviations than the picture is better explained by the shift.
        """
        return np.minimum(np.hypot(self.x / self.x_std, self.y / self.y_std), np.sqrt(self.better))


def tile_shifts(old: Floats, new: Floats, variance: Floats, tiles: tuple[int, int]) -> TileShifts:
    """Shifts of ``tiles`` (down, across) from ``old`` to ``new``, whose difference has this ``variance``."""
    from scipy.ndimage import spline_filter

    common = _common_shift(old, new, variance)
    old = spline_filter(old, order=3, mode="nearest")
    down, across = (
        np.linspace(0, size, count + 1).astype(int) for size, count in zip(old.shape, tiles, strict=True)
    )
    found = np.full((8, *tiles), np.inf)
    for i in range(tiles[0]):
        for j in range(tiles[1]):
            part = slice(down[i], down[i + 1]), slice(across[j], across[j + 1])
            found[:, i, j] = _one_tile(old, new, variance, part, common)
    return TileShifts(*found)


def _one_tile(
    old: Floats, new: Floats, variance: Floats, part: tuple[slice, slice], common: tuple[float, float]
) -> tuple[float, ...]:
    lost = (0.0, 0.0, np.inf, np.inf, 0.0, 1.0, 0.0, 0.0)
    shift = np.array(common)
    weight = 1 / variance[part].ravel()
    seen = new[part].ravel()
    for _ in range(STEPS):
        moved, gx, gy = (each.ravel() for each in _moved(old, part, shift))
        # new = gain old - shift . gradient + offset
        design = np.stack([-gx, -gy, moved, np.ones_like(moved)], 1)
        matrix = (design.T * weight) @ design
        scale = np.sqrt(np.diag(matrix)) + 1e-12
        whole = matrix / np.outer(scale, scale)
        if np.linalg.cond(whole) > 1e6:
            return lost
        covariance = np.linalg.inv(whole) / np.outer(scale, scale)
        values = covariance @ ((design.T * weight) @ seen)
        gain = values[2]
        if not 0.05 < gain < 20:
            return lost
        step = values[:2] / gain
        shift = shift + step
        if np.hypot(*(shift - common)) > FURTHEST_PX or np.hypot(*step) < SHORT_PX:
            break
    std = np.sqrt(np.diag(covariance)[:2])
    std = std / gain / _share_of_structure(1 / std**2, weight)
    left = seen - design @ values
    size = float(np.mean(np.abs(moved * gain))) + 1e-12
    change = np.sqrt(max(float(np.mean(left**2)) - float(np.mean(variance[part])), 0.0)) / size
    if np.hypot(*(shift - common)) > FURTHEST_PX:
        shift = np.array(common)
        std = np.full(2, np.inf)
    better = explained = 0.0
    if np.hypot(*shift) > SHORT_PX:
        unmoved, moved_by = (_chi_square(old, seen, weight, part, by) for by in (np.zeros(2), shift))
        better = max(unmoved - moved_by, 0.0)
        explained = min(better / max(unmoved - np.count_nonzero(weight > CLIPPED * weight.max()), 1.0), 1.0)
    return shift[0], shift[1], std[0], std[1], change, gain, better, explained


def _share_of_structure(information: Floats, weight: Floats) -> Floats:
    """Root of the share of what gradients tell of a shift (2,) that is not noise, hardly any if all may be.

    Half of the variance that pixels are weighted with is that of the old picture, whose noise has a gradient
    of half of that: a quarter for each pixel, which tells nothing of a shift.
    """
    noise = OF_NOISE * np.count_nonzero(weight > CLIPPED * weight.max())
    return np.asarray(np.sqrt(np.maximum(1 - noise / information, NO_STRUCTURE)))


def _chi_square(old: Floats, seen: Floats, weight: Floats, part: tuple[slice, slice], shift: Floats) -> float:
    """What is left of a tile after a shift, with brightness and offset fitted."""
    moved, _, _ = (each.ravel() for each in _moved(old, part, shift))
    root = np.sqrt(weight)
    design = np.stack([moved, np.ones_like(moved)], 1) * root[:, None]
    values = np.linalg.lstsq(design, seen * root)[0]
    return float(np.sum((seen * root - design @ values) ** 2))


def _moved(old: Floats, part: tuple[slice, slice], shift: Floats) -> tuple[Floats, Floats, Floats]:
    """A part of the old picture (coefficients of its spline) as moved by (x, y), and its gradients."""
    from scipy.ndimage import map_coordinates

    rows, columns = np.mgrid[part[0].start - 1 : part[0].stop + 1, part[1].start - 1 : part[1].stop + 1]
    wide = map_coordinates(
        old, [rows - shift[1], columns - shift[0]], order=3, mode="nearest", prefilter=False
    )
    gx, gy = (wide[1:-1, 2:] - wide[1:-1, :-2]) / 2, (wide[2:, 1:-1] - wide[:-2, 1:-1]) / 2
    return wide[1:-1, 1:-1], gx, gy


def _common_shift(old: Floats, new: Floats, variance: Floats) -> tuple[float, float]:
    """Shift (x, y) of most of the picture, whole pixels, by the correlation of edges; 0 unless sure."""
    window = np.outer(np.hanning(old.shape[0]), np.hanning(old.shape[1]))
    first, second = (np.fft.rfft2(_edges(each) * window) for each in (old, new))
    peak = np.fft.irfft2(second * first.conj(), old.shape)
    at = np.unravel_index(int(peak.argmax()), peak.shape)
    y, x = (int(i) if i <= size // 2 else int(i) - size for i, size in zip(at, peak.shape, strict=True))
    is_far = max(abs(x), abs(y)) > 1 and peak.max() > 1.05 * peak[0, 0]
    # Where nothing has edges, those of noise correlate anywhere.
    return (float(x), float(y)) if is_far and _explains(old, new, variance, x, y) else (0.0, 0.0)


def _explains(old: Floats, new: Floats, variance: Floats, x: int, y: int) -> bool:
    """Whether the old picture, moved by (x, y) whole pixels, is nearer to the new one than as it is."""
    there, before = (
        tuple(slice(max(by, 0), size + min(by, 0)) for by, size in zip(shift, old.shape, strict=True))
        for shift in ((y, x), (-y, -x))
    )
    root = 1 / np.sqrt(variance[there].ravel())
    root[root < np.sqrt(CLIPPED) * root.max(initial=0)] = 0
    seen = new[there].ravel() * root
    count = int(np.count_nonzero(root))

    def left(part: tuple[slice, ...]) -> float:
        design = np.stack([old[part].ravel() * root, root], 1)
        return float(np.sum((seen - design @ np.linalg.lstsq(design, seen)[0]) ** 2))

    return bool(count) and left(there) > (1 + BY_CHANCE / count**0.5) * left(before)


def _edges(picture: Floats) -> Floats:
    gy, gx = np.gradient(picture)
    size = np.hypot(gx, gy)
    return np.asarray(size - size.mean())
