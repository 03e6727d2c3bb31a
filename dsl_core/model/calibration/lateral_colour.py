"""Lateral colour: lenses that magnify light of different wavelengths differently about their axes."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.base import Record

#: Shares of red, green and blue samples in a colour mosaic.
SHARES = (0.25, 0.5, 0.25)
Nm = TypeVar("Nm", float, NDArray[np.float64])


class LateralColour(Record):
    """Magnifications relative to those that lenses and pose were calibrated with.

    ``camera`` is that of each colour of the mosaic (red, green, blue). The projector's rises by
    ``projector_per_nm`` with the wavelength; ``white_nm`` is the mean wavelength of white light as each
    colour of the camera sees it. Both vanish in the mean over the mosaic, by which lenses are calibrated.
    """

    camera: tuple[float, float, float]
    projector_per_nm: float
    white_nm: tuple[float, float, float]

    @property
    def zero_nm(self) -> float:
        """The wavelength at which the projector's lens is as calibrated."""
        return float(np.dot(SHARES, self.white_nm))

    def projector(self, nm: Nm) -> Nm:
        """Relative magnification of the projector at a wavelength."""
        return (nm - self.zero_nm) * self.projector_per_nm

    @property
    def projector_of_white(self) -> tuple[float, float, float]:
        """Relative magnification of white light of the projector as each colour of the camera sees it."""
        red, green, blue = (self.projector(nm) for nm in self.white_nm)
        return red, green, blue
