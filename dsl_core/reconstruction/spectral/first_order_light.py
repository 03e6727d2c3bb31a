"""What some pixels receive at each wavelength through each first order, before any spectrum is solved for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from dsl_core.optics.correspondence import Correspondence
from dsl_core.optics.lines.line_set import LineSet
from dsl_core.optics.spectra import ORDERS
from dsl_core.reconstruction.merge import PickedLines
from dsl_core.reconstruction.spectral.solving.tile_frames import Pixels

Floats = NDArray[np.float64]
#: Wavelengths at which light is looked for, nm.
NM = np.linspace(430.0, 660.0, 24)


@dataclass(frozen=True)
class FirstOrderLight:
    """Light of the line that is nearest to each wavelength, at pixels (n,) of a raw mosaic.

    ``site`` (n,) is where each is in the tile of the mosaic, 0 to 3; ``radiance`` and ``variance`` are those
    of each order, (wavelengths of `NM`, n), in DN per ms, NaN where no line shows that wavelength.
    """

    site: NDArray[np.intp]
    radiance: Mapping[int, Floats]
    variance: Mapping[int, Floats]

    @classmethod
    def of(
        cls, lines: LineSet, model: Correspondence, picked: PickedLines, pixels: Pixels
    ) -> FirstOrderLight:
        """That of the valid ones of picked pixels."""
        width = pixels.valid.shape[1]
        known = pixels.valid.ravel()[picked.pixels]
        index = picked.pixels[known]
        places = np.flatnonzero(known)
        depth_mm = torch.as_tensor(pixels.depth_mm.ravel()[index], dtype=torch.float64)
        radiance, variance = {}, {}
        for order in ORDERS:
            line = lines.nearest(model.trace(torch.as_tensor(index), depth_mm, order, NM).columns)
            frame, shown = lines.frame(line).numpy(), lines.exists(line).numpy()
            light = picked.radiance[frame, places] - pixels.offset.ravel()[index]
            std = picked.std[frame, places].astype(np.float64)
            radiance[order] = np.where(shown, light.astype(np.float64), np.nan)
            variance[order] = np.where(shown, std**2, np.nan)
        return cls(index // width % 2 * 2 + index % width % 2, radiance, variance)
