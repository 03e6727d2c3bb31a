"""The projector's line spread as a scan itself shows it, and what it leaves in the columns.

Focus changes from day to day, and with the distance of what is scanned. A spread that is off by a tenth moves
columns by as much as it moves them between two lines, so that surfaces get waves.
A spread that varies over the field is not the one curve that all pixels share. Where it differs, columns over
smooth surfaces have waves; how large these are is an error that no pixel's own fit can know of.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Protocol

import numpy as np
import torch
from numpy.typing import NDArray

from dsl_core.model.rig import ProjectorResponse, Rig
from dsl_core.optics.lines.line_set import LineSet
from dsl_core.optics.spread.equations import Peaks, settle
from dsl_core.optics.spread.field import places_of, relative_width
from dsl_core.optics.spread.fit import REACH_PX, SpreadFit, fit_spread
from dsl_core.optics.spread.wave import column_wave
from dsl_core.optics.unlit import unlit_px
from dsl_core.patterns.gray_code import DecodedCode
from dsl_core.reconstruction.columns.dark_offset import dark_offset
from dsl_core.reconstruction.hdr import MergedFrame
from dsl_core.reconstruction.merge import PickedLines
from dsl_core.solve.threads import one_kernel_thread

#: Pixels that are looked at, spread evenly over bright ones, and neighbours of a row in a run.
PIXELS, RUN = 4000, 10
#: Pixels darker than this share of all lit ones are left out.
DARKER = 0.3
#: Pixels whose decoded column is so many times the usual step from a neighbour's are at an edge.
EDGE_STEPS = 4.0
#: Regions of the picture, down and across, in which waves are looked for.
REGIONS = (4, 6)
#: Runs of a region, at least and at most, and how often they are asked: each time most of a wave is found.
FEWEST, MOST, ASKED = 30, 400, 3
#: The four sites of a mosaic of colours.
SITES = tuple((slice(row, None, 2), slice(column, None, 2)) for row in (0, 1) for column in (0, 1))
#: Columns are quiet with less noise than this, px.
QUIET_PX = 0.1
#: Pixels of a run that lines refined, at least.
MOST_OF_RUN = 7
#: Runs that see lines as calibrated rather than as found explain them so many times better, and are at least
#: this share of all.
BETTER, SHARP_SHARE = 4.0, 0.05


def own_spread(
    rig: Rig, lines: LineSet | None, code: DecodedCode, white: MergedFrame, stack: Pickable
) -> SpreadFit | None:
    """The line spread that single scan lines show; None for other patterns and where too few are seen."""
    pixels = spread_pixels(lines, code, white)
    if lines is None or pixels.size == 0:
        return None
    column = torch.as_tensor(code.likely_column.ravel()[pixels].astype(np.float64))
    with one_kernel_thread():
        place = places_of(rig, torch.as_tensor(pixels), column)
        peaks = _peaks(stack.pick(pixels), lines, column, rig)
        return scene_spread(peaks, column, rig.projector_response, place)


def scene_spread(
    peaks: Peaks, column_px: torch.Tensor, known: ProjectorResponse, place_px: torch.Tensor
) -> SpreadFit | None:
    """The line spread of the projector, with the arguments of `fit_spread`, whatever surfaces do to it.

    A projector out of focus blurs lines on all surfaces. Where some show them as they are ``known``, and the
    spread of most does not explain these, most are translucent or out of focus themselves.
    """
    found = fit_spread(peaks, column_px, known, place_px)
    if found is None or not found.changed:
        return found
    as_known, as_found = (_misfit(peaks, column_px, place_px, each) for each in (known, found.response))
    sharp = as_known * BETTER < as_found
    if int(sharp.sum()) < SHARP_SHARE * len(sharp):
        return found
    pixels = torch.nonzero(sharp.repeat_interleave(peaks.run)).ravel()
    of_sharp = fit_spread(peaks.of(pixels), column_px[pixels], known, place_px[:, pixels])
    if of_sharp is None:
        return replace(found, response=known, changed=False, field=None)
    return of_sharp


def _misfit(
    peaks: Peaks, column_px: torch.Tensor, place_px: torch.Tensor, response: ProjectorResponse
) -> torch.Tensor:
    """Chi-square of each run with a response, that of its median pixel, (runs,); infinite where unknown."""
    width = None if response.field is None else relative_width(response.field, place_px[0], place_px[1])
    chi_square = settle(peaks, column_px, peaks.y.amax(0), response, width)[2]
    chi_square = torch.where(torch.isfinite(chi_square), chi_square, torch.inf)
    return chi_square.reshape(-1, peaks.run).median(1).values.clip(min=1.0)


def with_own_spread(rig: Rig, found: SpreadFit | None) -> Rig:
    """The rig with the line spread that its scan calls for, if it calls for another one."""
    if found is None or not found.changed:
        return rig
    return rig.model_copy(update={"projector_response": found.response})


class Pickable(Protocol):
    """Line frames of which those of some pixels can be had."""

    def pick(self, pixels: NDArray[np.intp]) -> PickedLines:
        """The frames of some pixels (flat indices)."""


def spread_pixels(lines: LineSet | None, code: DecodedCode, white: MergedFrame) -> NDArray[np.intp]:
    """Flat indices of bright pixels, in runs of neighbours on smooth surfaces, evenly thinned.

    None where single lines do not cover the picture.
    """
    if lines is None or not lines.single or lines.step_px > lines.width_px:
        return np.empty(0, np.intp)
    return bright_runs(code, white)


def bright_runs(code: DecodedCode, white: MergedFrame) -> NDArray[np.intp]:
    """Flat indices of bright pixels, in runs of neighbours on smooth surfaces, evenly thinned."""
    light = white.radiance
    good = ~code.undecided & ~white.saturated & np.isfinite(light) & (light > 0)
    if not good.any():
        return np.empty(0, np.intp)
    good &= light >= np.quantile(light[good], DARKER)
    steps = np.abs(np.diff(code.likely_column.astype(np.float64), axis=1))
    smooth = steps <= EDGE_STEPS * max(float(np.median(steps)), 1.0)
    columns = light.shape[1]
    starts = np.arange(0, columns - RUN + 1, RUN)
    inside = starts[:, None] + np.arange(RUN)
    whole = good[:, inside].all(-1) & smooth[:, inside[:, :-1]].all(-1)
    row, run = np.nonzero(whole)
    first = row * columns + starts[run]
    first = first[:: max(first.size * RUN // PIXELS, 1)]
    return np.asarray((first[:, None] + np.arange(RUN)).ravel())


def _peaks(seen: PickedLines, lines: LineSet, column: torch.Tensor, rig: Rig) -> Peaks:
    """The lines around the columns of some pixels, without what all of a pixel's lines have alike."""
    half = int((lines.width_px / 2 + REACH_PX) / lines.step_px)
    line = lines.nearest(column) + torch.arange(-half, half + 1)[:, None]
    frame = lines.frame(line).numpy()
    y, std = (
        torch.as_tensor(frames[frame, np.arange(len(column))].astype(np.float64))
        for frames in (seen.radiance, seen.std)
    )
    used = lines.exists(line) & torch.isfinite(y) & torch.isfinite(std)
    all_y, all_std = (torch.as_tensor(frames) for frames in (seen.radiance, seen.std))
    amplitude = torch.where(used, y, 0.0).amax(0).to(all_y)
    unlit = unlit_px(rig, lines.width_px)
    offset, std_of = dark_offset(
        column.to(all_y), amplitude, all_y, all_std, lines, rig.projector_response, unlit
    )
    y = y - torch.where(torch.isfinite(std_of) & used.all(0), offset, 0.0)
    return Peaks(
        torch.where(used, y, 0.0),
        torch.where(used, std**2, torch.inf),
        lines.centre_px(line).to(torch.float64),
        lines.width_px,
        lines.step_px,
        RUN,
    )


@one_kernel_thread()
def wave_std_px(
    column_px: NDArray[np.floating],
    column_std_px: NDArray[np.floating],
    refined: NDArray[np.bool_],
    lines: LineSet | None,
    mosaic: bool = False,
) -> NDArray[np.float32]:
    """Rms of the waves around each pixel (rows, columns), px; 0 where there are none or nobody can tell.

    ``column_px`` and ``column_std_px`` (rows, columns) are the columns of all pixels with their noise, and
    ``refined`` where lines refined them. Regions too small to tell have what the whole picture tells.
    Neighbours of a ``mosaic`` see lines of different LEDs, whose waves may be opposite: there each of its
    four sites is asked by itself as well.

    On the flat middle of a line that is as wide as the step noise displaces columns by quarters of a pixel,
    to either side of the middle, which is a wave, too: it is no other pixel's.
    """
    if lines is None or not lines.single:
        return np.zeros(column_px.shape, np.float32)
    std = _waves_of(column_px, column_std_px, refined, lines)
    for site in SITES if mosaic else ():
        own = _waves_of(column_px[site], column_std_px[site], refined[site], lines)
        std[site] = np.maximum(std[site], own)
    return std


def _waves_of(
    column_px: NDArray[np.floating],
    column_std_px: NDArray[np.floating],
    refined: NDArray[np.bool_],
    lines: LineSet,
) -> NDArray[np.float32]:
    """What `wave_std_px` gives for a picture, or for one site of its mosaic."""
    std = np.zeros(column_px.shape, np.float32)
    quiet = refined & (column_std_px < QUIET_PX)
    usual = _rms(column_px, quiet, lines.step_px) or 0.0
    noisy = _rms(column_px, refined, lines.step_px) or 0.0
    rows, columns = (
        np.linspace(0, size, parts + 1).astype(int)
        for size, parts in zip(column_px.shape, REGIONS, strict=True)
    )
    for top, bottom in pairwise(rows):
        for left, right in pairwise(columns):
            where = np.s_[top:bottom, left:right]
            own = _rms(column_px[where], quiet[where], lines.step_px)
            std[where] = usual if own is None else own
    return np.where(refined & ~quiet, np.float32(noisy), std)


def _rms(column_px: NDArray[np.floating], refined: NDArray[np.bool_], period_px: float) -> float | None:
    """Rms of the wave of a region, px; None where too few runs tell."""
    width = column_px.shape[1] // RUN * RUN
    used = refined[:, :width].reshape(-1, RUN)
    some = np.flatnonzero(used.sum(1) >= MOST_OF_RUN)
    some = some[:: max(len(some) // MOST, 1)]
    if len(some) < FEWEST:
        return None
    runs = torch.as_tensor(column_px[:, :width].reshape(-1, RUN)[some].astype(np.float64))
    there = torch.as_tensor(used[some])
    straight = runs
    for _ in range(ASKED):
        wave = column_wave(straight, there, period_px)
        if int(wave.smooth.sum()) < FEWEST:
            return None
        straight = straight - wave.px
    return float((runs - straight)[wave.smooth][there[wave.smooth]].square().mean().sqrt())
