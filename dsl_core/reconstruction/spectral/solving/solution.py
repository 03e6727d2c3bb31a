"""Spectra that were solved for, in bands: node values, means and deviations, and how far data decide them."""

from __future__ import annotations

from dataclasses import dataclass, fields

import torch
from torch import Tensor

from dsl_core.solve.lane_kernels import MOST_SHARE

#: Deviation between centre and mean of a band, relative to the differences of its spectrum.
WITHIN_BAND = 1 / 36
#: Deviation against which local data are weighed in the data share.
LOCAL_STD = 0.1
#: Degrees of freedom that a spectrum takes from its data, roughly, in the reduced chi-square.
PARAMETERS = 25


def freedom(samples: Tensor) -> Tensor:
    """Degrees of freedom that are left of so many samples, as the compiled kernels count them; at least 1."""
    return (samples - (MOST_SHARE * samples).clip(max=PARAMETERS)).clip(min=1)


@dataclass(frozen=True)
class Spectra:
    """Node values, band means, deviation, data share, bound mask (bands, pixels); chosen tau (pixels,)."""

    nodes: Tensor
    mean: Tensor
    std: Tensor
    data_share: Tensor
    tau: Tensor
    at_bound: Tensor

    @classmethod
    def empty(cls, like: Tensor) -> Spectra:
        """Spectra to be filled by `put`, for (bands, pixels) as ``like``."""
        nodes, mean, std, share = (torch.empty_like(like) for _ in range(4))
        return cls(
            nodes, mean, std, share, torch.empty_like(like[0]), torch.zeros_like(like, dtype=torch.bool)
        )

    def to(self, dtype: torch.dtype) -> Spectra:
        """The same in another precision, masks as they are."""
        values = (getattr(self, field.name) for field in fields(self))
        return Spectra(*(v.to(dtype) if v.is_floating_point() else v for v in values))

    def put(self, where: Tensor, other: Spectra) -> None:
        """Replace the pixels of a mask (pixels,) by other spectra."""
        for field in fields(self):
            mine, others = getattr(self, field.name), getattr(other, field.name)
            mine[..., where] = others.to(mine.dtype)


def band_mean(nodes: Tensor) -> Tensor:
    """Mean reflectance over each band's triangle from node values (bands, ...): weights 1/6, 2/3, 1/6.

    Node values of a piecewise linear spectrum describe a narrow peak by overshooting; its means do not.
    """
    padded = torch.cat([nodes[:1], nodes, nodes[-1:]])
    return (padded[:-2] + 4 * padded[1:-1] + padded[2:]) / 6


def within_band(nodes: Tensor) -> Tensor:
    """How far the reflectance at a band's centre may be from its band mean, (bands, pixels).

    A share of the second difference, or of the fourth where that is larger; nothing for a smooth spectrum.
    The factor was found on lines of 2 to 15 nm under bands of 5 nm. Bands between straight lines cannot say
    how a line narrower than one is shared out among its neighbours; the fourth difference, unlike the second,
    tells such a line from a wider one and reaches these neighbours.
    """
    second = _second_difference(nodes)
    fourth = _second_difference(second)
    return torch.maximum(second.abs(), fourth.abs()) * WITHIN_BAND


def _second_difference(values: Tensor) -> Tensor:
    """Second differences along the bands, the outermost repeated."""
    inner = values[2:] - 2 * values[1:-1] + values[:-2]
    return torch.cat([inner[:1], inner, inner[-1:]])


def data_share(data: Tensor) -> Tensor:
    """Share of a band's answer that local data decide against a prior of 0.1, (bands, pixels).

    The data's information on a common change of the bands within two of it, ``i / (i + 1 / 0.1^2)``.
    """
    bands = data.shape[1]
    local = data[0].clone()
    for o in range(1, min(3, data.shape[0])):
        local[: bands - o] += data[o, : bands - o]
        local[o:] += data[o, : bands - o]
    return share_of(local)


def share_of(local: Tensor) -> Tensor:
    """Share of an answer that the information of data decides; rounding below zero is none."""
    local = local.clip(min=0)
    return local / (local + LOCAL_STD**-2)
