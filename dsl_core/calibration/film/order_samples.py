"""Columns of first orders on known planes, in one table, and those that a rig's grating equation gives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from dsl_core.calibration.film.order_columns import TileColumns
from dsl_core.errors import CalibrationError
from dsl_core.model.rig import Rig
from dsl_core.optics.correspondence import GratingModel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class OrderSamples:
    """Columns of first orders in one table, each entry of shape (samples,).

    ``position`` and ``filter`` are indices into a recipe's lists, ``pixel`` flat indices into the picture.
    """

    position: Ints
    filter: Ints
    order: Ints
    wavelength_nm: Floats
    tile: Ints
    pixel: Ints
    depth_mm: Floats
    column_px: Floats
    std_px: Floats

    @classmethod
    def of(cls, parts: Sequence[tuple[int, int, TileColumns]]) -> OrderSamples:
        """One table of (position, filter, shifts); raises `CalibrationError` when there are none."""
        if not parts:
            raise CalibrationError("No first orders were captured. Capture the lines through filters first.")
        sizes = [len(shifts) for _, _, shifts in parts]

        def numbers(values: list[int]) -> Ints:
            return np.repeat(np.array(values, np.int64), sizes)

        return cls(
            position=numbers([position for position, _, _ in parts]),
            filter=numbers([name for _, name, _ in parts]),
            order=numbers([shifts.order for _, _, shifts in parts]),
            wavelength_nm=np.repeat([shifts.wavelength_nm for _, _, shifts in parts], sizes),
            tile=np.concatenate([shifts.tiles for _, _, shifts in parts]),
            pixel=np.concatenate([shifts.pixels for _, _, shifts in parts]),
            depth_mm=np.concatenate([shifts.depth_mm for _, _, shifts in parts]),
            column_px=np.concatenate([shifts.column_px for _, _, shifts in parts]),
            std_px=np.concatenate([shifts.std_px for _, _, shifts in parts]),
        )

    def __len__(self) -> int:
        return len(self.column_px)

    def only(self, keep: NDArray[np.bool_]) -> OrderSamples:
        """The samples where ``keep`` is true."""
        return OrderSamples(*(getattr(self, name)[keep] for name in self.__dataclass_fields__))


def grating_columns(rig: Rig, samples: OrderSamples) -> Floats:
    """Columns (px) that the rig's grating equation gives for samples, shape (n,)."""
    pixels, depth = torch.as_tensor(samples.pixel), torch.as_tensor(samples.depth_mm)
    return GratingModel(rig).columns_of(pixels, depth, samples.order, samples.wavelength_nm).numpy()
