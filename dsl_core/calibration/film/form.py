"""The numbers of a film in a row, as fits need them, and how steep its shape is; without torch."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.geometry import Lens
from dsl_core.model.rig import SHAPE_POWERS, Film, FilmShape, Rig

Floats = NDArray[np.float64]

#: The fields of a film that are fitted.
FIELDS = ("tilt_x_deg", "tilt_y_deg", "roll_deg", "bend_per_mm", "lines_per_mm", "distance_mm")
#: How steep each power of a shape is beforehand, in the corner of the projector's frame (one deviation).
SLOPE_STD = 0.05


@dataclass(frozen=True)
class FilmForm:
    """A film's numbers in a row, and the part of it that the projector's frame is on.

    ``half_mm`` is half the size of that part across and along the lines, ``middle_mm`` its middle along them.
    Without ``shaped`` films are cylinders.
    """

    half_mm: tuple[float, float]
    middle_mm: float
    shaped: bool

    @classmethod
    def of(cls, lens: Lens, film: Film, shaped: bool) -> FilmForm:
        """That of a film in front of a projector's lens."""
        far, known = film.distance_mm, film.shape
        middle_mm = far * ((lens.height_px - 1) / 2 - lens.cy_px) / lens.fy_px
        return cls(
            (0.5 * far * lens.width_px / lens.fx_px, 0.5 * far * lens.height_px / lens.fy_px),
            middle_mm if known is None else known.middle_mm,
            shaped,
        )

    @property
    def std(self) -> Floats:
        """Deviations of the factors of the shape beforehand; none without one."""
        if not self.shaped:
            return np.empty(0)
        return np.asarray(SLOPE_STD / _slopes(*np.array(self.half_mm)).max(0))

    def steepest(self, film: Film) -> float:
        """Largest slope of a film's shape on that part."""
        if film.shape is None:
            return 0.0
        u, v = np.meshgrid(*(np.linspace(-half, half, 9) for half in self.half_mm))
        return float(np.abs(np.tensordot(np.array(film.shape.factors), _slopes(u, v), (0, 1))).max())

    def values(self, film: Film) -> Floats:
        """The fields, and with a shape its factors."""
        factors = (FilmShape() if film.shape is None else film.shape).factors if self.shaped else ()
        return np.array([*(getattr(film, name) for name in FIELDS), *factors])

    def rig(self, rig: Rig, values: Floats) -> Rig:
        """The rig with such a film."""
        shape = None
        if self.shaped:
            shape = FilmShape(middle_mm=self.middle_mm, factors=tuple(values[len(FIELDS) :].tolist()))
        fields = dict(zip(FIELDS, values[: len(FIELDS)].tolist(), strict=True))
        return rig.model_copy(update={"film": rig.film.model_copy(update=fields | {"shape": shape})})


def _slopes(u: Floats, v: Floats) -> Floats:
    """Slopes across and along the lines of each of `SHAPE_POWERS` at places, (2, powers, ...)."""
    across = [i * u ** max(i - 1, 0) * v**j for i, j in SHAPE_POWERS]
    along = [j * u**i * v ** max(j - 1, 0) for i, j in SHAPE_POWERS]
    return np.array([across, along])
