"""What some pixels say about the model itself: which small changes of it their frames ask for.

Each sampled pixel is solved again together with a few parameters of the model: columns of each first order,
its gain, blur and tails of a line, the level of the light over time. The spectrum is eliminated, so that what
is left is what no spectrum can take up: colours of a line that do not belong to one wavelength, orders that
disagree, a zero order of another colour. ``bias`` is what such a change does to the spectrum that takes the
model as it is.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dsl_core.model.line_spread import Spread, stretched
from dsl_core.model.rig import BayerPattern
from dsl_core.optics.colour_neighbours import bayer_colours
from dsl_core.optics.correspondence import Footprint, like
from dsl_core.optics.line_profile import SAMPLES, ProfileTable, halo_of_line
from dsl_core.optics.pixel_model import PixelModel
from dsl_core.optics.spectra import ORDERS
from dsl_core.optics.spread.field import widths_at
from dsl_core.reconstruction.spectral.curve_probe import (
    CurveMisfit,
    curve_changes,
    curve_misfit,
    normal_of_all_curves,
    of_all_curves,
    tells_of_curves,
    variety,
)
from dsl_core.reconstruction.spectral.dense_solver import solve_dense
from dsl_core.reconstruction.spectral.line_probe import LineProbe, probe_lines, sound_pixels
from dsl_core.reconstruction.spectral.picked_cube import PickedCube
from dsl_core.reconstruction.spectral.probed_pixels import Indices, cell_of, sample_pixels, samples_of
from dsl_core.reconstruction.spectral.solver import Prior, band_mean, roughness
from dsl_core.reconstruction.spectral.tile_frames import Pixels, weighted
from dsl_core.solve import banded

Floats = NDArray[np.float64]

#: The parameters, in their order: shifts in projector columns, stretches (a shift that rises by this many
#: columns from the middle wavelength to the last), all others relative.
PARAMETERS = (
    "shift +1",
    "shift -1",
    "gain +1",
    "gain -1",
    "blur",
    "tail",
    "drift",
    "stretch +1",
    "stretch -1",
)
#: The first of them that no other one makes up for, in a cell of the picture or over all of it.
LEADING = 7
#: What each may be off before any scan is seen, so that fits stay finite. Blur and tails hardly show in the
#: first orders, where an error of the spectrum's prior looks like them; the zero order tells them far better.
PRIOR_STD = (0.5, 0.5, 0.2, 0.2, 0.1, 0.02, 0.1, 0.5, 0.5)
#: Pixels probed in each cell: one of so many of the whole picture, and their range.
ONE_OF, PIXELS_PER_CELL = 6000, (8, 12)
#: With fewer pixels nothing is said; so many are worked out at a time.
FEWEST, CHUNK = 40, 48
#: Steps of the numerical derivatives: columns (px) and blur (share).
SHIFT_PX, BLUR_STEP = 0.05, 0.05
#: Blur of the tail of a line, relative to its own.
TAIL_BLUR = 4.0
#: Relative error of the zero order that neighbours need not share.
ZERO_ERROR = 0.01
#: Pixels whose chi-square exceeds the usual one by this factor see several surfaces.
MIXED_FROM = 5.0
#: A picture less wide than this (share of the distance) is a small piece, and spectra whose shapes differ by
#: less are of one colour.
ONE_VIEW, ONE_COLOUR = 0.2, 0.05
#: Degrees of freedom that a spectrum takes, roughly.
SPECTRUM = 25


@dataclass(frozen=True)
class ProbedScan:
    """A scan and its model: ``radiance`` and ``std`` are (frames, rows, columns), in DN per ms.

    Of the picture only `probed_pixels` are looked at.
    """

    model: PixelModel
    pixels: Pixels
    radiance: NDArray[np.float32] | PickedCube
    std: NDArray[np.floating] | PickedCube
    prior: Prior


@dataclass(frozen=True)
class Probe:
    """What sampled pixels say: arrays over targets (n,), parameters (p,) of `PARAMETERS` and bands (b,).

    ``normal`` (n, p, p) and ``score`` (n, p) are the equations of the parameters without the spectrum,
    weighted by the noise; ``bias`` (n, b, p) is the error of the stated reflectance for a parameter of one;
    ``reflectance`` (n, b); ``chi_square`` (n,) is reduced; ``correlation`` (n,) is by how much sums of
    neighbouring residuals vary more than independent ones; ``place`` (n, 2) is row and column from -1 to 1,
    ``cell`` (n,) the cell of `CELLS`, ``pixel`` (n,) the flat index. ``with_curves`` are ``normal`` and
    ``score`` of these parameters and of the curves after them, None where nobody asked. ``lines`` is what the
    zero order of the same pixels says, ``nm_per_px`` how far apart columns of the first orders are,
    ``step_nm`` bands. ``places`` is whether pixels can tell where the orders are: on a small piece of one
    colour an error of its spectrum looks like a shift.
    """

    normal: Floats
    score: Floats
    bias: Floats
    reflectance: Floats
    chi_square: Floats
    correlation: Floats
    place: Floats
    cell: Indices
    pixel: Indices
    lines: LineProbe
    nm_per_px: float
    places: bool = True
    step_nm: float = 5.0
    with_curves: tuple[Floats, Floats] | None = None

    @property
    def sound(self) -> NDArray[np.bool_]:
        """Pixels (n,) whose numbers are finite and that see one surface, by how well their frames fit."""
        return sound_pixels(self.score, self.normal, self.chi_square, MIXED_FROM)

    @property
    def weight(self) -> Floats:
        """Weight (n,) of each pixel: less where the frames fit less, nothing where they see two surfaces."""
        return np.where(self.sound, 1 / np.maximum(self.chi_square * self.correlation, 1), 0.0)

    @property
    def curves(self) -> CurveMisfit | None:
        """How far curves of camera and projector are off by what colours say; None where they say nothing."""
        if self.with_curves is None or not tells_of_curves(self.reflectance[self.sound]):
            return None
        return curve_misfit(*self.with_curves, self.weight, np.array(PRIOR_STD), self.step_nm)


def _targets(valid: NDArray[np.bool_]) -> Indices:
    """Pixels that are probed."""
    return sample_pixels(valid, int(np.clip(np.count_nonzero(valid) // ONE_OF, *PIXELS_PER_CELL)))


def probed_pixels(valid: NDArray[np.bool_], bayer: BayerPattern) -> Indices:
    """Flat indices, rising, of all pixels of a picture whose frames a probe of it looks at."""
    targets = _targets(valid)
    return np.union1d(targets, samples_of(targets, valid.shape, bayer)[0])


def probe(scan: ProbedScan) -> Probe | None:
    """Probe pixels of a scan of single lines; None for other patterns, and where there are too few pixels."""
    targets = _targets(scan.pixels.valid)
    if not scan.model.single or len(targets) < FEWEST:
        return None
    with torch.inference_mode():
        parts = [_probe_some(scan, targets[i : i + CHUNK]) for i in range(0, len(targets), CHUNK)]
    together = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    lines = scan.model.lines
    assert lines is not None
    response = scan.model.response(0.0)
    column = torch.as_tensor(scan.pixels.column_px.ravel()[targets], dtype=torch.float64)
    widths = widths_at(scan.model.rig, torch.as_tensor(targets), column)
    camera = scan.model.rig.camera
    wide = camera.width_px / camera.fx_px > ONE_VIEW
    whole = together.pop("normal"), together.pop("score")
    own = len(PARAMETERS)
    return Probe(
        **together,
        places=wide or variety(together["reflectance"]) > ONE_COLOUR,
        normal=whole[0][:, :own, :own],
        score=whole[1][:, :own],
        step_nm=scan.model.bands.step_nm,
        with_curves=whole,
        lines=probe_lines(lines, response, scan.pixels, scan.radiance, scan.std, targets, widths),
        nm_per_px=_nm_per_px(scan, targets),
    )


def along_bands(model: PixelModel) -> Floats:
    """Place of each internal band over the reported ones, -1 to 1, which a stretch rises with."""
    nm = model.bands.centres_nm
    first, last = nm[model.bands.reported][[0, -1]]
    return np.asarray((2 * nm - first - last) / (last - first))


def _nm_per_px(scan: ProbedScan, targets: Indices) -> float:
    """Wavelength from one column to the next in the first orders, mean over pixels."""
    depth = torch.as_tensor(scan.pixels.depth_mm.ravel()[targets], dtype=torch.float64)
    columns = scan.model.trace(torch.as_tensor(targets), depth, orders=ORDERS[:1]).orders[ORDERS[0]].columns
    nm = scan.model.bands.centres_nm
    return float((nm[-1] - nm[0]) / (columns[-1] - columns[0]).abs().mean())


def _probe_some(scan: ProbedScan, targets: Indices) -> dict[str, NDArray[Any]]:
    shape = scan.pixels.valid.shape
    samples, owner = samples_of(targets, shape, scan.model.rig.sensor.bayer)
    light = _Light(scan, samples)
    shading = torch.as_tensor(scan.pixels.shading.ravel()[targets], dtype=torch.float64)
    owners, count = torch.as_tensor(owner), len(targets)

    def gather(values: Tensor) -> Tensor:
        return torch.zeros((count, *values.shape[1:]), dtype=values.dtype).index_add_(0, owners, values)

    def of_curves(values: Tensor) -> Tensor:
        into = torch.zeros((3 * count, *values.shape[1:]), dtype=values.dtype)
        return into.index_add_(0, 3 * owners + light.colour, values).reshape(count, 3, *values.shape[1:])

    lit, weight = shading[owners], light.weight
    rows = light.rows * lit[:, None, None]
    heavy = rows * weight[:, None]
    matrix, right = gather(heavy @ rows.mT), gather((heavy @ light.values[..., None])[..., 0])
    found = solve_dense(matrix, right, scan.prior)
    nodes = found.nodes.T.contiguous()
    own = nodes[owners]
    residual = light.values - (own[:, None] @ rows)[:, 0]
    curves = curve_changes(rows.mT, own, scan.model.bands.centres_nm)
    changes, others = torch.cat([light.changes(own) * lit[:, None, None], curves], 2), len(PARAMETERS)
    cross = of_all_curves(of_curves(heavy @ changes), others)
    prior = banded.to_dense(roughness(nodes.shape[1], matrix)[..., None])[0] * found.tau[:, None, None] ** -2
    prior = prior + torch.eye(nodes.shape[1]).to(matrix) * scan.prior.level_std**-2
    bias = torch.linalg.solve(matrix + prior, cross)
    heavy = (changes * weight[..., None]).mT
    normal = normal_of_all_curves(of_curves(heavy @ changes), others) - cross.mT @ bias
    score = of_all_curves(of_curves((heavy @ residual[..., None])[..., 0]), others)
    freedom = (gather((weight > 0).double().sum(1)) - SPECTRUM).clip(min=1)
    reported = scan.model.bands.reported
    y, x = np.divmod(targets, shape[1])
    return {
        "normal": normal.numpy(),
        "score": score.numpy(),
        "bias": band_mean(bias[..., :others].transpose(0, 1))[reported].transpose(0, 1).numpy(),
        "reflectance": found.mean[reported].T.numpy(),
        "chi_square": (gather((weight * residual**2).sum(1)) / freedom).numpy(),
        "correlation": _correlation(residual * weight.sqrt(), gather).numpy(),
        "place": np.stack([2 * y / shape[0] - 1, 2 * x / shape[1] - 1], 1),
        "cell": cell_of(y, x, shape),
        "pixel": targets,
    }


def _correlation(standard: Tensor, gather: Callable[[Tensor], Tensor]) -> Tensor:
    """By how much sums of residuals (samples, rows) over lines vary more than independent ones: at least 1.

    ``1 + 2 sum(rho)`` of the autocorrelation up to the lag where it first vanishes.
    """
    total = gather((standard * standard).sum(1)).clip(min=1e-12)
    factor, open_ = torch.ones_like(total), torch.ones_like(total, dtype=torch.bool)
    for lag in range(1, 9):
        rho = gather((standard[:, lag:] * standard[:, :-lag]).sum(1)) / total
        open_ &= rho > 0.02
        factor += 2 * torch.where(open_, rho, 0.0)
    return factor


@dataclass(frozen=True)
class _OrderLight:
    """Lines near one order: the model's rows (samples, bands, lines), data, weight and time of each.

    Each band is lit by a few lines, numbered ``near`` (samples, bands, n): what their rows gain, of the light
    ``white`` (samples, bands), is ``changes`` (samples, bands, n, kinds).
    """

    rows: Tensor
    white: Tensor
    near: Tensor
    changes: Tensor
    values: Tensor
    weight: Tensor
    time: Tensor


def _changed_profiles(width_px: float, spread: Spread, band_px: float, like: Tensor) -> Tensor:
    """Profiles of a line on a band at even distances, `SAMPLES` a column, zero at both ends: (distances, 4).

    As it is, and what it gains per column of shift, per share of blur and per share of light in the tail.
    """
    own, blurred, tail = (
        ProfileTable(width_px, stretched(spread, by), band_px, like.device, like.dtype).values
        for by in (1.0, 1 + BLUR_STEP, TAIL_BLUR)
    )
    own, blurred = (
        torch.nn.functional.pad(each, ((len(tail) - len(each)) // 2,) * 2) for each in (own, blurred)
    )
    step = round(SHIFT_PX * SAMPLES)
    shifted = (own.roll(-step) - own.roll(step)) * (SAMPLES / (2 * step))
    return torch.stack([own, shifted, (blurred - own) / BLUR_STEP, tail - own], 1)


class _Light:
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
        self.weight = self.weight.nan_to_num(0.0, 0.0, 0.0)

    def _order(self, order: int, footprint: Footprint) -> _OrderLight:
        scan, lines = self._scan, self._scan.model.lines
        assert lines is not None
        columns, inside = footprint.columns, scan.model.inside(footprint)
        half = scan.model.bands.half_width_px(columns)
        spread = stretched(scan.model.response(0.0).line_spread, scan.model.width(footprint, inside))
        table = _changed_profiles(lines.width_px, spread, half, columns)
        reach = (len(table) - 1) / 2 / SAMPLES
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
        at = ((distance + reach) * SAMPLES).add_(0.5).clip_(0, len(table) - 1).int()
        light = table.index_select(0, at.reshape(-1)).reshape(*at.shape, -1)
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
        return _OrderLight(
            own,
            white,
            near,
            light[..., 1:],
            values,
            weight * lit,
            index / lines.lines - 0.5,
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
            shifted, part[..., 4], part[..., 5], part[..., 7 + number] = of_lines.unbind(-1)
            part[..., number], part[..., 2 + number] = shifted, own
            part[..., 6] = own * light.time
            parts.append(part)
        zero = torch.zeros_like(parts[0][:, :1])
        lines = self._scan.model.lines
        assert lines is not None
        time = lines.position(self._known["column_px"]) / lines.lines - 0.5
        zero[:, 0, 6] = (self.rows[..., -1] * nodes).sum(1) * time
        return torch.cat([*parts, zero], 1)
