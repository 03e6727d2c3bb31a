"""The published reconstruction, kept as a second solver to compare with.

Supplement of Shin et al. (CVPR 2024), sections 4.3 and 7: each pixel's spectrum is the sigmoid of free
parameters, fitted by Adam to the intensities of one valid first order (Eq. 3). A band is compared with the
single frame whose line is nearest to its column; where the chosen order leaves bands unreached, the blurred
mask of such pixels moves weight from the first order to the zero-order colour. Data terms are L1, and the
gradient along wavelength is penalised. What it leaves open is chosen in the method's favour: the response of
a band is that of the rig averaged over the line, as a calibration on known patches would make it, and the
weight of smoothness is the one that does best on the twin's ColorChecker.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dsl_core.errors import PlanError
from dsl_core.model.plan import CapturePlan
from dsl_core.model.result import Reach
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.optics.correspondence import Correspondence, Footprint
from dsl_core.optics.demosaic import demosaic
from dsl_core.optics.lines.line_set import LineSet
from dsl_core.optics.lines.profile import step_edge
from dsl_core.optics.lines.reach import sends_light
from dsl_core.optics.spectra import ORDERS, chain_response, hat_moments
from dsl_core.progress import NoProgress, Progress
from dsl_core.reconstruction.spectral.solving.tile_frames import Pixels
from dsl_core.reconstruction.spectral.spectra import blurred_mask
from dsl_core.reconstruction.spectral.spectral_maps import SpectralMaps
from dsl_core.solve.many import Check, work_through
from dsl_core.solve.threads import one_kernel_thread

#: Rows of frames that are demosaiced at once; even, to keep the Bayer phase.
STRIP = 32
#: Pixels that are fitted at once: their arrays stay in the processor's cache.
CHUNK = 1024


@dataclass(frozen=True)
class AdamOptions:
    """How the objective is minimised; ``smoothness`` weighs the squared gradient against the L1 terms.

    The supplement speaks of 1000 epochs; the published code takes 2000 steps.
    """

    steps: int = 2000
    learning_rate: float = 0.05
    smoothness: float = 1.0


@dataclass(frozen=True)
class LineData:
    """One pixel set's intensities in units of white, their model and weights.

    ``first`` and ``first_white`` (3, bands, pixels); ``zero`` (3, pixels) and ``zero_white`` (3, bands);
    ``reached`` (bands, pixels); ``kappa`` (pixels,), the first order's weight.
    """

    first: Tensor
    first_white: Tensor
    zero: Tensor
    zero_white: Tensor
    reached: Tensor
    kappa: Tensor


def require_single_lines(plan: CapturePlan) -> LineSet:
    """The lines of a plan that shows one line per frame; raises `PlanError` for any other."""
    lines = LineSet.of(plan)
    if lines is None or not lines.single:
        raise PlanError(
            f"The published reconstruction reads one line per frame; the plan {plan.name!r} projects"
            f" {plan.spectral.kind!r}. Scan with single lines, or use the best solver."
        )
    return lines


class PublishedReconstruction:
    """One scan's spectra by the published objective; the input is that of `SpectralReconstruction`.

    Raises `PlanError` for pattern sets other than single scan lines.
    """

    def __init__(
        self,
        rig: Rig,
        plan: CapturePlan,
        grid: WavelengthGrid,
        model: Correspondence,
        radiance: NDArray[np.float32],
        std: NDArray[np.floating],
        pixels: Pixels,
        *,
        options: AdamOptions | None = None,
        device: str = "cpu",
    ) -> None:
        self.lines = require_single_lines(plan)
        self.rig, self.plan, self.grid, self.model = rig, plan, grid, model
        self.radiance, self.saturated, self.pixels = radiance, ~np.isfinite(std), pixels
        self.options, self.device = options or AdamOptions(), torch.device(device)

    def run(self, progress: Progress | None = None, threads: int = 2) -> SpectralMaps:
        """Fit all valid pixels. The result states no uncertainty: ``std`` and ``data_share`` are NaN."""
        progress = progress or NoProgress()
        out = SpectralMaps.empty(self.grid.count, self.pixels.valid.shape)
        flat = np.flatnonzero(self.pixels.valid)
        order, reached, columns = self._valid_order(flat)
        kappa = self._first_order_weight(flat, reached)
        first = self._nearest_intensities(flat, columns)
        reached = reached & torch.isfinite(first).all(0)
        colour = demosaic(np.nan_to_num(self.pixels.amplitude), self.rig.sensor.bayer).reshape(3, -1)[:, flat]

        def work(start: int, check: Check) -> None:
            part = slice(start, start + CHUNK)
            check()
            measured = self._measured(
                flat[part], order[part], columns[:, part], reached[:, part], kappa[part], first[..., part],
                torch.as_tensor(colour[:, part], dtype=torch.float32),
            )  # fmt: skip
            self._store(out, flat[part], order[part], reached[:, part], self.fit(measured))

        starts = range(0, flat.size, CHUNK)
        with one_kernel_thread():
            work_through(work, starts, threads, "spectra", progress)
        return out

    def fit(self, measured: LineData) -> Tensor:
        """Spectra (bands, pixels) that minimise the objective."""
        return fit(measured, self.options)

    def _valid_order(self, flat: NDArray[np.intp]) -> tuple[Tensor, Tensor, Tensor]:
        """Eq. (3): per pixel the first order that reaches more bands; which bands, and their columns."""
        index = torch.as_tensor(flat)
        depth = torch.as_tensor(self.pixels.depth_mm.ravel()[flat], dtype=torch.float32)
        width, height = self.plan.projector_size_px
        nm = self.grid.centres_nm
        footprints: list[Footprint] = [self.model.trace(index, depth, order, nm) for order in ORDERS]
        plus, minus = (
            seen.inside(width, height) & torch.as_tensor(sends_light(self.rig, order, nm))[:, None]
            for order, seen in zip(ORDERS, footprints, strict=True)
        )
        use_plus = plus.sum(0) >= minus.sum(0)
        return (
            torch.where(use_plus, 1, -1),
            torch.where(use_plus, plus, minus),
            torch.where(use_plus, footprints[0].columns, footprints[1].columns),
        )

    def _first_order_weight(self, flat: NDArray[np.intp], reached: Tensor) -> Tensor:
        """Kappa 1: the mask of completely reached pixels, Gaussian-blurred (section 7.1)."""
        complete = np.ones(self.pixels.valid.shape, np.float32)
        complete.ravel()[flat] = reached.all(0).numpy()
        return torch.as_tensor(blurred_mask(complete).ravel()[flat])

    def _nearest_intensities(self, flat: NDArray[np.intp], columns: Tensor) -> Tensor:
        """Colours (3, bands, pixels) of the frame whose line is nearest to each column; NaN if saturated."""
        height, width = self.pixels.valid.shape
        frame = self.lines.nearest(columns).clip(0, self.lines.lines - 1)
        out = torch.empty((3, *columns.shape))
        y, x = np.divmod(flat, width)
        for top in range(0, height, STRIP):
            here = np.flatnonzero((y >= top) & (y < top + STRIP))
            if here.size == 0:
                continue
            # Two more rows on either side, so that demosaicing sees its neighbours.
            first, last = max(top - 2, 0), min(top + STRIP + 2, height)
            block = np.where(self.saturated[:, first:last], np.nan, self.radiance[:, first:last])
            colours = demosaic(torch.as_tensor(block), self.rig.sensor.bayer)
            at = torch.as_tensor((y[here] - first) * width + x[here])
            samples = colours.reshape(len(block), 3, -1)
            for channel in range(3):
                out[channel][:, here] = samples[frame[:, here], channel, at]
        return out

    def _measured(
        self,
        flat: NDArray[np.intp],
        order: Tensor,
        columns: Tensor,
        reached: Tensor,
        kappa: Tensor,
        first: Tensor,
        zero: Tensor,
    ) -> LineData:
        shading = torch.as_tensor(self.pixels.shading.ravel()[flat], dtype=torch.float32)
        white = torch.zeros_like(first)
        for m in ORDERS:
            of_order = order == m
            if bool(of_order.any()):
                slope = self._slope(columns[:, of_order])
                white[..., of_order] = self._line_response(m, slope)[..., None]
        moments, _ = hat_moments(self.rig, 0, self.grid.centres_nm, self.grid.step_nm)
        zero_white = torch.as_tensor(moments.sum(1), dtype=torch.float32)
        unit, zero_unit = white.amax().clip(min=1e-12), zero_white.sum(1).amax().clip(min=1e-12)
        to_device = self.device
        return LineData(
            torch.where(reached, first / (shading * unit), 0.0).to(to_device),
            (white / unit).to(to_device),
            (zero / (shading * zero_unit)).to(to_device),
            (zero_white / zero_unit).to(to_device),
            reached.to(to_device),
            kappa.to(to_device),
        )

    def _slope(self, columns: Tensor) -> float:
        """Mean dispersion of some pixels, px per nm."""
        nm = self.grid.centres_nm
        return float((columns[-1] - columns[0]).abs().mean()) / float(nm[-1] - nm[0])

    def _line_response(self, order: int, slope: float) -> Tensor:
        """Signal of a white pixel from a line centred on each band's column, (3, bands), DN per ms."""
        response, half = self.rig.projector_response, self.lines.width_px / 2
        reach_nm = math.ceil((half + 4 * response.blur_px) / slope)
        offsets_nm = np.arange(-reach_nm, reach_nm + 0.5, 0.5)
        at = torch.as_tensor(offsets_nm * slope)
        spread = response.line_spread
        profile = (step_edge(at + half, spread) - step_edge(at - half, spread)).numpy()
        nm = (self.grid.centres_nm[:, None] + offsets_nm).ravel()
        density = chain_response(self.rig, order, nm).sum(1).reshape(3, self.grid.count, -1)
        return torch.as_tensor(density @ profile * 0.5, dtype=torch.float32)

    def _store(
        self, out: SpectralMaps, flat: NDArray[np.intp], order: Tensor, reached: Tensor, spectra: Tensor
    ) -> None:
        out.reflectance.reshape(self.grid.count, -1)[:, flat] = spectra.cpu().numpy()
        bits = torch.where(order == 1, int(Reach.PLUS_ONE), int(Reach.MINUS_ONE))
        reach = torch.where(reached, bits, int(Reach.ZERO_ONLY))
        out.reach.reshape(self.grid.count, -1)[:, flat] = reach.to(torch.uint8).numpy()


def objective(spectra: Tensor, measured: LineData, smoothness: float) -> Tensor:
    """Sum over pixels of the L1 terms and the smoothness of spectra (bands, pixels), all per band."""
    bands = spectra.shape[0]
    misfit = (measured.first_white * spectra - measured.first).abs().sum(0)
    first = (misfit * measured.reached).sum(0) / bands
    zero = (measured.zero_white @ spectra - measured.zero).abs().sum(0)
    rough = (spectra[1:] - spectra[:-1]).square().sum(0) / bands
    return (measured.kappa * first + (1 - measured.kappa) * zero + smoothness * rough).sum()


def fit(measured: LineData, options: AdamOptions) -> Tensor:
    """Spectra (bands, pixels) in 0..1 that minimise the objective from a grey start, by Adam."""
    free = torch.zeros_like(measured.first[0], requires_grad=True)
    adam = torch.optim.Adam([free], lr=options.learning_rate)
    for _ in range(options.steps):
        adam.zero_grad(set_to_none=True)
        objective(torch.sigmoid(free), measured, options.smoothness).backward()  # type: ignore[no-untyped-call]
        adam.step()
    return torch.sigmoid(free).detach()
