"""From light to digital numbers: gain, Bayer mosaic, shot and read noise, black level, saturation."""

from __future__ import annotations

from functools import lru_cache
from typing import cast

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.rig import BayerPattern, FlatField, Rig, Sensor, colour_sites

Floats = NDArray[np.float64]

#: A value that fewer pixels have says nothing about the step to the next one.
SEEN = 5
#: So many steps of one size are no chance.
ALIKE = 10
#: Where values end, as many pixels have the last one, and so many times as many as those next below it.
PILE, TIMES = 20, 10.0
#: Share of the pile that may be above it: hot pixels.
ABOVE = 0.01
#: Where values end, the second of the colours has at least this share of the pixels.
OTHER_COLOUR = 0.1
#: Cameras as they are end above this share of their bit depth's range; below it, something cuts them off.
NEAR_FULL = 0.9
#: Of one colour, those below this share are ends only where there is also light just below them, or noise,
#: which grows with the light, in pixels darker than a share of it: so many of them stand out in their row.
NEARLY_FULL, DARK, NOISY = 0.98, 0.1, 0.1
#: Exposures that differ by less than this share count as equal: light is not known so well.
EVEN = 1e-3


def bayer_channels(bayer: BayerPattern, rows: int, columns: int) -> NDArray[np.int64]:
    """Colour (0 R, 1 G, 2 B) of every pixel of a mosaic, shape (rows, columns).

    >>> bayer_channels("RGGB", 2, 3).tolist()
    [[0, 1, 0], [1, 2, 1]]
    """
    return np.asarray(bayer_colours(bayer, np.arange(rows)[:, None], np.arange(columns)), np.int64)


def bayer_colours(
    bayer: BayerPattern, rows: NDArray[np.integer], columns: NDArray[np.integer]
) -> NDArray[np.intp]:
    """Colour (0 R, 1 G, 2 B) of pixels at rows and columns of a mosaic, in the shape of both together."""
    tile = np.array(colour_sites(bayer), np.intp).reshape(2, 2)
    return np.asarray(tile[rows % 2, columns % 2])


def mosaic_from(bayer: BayerPattern, row: int, column: int) -> BayerPattern:
    """The pattern of the part of a mosaic that begins at a row and a column.

    >>> mosaic_from("RGGB", 3, 2)
    'GBRG'
    """
    if bayer == "MONO":
        return bayer
    tile = np.roll(np.array(list(bayer)).reshape(2, 2), (-row, -column), (0, 1))
    return cast(BayerPattern, "".join(tile.ravel().tolist()))


def raw_variance(sensor: Sensor, signal_dn: NDArray[np.floating]) -> NDArray[np.floating]:
    """Variance (DN^2) of raw values whose expectation above black is ``signal_dn``, same shape.

    The linear model of EMVA 1288: read noise, rounding to steps (``step^2 / 12``), and shot noise of the
    signal, whose gain is one over ``electrons_per_dn``; the black level is an offset without shot noise.
    """
    floor = sensor.read_noise_dn**2 + sensor.step_dn**2 / 12
    return np.asarray(floor + np.maximum(signal_dn, 0) / sensor.electrons_per_dn)


def step_of(total: NDArray[np.int64]) -> int:
    """The usual distance between neighbouring values (DN), from how often each occurs, shape (values,)."""
    values = np.flatnonzero(total >= SEEN)
    if values.size < 2:
        return 1
    steps, weights = np.diff(values), total[values[:-1]]
    order = np.argsort(steps)
    middle = np.searchsorted(np.cumsum(weights[order]), weights.sum() / 2)
    step = int(steps[order[middle]])
    # Pictures converted from fewer bits have steps of two neighbouring sizes, such as 16 and 17.
    return step if np.count_nonzero(np.abs(steps - step) <= 1) >= ALIKE else 1


def end_of(total: NDArray[np.int64], low_dn: int) -> int | None:
    """The value from ``low_dn`` on at which pictures end, from how often each occurs, shape (values,).

    None if no value has so many pixels that it is where brighter light piles up: noise spreads all other
    light over neighbouring values.
    """
    end = low_dn + int(total[low_dn:].argmax())
    pile, below = int(total[end]), total[max(end - max(end // 100, 8), 0) : end]
    if pile < PILE or pile < TIMES * below.mean() or total[end + 1 :].sum() > ABOVE * pile:
        return None
    return end


def end_near_full(
    pixels: NDArray[np.unsignedinteger], full_scale_dn: int, channels: NDArray[np.integer]
) -> int:
    """Where the values of a picture end: ``full_scale_dn``, or a little below it where many pixels have that.

    Many cameras saturate below the largest number of their bit depth, as those do whose 12 bits are moved up
    to 16. A picture without saturated pixels does not say so. Light without noise piles up as well, but in
    one colour alone, and with no light just below: ``channels`` are those of the pixels, in their shape.
    """
    low_dn = int(np.ceil(NEAR_FULL * full_scale_dn))
    bright = pixels[pixels >= low_dn]
    if bright.size < PILE:
        return full_scale_dn
    end = end_of(np.bincount(np.minimum(bright, full_scale_dn), minlength=full_scale_dn + 1), low_dn)
    if end is None:
        return full_scale_dn
    if channels.min() < channels.max():
        piled = np.sort(np.bincount(channels[pixels == end], minlength=3))
        return end if piled[1] >= OTHER_COLOUR * piled.sum() else full_scale_dn
    # Little noise reaches the next value, and no further.
    far = max(end // 100, 8)
    just_below = (pixels >= end - far) & (pixels <= end - far // 2)
    is_end = end >= NEARLY_FULL * full_scale_dn or np.count_nonzero(just_below) >= SEEN
    return end if is_end or (pixels.max() == end and _is_noisy(pixels, DARK * end)) else full_scale_dn


def _is_noisy(pixels: NDArray[np.unsignedinteger], below_dn: float) -> bool:
    """Whether pixels darker than ``below_dn`` are brighter, or darker, than both neighbours in their row."""
    flat = pixels.ravel().astype(np.int64)
    triples = np.lib.stride_tricks.sliding_window_view(flat, 3)
    left, middle, right = triples[triples.max(axis=1) < below_dn].T
    return middle.size >= PILE and float(np.mean((middle - left) * (middle - right) > 0)) > NOISY


def as_if_exposed(pixels: NDArray[np.uint16], share: float, sensor: Sensor) -> NDArray[np.uint16]:
    """A raw mosaic (rows, columns), DN, as it were with ``share`` times its exposure; itself if that is 1.

    Where values end, they stay, and no other exceeds them.
    """
    if abs(share - 1.0) <= EVEN:
        return pixels
    end = end_near_full(pixels, sensor.full_scale_dn, bayer_channels(sensor.bayer, *pixels.shape))
    black = np.float32(sensor.black_level_dn)
    light = np.clip(np.rint(black + (pixels - black) * np.float32(share)), 0, end)
    return np.where(pixels < end, light.astype(np.uint16), pixels)


def digitise(
    sensor: Sensor,
    signal_dn: NDArray[np.float32],
    rng: np.random.Generator | None,
) -> NDArray[np.uint16]:
    """Raw mosaic of an expected signal above black (DN), same shape; no noise when ``rng`` is None.

    Values are whole steps of the sensor, or its full scale. Shot noise is Gaussian with the
    Poisson variance, which is exact to a percent above 30 electrons.
    """
    value = signal_dn + np.float32(sensor.black_level_dn)
    if rng is not None:
        variance = np.maximum(signal_dn, 0) * np.float32(1 / sensor.electrons_per_dn)
        variance += np.float32(sensor.read_noise_dn**2)
        value = value + rng.standard_normal(signal_dn.shape, np.float32) * np.sqrt(variance)
    value = np.rint(value / np.float32(sensor.step_dn)) * np.float32(sensor.step_dn)
    return np.asarray(np.clip(value, 0, sensor.full_scale_dn), np.uint16)


def relative_gain(rig: Rig) -> Floats:
    """Gain by which the camera multiplies all light, (rows, columns); (1, 1) of one without a flat field."""
    if rig.flat_field is None:
        return np.ones((1, 1))
    return gain_at_pixels(rig.flat_field, rig.camera.height_px, rig.camera.width_px)


@lru_cache(maxsize=4)
def gain_at_pixels(flat_field: FlatField, height_px: int, width_px: int) -> Floats:
    """Bilinear interpolation at every pixel, shape (rows, columns), read-only."""
    down = _shares(np.arange(height_px, dtype=np.float64), flat_field.rows_px)
    across = _shares(np.arange(width_px, dtype=np.float64), flat_field.columns_px)
    gain: Floats = down @ np.array(flat_field.gain) @ across.T
    gain.setflags(write=False)
    return gain


def _shares(positions: Floats, nodes: tuple[float, ...]) -> Floats:
    """Share of each node at each position, (positions, nodes)."""
    return np.stack([np.interp(positions, nodes, unit) for unit in np.eye(len(nodes))], 1)
