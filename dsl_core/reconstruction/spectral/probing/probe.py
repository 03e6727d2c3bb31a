"""What some pixels say about the model itself: which small changes of it their frames ask for.

Each sampled pixel is solved again together with a few parameters of the model: columns of each first order,
its gain, blur and tails of a line, the level of the light over time. The spectrum is eliminated, so that what
is left is what no spectrum can take up: colours of a line that do not belong to one wavelength, orders that
disagree, a zero order of another colour. ``bias`` is what such a change does to the spectrum that takes the
model as it is.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dsl_core.model.rig import BayerPattern
from dsl_core.optics.lines.reach import LEAST_SENT
from dsl_core.optics.spectra import ORDERS
from dsl_core.optics.spread.field import widths_at
from dsl_core.reconstruction.spectral.probing.colour_gains import ColourGains, colour_gains
from dsl_core.reconstruction.spectral.probing.curve_probe import (
    USUAL_STEEPNESS,
    CurveMisfit,
    bright_knots,
    curve_changes,
    curve_misfit,
    normal_of_all_curves,
    of_all_curves,
    steepness_per_nm,
    tells_of_curves,
    variety,
)
from dsl_core.reconstruction.spectral.probing.line_probe import LineProbe, probe_lines, sound_pixels
from dsl_core.reconstruction.spectral.probing.probed_light import PARAMETERS, ProbedScan
from dsl_core.reconstruction.spectral.probing.probed_pixels import Indices, cell_of, sample_pixels, samples_of
from dsl_core.reconstruction.spectral.probing.solved_pixels import SolvedPixels, solve_pixels
from dsl_core.reconstruction.spectral.solving.solution import band_mean

Floats = NDArray[np.float64]

#: The first of them that no other one makes up for, in a cell of the picture or over all of it.
LEADING = 8
#: What each may be off before any scan is seen, so that fits stay finite. Blur and tails hardly show in the
#: first orders, where an error of the spectrum's prior looks like them; the zero order tells them far better.
PRIOR_STD = (0.5, 0.5, 0.2, 0.2, 0.1, 0.02, 0.1, 0.1, 0.5, 0.5)
#: Pixels probed in each cell: one of so many of the whole picture, and their range.
ONE_OF, PIXELS_PER_CELL = 6000, (8, 12)
#: With fewer pixels nothing is said; so many are worked out at a time.
FEWEST, CHUNK = 40, 48
#: Pixels whose chi-square exceeds the usual one by this factor see several surfaces.
MIXED_FROM = 5.0
#: Light around a pixel is even where it differs by less than this share, as on a curved surface.
EVEN = 0.2
#: A picture less wide than this (share of the distance) is a small piece, and spectra whose shapes differ by
#: less are of one colour.
ONE_VIEW, ONE_COLOUR = 0.2, 0.05


@dataclass(frozen=True)
class Probe:
    """What sampled pixels say: arrays over targets (n,), parameters (p,) of `PARAMETERS` and bands (b,).

    ``normal`` (n, p, p) and ``score`` (n, p) are the equations of the parameters without the spectrum,
    weighted by the noise; ``bias`` (n, b, p) is the error of the stated reflectance for a parameter of one;
    ``reflectance`` (n, b); ``chi_square`` (n,) is reduced, by ``freedom`` (n,), None where nobody counted;
    ``correlation`` (n,) is by how much sums of neighbouring residuals vary more than independent ones;
    ``place`` (n, 2) is row and column from -1 to 1, ``cell`` (n,) the cell of `CELLS`, ``pixel`` (n,) the
    flat index. ``with_curves`` are ``normal`` and ``score`` of these parameters and of the curves after
    them, None where nobody asked, ``bright`` (knots of all colours,) where these have light. ``lines`` says
    what the zero order of the same pixels does, None where no frame shows it alone, ``nm_per_px`` how far
    apart columns of the first orders are, ``step_nm`` bands; ``steepness`` is by how much the logarithm of
    the light changes along 1 nm. ``places`` is whether pixels can tell where the orders are: on a small
    piece of one colour an error of its spectrum looks like a shift. ``sideways`` (n, 2) is by how much
    lines of each order are farther to the sides of the projector's frame than the pixel's own column: the
    difference of squares, one at the side, mean over bands; None where nobody traced them. ``uneven``
    (n,) is how much darker the darkest of neighbours of a pixel's colour is than the brightest, a share.
    ``by_columns`` (n,) is as much of ``chi_square`` as errors of the columns of single samples explain.
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
    lines: LineProbe | None
    nm_per_px: float
    places: bool = True
    step_nm: float = 5.0
    steepness: float = USUAL_STEEPNESS
    with_curves: tuple[Floats, Floats] | None = None
    bright: NDArray[np.bool_] | None = None
    freedom: Floats | None = None
    sideways: Floats | None = None
    uneven: Floats | None = None
    by_columns: Floats | None = None

    @property
    def usual_chi_square(self) -> float:
        """Median of chi-squares where light is even around pixels; of all where that is hardly anywhere.

        Along edges pixels see two materials, and in small pictures most pixels are at one. What columns
        explain is no fault of the model: where a film disperses little, light changes much with the column.
        """
        chi_square = self.chi_square if self.by_columns is None else self.chi_square - self.by_columns
        even = np.zeros(len(self.pixel), bool) if self.uneven is None else self.uneven < EVEN
        return float(np.median(chi_square[even] if even.sum() >= FEWEST else chi_square))

    @cached_property
    def seen_orders(self) -> NDArray[np.bool_]:
        """Which of `ORDERS` (2,) frames tell of: a film may have one only, or send one out of the frame."""
        gains = [PARAMETERS.index("gain +1"), PARAMETERS.index("gain -1")]
        known = np.nan_to_num(self.normal[:, gains, gains]).sum(0)
        return np.asarray(known > LEAST_SENT**2 * known.max())

    @cached_property
    def sound(self) -> NDArray[np.bool_]:
        """Pixels (n,) whose numbers are finite and that see one surface, by how well their frames fit."""
        return sound_pixels(self.score, self.normal, self.chi_square, MIXED_FROM)

    @cached_property
    def weight(self) -> Floats:
        """Weight (n,) of each pixel: less where the frames fit less, nothing where they see two surfaces."""
        return np.where(self.sound, 1 / np.maximum(self.chi_square * self.correlation, 1), 0.0)

    @property
    def curves(self) -> CurveMisfit | None:
        """How far curves of camera and projector are off by what colours say; None where they say nothing.

        Where colours are faint, bands are coarse for their curves; without these places, what straight
        spectra leave counts for more. Curves that are off show either way.
        """
        if self.with_curves is None or not tells_of_curves(self.reflectance[self.sound]):
            return None
        known = *self.with_curves, self.weight, np.array(PRIOR_STD), self.step_nm, self.steepness
        found = [curve_misfit(*known, bright=bright) for bright in (None, self.bright)]
        return min((each for each in found if each is not None), key=lambda each: each.rms, default=None)

    @property
    def colour_gains(self) -> ColourGains | None:
        """How the camera weighs its colours, over the calibration; None where pixels do not tell."""
        if self.with_curves is None:
            return None
        return colour_gains(*self.with_curves, self.weight, np.array(PRIOR_STD))


def probe_targets(valid: NDArray[np.bool_]) -> Indices:
    """Pixels that are probed."""
    return sample_pixels(valid, int(np.clip(np.count_nonzero(valid) // ONE_OF, *PIXELS_PER_CELL)))


def probed_pixels(valid: NDArray[np.bool_], bayer: BayerPattern) -> Indices:
    """Flat indices, rising, of all pixels of a picture whose frames a probe of it looks at."""
    targets = probe_targets(valid)
    return np.union1d(targets, samples_of(targets, valid.shape, bayer)[0])


def probe(scan: ProbedScan) -> Probe | None:
    """Probe pixels of a scan; None where there are too few of them."""
    targets = probe_targets(scan.pixels.valid)
    if len(targets) < FEWEST:
        return None
    with torch.inference_mode():
        parts = [_probe_some(scan, targets[i : i + CHUNK]) for i in range(0, len(targets), CHUNK)]
    together = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    column = torch.as_tensor(scan.pixels.column_px.ravel()[targets], dtype=torch.float64)
    traced = _columns(scan, targets)
    camera = scan.model.rig.camera
    wide = camera.width_px / camera.fx_px > ONE_VIEW
    whole = together.pop("normal"), together.pop("score")
    if not scan.model.single:
        whole = with_columns_unsure(*whole, scan.pixels.column_std_px.ravel()[targets])
    own, white = len(PARAMETERS), _white(scan)
    return Probe(
        **together,
        places=wide or variety(together["reflectance"]) > ONE_COLOUR,
        normal=whole[0][:, :own, :own],
        score=whole[1][:, :own],
        step_nm=scan.model.bands.step_nm,
        steepness=steepness_per_nm(white, scan.model.bands.step_nm),
        bright=bright_knots(white, scan.model.bands.centres_nm[scan.model.bands.reported]),
        # A monochrome camera has no colours that could disagree.
        with_curves=None if scan.model.rig.sensor.bayer == "MONO" else whole,
        lines=_lines(scan, targets, column) if scan.model.single else None,
        nm_per_px=_nm_per_px(scan, traced[ORDERS[0]][0]),
        sideways=_sideways(scan, column, traced),
        uneven=unevenness(scan.pixels.amplitude, targets),
    )


def with_columns_unsure(normal: Floats, score: Floats, std_px: NDArray[np.floating]) -> tuple[Floats, Floats]:
    """Equations (n, p, p), (n, p) of parameters of pixels whose columns are as sure as ``std_px`` (n,).

    A column that is off puts depth off and displaces both first orders as far. Where lines share frames,
    columns are off by what first orders do to zero orders, in the same way all over a picture: taken as
    certain, they look like a film that has moved.
    """
    alike = normal[:, :, 0] + normal[:, :, 1]
    lever = alike[:, 0] + alike[:, 1] + np.maximum(np.asarray(std_px, np.float64), 1e-6) ** -2.0
    taken = alike / lever[:, None]
    asked = score[:, 0] + score[:, 1]
    return normal - taken[:, :, None] * alike[:, None], score - taken * asked[:, None]


def _lines(scan: ProbedScan, targets: Indices, column_px: Tensor) -> LineProbe:
    """What single lines say near the columns (n,) of pixels."""
    lines, response = scan.model.lines, scan.model.response(0.0)
    assert lines is not None
    widths = widths_at(scan.model.rig, torch.as_tensor(targets), column_px)
    return probe_lines(lines, response, scan.pixels, scan.radiance, scan.std, targets, widths)


def unevenness(amplitude: NDArray[np.float32], targets: Indices) -> Floats:
    """Differences of the light (rows, columns) around pixels (flat indices, (n,)), relative to the brightest.

    Every other row and column has the same colour; beyond the picture, a pixel stands for its neighbour.
    """
    rows, columns = amplitude.shape
    y, x = np.divmod(targets, columns)
    down, across = (_beside(at, size) for at, size in ((y, rows), (x, columns)))
    light = np.nan_to_num(amplitude[down[:, :, None], across[:, None]]).reshape(len(targets), -1).clip(0)
    high = light.max(1)
    return np.asarray((high - light.min(1)) / np.maximum(high, 1e-12), np.float64)


def _beside(at: Indices, size: int) -> Indices:
    """Places (n, 3) two before, at and two behind each one, and the place itself where that is outside."""
    places = at[:, None] + np.array([-2, 0, 2])
    return np.where((places < 0) | (places >= size), at[:, None], places)


def _white(scan: ProbedScan) -> Floats:
    """The light of the first orders, (orders, colours, bands)."""
    bands = scan.model.bands
    return np.stack([bands.moments[order].sum(1)[:, bands.reported] for order in ORDERS])


def _columns(scan: ProbedScan, targets: Indices) -> dict[int, tuple[Tensor, Tensor]]:
    """Columns (bands, n) of each first order at the probed pixels, and where they are inside the frame."""
    depth = torch.as_tensor(scan.pixels.depth_mm.ravel()[targets], dtype=torch.float64)
    traced = scan.model.trace(torch.as_tensor(targets), depth, orders=ORDERS).orders
    return {order: (traced[order].columns, scan.model.inside(traced[order])) for order in ORDERS}


def _nm_per_px(scan: ProbedScan, columns: Tensor) -> float:
    """Wavelength from one column to the next in an order of these columns (bands, n), mean over pixels."""
    nm = scan.model.bands.centres_nm
    return float((nm[-1] - nm[0]) / (columns[-1] - columns[0]).abs().mean())


def _sideways(scan: ProbedScan, column_px: Tensor, traced: dict[int, tuple[Tensor, Tensor]]) -> Floats:
    """How much farther to the sides lines of orders are than own columns; 0 where none arrives, (n, 2)."""
    half = scan.model.rig.projector.width_px / 2
    own = column_px / half - 1
    found = []
    for order in ORDERS:
        columns, inside = traced[order]
        away = (columns / half - 1) ** 2 - own**2
        found.append(torch.where(inside, away, 0.0).sum(0) / inside.sum(0).clip(min=1))
    return np.asarray(torch.stack(found, 1).numpy())


def _probe_some(scan: ProbedScan, targets: Indices) -> dict[str, NDArray[Any]]:
    shape, solved = scan.pixels.valid.shape, solve_pixels(scan, targets)
    light, weight, count = solved.light, solved.light.weight, len(targets)

    def of_curves(values: Tensor) -> Tensor:
        into = torch.zeros((3 * count, *values.shape[1:]), dtype=values.dtype)
        return into.index_add_(0, 3 * solved.owner + light.colour, values).reshape(
            count, 3, *values.shape[1:]
        )

    own = solved.nodes[solved.owner]
    curves = curve_changes(solved.rows.mT, own, scan.model.bands.centres_nm)
    changes = torch.cat([light.changes(own) * solved.shading[:, None, None], curves], 2)
    others = len(PARAMETERS)
    cross = of_all_curves(of_curves(solved.heavy @ changes), others)
    bias = solved.give_way(cross)
    heavy = (changes * weight[..., None]).mT
    normal = normal_of_all_curves(of_curves(heavy @ changes), others) - cross.mT @ bias
    score = of_all_curves(of_curves((heavy @ solved.residual[..., None])[..., 0]), others)
    # What the level of the prior keeps spectra from taking up is not the model's: all pixels of a bright
    # surface would ask for more light.
    pull = (solved.nodes - scan.prior.level) * solved.free / scan.prior.level_std**2
    score = score - (bias.mT @ pull[..., None])[..., 0]
    reported = scan.model.bands.reported
    by_columns = explained_by_columns(solved, changes, scan.pixels.column_std_px.ravel()[solved.samples])
    y, x = np.divmod(targets, shape[1])
    return {
        "normal": normal.numpy(),
        "score": score.numpy(),
        "bias": band_mean(bias[..., :others].transpose(0, 1))[reported].transpose(0, 1).numpy(),
        "reflectance": solved.mean[reported].T.numpy(),
        "chi_square": solved.chi_square.numpy(),
        "freedom": solved.freedom.numpy(),
        "by_columns": (solved.gather(by_columns) / solved.freedom).numpy(),
        "correlation": _correlation(
            torch.split(solved.residual * weight.sqrt(), light.sizes, 1), solved.gather
        ).numpy(),
        "place": np.stack([2 * y / shape[0] - 1, 2 * x / shape[1] - 1], 1),
        "cell": cell_of(y, x, shape),
        "pixel": targets,
    }


def explained_by_columns(solved: SolvedPixels, changes: Tensor, std_px: NDArray[np.floating]) -> Tensor:
    """How much less the squares of samples are in sum (samples,) at the columns that fit each best.

    ``changes`` (samples, k, parameters) are those of their light; the columns are as sure as ``std_px``
    (samples,), and displace both first orders.
    """
    alike = changes[..., 0] + changes[..., 1]
    heavy = alike * solved.light.weight
    sure = torch.as_tensor(std_px, dtype=alike.dtype).clip(min=1e-6) ** -2
    return (heavy * solved.residual).sum(1) ** 2 / ((heavy * alike).sum(1) + sure)


def _correlation(orders: Sequence[Tensor], gather: Callable[[Tensor], Tensor]) -> Tensor:
    """By how much sums of residuals over lines vary more than independent ones: at least 1.

    ``orders`` holds the residuals (samples, lines) of each order. ``1 + 2 sum(rho)`` of the autocorrelation
    up to the lag where it first vanishes.
    """

    def products(lag: int) -> Tensor:
        parts = [(each[:, lag:] * each[:, : -lag or None]).sum(1) for each in orders]
        return gather(torch.stack(parts).sum(0))

    total = products(0).clip(min=1e-12)
    factor, open_ = torch.ones_like(total), torch.ones_like(total, dtype=torch.bool)
    for lag in range(1, 9):
        rho = products(lag) / total
        open_ &= rho > 0.02
        factor += 2 * torch.where(open_, rho, 0.0)
    return factor
