"""Sharpness from projected bars: the blur of their edges, camera and projector together.

For an edge blurred by a Gaussian of standard deviation s the share of light n runs from 0 to 1, and the
integral of ``n * (1 - n)`` across it is ``s / sqrt(pi)``. No edge has to be located, so coarse pixels do no
harm as long as there are many edges; two independent pictures make the product free of a bias by noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import CalibrationError
from dsl_core.model.calibration.selftest import FocusCheck, Measured

Floats = NDArray[np.float64]

#: Bars and gaps this wide; eight of each cover a projector 640 px wide.
BAR_PX = 40
#: Bands of rows from whose spread the standard deviation comes.
_BANDS = 8
_MIN_EDGES = 50


@dataclass(frozen=True)
class BarFrames:
    """Two frames of the bars and two of their inverse, in DN, (rows, columns) each."""

    bars: tuple[NDArray[np.uint16], NDArray[np.uint16]]
    inverse: tuple[NDArray[np.uint16], NDArray[np.uint16]]


@dataclass(frozen=True)
class _Edges:
    row: NDArray[np.int64]
    column: NDArray[np.int64]
    blur_px: Floats  # one estimate each, noisy; its mean over many edges counts
    pitch_px: float  # camera pixels to a bar


def bar_levels(width_px: int, level: int, inverse: bool) -> NDArray[np.uint8]:
    """Drive levels of one row of the picture, (width,)."""
    lit = (np.arange(width_px) // BAR_PX) % 2 == (1 if inverse else 0)
    return np.where(lit, level, 0).astype(np.uint8)


def check_focus(frames: BarFrames, black_dn: float) -> FocusCheck:
    """Blur of the edges, over all and by thirds; raises `CalibrationError` when no edges are seen."""
    first, second, light = _upright(*_shares(frames, black_dn))
    edges = _find_edges(first, second, light)
    scale = BAR_PX / edges.pitch_px
    mean = _blur(edges, np.ones(len(edges.row), bool))
    third = np.minimum(edges.column * 3 // first.shape[1], 2)
    thirds = [_blur(edges, third == i) for i in range(3) if (third == i).sum() >= _MIN_EDGES]
    worst = max(thirds or [mean], key=lambda each: each.value)
    return FocusCheck(
        camera_px=mean,
        projector_px=Measured(value=mean.value * scale, std=mean.std * scale),
        worst_px=Measured(value=worst.value * scale, std=worst.std * scale),
    )


def _shares(frames: BarFrames, black_dn: float) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """Share of the light that the bars give, twice, and where there is light enough to say so."""
    pairs = [
        (bars.astype(float) - black_dn, inverse.astype(float) - black_dn)
        for bars, inverse in zip(frames.bars, frames.inverse, strict=True)
    ]
    white = np.mean([bars + inverse for bars, inverse in pairs], axis=0)
    light = white > 0.2 * np.percentile(white, 99)
    safe = np.where(light, white, 1.0)
    shares = [(bars + (safe - inverse)) / (2 * safe) for bars, inverse in pairs]
    return shares[0], shares[1], light


def _upright(
    first: Floats, second: Floats, light: NDArray[np.bool_]
) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """Shares of light and where they can be judged, transposed if the bars run across the picture."""
    share = np.where(light, (first + second) / 2, 0.5)
    # From cell to cell of a mosaic, whose colours may see different shares.
    across, down = np.abs(share[:, 2:] - share[:, :-2]).mean(), np.abs(share[2:] - share[:-2]).mean()
    return (first, second, light) if across >= down else (first.T, second.T, light.T)


def _find_edges(first: Floats, second: Floats, light: NDArray[np.bool_]) -> _Edges:
    """Where the mean share crosses one half between two clear plateaus, and the sum of products around it."""
    mean = (first + second) / 2
    crossing = (mean[:, :-1] >= 0.5) != (mean[:, 1:] >= 0.5)
    per_row = crossing.sum(1)
    span = light.sum(1)[per_row > 0]
    if not len(span):
        raise CalibrationError(_NO_EDGES)
    reach = max(int(np.median(span / per_row[per_row > 0]) / 2) - 1, 2)
    row, column = np.nonzero(crossing)
    inside = (column >= reach) & (column + reach + 1 < mean.shape[1])
    row, column = row[inside], column[inside]
    window = column[:, None] + np.arange(-reach + 1, reach + 1)
    values = mean[row[:, None], window]
    clear = (np.abs(values[:, [0, 1, -2, -1]] - 0.5) > 0.3).all(1) & light[row[:, None], window].all(1)
    # Noise may cross one half twice at a soft edge; an edge counts once, at its middle crossing.
    once = (np.diff(values >= 0.5, axis=1) != 0).sum(1) == 1
    row, column, window = row[clear & once], column[clear & once], window[clear & once]
    if len(row) < _MIN_EDGES:
        raise CalibrationError(_NO_EDGES)
    a, b = first[row[:, None], window], second[row[:, None], window]
    product = (a * (1 - b) + b * (1 - a)) / 2
    # What the plateaus hold is stray light and no blur.
    stray = product[:, [0, -1]].mean(1, keepdims=True)
    blur = np.sqrt(np.pi) * (product - stray).sum(1)
    same_row = np.diff(row) == 0
    pitch = float(np.median(np.diff(column)[same_row])) if same_row.any() else float(2 * reach)
    near = same_row & (np.abs(np.diff(column) - pitch) < 0.25 * pitch)
    return _Edges(row, column, blur, float(np.diff(column)[near].mean()) if near.any() else pitch)


def _blur(edges: _Edges, chosen: NDArray[np.bool_]) -> Measured:
    """Mean over edges; standard deviation from bands of rows, which share no noise and no row phase."""
    row, blur = edges.row[chosen], edges.blur_px[chosen]
    bands = np.array_split(blur[np.argsort(row, kind="stable")], _BANDS)
    means = np.array([band.mean() for band in bands if len(band)])
    std = float(means.std(ddof=1) / np.sqrt(len(means))) if len(means) > 1 else float(blur.std())
    return Measured(value=max(float(blur.mean()), 0.0), std=std)


_NO_EDGES = (
    "No clear edges of the projected bars are visible: the picture is far out of focus, or the target is"
    " too rough or small, or the projector showed an earlier picture. Focus projector and camera on the"
    " target and make it fill the view; if it is sharp, raise the latency in the projector's driver."
)
