"""What is kept of the self-test's frames: means and spreads of one region, a row for each frame."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

#: Rounding to whole digital numbers adds this variance, DN^2.
ROUNDING_DN2 = 1 / 12


@dataclass(frozen=True)
class Readings:
    """Columns of n frames, for red, green, blue where there are three.

    A monochrome camera has three channels as well, of every third row each, which see the same.
    The region holds the well lit pixels of each channel, ``beside`` those outside the projected picture.
    ``pair_variance_dn2`` is half the variance of the difference to the frame before over the region, 0 where
    ``is_pair`` is not set; ``pair_covariance_dn2`` is half that difference's covariance with the one of the
    next pixel of the colour. ``second_variance_dn2`` is half the variance of the difference to the frame two
    before, 0 unless both are of one picture and exposure. ``gap_ms`` is the wait requested before the frame,
    ``since_show`` how many frames came before it since the picture changed. ``drive`` is the level (0..255)
    shown.
    """

    exposure_ms: Floats  # (n,)
    timestamp_s: Floats  # (n,)
    gap_ms: Floats  # (n,)
    since_show: NDArray[np.int64]  # (n,)
    drive: NDArray[np.int64]  # (n, 3)
    mean_dn: Floats  # (n, 3)
    beside_dn: Floats  # (n, 3)
    clipped: Floats  # (n, 3): share of the region at or near the end of the scale
    pair_variance_dn2: Floats  # (n, 3)
    pair_covariance_dn2: Floats  # (n, 3)
    second_variance_dn2: Floats  # (n, 3)
    is_pair: NDArray[np.bool_]  # (n,)

    def __len__(self) -> int:
        return len(self.exposure_ms)

    def __getitem__(self, chosen: NDArray[np.bool_] | NDArray[np.int64] | slice) -> Readings:
        """Some of the rows."""
        return Readings(**{each.name: getattr(self, each.name)[chosen] for each in fields(self)})

    @property
    def unclipped(self) -> NDArray[np.bool_]:
        """Where no more than stray pixels of the region clipped, (n, 3)."""
        return np.asarray(self.clipped < CLIPPED_SHARE)


#: A hot pixel may clip; a picture that clips does so in more pixels than this share.
CLIPPED_SHARE = 2e-4


@dataclass(frozen=True)
class RegionSizes:
    """Pixels inside and outside the projected picture by colour, and the number format of the camera.

    ``step_dn`` is the distance of neighbouring values, ``ends_dn`` the number that nearly all pixels of a
    picture that clips reach, None where no picture did. Channels that are no colours are ``is_monochrome``.
    """

    pixels: NDArray[np.int64]
    beside: NDArray[np.int64]
    bit_depth: int
    step_dn: int = 1
    ends_dn: int | None = None
    is_monochrome: bool = False

    @property
    def full_scale_dn(self) -> float:
        """The largest number the camera can say."""
        return float(2**self.bit_depth - 1)


def line_fit(design: Floats, values: Floats, std: Floats) -> tuple[Floats, Floats]:
    """Weighted least squares: coefficients, and their covariance, wider where residuals exceed ``std``."""
    rows = design / std[:, None]
    covariance = np.linalg.inv(rows.T @ rows)
    found = covariance @ rows.T @ (values / std)
    spare = len(values) - design.shape[1]
    chi2 = float((((values - design @ found) / std) ** 2).sum())
    return found, covariance * max(1.0, chi2 / spare if spare > 0 else 1.0)


def joined(*parts: Readings) -> Readings:
    """The rows of all, one after the other."""
    return Readings(
        **{
            each.name: np.concatenate([getattr(part, each.name) for part in parts])
            for each in fields(Readings)
        }
    )
