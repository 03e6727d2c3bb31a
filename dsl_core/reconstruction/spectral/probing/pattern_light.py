"""The light that probed pixels receive frame by frame where orders share frames, and its changes.

Combs and designed sets light a pixel by several orders at once, so that every frame tells of all of them.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from dsl_core.optics.colour_neighbours import bayer_colours
from dsl_core.optics.correspondence import like
from dsl_core.optics.pixel_model import Traced, without_offset
from dsl_core.reconstruction.spectral.probing.probed_light import (
    BLUR_STEP,
    PARAMETERS,
    SECOND,
    SHIFT_PX,
    TAIL_BLUR,
    ProbedScan,
    along_bands,
    second_share,
)
from dsl_core.reconstruction.spectral.probing.probed_pixels import Indices
from dsl_core.reconstruction.spectral.solving.tile_frames import weighted

#: Widths of lines relative to the usual one: as they are, blurred, and those of a tail.
WIDTHS = (1.0, 1 + BLUR_STEP, TAIL_BLUR)
#: What changes of the light of each band and frame are worked out for: the first of `PARAMETERS`.
_OF_BANDS = PARAMETERS[: SECOND + 1]


class PatternLight:
    """Data of samples, and rows of the model of unit shading and of its changes, as `ProbedLight` has them.

    ``values`` and ``weight`` (samples, frames), ``rows`` (samples, bands, frames). What displaces a first
    order displaces the second order of its side twice as far.
    """

    def __init__(self, scan: ProbedScan, samples: Indices) -> None:
        self._scan = scan
        self._known = {
            name: torch.as_tensor(values.ravel()[samples], dtype=torch.float64)
            for name, values in vars(scan.pixels).items()
            if name != "valid"
        }
        place = np.divmod(samples, scan.pixels.valid.shape[1])
        self.colour = torch.as_tensor(bayer_colours(scan.model.rig.sensor.bayer, *place))
        traced = scan.model.trace(torch.as_tensor(samples), self._known["depth_mm"], self._known["column_px"])
        frames = len(scan.radiance)
        rows, columns = (at[:, None] for at in place)
        shown = np.arange(frames)[None]
        y, std = (torch.as_tensor(cube[shown, rows, columns]).double() for cube in (scan.radiance, scan.std))
        values, weight = weighted(y - self._known["offset"][:, None], std**2)
        weight = 1 / (1 / weight + (scan.direct_error * self._direct(traced)) ** 2)
        self.weight = weight.nan_to_num(0.0, 0.0, 0.0)
        own, changes = self._rows(traced)
        self.values = self._without_offset(values[..., None])[..., 0]
        self.rows = self._without_offset(own.mT).mT
        self._light_of_bands, self._changes = own, changes
        #: How many values belong to each order: all orders share them.
        self.sizes = [frames]

    def _without_offset(self, values: Tensor) -> Tensor:
        """Values (samples, frames, n) without what an offset that frames share takes of them."""
        return without_offset(values, self.weight[..., None], self._known["offset_std"] ** 2)

    def _moments(self, order: int) -> Tensor:
        """Response of the samples' own colours to the light of an order, (samples, LEDs, bands)."""
        moments = like(self._scan.model.bands.moments[order], self._known["shading"])[self.colour]
        grey = self._scan.model.profiles.shape[2] == 1
        return moments.sum(1, keepdim=True) if grey else moments

    def _direct(self, traced: Traced) -> Tensor:
        """Largest zero-order light within a column of each sample's, (samples, frames), DN per ms."""
        light = self._scan.model.zero_light(self._known["shading"])
        lit = torch.stack([light.at(traced.column_px + shift) for shift in (-1.0, 0.0, 1.0)]).amax(0)
        share = self._moments(0).sum(2)
        share = share / share.sum(1, keepdim=True).clip(min=1e-30)
        return torch.einsum("sl,slf->sf", share * self._known["amplitude"][:, None], lit)

    def _rows(self, traced: Traced) -> tuple[Tensor, Tensor]:
        """The model (samples, bands, frames) and its changes (samples, bands, frames, `_OF_BANDS`)."""
        model = self._scan.model
        total, blurred, tail = (
            self._light(0, 0.0, traced.column_px[None], traced.direct[None], width) for width in WIDTHS
        )
        changes = total.new_zeros((*total.shape, len(_OF_BANDS)))
        seconds = second_share(model)
        for order, footprint in traced.orders.items():
            columns, inside = footprint.columns, model.inside(footprint)
            half = model.bands.half_width_px(columns)
            own, wider, far = (self._light(order, half, columns, inside, width) for width in WIDTHS)
            low, high = (self._light(order, half, columns + step, inside) for step in (-SHIFT_PX, SHIFT_PX))
            side = 0 if order > 0 else 1
            changes[..., side] += abs(order) * (high - low) / (2 * SHIFT_PX)
            if abs(order) == 1:
                changes[..., 2 + side] = own
            else:
                changes[..., SECOND] += own / seconds
            total += own
            blurred += wider
            tail += far
        changes[..., 4] = (blurred - total) / BLUR_STEP
        changes[..., 5] = tail - total
        return total, changes

    def _light(
        self, order: int, half_px: float, columns: Tensor, inside: Tensor, width: float = 1.0
    ) -> Tensor:
        """Light of an order, (samples, bands, frames), with lines so many times as wide as usual.

        ``columns`` and ``inside`` are (bands, samples), or (1, samples) where bands share a column.
        ``half_px`` is the half width of a band's triangle.
        """
        moments = self._moments(order)
        light = self._scan.model.light(half_px, moments, width=width)
        lit = light.at(columns.reshape(-1)).reshape(*columns.shape, *light.table.shape[1:])
        lit = lit * inside[..., None, None]
        if len(columns) == 1:
            return torch.einsum("slb,slf->sbf", moments, lit[0])
        return torch.einsum("slb,bslf->sbf", moments, lit)

    def changes(self, nodes: Tensor) -> Tensor:
        """What each of `PARAMETERS` adds to ``values`` of unit shading for spectra (samples, bands).

        Shape (samples, frames, parameters).
        """
        along = torch.as_tensor(along_bands(self._scan.model), dtype=nodes.dtype)
        of_bands = torch.einsum("sbfk,sb->sfk", self._changes, nodes)
        stretched = torch.einsum("sbfk,sb->sfk", self._changes[..., :2], nodes * along)
        frames = self.values.shape[1]
        time = (torch.arange(frames, dtype=nodes.dtype) + 0.5) / frames - 0.5
        drift = (nodes[:, None] @ self._light_of_bands)[:, 0] * time
        return self._without_offset(torch.cat([of_bands, drift[..., None], stretched], 2))
