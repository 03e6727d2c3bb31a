"""Lenses and poses."""

from __future__ import annotations

from typing import Annotated, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from dsl_core.model.base import Record

Row3 = tuple[float, float, float]
#: Row by row, of the 24 parameters of lenses and pose.
GeometryCovariance = Annotated[tuple[float, ...], Field(min_length=24**2, max_length=24**2)]


class Lens(Record):
    """A pinhole with the five-coefficient distortion of OpenCV (k1, k2, p1, p2, k3), in pixels."""

    width_px: int = Field(gt=0)
    height_px: int = Field(gt=0)
    fx_px: float = Field(gt=0)
    fy_px: float = Field(gt=0)
    cx_px: float
    cy_px: float
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)

    @property
    def matrix(self) -> NDArray[np.float64]:
        """Camera matrix, shape (3, 3), pixels."""
        return np.array([[self.fx_px, 0, self.cx_px], [0, self.fy_px, self.cy_px], [0, 0, 1]], float)

    def resized(self, width_px: int, height_px: int) -> Lens:
        """The same optics seen by a sensor with another number of pixels over the same area."""
        sx, sy = width_px / self.width_px, height_px / self.height_px
        return self.model_copy(
            update={
                "width_px": width_px,
                "height_px": height_px,
                "fx_px": self.fx_px * sx,
                "fy_px": self.fy_px * sy,
                "cx_px": (self.cx_px + 0.5) * sx - 0.5,
                "cy_px": (self.cy_px + 0.5) * sy - 0.5,
            }
        )


class Pose(Record):
    """A rigid motion from camera to projector coordinates, ``x_p = R x_c + t`` (mm)."""

    rotation: tuple[Row3, Row3, Row3]
    translation_mm: Row3

    @model_validator(mode="after")
    def _check(self) -> Self:
        r = np.array(self.rotation)
        if np.abs(r @ r.T - np.eye(3)).max() > 1e-3 or np.linalg.det(r) < 0:
            raise ValueError("the rotation of a pose must be orthonormal and right-handed")
        return self

    @property
    def matrix(self) -> NDArray[np.float64]:
        """Rotation, shape (3, 3)."""
        return np.array(self.rotation, float)

    @property
    def vector_mm(self) -> NDArray[np.float64]:
        """Translation, shape (3,), mm."""
        return np.array(self.translation_mm, float)

    @property
    def projector_centre_mm(self) -> NDArray[np.float64]:
        """The projector's centre in camera coordinates, shape (3,), mm."""
        return -self.matrix.T @ self.vector_mm
