"""The light of each pattern frame relative to white, from two laws that need no model of the scene.

Light adds up: the frames of a set that covers all columns evenly are together a multiple of white, in every
pixel and whatever surfaces do with the light. That gives the level of each frame relative to white. And away
from a line itself a picture changes slowly from frame to frame, because only first orders reach there: a
frame that is brighter than its neighbours in all of these pixels had more light. The first law tells slow
changes, the second one quick ones. Where light from surface to surface outshines first orders the second does
not hold, and halves of the picture contradict each other: then neither is asked.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.plan import CapturePlan, NoSpectral, ScanLines
from dsl_core.patterns.images import spectral_profiles
from dsl_core.reconstruction.merge import PickedLines
from dsl_core.solve.normal import STD_OF_MEDIAN_SIZE
from dsl_core.solve.robust import robust_std
from dsl_core.solve.thinned import thinned

Floats = NDArray[np.float64]

#: Pixels asked at most, and at least.
PIXELS, FEWEST = 12_000, 300
#: Share of the light that a pixel gets straight, roughly: what is left of coverage by the lines' edges.
STRAIGHT = 0.85
#: How far coverage of columns, softened as a line is, may be from even for the sum to be a multiple of white.
EVEN, SOFT_PX = 0.06, 0.9
#: Relative error of that sum in a pixel, and of the second law in a frame.
SUM_ERROR, SMOOTH_ERROR = 0.1, 0.0025
#: A frame from its neighbours two before to two behind: cubic interpolation.
AROUND = {-2: -1 / 6, -1: 4 / 6, 1: 4 / 6, 2: -1 / 6}
#: Pixels within so many columns of a line's edge see it by the zero order, on a camera as fine as the lines.
ZERO_PX = 6.0
#: Share of what frames of one half of the picture are off their neighbours that the other half has as well.
AGREED = 0.5
#: Frames by which quick changes are judged.
FEWEST_FRAMES = 8
#: Frames by which the second law is asked for.
FEWEST_LINES = 16
#: What frames are off their neighbours has to exceed its noise by this factor to say what of black flickers.
CLEARLY = 2.0
#: What frames are expected to differ by, unless they say more.
LEAST_SPREAD = 0.01


@dataclass(frozen=True)
class LineLevels:
    """``log`` (frames,) of the light relative to white, with the deviation of each; ``misfit`` of the sum.

    ``quick`` is by how much frames differ from their neighbours (rms, noise taken off).
    """

    log: Floats
    std: Floats
    misfit: float
    quick: float


def line_levels(
    plan: CapturePlan,
    column: NDArray[np.integer],
    white: tuple[NDArray[np.floating], NDArray[np.floating]],
    seen: PickedLines,
    leak: NDArray[np.floating] | float = 0.0,
    is_calibrated: bool = True,
) -> LineLevels | None:
    """Levels of the frames, from `candidates`; None where the patterns or the picture do not tell.

    ``column`` is the projector column of each pixel (negative: unknown), ``white`` radiance and variance,
    both of the whole picture; so is ``leak``, the projector's light in a black picture. Unless that
    ``is_calibrated`` it is all light there, and frames say which share of it is the projector's.
    """
    if isinstance(plan.spectral, NoSpectral):
        return None
    cover = _coverage(plan)
    sound = np.flatnonzero(np.isfinite(seen.std).all(0))
    sound = thinned(sound, PIXELS)
    if cover is None or len(sound) < FEWEST:
        return None
    picked = seen.pixels[sound]
    flat = column.ravel()[picked]
    frames = seen.radiance[:, sound].astype(np.float64).T
    variance = np.square(seen.std[:, sound], dtype=np.float64).T
    light, light_variance = (each.ravel()[picked].astype(np.float64) for each in white)
    mean = float(cover.mean())
    total = light * (STRAIGHT * cover[flat] + (1 - STRAIGHT) * mean)
    # What black is off by adds up over all frames.
    blacks = len(seen.radiance) * seen.black_std[sound].astype(np.float64)
    # Weights must not know the noise of white: they would prefer pixels whose white is too dark.
    summed = frames.sum(1) * (total.sum() / frames.sum())
    usual = np.polyval(np.polyfit(summed, light_variance, 1), summed).clip(light_variance.min())
    noise = (SUM_ERROR * summed) ** 2 + mean**2 * usual + blacks**2
    pitch = pitch_of(column)
    # What gets through the projector flickers as well: of faint first orders it is most of the light.
    dark = np.broadcast_to(leak, column.shape).ravel()[picked].astype(np.float64)
    own = 1.0 if is_calibrated else _flickering_share(plan, flat, frames, variance, dark, pitch)
    whole = frames + own * dark[:, None]
    smooth, smooth_std = _smooth_rows(plan, flat, whole, variance, pitch)
    if 1.1 * _quick(smooth, smooth_std) > LEAST_SPREAD:
        upper = picked < np.median(picked)
        halves = (
            _smooth_rows(plan, flat[half], whole[half], variance[half], pitch)[0] for half in (upper, ~upper)
        )
        if not _agree(*halves):
            return None
    return _solve(frames, variance, total, noise, smooth, smooth_std)


def _solve(
    frames: Floats, variance: Floats, total: Floats, noise: Floats, smooth: Floats, smooth_std: Floats
) -> LineLevels:
    """Levels from frames (pixels, frames), their ``total`` (pixels,) and the ``noise`` of that."""
    count = frames.shape[1]
    quick = _quick(smooth, smooth_std)
    spread = max(1.1 * quick, LEAST_SPREAD)
    weight = 1 / noise
    for _ in range(3):
        heavy = frames * np.sqrt(weight)[:, None]
        # A product with itself takes half as long.
        matrix = heavy.T @ heavy
        # Noise in the frames themselves adds its squares, which the sum of light does not have.
        matrix[np.diag_indices(count)] -= weight @ variance
        right = (weight * total) @ frames
        mean = float(right.sum() / matrix.sum())
        matrix += (smooth.T * (mean * smooth_std) ** -2) @ smooth + np.eye(count) / (spread * mean) ** 2
        inverse = np.linalg.inv(matrix)
        needed = inverse @ (right + 1 / (spread**2 * mean))
        away = np.abs(frames @ needed - total) / np.sqrt(noise)
        usual = max(float(robust_std(away)), 1e-9)
        weight = np.minimum(1, 2.5 * usual / np.maximum(away, 1e-9)) / noise
    misfit = float(robust_std(away * np.sqrt(noise) / total))
    deviation = np.sqrt(np.diag(inverse).clip(0)) * max(usual, 1.0) / mean
    return LineLevels(-np.log(needed.clip(1e-3)), deviation, misfit, quick)


def _agree(one: Floats, other: Floats) -> bool:
    """Whether two halves of a picture, by their rows of the second law, say the same of quick changes.

    A lamp that flickers is as bright in both. Light that surfaces send each other changes from line to line
    as well, by what each line hits, and that differs from place to place.
    """
    off = np.full((2, one.shape[1]), np.nan)
    for own, smooth in zip(off, (one, other), strict=True):
        own[smooth.argmax(1)] = smooth.sum(1)
    both = off[:, np.isfinite(off).all(0)]
    if both.shape[1] < FEWEST_FRAMES:
        return False
    # Few frames may be far off in either half: signs count, and sizes up to the usual one.
    usual = max(float(np.median(np.abs(both))), 1e-12)
    both = np.clip(both / usual, -3, 3)
    return float((both[0] * both[1]).sum()) > AGREED * float((both**2).sum()) / 2


def _quick(smooth: Floats, smooth_std: Floats) -> float:
    """By how much frames differ, from how far they are off their neighbours."""
    if len(smooth) < FEWEST_FRAMES:
        return 0.0
    off = smooth.sum(1)
    norm = np.sqrt((smooth**2).sum(1))
    variance = STD_OF_MEDIAN_SIZE**2 * np.median((off / norm) ** 2) - np.median(smooth_std / norm) ** 2
    return float(np.sqrt(max(variance, 0.0)))


def _coverage(plan: CapturePlan) -> Floats | None:
    """How many frames light each column, softened; None where that is uneven."""
    from scipy.ndimage import gaussian_filter1d

    profiles = spectral_profiles(plan)
    if len(profiles) < 8:
        return None
    cover = gaussian_filter1d(profiles.sum(0).mean(1).astype(np.float64), SOFT_PX, mode="nearest")
    edge = len(cover) // 16
    inner = cover[edge:-edge]
    return cover if inner.std() < EVEN * inner.mean() else None


def candidates(
    column: NDArray[np.integer], white: tuple[NDArray[np.floating], NDArray[np.floating]]
) -> NDArray[np.intp]:
    """Flat indices of pixels that are lit and decoded, spread over the picture: about twice those asked."""
    light, variance = white
    lit = (column >= 0) & np.isfinite(variance) & (light > 5 * np.sqrt(np.maximum(variance, 0)))
    some = np.flatnonzero(lit.ravel())
    return thinned(some, 2 * PIXELS)


def pitch_of(column: NDArray[np.integer]) -> float:
    """Projector columns from one pixel to the next."""
    known = (column[:, 1:] >= 0) & (column[:, :-1] >= 0)
    steps = np.abs(np.diff(column, axis=1))[known]
    return float(np.median(steps)) if steps.size else 1.0


def zone_px(lines: ScanLines, pitch: float) -> float:
    """Columns from the middle of a line from which on only first orders reach a pixel."""
    return lines.width_px / 2 + 2 * lines.step_px + ZERO_PX + 1.5 * pitch


def _away(lines: ScanLines, column: NDArray[np.integer], zone: float, values: Floats) -> dict[int, Floats]:
    """Sums (n,) over the pixels away from each line, of its own frame and those around it.

    ``column`` is (pixels,), ``values`` (pixels, frames).
    """
    count = values.shape[1]
    k = np.arange(2, count - 2)
    centre = k * lines.step_px + lines.width_px / 2
    # In the order of columns, pixels near a line are next to each other.
    order = np.argsort(column, kind="stable")
    first = np.searchsorted(column, centre - zone, sorter=order)
    last = np.searchsorted(column, centre + zone, "right", sorter=order)
    sums = np.zeros((count, len(column) + 1))
    np.cumsum(values.T[:, order], axis=1, out=sums[:, 1:])
    return {by: sums[k + by, -1] - sums[k + by, last] + sums[k + by, first] for by in (0, *AROUND)}


def _flickering_share(
    plan: CapturePlan,
    column: NDArray[np.integer],
    frames: Floats,
    variance: Floats,
    dark: Floats,
    pitch: float,
) -> float:
    """The share of the light of black that flickers as lines do; 1 where nothing flickers, or tells.

    Where lines are faint, frames are off their neighbours by what of black flickers alone; where first orders
    are bright, by these as well. ``dark`` is the light (pixels,) of black.
    """
    if not isinstance(plan.spectral, ScanLines) or frames.shape[1] < FEWEST_LINES:
        return 1.0
    near = zone_px(plan.spectral, pitch)
    far = near + float(np.ptp(column)) / 4
    values = frames, variance, np.broadcast_to(dark[:, None], frames.shape)
    outside, outer = ([_away(plan.spectral, column, zone, each) for each in values] for zone in (near, far))
    inner = [{by: sums[by] - out[by] for by in sums} for sums, out in zip(outside, outer, strict=True)]
    (off, light, noise), (far_off, far_light, far_noise) = (_per_black(*each) for each in (inner, outer))
    # Each is the flicker times light and the share; their noise adds its squares.
    square = (off - far_off) ** 2 - noise - far_noise
    product = (off - far_off) * (far_off * light - off * far_light) + noise * far_light + far_noise * light
    known = np.isfinite(square + product)
    clear = square[known].sum() > CLEARLY * (noise + far_noise)[known].sum()
    if not clear or np.count_nonzero(known) < FEWEST_FRAMES:
        return 1.0
    return float(np.clip(product[known].sum() / square[known].sum(), 0.0, 1.0))


def _per_black(
    light: dict[int, Floats], noises: dict[int, Floats], black: dict[int, Floats]
) -> tuple[Floats, Floats, Floats]:
    """By how much frames are off their neighbours, their usual light, and the variance of the first.

    All are (n,), and in the light of black, that of the variance squared.
    """
    usual, noise = np.zeros((2, len(black[0])))
    for by, share in AROUND.items():
        usual += share * light[by]
        noise += share**2 * noises[by]
    noise += noises[0] + (SMOOTH_ERROR * usual) ** 2
    dark = np.where(black[0] > 0, black[0], np.nan)
    return (light[0] - usual) / dark, usual / dark, noise / dark**2


def _smooth_rows(
    plan: CapturePlan, column: NDArray[np.integer], frames: Floats, variance: Floats, pitch: float
) -> tuple[Floats, Floats]:
    """Equations (n, frames) that the inverse levels fulfil, and how well; none for several lines a frame.

    ``column`` is (pixels,), ``frames``, all light of the projector, and ``variance`` are (pixels, frames).
    """
    count = frames.shape[1]
    if not isinstance(plan.spectral, ScanLines) or count < FEWEST_LINES:
        return np.zeros((0, count)), np.zeros(0)
    k, zone = np.arange(2, count - 2), zone_px(plan.spectral, pitch)
    light, noises = (_away(plan.spectral, column, zone, values) for values in (frames, variance))
    own, noise = light[0], noises[0] + sum(share**2 * noises[by] for by, share in AROUND.items())
    used = own > np.maximum(10 * np.sqrt(noise), 0.0)
    rows = np.zeros((len(k), count))
    at = np.arange(len(k))
    rows[at, k] = 1.0
    for by, share in AROUND.items():
        rows[at, k + by] = -share * np.divide(light[by], own, out=np.zeros_like(own), where=used)
    std = np.hypot(SMOOTH_ERROR, np.sqrt(noise[used]) / own[used])
    return rows[used], std
