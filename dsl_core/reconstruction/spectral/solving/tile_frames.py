"""What is measured of the pixels of a tile: their frames in three colours, and what is known before."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dsl_core.model.rig import Rig
from dsl_core.optics.colour_neighbours import shares_on_a_surface, usual_shares
from dsl_core.optics.demosaic import demosaic, demosaic_variance
from dsl_core.optics.lines.line_set import LineSet
from dsl_core.optics.lines.profile import halo_of_line
from dsl_core.optics.pixel_model import MODEL_ERROR
from dsl_core.optics.sensor import mosaic_from


@dataclass(frozen=True)
class Pixels:
    """What is known of every pixel before its spectrum: arrays of shape (rows, columns).

    ``amplitude`` and ``amplitude_std`` (DN per ms) are those of the zero order in the pixel's own colour,
    ``offset`` the residual dark signal and ``offset_std`` how far all frames may be off it; ``column_std_px``
    is the deviation of the column, and of depth with it; ``valid`` pixels get a spectrum.
    """

    column_px: NDArray[np.float32]
    depth_mm: NDArray[np.float32]
    shading: NDArray[np.float32]
    shading_rel_std: NDArray[np.float32]
    amplitude: NDArray[np.float32]
    amplitude_std: NDArray[np.float32]
    offset: NDArray[np.float32]
    offset_std: NDArray[np.float32]
    column_std_px: NDArray[np.float32]
    valid: NDArray[np.bool_]


class TileFrames:
    """The frames of one tile with the neighbours that demosaicing needs."""

    def __init__(
        self,
        rig: Rig,
        radiance: NDArray[np.float32],
        std: NDArray[np.floating],
        pixels: Pixels,
        rows: slice,
        columns: slice,
        like: Tensor,
        first_row: int = 0,
    ) -> None:
        """``pixels`` are those of the whole picture; ``radiance`` and ``std`` are (frames, rows, columns).

        Their first row is the ``first_row`` of the picture. All comes in the precision and on the device of
        ``like``.
        """
        self.response, self.bayer, self.like = rig.projector_response, rig.sensor.bayer, like
        self.rows, self.columns = rows, columns
        inside = np.nonzero(pixels.valid[rows, columns])
        y, x = (at + part.start for at, part in zip(inside, (rows, columns), strict=True))
        self.width = pixels.valid.shape[1]
        #: Flat indices of the tile's valid pixels in the picture, ascending.
        self.flat = y * self.width + x
        near = np.s_[max(rows.start - 2, 0) : rows.stop + 2, max(columns.start - 2, 0) : columns.stop + 2]
        there = slice(near[0].start - first_row, near[0].stop - first_row), near[1]
        self._corner = near[0].start, near[1].start
        self._mosaic = mosaic_from(self.bayer, *self._corner)
        self._radiance, self._std = radiance[:, *there], std[:, *there]
        self._near = Pixels(**{name: values[near] for name, values in vars(pixels).items()})
        at = (y - near[0].start) * self._near.valid.shape[1] + x - near[1].start
        self.at = torch.as_tensor(at, device=like.device)

    def known(self, name: str) -> Tensor:
        """A map of `Pixels` at the tile's pixels, (pixels,)."""
        return self._tensor(getattr(self._near, name)).reshape(-1)[self.at]

    def _tensor(self, values: NDArray[np.floating]) -> Tensor:
        return torch.as_tensor(np.ascontiguousarray(values), device=self.like.device).to(self.like.dtype)

    def own(self) -> tuple[Tensor, Tensor]:
        """Radiance of all frames without offset, and its weight, of the pixels' own colour.

        Each has shape (frames, pixels).
        """
        y, std = self._samples(slice(None))
        return weighted(y - self.known("offset"), std**2)

    def _samples(self, frames: slice) -> tuple[Tensor, Tensor]:
        """Radiance of frames, and its deviation, at the tile's pixels, (frames, pixels)."""
        y, std = (self._tensor(values[frames]).flatten(1) for values in (self._radiance, self._std))
        return y[:, self.at], std[:, self.at]

    def samples(self, frames: range, lines: LineSet) -> tuple[Tensor, Tensor]:
        """Radiance without offset and halo of lines, and weight, of the pixels' own colour.

        Each has shape (frames, pixels).
        """
        y, std = self._samples(slice(frames.start, frames.stop))
        index = torch.arange(frames.start, frames.stop, device=y.device)[:, None]
        distance = self.known("column_px") - lines.centre_px(index).to(y.dtype)
        halo = halo_of_line(distance, lines.width_px, self.response)
        return weighted(y - self.known("offset") - self.known("amplitude") * halo, std**2)

    def shares(self, width: int | None = None) -> NDArray[np.float64]:
        """How much samples around the tile's pixels count, (8, rows, columns), see `shares_on_a_surface`.

        With a ``width`` there are so many columns; those beyond the tile's own are zero.
        """
        usual = usual_shares(self.bayer, self.rows, self.columns)
        height, own = usual.shape[1:]
        # Two pixels on every side, also beyond the picture.
        amplitude, std = np.full((2, height + 4, own + 4), np.nan)
        top, left = self._corner[0] - self.rows.start + 2, self._corner[1] - self.columns.start + 2
        there = np.s_[top : top + self._near.valid.shape[0], left : left + self._near.valid.shape[1]]
        amplitude[there], std[there] = self._near.amplitude, self._near.amplitude_std
        found = np.zeros((8, height, width or own))
        found[..., :own] = shares_on_a_surface(usual, amplitude, std)
        return found

    def zero_order_colour(self) -> tuple[Tensor, Tensor]:
        """Zero-order amplitude in three colours and its variance, each (3, pixels)."""
        colour = demosaic(self._tensor(self._near.amplitude), self._mosaic).reshape(3, -1)[:, self.at]
        return colour, self._variance(self._near.amplitude_std)

    def place(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Rows and columns of the pixels in the picture."""
        rows, columns = np.divmod(self.flat, self.width)
        return rows, columns

    def _variance(self, std: NDArray[np.float32]) -> Tensor:
        """Variance in three colours of independent deviations (rows, columns), (3, pixels)."""
        return demosaic_variance(self._tensor(std) ** 2, self._mosaic).reshape(3, -1)[:, self.at]


def weighted(values: Tensor, variance: Tensor) -> tuple[Tensor, Tensor]:
    """Values and their weight, with the error of the model itself."""
    weight = variance.addcmul_(values, values, value=MODEL_ERROR**2).reciprocal_()
    # An infinite variance has weight zero by itself; NaN must not survive the product.
    return torch.nan_to_num_(values, 0.0, 0.0, 0.0), torch.nan_to_num_(weight, 0.0, 0.0, 0.0)
