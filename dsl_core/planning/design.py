"""Pattern sets by design: the lines and their order that a rig's own model expects the least error of.

Every candidate is judged by the reconstruction's own estimators at virtual pixels (see `virtual`): noise of
the bracket, saturation, columns and prior included. The pixels lie where first orders reach all bands, as
elsewhere the prior decides whatever is shown; the spectra are random, from calm to narrow. The error of a
set is the geometric mean of its errors over the spectra, so that none outweighs the others.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import cast

import numpy as np
import torch
from numpy.typing import NDArray

from dsl_core.errors import PlanError
from dsl_core.model.plan import CapturePlan, Columns, LineComb, SpectralSet
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.optics.correspondence import correspondence
from dsl_core.planning.mixed_lines import MixedLines
from dsl_core.planning.references import FINE_NM
from dsl_core.planning.views import View, plane_view
from dsl_core.planning.virtual import VirtualPixels
from dsl_core.progress import NoProgress, Progress
from dsl_core.solve.threads import one_kernel_thread

Floats = NDArray[np.float64]
#: Where the pixels lie: depths as shares of the rig's range, and pixels across and down.
DEPTHS, PLACES = (0.3, 0.8), (9, 2)
#: Fewer pixels with all bands are not enough; then those without count as well.
LEAST_PLACES = 4
#: Sizes of cosines over wavelength of calm and of lively spectra, and how many are drawn of each.
CALM = (1.3, 1.2, 0.8, 0.4, 0.15, 0.06, 0.02, 0.01)
LIVELY = (1.5, 1.4, 1.1, 0.7, 0.4, 0.2, 0.1, 0.05)
DRAWN, SPECTRA_SEED = (10, 7), 5
#: Centres and deviation of narrow spectra, nm.
PEAKS_NM, PEAK_STD_NM = (462.0, 538.0, 612.0), 6.0
#: Runs of slots, as shares of the columns that a first order's spectrum covers, and widths of lines (px).
RUNS, WIDTHS_PX = (0.5, 0.62, 0.75), (5, 6, 7, 9, 11)
SPECTRUM_NM = (430.0, 690.0)
#: How many kinds of lines are tried in further orders.
FINALISTS = 3


@dataclass(frozen=True)
class Design:
    """The set chosen, and the expected errors of it and of the best comb of as many frames."""

    lines: MixedLines
    levels: NDArray[np.uint8]
    error: float
    comb: LineComb
    comb_error: float

    @property
    def columns(self) -> Columns:
        """The set as it stands in a plan."""
        return columns_of(self.levels)


def columns_of(levels: NDArray[np.uint8]) -> Columns:
    """Drive levels (frames, width, 3), 0 to 255, as a pattern set."""
    shares = np.round(levels / 255.0, 5)
    return Columns(levels=tuple(tuple(tuple(rgb) for rgb in frame) for frame in shares.tolist()))


class Judge:
    """Expected errors of pattern sets on a rig, with the settings of a plan."""

    def __init__(self, rig: Rig, plan: CapturePlan, grid: WavelengthGrid | None = None) -> None:
        # Without the noise of the projector's black, which favours wide lines: on the twin these find columns
        # so coarsely that they lose more than they gain.
        response = rig.projector_response.model_copy(update={"black_fraction": 0.0})
        self.rig = rig.model_copy(update={"projector_response": response})
        self.grid = grid or WavelengthGrid()
        self.plan = plan.model_copy(
            update={
                "camera_size_px": (rig.camera.width_px, rig.camera.height_px),
                "projector_size_px": (rig.projector.width_px, rig.projector.height_px),
            }
        )
        self.spectra = training_spectra()
        self.view = self._places()

    def _places(self) -> View:
        low, high = self.rig.depth_range_mm
        views = [plane_view(self.rig, low + share * (high - low), PLACES) for share in DEPTHS]
        some = [_part(view, self._complete(view)) for view in views]
        if sum(len(view.pixels) for view in some) >= LEAST_PLACES:
            views = some
        first = views[0]
        for view in views[1:]:
            first = replace(
                first,
                pixels=np.concatenate([first.pixels, view.pixels]),
                depth_mm=np.concatenate([first.depth_mm, view.depth_mm]),
                shading=np.concatenate([first.shading, view.shading]),
                incidence_tan=np.concatenate([first.incidence_tan, view.incidence_tan]),
            )
        return first

    def _complete(self, view: View) -> NDArray[np.bool_]:
        """Whether first orders reach every band at the samples of a view."""
        nm, lens = self.grid.centres_nm, self.rig.projector
        pixels, depth = torch.as_tensor(view.pixels), torch.as_tensor(view.depth_mm)
        trace = correspondence(self.rig).trace
        reached = [trace(pixels, depth, m, nm).inside(lens.width_px, lens.height_px) for m in (1, -1)]
        return np.asarray((reached[0] | reached[1]).all(0).numpy())

    def error(self, spectral: SpectralSet) -> float:
        """Expected error of a set, in reflectance: geometric mean over the spectra."""
        plan = self.plan.model_copy(update={"spectral": spectral})
        with one_kernel_thread():
            # All of the granted model error: sets that rely on a perfect model do worse on narrow spectra.
            pixels = VirtualPixels(self.rig, plan, self.grid, self.view, scatter=1.0)
            at = pixels.bands.centres_nm
            rows = np.stack([np.interp(at, FINE_NM, row) for row in self.spectra])
            nodes = np.tile(rows, (len(self.view.pixels), 1, 1))
            found = pixels.run(nodes, *pixels.signals(torch.as_tensor(nodes, dtype=torch.float32)))
        squares = ((found.mean - found.truth) ** 2).mean((0, 1))
        return float(np.exp(0.5 * np.log(squares).mean()))


def design(
    rig: Rig,
    plan: CapturePlan,
    frames: int,
    *,
    grid: WavelengthGrid | None = None,
    orders: int = 24,
    progress: Progress | None = None,
) -> Design:
    """Search ``frames`` patterns for a rig and the settings of a plan; raises `PlanError`.

    Every kind of line is tried in one order, the best ones in ``orders`` of them. The answer depends on the
    rig, the settings and the numbers alone.
    """
    if not 8 <= frames <= 160:
        raise PlanError(f"A set of {frames} patterns cannot be designed; choose 8 to 160.")
    if orders < 1:
        raise PlanError(f"A design needs at least one order of its lines, not {orders}.")
    progress, judge = progress or NoProgress(), Judge(rig, plan, grid)
    kinds, combs = list(_kinds(rig, frames)), list(_combs(rig, frames))
    if not kinds:
        raise PlanError(f"No lines of {frames} patterns fit the projector of rig {rig.name!r}. Ask for more.")
    total = len(combs) + len(kinds) + FINALISTS * (orders - 1)
    count = iter(range(1, total + 1))

    def judged(sets: Iterable[LineComb | MixedLines]) -> list[tuple[float, LineComb | MixedLines]]:
        found = []
        for each in sets:
            found.append((judge.error(_spectral(each, rig)), each))
            progress.report("design", next(count), total)
        return sorted(found, key=lambda pair: pair[0])

    comb_error, comb = judged(combs)[0]
    first = judged(kinds)
    more = [
        replace(cast(MixedLines, kind), seed=seed)
        for _, kind in first[:FINALISTS]
        for seed in range(2, orders + 1)
    ]
    error, lines = min([first[0], *judged(more)], key=lambda pair: pair[0])
    chosen = cast(MixedLines, lines)
    return Design(chosen, chosen.levels(rig.projector.width_px), error, cast(LineComb, comb), comb_error)


def training_spectra() -> Floats:
    """Reflectances on `FINE_NM` that designs are judged with, (spectra, wavelengths): 0.02 to 0.95."""
    random = np.random.Generator(np.random.PCG64(SPECTRA_SEED))
    x = (FINE_NM - FINE_NM[0]) / (FINE_NM[-1] - FINE_NM[0])
    waves = np.stack([np.cos(np.pi * k * x) for k in range(len(CALM))])
    rows = [0.8 * np.exp(-0.5 * ((FINE_NM - centre) / PEAK_STD_NM) ** 2) for centre in PEAKS_NM]
    for size, count in zip((CALM, LIVELY), DRAWN, strict=True):
        weights = random.standard_normal((count, len(size))) * size
        rows += list(0.02 + 0.93 / (1 + np.exp(0.4 - weights @ waves)))
    return np.stack(rows)


def _part(view: View, chosen: NDArray[np.bool_]) -> View:
    return replace(
        view,
        pixels=view.pixels[chosen],
        depth_mm=view.depth_mm[chosen],
        shading=view.shading[chosen],
        incidence_tan=view.incidence_tan[chosen],
    )


def _spectral(each: LineComb | MixedLines, rig: Rig) -> SpectralSet:
    return each if isinstance(each, LineComb) else columns_of(each.levels(rig.projector.width_px))


def _steps(rig: Rig, frames: int) -> list[int]:
    """Steps of lines (px), at least one: runs as long as a part of a first order's spectrum."""
    pixel = torch.tensor([int(rig.camera.cy_px) * rig.camera.width_px + int(rig.camera.cx_px)])
    depth = torch.tensor([sum(rig.depth_range_mm) / 2], dtype=torch.float64)
    columns = correspondence(rig).trace(pixel, depth, 1, np.array(SPECTRUM_NM)).columns
    span = abs(float(columns[1, 0] - columns[0, 0]))
    return sorted({max(round(share * span / frames), 1) for share in RUNS})


def _kinds(rig: Rig, frames: int) -> Iterator[MixedLines]:
    for step in _steps(rig, frames):
        for width in WIDTHS_PX:
            lines = MixedLines(frames, width, step, 1)
            if step < width:
                try:
                    lines.order(3 * frames)
                except PlanError:
                    continue
                yield lines


def _combs(rig: Rig, frames: int) -> Iterator[LineComb]:
    """Combs of as many frames, in the steps of mixed lines."""
    for step in _steps(rig, frames):
        for width in WIDTHS_PX:
            if step < width < step * frames:
                yield LineComb(width_px=width, step_px=step, period_px=step * frames)
