"""Maps of a result as pictures with legends, ready to be put into a page."""

from __future__ import annotations

import base64
from dataclasses import dataclass
from io import BytesIO
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.result import FLAG_COLOURS, GRAVITY, REASONS, Flag

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Floats = NDArray[np.float64] | NDArray[np.float32]
Rgba = NDArray[np.uint8]

#: Larger pictures are thinned by whole steps to at most this width, px.
_MAX_WIDTH_PX = 1000
_STOPS = 17


@dataclass(frozen=True)
class Key:
    """A line of a legend: a colour, words and a share of the pixels."""

    colour: str
    text: str
    share: float


@dataclass(frozen=True)
class ReportPicture:
    """A picture (data URI) with a caption and either a colour bar (CSS gradient, ends) or keys."""

    title: str
    caption: str
    uri: str
    gradient: str = ""
    low: str = ""
    high: str = ""
    keys: tuple[Key, ...] = ()
    pins: tuple[tuple[float, float, str], ...] = ()


def png_uri(rgba: Rgba) -> str:
    """A PNG data URI of RGB or RGBA bytes, shape (h, w, 3 or 4)."""
    from matplotlib.image import imsave

    step = -(-rgba.shape[1] // _MAX_WIDTH_PX)
    buffer = BytesIO()
    imsave(buffer, np.ascontiguousarray(rgba[::step, ::step]), format="png")
    return _png_uri(buffer)


def figure_uri(figure: Figure) -> str:
    """A PNG data URI of a drawing."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    buffer = BytesIO()
    FigureCanvasAgg(figure)
    figure.savefig(buffer, format="png")
    return _png_uri(buffer)


def _png_uri(buffer: BytesIO) -> str:
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode("ascii")


def colour_picture(rgb: Floats, title: str, caption: str) -> ReportPicture:
    """The sRGB image (3, h, w), 0..1; pixels without colour are transparent."""
    solid = np.isfinite(rgb).all(axis=0)
    pixels = np.nan_to_num(np.moveaxis(rgb, 0, -1)).clip(0, 1)
    rgba = np.dstack([(pixels * 255 + 0.5).astype(np.uint8), np.where(solid, 255, 0).astype(np.uint8)])
    return ReportPicture(title, caption, png_uri(rgba))


def value_picture(
    values: Floats, title: str, caption: str, unit: str, colours: str = "viridis", symmetric: bool = False
) -> ReportPicture:
    """A map (h, w) in false colour between its 1st and 99th percentile; NaN is transparent.

    ``symmetric`` centres the colours on zero, for signed errors.
    """
    from matplotlib import colormaps

    known = values[np.isfinite(values)]
    low, high = np.percentile(known, (1, 99)) if known.size else (0.0, 1.0)
    if symmetric:
        low, high = -max(abs(low), abs(high)), max(abs(low), abs(high))
    # A constant map still needs a range.
    high = high if high > low else low + 1e-6 * max(abs(low), 1.0)
    scheme = colormaps[colours]
    shade = np.nan_to_num((values - low) / (high - low)).clip(0, 1)
    rgba = scheme(shade, bytes=True)
    rgba[..., 3] = np.where(np.isfinite(values), 255, 0)
    stops = scheme(np.linspace(0, 1, _STOPS), bytes=True)[:, :3]
    gradient = ", ".join(f"#{r:02x}{g:02x}{b:02x}" for r, g, b in stops.tolist())
    return ReportPicture(title, caption, png_uri(rgba), gradient, f"{low:.4g} {unit}", f"{high:.4g} {unit}")


def flag_picture(flags: NDArray[np.integer], title: str, caption: str) -> ReportPicture:
    """The flags (h, w), each pixel in the colour of its gravest flag, with words for those that occur."""
    rgba = np.zeros((*flags.shape, 4), np.uint8)
    keys = []
    for flag in reversed(GRAVITY):
        rgba[(flags & int(flag)) != 0] = (*bytes.fromhex(FLAG_COLOURS[flag][1:]), 255)
    for flag in Flag:
        share = float(np.mean((flags & int(flag)) != 0))
        if share > 0:
            keys.append(Key(FLAG_COLOURS[flag], REASONS[flag], share))
    keys.append(Key("transparent", "no flag", float(np.mean(flags == 0))))
    return ReportPicture(title, caption, png_uri(rgba), keys=tuple(keys))
