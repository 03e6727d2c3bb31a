"""What is expected of a pattern set: its error at virtual pixels of a rig, for spectra drawn at random.

Every set is judged by the reconstruction's own estimators at virtual pixels (see `virtual`): noise of the
bracket, saturation, columns and prior included. The pixels are where first orders reach all bands, as
elsewhere the prior decides whatever is shown; the spectra are random, from calm to narrow. The error of a
set is the geometric mean of its errors over the spectra, so that none outweighs the others.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch
from numpy.typing import NDArray

from dsl_core.model.plan import CapturePlan, SpectralSet
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.optics.correspondence import correspondence
from dsl_core.optics.lines.reach import sends_light
from dsl_core.planning.references import FINE_NM
from dsl_core.planning.samples import SamplePixels, plane_samples
from dsl_core.planning.virtual import VirtualPixels
from dsl_core.solve.threads import one_kernel_thread

Floats = NDArray[np.float64]
#: Where the pixels are: depths as shares of the rig's range, and pixels across and down.
DEPTHS, PLACES = (0.3, 0.8), (9, 2)
#: Fewer pixels with all bands are not enough; then those without count as well.
LEAST_PLACES = 4
#: Sizes of cosines over wavelength of calm and of lively spectra, and how many are drawn of each.
CALM = (1.3, 1.2, 0.8, 0.4, 0.15, 0.06, 0.02, 0.01)
LIVELY = (1.5, 1.4, 1.1, 0.7, 0.4, 0.2, 0.1, 0.05)
DRAWN, SPECTRA_SEED = (10, 7), 5
#: Centres and deviation of narrow spectra, nm.
PEAKS_NM, PEAK_STD_NM = (462.0, 538.0, 612.0), 6.0


class Judge:
    """Expected errors of pattern sets on a rig, with the settings of a plan."""

    def __init__(self, rig: Rig, plan: CapturePlan, grid: WavelengthGrid | None = None) -> None:
        # Without the noise of the projector's black, which favours wide lines: on the twin these find columns
        # so coarsely that they lose more than they gain.
        response = rig.projector_response.model_copy(update={"black_fraction": 0.0})
        self.rig = rig.model_copy(update={"projector_response": response})
        self.grid = grid or WavelengthGrid()
        self.plan = plan.sized(rig.camera, rig.projector)
        self.spectra = training_spectra()
        self.view = self._places()

    def _places(self) -> SamplePixels:
        low, high = self.rig.depth_range_mm
        views = [plane_samples(self.rig, low + share * (high - low), PLACES) for share in DEPTHS]
        some = [view.part(self._complete(view)) for view in views]
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

    def _complete(self, view: SamplePixels) -> NDArray[np.bool_]:
        """Whether first orders reach every band at the samples of a view."""
        nm, lens = self.grid.centres_nm, self.rig.projector
        pixels, depth = torch.as_tensor(view.pixels), torch.as_tensor(view.depth_mm)
        trace = correspondence(self.rig).trace
        reached = [
            trace(pixels, depth, m, nm).inside(lens.width_px, lens.height_px)
            & torch.as_tensor(sends_light(self.rig, m, nm))[:, None]
            for m in (1, -1)
        ]
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
