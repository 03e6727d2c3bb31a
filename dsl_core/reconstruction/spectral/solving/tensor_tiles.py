"""Spectra of tiles by tensors: on a GPU, and in other precisions."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import torch
from torch import Tensor

from dsl_core.optics.colour_neighbours import ColourNeighbours, bayer_colours
from dsl_core.optics.correspondence import like
from dsl_core.optics.lines.equations import LineEquations
from dsl_core.optics.pixel_model import PixelModel, Traced
from dsl_core.reconstruction.spectral.solving.lane_solver import solve_spectra
from dsl_core.reconstruction.spectral.solving.prior import Prior
from dsl_core.reconstruction.spectral.solving.solution import Spectra, freedom
from dsl_core.reconstruction.spectral.solving.tile_frames import TileFrames
from dsl_core.solve.banded import multiply
from dsl_core.solve.many import Check

#: Pixels whose full matrices are solved at a time.
DENSE_PIXELS = 512


@dataclass(frozen=True)
class TensorTiles:
    """Solves the tiles of a scan; ``direct_error`` is that of the zero order, relative to it."""

    prior: Prior
    direct_error: float

    def solve(
        self,
        model: PixelModel,
        frames: TileFrames,
        near: TileFrames,
        traced: Traced,
        colour: tuple[Tensor, Tensor] | None,
        check: Check,
    ) -> tuple[Spectra, Tensor]:
        """Spectra and reduced chi-square of a tile from the samples ``near`` it, whose light was traced.

        ``colour`` is zero-order colour and roots of its weights, (3, pixels), where single lines need them.
        """
        if not model.single:
            return self._dense(model, frames, near, traced, check)
        shading = frames.known("shading")
        system, offset = self._samples(model, near, traced, check)
        gather = _gather(frames, near)
        matrix, right, square, samples = (
            gather.sum(values)
            for values in (system.positive_matrix(), system.right, system.square, system.samples)
        )
        scaled = right * shading
        rows = None if colour is None else _colour_rows(model, *colour, shading, scaled)
        check()
        spectra = solve_spectra(matrix * shading**2, scaled, rows, self.prior, check)
        if offset is not None:
            spectra = with_offset(spectra, matrix * shading**2, gather.sum(offset) * shading**2, self.prior)
        radiance = spectra.nodes * shading
        explained = (radiance * (2 * right - multiply(matrix, radiance))).sum(0)
        return spectra, (square - explained) / freedom(samples)

    def _samples(
        self, model: PixelModel, frames: TileFrames, traced: Traced, check: Check
    ) -> tuple[LineEquations, Tensor | None]:
        """Equations of the pixels' own colours alone, and the variance that offsets give their right side."""
        variance = frames.known("offset_std") ** 2
        colour = torch.as_tensor(bayer_colours(frames.bayer, *frames.place()), device=frames.like.device)
        system = model.line_equations(colour, variance, bool(variance.any()))
        for order, footprint in traced.orders.items():
            inside = model.inside(footprint)
            lit = model.frames(footprint.columns, inside)
            if lit and model.lines is not None:
                check()
                radiance, weight = frames.samples(lit, model.lines)
                width = model.width(footprint, inside)
                system.add(order, footprint.columns, inside, radiance, weight, lit.start, width)
        return system, None if system.offset is None else variance * system.offset**2

    def _dense(
        self, model: PixelModel, frames: TileFrames, near: TileFrames, traced: Traced, check: Check
    ) -> tuple[Spectra, Tensor]:
        """Spectra where patterns couple distant bands."""
        from dsl_core.reconstruction.spectral.solving.dense_solver import solve_dense

        parts: list[tuple[Tensor, ...]] = []
        samples = dense_samples(model, near, traced, self.direct_error)
        # Full matrices take long: a part of the pixels at a time, so that a cancel need not wait.
        for start in range(0, len(near.flat), DENSE_PIXELS):
            check()
            part = slice(start, start + DENSE_PIXELS)
            colour, radiance, weight, variance = (each[..., part] for each in samples)
            made = model.equations(traced.part(part), colour, radiance, weight, variance)
            parts.append((*made, (weight > 0).sum(0).to(radiance)))
        gather = _gather(frames, near)
        matrix, right, square, number = (gather.sum(torch.cat(each, -1)) for each in zip(*parts, strict=True))
        shading, left = frames.known("shading"), freedom(number)
        found, misfit = [], []
        for start in range(0, len(shading), DENSE_PIXELS):
            check()
            part = slice(start, start + DENSE_PIXELS)
            lit, own, side = shading[part], matrix[..., part].permute(2, 0, 1), right[:, part].T
            spectra = solve_dense(own * (lit**2)[:, None, None], side * lit[:, None], self.prior)
            found.append(spectra)
            nodes = (spectra.nodes * lit).T
            explained = (nodes * (2 * side - (own @ nodes[..., None])[..., 0])).sum(1)
            misfit.append((square[part] - explained) / left[part])
        return _joined(found), torch.cat(misfit)


def dense_samples(
    model: PixelModel, near: TileFrames, traced: Traced, direct_error: float
) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Own colours (samples,), radiance and weight (frames, samples), variance of offsets (samples,).

    ``direct_error`` is that of the zero order, relative to it, in frames that mix orders.
    """
    colour = torch.as_tensor(bayer_colours(near.bayer, *near.place()), device=near.like.device)
    radiance, weight = near.own()
    light = model.zero_light(near.known("shading"))
    direct = model.direct_light(light, traced.column_px, near.zero_order_colour()[0])
    direct = direct.gather(0, colour.expand(1, len(radiance), -1))[0]
    weight = 1 / (1 / weight + (direct_error * direct) ** 2)
    return colour, radiance, weight, near.known("offset_std") ** 2


def _gather(frames: TileFrames, near: TileFrames) -> ColourNeighbours:
    """Sums over the samples that belong to a tile's pixels."""
    return ColourNeighbours(frames.rows, frames.columns, near.place(), frames.place(), frames.shares())


def _colour_rows(model: PixelModel, colour: Tensor, root: Tensor, shading: Tensor, right: Tensor) -> Tensor:
    """Weighted zero-order equations (bands, 3, pixels), added to ``right``."""
    moments = like(model.bands.moments[0].sum(1).T, right)
    rows = moments[:, :, None] * (root * shading)
    right += torch.einsum("jcp,cp->jp", rows, colour * root)
    return rows


def with_offset(spectra: Spectra, matrix: Tensor, variance: Tensor, prior: Prior) -> Spectra:
    """Spectra less sure by unknown offsets that all frames of a sample share.

    ``variance`` (bands, pixels) is theirs in the right side. An offset looks like a grey that gives the same.
    """
    grey = multiply(matrix, torch.ones_like(spectra.std)) + prior.level_std**-2
    return replace(spectra, std=torch.hypot(spectra.std, variance.sqrt() / grey))


def _joined(parts: list[Spectra]) -> Spectra:
    """Spectra of some pixels after the other."""
    maps = ([getattr(part, field.name) for part in parts] for field in fields(Spectra))
    return Spectra(*(torch.cat(each, -1) for each in maps))
