"""What is expected of a plan's scan."""

from __future__ import annotations

from dsl_core.model.base import Record


class Prediction(Record):
    """Expected figures of a plan; what its scan is expected to reach.

    ``pixel_*`` are of single pixels, the others of patch means. ``fwhm_nm`` is how wide a 10 nm filter
    looks. ``coverage`` is the share of the picture that gets a depth, ``decided`` the share of bands that
    data decide. ``seconds`` is latency and exposures, ``raw_bytes`` before compression. ``depth_std_mm`` is
    without the calibration's share.
    """

    frames: int
    spectral_frames: int
    seconds: float
    raw_bytes: int
    computing_s: float
    rmse: float
    pixel_rmse: float
    angle_rad: float
    pixel_angle_rad: float
    delta_e: float
    fwhm_nm: float | None
    depth_std_mm: float
    coverage: float
    decided: float
