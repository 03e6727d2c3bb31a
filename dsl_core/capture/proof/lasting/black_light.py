"""What black pictures show: as much light as the projector gives without a pattern, and nothing else.

White and black of one setting tell what no later picture does, where something is wrong all the time: levels
that computer, cable and projector take differently, and what stays in the picture whatever is projected.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.raster import Counts, Raster
from dsl_core.model.rig import ProjectorResponse
from dsl_core.optics.seen_noise import DARKER
from dsl_core.words import counted

#: Light of a dark projector, as a share of full light, from which on it is not that of its calibration: so
#: many times that, and so much more. Limited levels (16 of 255) have .0023 at the usual gamma.
MANY_TIMES, MORE = 1.5, 0.001
#: It is the projector's, not the room's, where it is the same share of white in all colours and all over the
#: picture: what colours and blocks of the raster may differ by, as a share, and in deviations.
SAME_COLOUR, SAME_PLACE, SIGMAS = 0.08, 0.15, 4.0
#: Blocks needed to say so, and how bright their white has to be, as a share of what a tenth of them exceeds.
FEWEST_BLOCKS, BRIGHT_BLOCK = 12, 0.3
#: So many blocks, as a share, may be lit otherwise all the same.
MOST_APART = 0.1
#: What the black level may have changed by since its calibration, DN.
LEVEL_DN = 2.0
#: A pixel is lit in black if it has more than this share of usual white, more than so many times what white
#: adds to it, and so many deviations; white is what it is where it adds as many to black.
AS_WHITE, TIMES, SEEN_SIGMAS = 0.5, 2.0, 6.0
#: Where more of the pixels that white lights are lit in black, as a share, the room lights the scene; where
#: more than a few pixels, as a share, are so lit in more of the blocks that white lights, it does so, too.
MOST_LIT, FEW_LIT = 0.5, 0.05
#: So many such pixels that have a neighbour among them: hot pixels of a sensor are alone.
FEWEST_LIT = 5
#: Less of them count if first orders light their row: this share of its pixels, but for so many columns
#: beside these, is brighter than those so many rows above and below.
LIT_OF_ROW, BESIDE, ROWS_AWAY = 0.15, 6, 4


@dataclass(frozen=True)
class BlackLight:
    """Light of the projector's black as a share of its full light, with what its calibration says."""

    share: float
    std: float
    calibrated: float

    @property
    def is_off(self) -> bool:
        """Whether it is more than its calibration and noise explain."""
        return self.share - SIGMAS * self.std > MANY_TIMES * self.calibrated + MORE

    @property
    def sentence(self) -> str:
        """What is wrong, and what to do; empty if nothing is."""
        if not self.is_off:
            return ""
        return (
            f"In black pictures, every colour and every place has {self.share:.2%} of the projector's full"
            f" light, and {self.calibrated:.2%} by its calibration: computer, cable or projector use limited"
            " levels (16-235), so that black is grey and every level is off, or contrast and brightness of"
            " the projector were changed. Set the output to full range (0-255) at both ends, and its picture"
            " mode as it was when the self-test was done; then scan again."
        )


def black_light(
    white: Counts, black: Counts, level: float, response: ProjectorResponse, channels: NDArray[np.int8],
    noise: Noise, raster: Raster,
) -> BlackLight | None:  # fmt: skip
    """The projector's light in a black picture; None where it is the room's, or nobody knows what it was.

    ``white`` and ``black`` are rasters of one setting, whose drive level ``level`` is, and ``channels`` the
    colours of their pixels.
    """
    if response.black_fraction <= 0:
        return None
    dark_dn = np.float32(noise.sensor.black_level_dn)
    sound = (white < noise.sensor.full_scale_dn) & (black < noise.sensor.full_scale_dn)
    light, rest = white.astype(np.float32) - black, black.astype(np.float32) - dark_dn
    shares, stds = [], []
    for colour in np.unique(channels):
        mask = np.asarray(sound & (channels == colour), np.float32)
        count, bright, glow, variance = (
            raster.pool(each * mask) * raster.pooled
            for each in (np.float32(1), light, rest, noise.variance(black))
        )
        used = (count > 0) & (bright > 0)
        used &= bright > BRIGHT_BLOCK * np.quantile(bright[used], 0.9) if used.any() else used
        if int(used.sum()) < FEWEST_BLOCKS:
            return None
        count, bright, glow, variance = (each[used] for each in (count, bright, glow, variance))
        mean = float(glow.sum() / bright.sum())
        std = np.sqrt(variance + (LEVEL_DN * count) ** 2) / bright
        apart = np.abs(glow / bright - mean)
        if float(np.mean(apart > SAME_PLACE * mean + SIGMAS * std)) > MOST_APART:
            return None
        shares.append(mean)
        stds.append(LEVEL_DN * float(count.sum() / bright.sum()))
    share = float(np.mean(shares))
    if max(shares) - min(shares) > SAME_COLOUR * share:
        return None
    full = float(response.radiance(level)) - response.black_fraction
    return BlackLight(share * full, float(np.mean(stds)) * full, response.black_fraction)


@dataclass(frozen=True)
class LitBlack:
    """Pixels that are as bright in black as in white: how many, and the camera pixels around them."""

    count: int
    columns: tuple[int, int]
    rows: tuple[int, int]
    is_in_stripes: bool

    @property
    def sentence(self) -> str:
        """What is wrong, and what to do."""
        if self.is_in_stripes:
            return (
                "In alternate rows of the picture, black is as bright as"
                " white: these rows show the picture before, so that camera or projector deliver half of"
                " the rows at a time (interlaced). Set both to progressive pictures, and scan again."
            )
        return (
            f"Black is as bright as white at {counted(self.count, 'pixel')} in columns"
            f" {self.columns[0]}-{self.columns[1]}, rows {self.rows[0]}-{self.rows[1]}: something is in the"
            " projected picture all the time (mouse pointer, menu, window), or a lamp is in view. Nothing is"
            " measured there, and its light falls on what is. Take it away, and scan again."
        )


def lit_black(
    white: Counts, black: Counts, channels: NDArray[np.int8], noise: Noise, raster: Raster,
    size_px: tuple[int, int],
) -> LitBlack | None:  # fmt: skip
    """Where black, raster of a setting as ``white`` is, has the light of white; None where that is nowhere.

    None, too, where it is the room that is so bright. ``size_px`` is the camera's (width, height).
    """
    gain, rest, is_bright = _light(white, black, noise)
    if _room(gain, rest, is_bright):
        return None
    usual = np.zeros(gain.shape, np.float32)
    for colour in np.unique(channels):
        own = channels == colour
        bright = own & is_bright
        usual[own] = np.quantile((gain + rest)[bright if bright.any() else own], 0.75)
    lit = (rest > AS_WHITE * usual) & (rest > TIMES * np.abs(gain))
    lit &= rest > SEEN_SIGMAS * np.sqrt(noise.variance(black))
    grid = lit.reshape(raster.shape)
    near = np.zeros_like(grid)
    for one, other in ((np.s_[:, 1:], np.s_[:, :-1]), (np.s_[1:], np.s_[:-1])):
        both = grid[one] & grid[other]
        near[one] |= both
        near[other] |= both
    if int(near.sum()) < FEWEST_LIT and not _is_dispersed(near, black, noise):
        return None
    down, across = np.nonzero(near)
    rows = raster.rows[down]
    in_rows = near.mean(1) > 0
    is_in_stripes = _alternate(near, raster.rows) and float(in_rows.mean()) > 0.2
    in_blocks = raster.pool(lit.astype(np.float32)) > FEW_LIT
    white_blocks = raster.pool(is_bright.astype(np.float32)) > 0
    if not is_in_stripes and white_blocks.any() and in_blocks[white_blocks].mean() > MOST_LIT:
        return None
    step = size_px[0] / raster.shape[1]
    columns = int(across.min() * step), int((across.max() + 1) * step)
    return LitBlack(int(lit.sum()), columns, (int(rows.min()), int(rows.max()) + 1), is_in_stripes)


def _is_dispersed(lit: NDArray[np.bool_], black: Counts, noise: Noise) -> bool:
    """Whether rows of ``lit`` pixels (rows, columns) have light beside them: no hot pixels of a sensor have.

    Of a pointer that is smaller than a pixel of a coarse picture, little else is seen.
    """
    counts = black.reshape(lit.shape).astype(np.float32)
    std = np.sqrt(noise.variance(counts))
    for row in np.flatnonzero(lit.any(1)):
        others = [each for each in (row - ROWS_AWAY, row + ROWS_AWAY) if 0 <= each < lit.shape[0]]
        core = np.convolve(lit[row], np.ones(2 * BESIDE + 1), "same") > 0
        if not others or core.all():
            continue
        # A picture that the room lights may be brighter than one of them, as at an edge.
        more = (counts[row] - counts[others].max(0))[~core] / std[row][~core]
        less = (counts[others].min(0) - counts[row])[~core] / std[row][~core]
        if float((more > SEEN_SIGMAS).mean() - (less > SEEN_SIGMAS).mean()) > LIT_OF_ROW:
            return True
    return False


def room_light(white: Counts, black: Counts, level: float, noise: Noise, *, is_highest: bool = True) -> str:
    """That the room lights most of the scene more than white of a ``level``; empty where it does not.

    Levels of other settings are no higher if it ``is_highest``.
    """
    gain, rest, is_bright = _light(white, black, noise)
    if not _room(gain, rest, is_bright):
        return ""
    times = float(np.median(rest[is_bright] / gain[is_bright]))
    advice = ", or use settings of a higher level" if is_highest else ""
    return (
        f"The room gives {times:.2g} times the light of the projector's white at a level of {level:g}:"
        f" its noise is in every picture of that level. Darken the room{advice}."
    )


def _light(
    white: Counts, black: Counts, noise: Noise
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_]]:
    """What white adds to black, what black has itself, and where white surely adds something."""
    # Without a calibration, the black level is what the darkest pixels show.
    dark_dn = np.float32(noise.sensor.black_level_dn or np.quantile(black, DARKER))
    gain, rest = white.astype(np.float32) - black, black.astype(np.float32) - dark_dn
    # Before nothing, an object may be a small part of the picture, and all the rest of it noise.
    return gain, rest, gain > SEEN_SIGMAS * np.sqrt(noise.variance(white) + noise.variance(black))


def _room(gain: NDArray[np.float32], rest: NDArray[np.float32], is_bright: NDArray[np.bool_]) -> bool:
    """Whether most of what white lights has more light in black: no pointer or window is so large."""
    return bool(np.mean(rest[is_bright] > TIMES * gain[is_bright]) > MOST_LIT) if is_bright.any() else False


def _alternate(lit: NDArray[np.bool_], rows: NDArray[np.intp]) -> bool:
    """Whether nearly all lit pixels are in every other row, or in every other row of the mosaic's cells."""
    total = int(lit.sum())
    for height in (1, 2):
        odd = int(lit[rows // height % 2 == 1].sum())
        if not 0.05 * total < odd < 0.95 * total:
            return True
    return False
