"""The light that probed pixels receive line by line, as measured and as the model says, and its changes.

It is worked out for the samples of the mosaic that belong to some pixels; for single lines, of which only
those near an order light a pixel by it. `pattern_light` does the same for all other patterns.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn.functional import pad

from dsl_core.model.projector.line_spread import Spread, stretched
from dsl_core.optics.colour_neighbours import bayer_colours
from dsl_core.optics.correspondence import Footprint, like
from dsl_core.optics.lines.profile import SAMPLES, ProfileTable, halo_of_line
from dsl_core.optics.pixel_model import DIRECT_ERROR, PixelModel
from dsl_core.optics.spectra import ORDERS, SECOND_ORDERS
from dsl_core.reconstruction.spectral.probing.picked_cube import PickedCube
from dsl_core.reconstruction.spectral.probing.probed_pixels import Indices
from dsl_core.reconstruction.spectral.solving.prior import Prior
from dsl_core.reconstruction.spectral.solving.tile_frames import Pixels, weighted

Floats = NDArray[np.float64]

#: The parameters, in their order: shifts in projector columns, stretches (a shift that rises by this many
#: columns from the middle wavelength to the last), all others relative. The light of second orders is
#: relative to that of the first; single lines, of which only those near first orders are looked at, say
#: nothing of it.
PARAMETERS = (
    "shift +1",
    "shift -1",
    "gain +1",
    "gain -1",
    "blur",
    "tail",
    "gain 2",
    "drift",
    "stretch +1",
    "stretch -1",
)
#: Where the light of second orders is among them.
SECOND = PARAMETERS.index("gain 2")
#: Steps of the numerical derivatives: columns (px) and blur (share).
SHIFT_PX, BLUR_STEP = 0.05, 0.05
#: Blur of the tail of a line, relative to its own.
TAIL_BLUR = 4.0
#: Relative error of the zero order that neighbours need not share.
ZERO_ERROR = 0.01


@dataclass(frozen=True)
class ProbedScan:
    """A scan and its model: ``radiance`` and ``std`` are (frames, rows, columns), in DN per ms.

    Of the picture only `probed_pixels` are looked at. ``direct_error`` is that of the zero order, relative to
    it, in frames that light a pixel by several orders at once.
    """

    model: PixelModel
    pixels: Pixels
    radiance: NDArray[np.float32] | PickedCube
    std: NDArray[np.floating] | PickedCube
    prior: Prior
    direct_error: float = DIRECT_ERROR


def along_bands(model: PixelModel) -> Floats:
    """Place of each internal band over the reported ones, -1 to 1, which a stretch rises with."""
    nm = model.bands.centres_nm
    first, last = nm[model.bands.reported][[0, -1]]
    return np.asarray((2 * nm - first - last) / (last - first))


def second_share(model: PixelModel) -> float:
    """Light of the second orders over that of the first, as the model has it."""
    moments = model.bands.moments
    first, second = (
        sum(float(moments[order].sum()) for order in orders if order in moments)
        for orders in (ORDERS, SECOND_ORDERS)
    )
    return second / first


@dataclass(frozen=True)
class OrderLight:
    """Lines near one order: the model's rows (samples, bands, lines), data, weight and time of each.

    Each band is lit by a few lines, numbered ``near`` (samples, bands, n): what their rows gain, of the light
    ``white`` (samples, bands), is ``changes`` (samples, bands, n, kinds). ``frame`` (samples, lines) has the
    frame of each line.
    """

    rows: Tensor
    white: Tensor
    near: Tensor
    changes: Tensor
    values: Tensor
    weight: Tensor
    time: Tensor
    frame: Tensor


@lru_cache(maxsize=256)
def _changed_profiles(width_px: float, spread: Spread, band_px: float) -> Tensor:
    """Profiles of a line on a band at even distances, `SAMPLES` a column, zero at both ends: (distances, 4).

    As it is, and what it gains per column of shift, per share of blur and per share of light in the tail.
    """
    own, blurred, tail = (
        ProfileTable(width_px, stretched(spread, by), band_px, torch.device("cpu"), torch.float64).values
        for by in (1.0, 1 + BLUR_STEP, TAIL_BLUR)
    )
    own, blurred = (pad(each, ((len(tail) - len(each)) // 2,) * 2) for each in (own, blurred))
    step = round(SHIFT_PX * SAMPLES)
    shifted = (own.roll(-step) - own.roll(step)) * (SAMPLES / (2 * step))
    return torch.stack([own, shifted, (blurred - own) / BLUR_STEP, tail - own], 1)


class _Profiles:
    """`_changed_profiles` of samples, each by the width of its own bands and lines.

    So what is found of a pixel does not depend on those that are worked out together with it.
    """

    def __init__(self, width_px: float, spread: Spread, halves_px: Tensor, widths: Tensor) -> None:
        """Half widths of bands (samples,) and widths of the spread relative to the usual one (samples,)."""
        kinds, self._kind = torch.unique(torch.stack([halves_px, widths]), dim=1, return_inverse=True)
        tables = [_changed_profiles(width_px, stretched(spread, by), half) for half, by in kinds.T.tolist()]
        self._size = max(len(table) for table in tables)
        # Zeros at both ends change nothing.
        same = [pad(table, (0, 0, *2 * ((self._size - len(table)) // 2,))) for table in tables]
        self._values = torch.cat(same)
        #: Distance (px) beyond which no sample's line lights a band.
        self.reach_px = (self._size - 1) / 2 / SAMPLES

    def at(self, distance_px: Tensor) -> Tensor:
        """Profiles at distances (samples, bands, n) of bands from lines, (samples, bands, n, 4)."""
        at = ((distance_px + self.reach_px) * SAMPLES).add_(0.5).clip_(0, self._size - 1).long()
        at += self._kind[:, None, None] * self._size
        return self._values.index_select(0, at.reshape(-1)).reshape(*at.shape, -1)


class ProbedLight:
    """Data of samples, and the rows of the model of unit shading and of its changes.

    ``values`` and ``weight`` (samples, k), ``rows`` (samples, bands, k): the lines near each order, one order
    after the other, and last the zero order.
    """

    def __init__(self, scan: ProbedScan, samples: Indices) -> None:
        self._scan, self._samples = scan, samples
        self._known = {
            name: torch.as_tensor(values.ravel()[samples], dtype=torch.float64)
            for name, values in vars(scan.pixels).items()
            if name != "valid"
        }
        self._place = np.divmod(samples, scan.pixels.valid.shape[1])
        colour = bayer_colours(scan.model.rig.sensor.bayer, *self._place)
        self.colour = torch.as_tensor(colour)
        known = self._known
        traced = scan.model.trace(torch.as_tensor(samples), known["depth_mm"], known["column_px"], ORDERS)
        self._orders = [self._order(order, traced.orders[order]) for order in ORDERS]
        zero = like(scan.model.bands.moments[0].sum(1), known["shading"])[self.colour][..., None]
        amplitude, std = known["amplitude"][:, None], known["amplitude_std"][:, None]
        weight = 1 / (std**2 + (ZERO_ERROR * amplitude) ** 2)
        self.rows = torch.cat([*(order.rows for order in self._orders), zero], 2)
        self.values = torch.cat([*(order.values for order in self._orders), amplitude], 1)
        self.weight = torch.cat([*(order.weight for order in self._orders), weight], 1)
        #: The frame (samples, k) of each value; that of the zero order is one behind the last.
        self.frame = torch.cat(
            [*(order.frame for order in self._orders), torch.full_like(amplitude, len(scan.radiance)).long()],
            1,
        )
        self.weight = self.weight.nan_to_num(0.0, 0.0, 0.0)
        #: How many values belong to each order.
        self.sizes = [order.values.shape[1] for order in self._orders] + [1]

    def _order(self, order: int, footprint: Footprint) -> OrderLight:
        scan, lines = self._scan, self._scan.model.lines
        assert lines is not None
        columns, inside = footprint.columns, scan.model.inside(footprint)
        profiles = _Profiles(
            lines.width_px,
            scan.model.response(0.0).line_spread,
            scan.model.bands.half_widths_px(columns),
            scan.model.widths(footprint, inside),
        )
        reach = profiles.reach_px
        low = torch.where(inside, columns, torch.inf).amin(0)
        high = torch.where(inside, columns, -torch.inf).amax(0)
        any_inside = inside.any(0)
        span = float((high - low)[any_inside].max()) if bool(any_inside.any()) else 0.0
        first = torch.where(any_inside, lines.position(low - reach).ceil(), 0.0).long()
        index = first[:, None] + torch.arange(math.ceil((span + 2 * reach) / lines.step_px) + 1)
        used = lines.exists(index) & any_inside[:, None]
        white = like(scan.model.bands.moments[order].sum(1), columns)[self.colour] * inside.T
        # Only these lines light a band: all others are too far away.
        near = (lines.position(columns.T - reach).ceil().long() - first[:, None])[..., None]
        near = near + torch.arange(math.floor(2 * reach / lines.step_px) + 1)
        distance = columns.T[..., None] - lines.centre_px(near + first[:, None, None]).to(columns)
        light = profiles.at(distance)
        near = near.clip_(0, index.shape[1] - 1)
        own = columns.new_zeros((*white.shape, index.shape[1]))
        own.scatter_add_(2, near, light[..., 0] * white[..., None])
        frame = lines.frame(index).numpy()
        rows, columns_at = (at[:, None] for at in self._place)
        y = torch.as_tensor(scan.radiance[frame, rows, columns_at]).double()
        std = torch.as_tensor(scan.std[frame, rows, columns_at]).double()
        known = self._known
        away = known["column_px"][:, None] - lines.centre_px(index)
        halo = known["amplitude"][:, None] * halo_of_line(
            away, lines.width_px, scan.model.rig.projector_response
        )
        values, weight = weighted(y - known["offset"][:, None] - halo, std**2)
        lit = (own > 0).any(1) & used
        return OrderLight(
            own,
            white,
            near,
            light[..., 1:],
            values,
            weight * lit,
            index / lines.lines - 0.5,
            lines.frame(index),
        )

    def changes(self, nodes: Tensor) -> Tensor:
        """What each of `PARAMETERS` adds to ``values`` of unit shading for spectra (samples, bands).

        Shape (samples, k, parameters).
        """
        parts = []
        along = torch.as_tensor(along_bands(self._scan.model), dtype=nodes.dtype)
        for number, light in enumerate(self._orders):
            own = (nodes[:, None] @ light.rows)[:, 0]
            gained = light.changes * (light.white * nodes)[..., None, None]
            gained = torch.cat([gained, gained[..., :1] * along[:, None, None]], -1).flatten(1, 2)
            line = light.near.flatten(1)[..., None].expand_as(gained)
            of_lines = own.new_zeros((*own.shape, gained.shape[-1])).scatter_add_(1, line, gained)
            part = torch.zeros((*own.shape, len(PARAMETERS)), dtype=own.dtype)
            shifted, part[..., 4], part[..., 5], part[..., 8 + number] = of_lines.unbind(-1)
            part[..., number], part[..., 2 + number] = shifted, own
            part[..., 7] = own * light.time
            parts.append(part)
        zero = torch.zeros_like(parts[0][:, :1])
        lines = self._scan.model.lines
        assert lines is not None
        time = lines.position(self._known["column_px"]) / lines.lines - 0.5
        zero[:, 0, 7] = (self.rows[..., -1] * nodes).sum(1) * time
        return torch.cat([*parts, zero], 1)
