"""Random pixels of the published rig as the spectral solver sees them: its own normal equations.

Place, depth, spectrum, brightness, noise and the weight of the zero-order colour are drawn; the lines' light
follows from bands of the solver's own width, so that only arithmetic and prior separate answer and truth.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from dsl_core.model.plan import CapturePlan
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.optics.correspondence import GratingModel
from dsl_core.optics.lines.equations import LineEquations
from dsl_core.optics.lines.line_set import LineSet
from dsl_core.optics.spectra import ORDERS, Bands
from dsl_core.simulation.published_rig import published_rig
from dsl_core.solve.banded import factorise, multiply
from tests.stability.double_double import Floats
from tests.stability.exact_solution import System

Equations = tuple[Tensor, Tensor, Tensor]


def random_equations(count: int, seed: int, dtype: torch.dtype) -> Equations:
    """Data (bandwidth + 1, bands, pixels), right side and rows as `solve_spectra` takes them."""
    rig, plan = published_rig(), CapturePlan()
    bands, lines = Bands.of(rig, WavelengthGrid()), LineSet.of(plan)
    assert lines is not None
    rng = np.random.default_rng(seed)
    pixels = torch.as_tensor(rng.integers(0, rig.camera.width_px * rig.camera.height_px, count))
    depth = torch.as_tensor(rng.uniform(500, 1000, count)).to(dtype)
    # From the noise of the reference plan, with the model's error of a percent, to a thousandfold.
    noise = np.geomspace(6e-3, 6, 64)[rng.integers(0, 64, count)]
    weight_of_noise = torch.as_tensor(1 / (noise**2 + (0.01 * rng.uniform(0, 1, (3, 1, count))) ** 2))
    weight = weight_of_noise.expand(-1, plan.spectral_count, -1).to(dtype)
    data = torch.zeros((0, 0, 0))
    for colour in range(3):
        which = torch.full((count,), colour)
        system = LineEquations(bands, lines, rig.projector_response.blur_px, which, depth)
        nothing = torch.zeros((plan.spectral_count, count), dtype=dtype)
        for order in ORDERS:
            footprint = GratingModel(rig).trace(pixels, depth, order, bands.centroids_nm[order])
            inside = footprint.inside(*plan.projector_size_px)
            system.add(order, footprint.columns, inside, nothing, weight[colour], 0)
        data = data + system.positive_matrix() if colour else system.positive_matrix()
    truth = torch.as_tensor(_spectra(bands.centres_nm, count, rng)).to(dtype)
    right = multiply(data, truth) + _noise(data, rng).to(dtype)
    moments = torch.as_tensor(bands.moments[0].sum(1).T).to(dtype)
    kappa = torch.as_tensor(rng.uniform(0, 1, count) * (rng.random(count) < 0.5)).to(dtype)
    rows = moments[:, :, None] / moments.sum(0)[:, None] * (50 * kappa)
    right = right + (rows * (rows * truth[:, None]).sum(0)).sum(1)
    return data, right, rows


def _noise(data: Tensor, rng: np.random.Generator) -> Tensor:
    """What noise of weighted values makes of a right side: its covariance is the data's own matrix."""
    safe = data.double().clone()
    safe[0] += 1e-9 * safe[0].amax(0) + 1e-300
    factor = factorise(safe)
    z = torch.as_tensor(rng.standard_normal(data.shape[1:])) * factor.diagonal.sqrt()
    out = z.clone()
    for o in range(1, len(data)):
        out[o:] += factor.lower[o - 1, : len(z) - o] * z[: len(z) - o]
    return out


def _spectra(nm: Floats, count: int, rng: np.random.Generator) -> Floats:
    """Smooth spectra, some with a narrow line, some black, some beyond the bound; (bands, pixels)."""
    x = (nm - 545) / 115
    waves = rng.normal(0, 0.15, (4, count))
    smooth = 0.45 + sum(a * np.cos((i + 1) * x[:, None] + i) for i, a in enumerate(waves))
    centre, width = rng.uniform(430, 660, count), rng.uniform(3, 20, count)
    line = np.exp(-0.5 * ((nm[:, None] - centre) / width) ** 2) * (rng.random(count) < 0.3)
    return np.asarray((smooth.clip(0.0) + line) * rng.choice([0.0, 0.02, 1.0, 1.0, 1.0, 1.6], count))


def widened(equations: Equations) -> System:
    """The same numbers for the exact reference."""
    data, right, rows = (part.double().numpy() for part in equations)
    return System(data, right, rows)
