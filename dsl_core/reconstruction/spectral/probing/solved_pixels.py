"""Spectra of probed pixels by all that their samples receive, and what these leave of it."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from dsl_core.reconstruction.spectral.probing.pattern_light import PatternLight
from dsl_core.reconstruction.spectral.probing.probed_light import ProbedLight, ProbedScan
from dsl_core.reconstruction.spectral.probing.probed_pixels import Indices, samples_of
from dsl_core.reconstruction.spectral.solving.dense_solver import solve_dense
from dsl_core.reconstruction.spectral.solving.prior import roughness
from dsl_core.reconstruction.spectral.solving.solution import freedom
from dsl_core.solve import banded


@dataclass(frozen=True)
class SolvedPixels:
    """Probed pixels (n,) and their spectra, found by the samples (m,) of each, whose values are (m, k).

    ``samples`` (m,) are their flat indices, ``owner`` (m,) the pixel of each, ``shading`` (m,) its shading,
    ``rows`` (m, bands, k) the model for that and ``heavy`` the same, weighted; ``residual`` (m, k) is what
    spectra leave. ``nodes`` (n, bands) and ``mean`` (bands, n) are the spectra, ``information`` (n, bands,
    bands) what is known of them, with the prior; ``free`` (n, bands) are bands that are not held at a bound.
    """

    light: ProbedLight | PatternLight
    samples: Indices
    owner: Tensor
    shading: Tensor
    rows: Tensor
    heavy: Tensor
    residual: Tensor
    nodes: Tensor
    mean: Tensor
    information: Tensor
    free: Tensor

    def gather(self, values: Tensor) -> Tensor:
        """Sums over the samples of each pixel: (m, ...) -> (n, ...)."""
        into = values.new_zeros((len(self.nodes), *values.shape[1:]))
        return into.index_add_(0, self.owner, values)

    def give_way(self, asked: Tensor, part: slice = slice(None)) -> Tensor:
        """By how much nodes of some pixels change that are asked to (pixels, bands, q) by the data.

        Those that are held at a bound do not: with them, spectra of dark surfaces would take up more than
        they can, and what is left would ask for changes of the model.
        """
        free = self.free[part].to(asked)
        information = self.information[part] * free[:, None] * free[..., None] + torch.diag_embed(1 - free)
        given: Tensor = torch.linalg.solve(information, asked * free[..., None])
        return given

    @property
    def freedom(self) -> Tensor:
        """Degrees of freedom (n,) of the frames of each pixel."""
        return freedom(self.gather((self.light.weight > 0).double().sum(1)))

    @property
    def chi_square(self) -> Tensor:
        """Reduced chi-square (n,) of the frames of each pixel."""
        return self.gather((self.light.weight * self.residual**2).sum(1)) / self.freedom


def solve_pixels(scan: ProbedScan, targets: Indices) -> SolvedPixels:
    """Spectra of some pixels (flat indices) by all that their samples receive, in double precision."""
    shape = scan.pixels.valid.shape
    samples, owner = samples_of(targets, shape, scan.model.rig.sensor.bayer)
    kind = ProbedLight if scan.model.single else PatternLight
    light, owners = kind(scan, samples), torch.as_tensor(owner)
    lit = torch.as_tensor(scan.pixels.shading.ravel()[targets], dtype=torch.float64)[owners]
    rows = light.rows * lit[:, None, None]
    heavy = rows * light.weight[:, None]

    def gather(values: Tensor) -> Tensor:
        return values.new_zeros((len(targets), *values.shape[1:])).index_add_(0, owners, values)

    matrix, right = gather(heavy @ rows.mT), gather((heavy @ light.values[..., None])[..., 0])
    found = solve_dense(matrix, right, scan.prior)
    nodes = found.nodes.T.contiguous()
    prior = banded.to_dense(roughness(nodes.shape[1], matrix)[..., None])[0] * found.tau[:, None, None] ** -2
    prior = prior + torch.eye(nodes.shape[1]).to(matrix) * scan.prior.level_std**-2
    residual = light.values - (nodes[owners][:, None] @ rows)[:, 0]
    free = ~found.at_bound.T
    information = matrix + prior
    return SolvedPixels(
        light, samples, owners, lit, rows, heavy, residual, nodes, found.mean, information, free
    )  # fmt: skip
