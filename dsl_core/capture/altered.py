"""How pictures are altered on their way since a scan began: turned, begun elsewhere, coarser, filtered.

White, black and a frame of the code, captured once more, hold the same scene, so that what a camera, its
driver or its link do to them shows by the mark that each such alteration leaves.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.proof.lasting.written_row import written_row
from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.raster import Raster
from dsl_core.model.conditions import COLOUR_NAMES
from dsl_core.model.rig import Sensor, colour_sites
from dsl_core.optics.sensor import NEAR_FULL, raw_variance

Mosaic = NDArray[np.uint16]
#: White, black and a frame of the code of one time, raw mosaics (rows, columns), DN.
Pictures = tuple[Mosaic, Mosaic, Mosaic]

#: A picture is the one of before, turned, if they differ by no more deviations (rms), and by this share of
#: what they differ by as they are.
SAME_SIGMAS, NEARER = 2.0, 0.5
#: Places of a mosaic have changed if their light has by this much (natural logarithm), and have done so with
#: each other if it then has not by this much.
CHANGED, KEPT = 0.15, 0.05
#: A row is dark with less than this share of its light; so many have to be, and no more than this share.
NO_LIGHT, FEWEST_ROWS, MOST_ROWS = 0.05, 2, 0.7
#: Rows of which pixels work have this share of the noise of black that they had, and black but for so much.
ALIVE, SAME_BLACK_DN = 0.6, 2.0
#: Pictures are clipped where this share of the pixels has the largest value, and so many times as many as the
#: two values below it, which noise of a flat surface fills as well.
CLIPPED, PILED = 0.01, 2
#: A picture alone says so with more than this share of full scale.
BRIGHT_SHARE = 0.2
#: White follows that of before by another power than one by so much, alike in every colour, and as closely as
#: this correlation; blocks of so many pixels of a colour a side are asked that are so many deviations bright,
#: and so many are needed, whose light (logarithm) deviates by so much.
POWER, CLOSELY, BLOCK_PX, BRIGHT_SIGMAS, FEWEST_BRIGHT, RANGE = 0.08, 0.97, 4, 20.0, 24, 0.02
#: Light differs from row to row from this much on (rms of its factors), by so much up and down; within rows,
#: of so many parts, it differs by no more than this share of that.
BANDS, UP_AND_DOWN, WITHIN, PARTS = 0.03, 0.03, 0.5, 6
#: Light that follows the row as closely as this correlation rises from one end to the other: no flicker does.
RISING = 0.9
#: Values are coarser if there are less of them than this share of those before, which were at least so many.
COARSER, FEWEST_VALUES = 0.3, 64
#: Black is filtered with less than this share of its noise, where it was noise at first: so many times what
#: the sensor explains. A picture that trembles by parts of a pixel has half of it.
CALMER, MOSTLY_NOISE = 0.4, (0.6, 1.4)
#: It has so many times its noise where gain was raised, if white has its light but for so much.
NOISIER, SAME_LIGHT = 1.25, 0.1
#: Share of the pixels that noise is measured by: others are at edges of what the room lights; and what these
#: have of the noise of all.
CALM, CALM_NOISE = 0.9, 0.82
#: A pixel is beyond black or white by so many deviations and this share of its contrast; where pictures are
#: sharpened, this share of the lit ones is beyond either, and so many.
BEYOND_SIGMAS, BEYOND, SHARPENED, FEWEST_SHARPENED = 6.0, 0.1, 0.01, 8
#: Pictures are mixed where black has gained this share of the light of white, as closely as this correlation
#: and in all colours alike but for so much of it, and white has lost so much of what black has gained. Light
#: of the room takes nothing from white.
MIXED, MIXED_CLOSELY, MIXED_ALIKE, MIXED_LOST = 0.05, 0.9, 0.3, 0.25


def alteration(before: Pictures, now: Pictures, sensor: Sensor) -> str:
    """What was done to pictures since ``before``, with what to do; empty if nothing shows."""
    return (
        _numbered(now[1], sensor)
        or _turned(before[0], now[0], sensor)
        or _begun_elsewhere(before, now)
        or _dark_rows(before, now, sensor)
        or _clipped(before[0], now[0], sensor)
        or _coarser(before, now)
        or _mixed(before, now, sensor)
        or _banded(before, now)
        or _filtered(before, now, sensor)
        or _curved(before, now, sensor)
        or _noisier(before, now, sensor)
    )


def _numbered(black: Mosaic, sensor: Sensor) -> str:
    raster = Raster((black.shape[1], black.shape[0]))
    found = written_row(raster.take(black), Noise(sensor), raster)
    return "" if found is None else found.sentence


def _turned(before: Mosaic, now: Mosaic, sensor: Sensor) -> str:
    usual = _apart(before, now, sensor)
    turns = {
        "mirrored": before[:, ::-1],
        "upside down": before[::-1],
        "turned by 180 degrees": before[::-1, ::-1],
    }
    for how, picture in turns.items():
        apart = _apart(picture, now, sensor)
        if apart < SAME_SIGMAS and apart < NEARER * usual:
            return (
                f"The camera's picture is {how}, and was not when the scan began. Switch mirroring and"
                " turning off in the settings of the camera."
            )
    return ""


def _apart(one: Mosaic, other: Mosaic, sensor: Sensor) -> float:
    """Rms of what pictures differ by where neither saturates, in deviations; infinite where both do."""
    sound = np.maximum(one, other) < 0.98 * sensor.full_scale_dn
    if not sound.any():
        return np.inf
    first, second = (each[sound].astype(np.float64) for each in (one, other))
    noise = sum(raw_variance(sensor, np.maximum(each - sensor.black_level_dn, 0)) for each in (first, second))
    return float(np.sqrt(np.mean((first - second) ** 2 / noise)))


def _begun_elsewhere(before: Pictures, now: Pictures) -> str:
    """Whether the colours of the mosaic have changed places, as where it begins a row or column later."""
    old, new = (
        np.array([[float(light[i::2, j::2].sum()) for j in (0, 1)] for i in (0, 1)])
        for light in (pictures[0].astype(np.float64) - pictures[1] for pictures in (before, now))
    )
    if min(old.min(), new.min()) <= 0:
        return ""

    def changed(down: int, across: int) -> float:
        return float(np.abs(np.log(new / np.roll(old, (down, across), (0, 1)))).max())

    if changed(0, 0) < CHANGED:
        return ""
    moves = {"column": (0, 1), "row": (1, 0), "column and row": (1, 1)}
    what = min(moves, key=lambda each: changed(*moves[each]))
    if changed(*moves[what]) > KEPT:
        return ""
    return (
        "The camera's pixels see other colours than when the scan began, as where its picture begins one"
        f" {what} later: its region of interest or its format (order of the colours) was changed. Set both as"
        " they were."
    )


def _dark_rows(before: Pictures, now: Pictures, sensor: Sensor) -> str:
    old, new = ((white.astype(np.float64) - black).sum(1) for white, black, _ in (before, now))
    lit = old > 0.1 * old.max()
    dark = lit & (new < NO_LIGHT * old)
    if not FEWEST_ROWS <= int(dark.sum()) <= MOST_ROWS * int(lit.sum()):
        return ""
    count, first = int(dark.sum()), int(np.flatnonzero(dark)[0])
    was, black = (pictures[1][dark] for pictures in (before, now))
    gained = float(black.mean(dtype=np.float64)) - float(was.mean(dtype=np.float64))
    if abs(gained) < SAME_BLACK_DN and _noise(black, sensor)[0] > ALIVE * _noise(was, sensor)[0]:
        return (
            f"{count} rows of the picture no longer have any light of the projector, the first of them is row"
            f" {first}, and their pixels work: the projector leaves a part of its picture dark (another"
            " window or size, a failed part), or something stands in its way. Set its picture as it was"
            " and clear the way."
        )
    return (
        f"{count} rows of the picture no longer have any light, the first of them is row {first}: rows of"
        " the sensor failed, or their packets are lost. Check cable and driver of the camera."
    )


def _clipped(before: Mosaic, now: Mosaic, sensor: Sensor) -> str:
    """Whether white ends below full scale, all of it or one colour, and did not before."""
    for words, own in _parts(now.shape, sensor):
        found = _limit_of(now[own], _highest_dn(now, sensor))
        old = before[own]
        if found is not None and float((old == old.max()).mean()) <= found[1] / 4:
            return _said_of_limit(f"white{words}", *found)
    return ""


def ends_early(picture: Mosaic, sensor: Sensor) -> str:
    """Whether the counts of a bright picture, or of a colour of it, end below full scale; empty if not."""
    for words, own in _parts(picture.shape, sensor):
        found = _limit_of(picture[own], _highest_dn(picture, sensor))
        if found is not None and found[0] > BRIGHT_SHARE * sensor.full_scale_dn:
            return _said_of_limit(f"it{words}", *found)
    return ""


def _parts(shape: tuple[int, ...], sensor: Sensor) -> Iterator[tuple[str, NDArray[np.bool_]]]:
    """All pixels of a mosaic (rows, columns), and those of each colour, with words that say which."""
    yield "", np.ones(shape, np.bool_)
    rows, columns = np.indices(shape) % 2
    colour = np.array(colour_sites(sensor.bayer)).reshape(2, 2)[rows, columns]
    for each, name in enumerate(COLOUR_NAMES):
        if (colour == each).any():
            yield f" in {name}", colour == each


def _highest_dn(picture: Mosaic, sensor: Sensor) -> float:
    """Below which values counts of a picture end early, all of them or those of a colour.

    Many cameras saturate a little below full scale. A colour that ends below the others has a digital gain
    below one, as of a white balance, which leaves little between the two.
    """
    return max(NEAR_FULL * sensor.full_scale_dn, float(picture.max()))


def _limit_of(counts: Mosaic, highest_dn: float) -> tuple[int, float] | None:
    """The value below ``highest_dn`` that counts pile up at, and the share of pixels that have it."""
    values, numbers = np.unique(counts, return_counts=True)
    most, share = int(values[-1]), float(numbers[-1]) / counts.size
    is_piled_up = numbers[-1] > PILED * numbers[-3:-1].sum()
    return (most, share) if most < highest_dn and share >= CLIPPED and is_piled_up else None


def _said_of_limit(where: str, most: int, share: float) -> str:
    return (
        f"No pixel of {where} has more than {most} DN, and {share:.0%} have just that: the camera"
        " saturates below its full scale. Set gain, white balance, bit depth and limits of its driver as they"
        " were."
    )


def _curved(before: Pictures, now: Pictures, sensor: Sensor) -> str:
    """Whether counts follow the light by another power than before."""
    sound = np.maximum(before[0], now[0]) < 0.98 * sensor.full_scale_dn
    old, new = (white.astype(np.float64) - black for white, black, _ in (before, now))
    sigma = np.sqrt(2 * raw_variance(sensor, np.maximum(old, 0)))
    bright = sound & (np.minimum(old, new) > BRIGHT_SIGMAS * sigma)
    powers = []
    for site in ((0, 0), (0, 1), (1, 0), (1, 1)):
        place = np.s_[site[0] :: 2, site[1] :: 2]
        used = _blocks(bright[place].astype(np.float64)) == 1
        x, y = (np.log(_blocks(each[place])[used]) for each in (old, new))
        if x.size < FEWEST_BRIGHT or min(x.std(), y.std()) < RANGE:
            continue
        if float(np.corrcoef(x, y)[0, 1]) < CLOSELY:
            return ""
        powers.append(float(y.std() / x.std()))
    off = [power - 1 for power in powers]
    if not off or min(abs(each) for each in off) < POWER or min(off) < 0 < max(off):
        return ""
    return (
        f"White follows the light of when the scan began by a power of {float(np.mean(powers)):.2f}: gamma,"
        " tone mapping or high dynamic range of the camera was switched on, or its black level changed. Set"
        " it to values that are proportional to light."
    )


def _blocks(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Means over blocks of `BLOCK_PX` a side."""
    rows, columns = (size // BLOCK_PX for size in values.shape)
    whole = values[: rows * BLOCK_PX, : columns * BLOCK_PX]
    return np.asarray(whole.reshape(rows, BLOCK_PX, columns, BLOCK_PX).mean(axis=(1, 3)))


def _mixed(before: Pictures, now: Pictures, sensor: Sensor) -> str:
    """Whether black, captured right after white, holds a share of it."""
    sound = np.maximum(before[0], now[0]) < 0.98 * sensor.full_scale_dn
    contrast = before[0].astype(np.float64) - before[1]
    gained = now[1].astype(np.float64) - before[1]
    lost = before[0].astype(np.float64) - now[0]
    shares = []
    for site in np.ndindex(2, 2):
        own = np.zeros_like(sound)
        own[site[0] :: 2, site[1] :: 2] = True
        white, black = contrast[own & sound], gained[own & sound]
        if white.size < FEWEST_BRIGHT or min(white.std(), black.std()) <= 0:
            return ""
        if float(np.corrcoef(white, black)[0, 1]) < MIXED_CLOSELY:
            return ""
        shares.append(float(black.sum() / white.sum()))
    share = float(np.mean(shares))
    if share < MIXED or max(abs(each - share) for each in shares) > MIXED_ALIKE * share:
        return ""
    if float(lost[sound].sum()) < MIXED_LOST * float(gained[sound].sum()):
        return ""
    return (
        f"Black, captured after white, holds {share:.2f} times the light of white: pictures are mixed with"
        " those before them (noise reduction over time, frames that are blended, afterglow). Switch that off"
        " in camera, projector and computer."
    )


def _banded(before: Pictures, now: Pictures) -> str:
    """Whether whole rows have more light than before and others less."""
    parts = np.linspace(0, before[0].shape[1], PARTS + 1)[:-1].astype(int)
    cells = np.arange(0, before[0].shape[0] - 1, 2)  # two rows of a mosaic have all its colours
    old, new = (
        np.add.reduceat(np.add.reduceat(white.astype(np.float64) - black, parts, axis=1), cells, axis=0)
        for white, black, _ in (before, now)
    )
    lit = old.sum(1) > 0.25 * old.sum(1).max()
    if int(lit.sum()) < len(lit) / 2 or min(old[lit].min(), new[lit].min()) <= 0:
        return ""
    of_rows = new[lit].sum(1) / old[lit].sum(1)
    of_parts = new[lit] / old[lit] / of_rows[:, None]
    usual = float(np.median(of_rows))
    spread = float(np.std(of_rows)) / usual
    is_both = max(of_rows) > (1 + UP_AND_DOWN) * usual and min(of_rows) < (1 - UP_AND_DOWN) * usual
    if spread < BANDS or not is_both or float(np.std(of_parts)) > WITHIN * spread:
        return ""
    if abs(float(np.corrcoef(of_rows, np.arange(of_rows.size))[0, 1])) > RISING:
        return ""
    return (
        f"Whole rows of white have other light than when the scan began, by {100 * spread:.0f} % up and down:"
        " the light flickers, as that of the mains or of pulsed LEDs does, while the camera exposes one row"
        " after the other. Expose for whole periods of the light and keep lamps of the room off."
    )


def _coarser(before: Pictures, now: Pictures) -> str:
    old, new = (np.unique(np.concatenate([each.ravel() for each in pictures])) for pictures in (before, now))
    span = [int(np.ptp(each)) for each in (old, new)]
    # Less light has less values as well.
    if old.size < FEWEST_VALUES or new.size * max(span[0], 1) > COARSER * old.size * max(span[1], 1):
        return ""
    step = max(round(span[1] / max(new.size - 1, 1)), 1)
    return (
        f"Values of the camera come in steps of about {step} DN, and did not when the scan began: it delivers"
        " less bits, or compresses its pictures. Set its pixel format to raw values of all bits."
    )


def _filtered(before: Pictures, now: Pictures, sensor: Sensor) -> str:
    """Whether noise or edges are not those of before: a filter smooths or sharpens pictures."""
    white, black, code = (each.astype(np.float64) for each in now)
    sigma = np.sqrt(2 * raw_variance(sensor, np.maximum(white - sensor.black_level_dn, 0)))
    contrast = white - black
    lit = contrast > 2 * BEYOND_SIGMAS * sigma
    limit = np.maximum(BEYOND_SIGMAS * sigma, BEYOND * contrast)
    fewest = max(SHARPENED * int(lit.sum()), FEWEST_SHARPENED)
    if all(int((lit & beyond).sum()) > fewest for beyond in (code > white + limit, code < black - limit)):
        return (
            "Edges of the pattern are darker than black or brighter than white: camera or projector sharpens"
            " its picture. Switch sharpening and edge enhancement off."
        )
    shares = _noise_shares(before[1], now[1], sensor)
    if max(shares) < CALMER:
        return (
            f"Black has {max(shares):.1f} times the noise that it had when the scan began: the camera filters"
            " its pictures (noise reduction, median, compression). Switch that off."
        )
    return ""


def _noisier(before: Pictures, now: Pictures, sensor: Sensor) -> str:
    """Whether pictures of the same light have more noise."""
    old, new = (float((white.astype(np.float64) - black).sum()) for white, black, _ in (before, now))
    shares, (noise, expected) = _noise_shares(before[1], now[1], sensor), _noise(now[1], sensor)
    # Of a picture that was displaced by parts of a pixel, there may have been less noise before.
    share, is_same_black = (
        min(*shares, noise / (CALM_NOISE * expected)),
        max(shares) < (1 + SAME_LIGHT) * min(shares),
    )
    # Light of the room shows what it falls on.
    if share < NOISIER or not is_same_black or abs(new - old) > SAME_LIGHT * abs(old):
        return ""
    return (
        f"Black has {share:.1f} times the noise that it had when the scan began, and white has the same"
        " light: gain of the camera was raised and its exposure shortened, or something disturbs its"
        " electronics. Switch automatic exposure and gain off."
    )


def _noise_shares(before: Mosaic, now: Mosaic, sensor: Sensor) -> tuple[float, float]:
    """Noise of black over what it was: as it is, and but for what the sensor explains; 1 if it was no noise.

    Less light has less noise as well.
    """
    (usual, expected), (noise, now_expected) = (_noise(black, sensor) for black in (before, now))
    if not MOSTLY_NOISE[0] < usual / expected < MOSTLY_NOISE[1]:
        return 1.0, 1.0
    share = noise / max(usual, 1e-9)
    return share, share * expected / now_expected


def _noise(picture: Mosaic, sensor: Sensor) -> tuple[float, float]:
    """How much most pixels differ from those of their colour beside them, and what noise explains, DN.

    Others are at edges of what the room lights.
    """
    light = picture.astype(np.float64) - sensor.black_level_dn
    step = np.abs(light[:, 2:] - light[:, :-2]).ravel()
    # Mean distance of two normal values is 2 / sqrt(pi) of their deviation.
    expected = 2 / np.sqrt(np.pi) * np.sqrt(np.mean(raw_variance(sensor, np.maximum(light, 0))))
    return float(np.mean(np.sort(step)[: max(int(CALM * step.size), 1)])), float(expected)
