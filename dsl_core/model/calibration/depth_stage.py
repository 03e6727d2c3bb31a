"""Film and geometry from a plane on a stage, and how far to trust them."""

from __future__ import annotations

from typing import Literal

from dsl_core.model.base import Record
from dsl_core.model.calibration.chain import ChainCorrection, apply_chain
from dsl_core.model.calibration.lateral_colour import LateralColour
from dsl_core.model.geometry import GeometryCovariance, Lens, Pose
from dsl_core.model.rig import ColumnResidual, CorrespondenceGrid, Film, Rig


class StagePosition(Record):
    """The plane at one position of the stage.

    ``plane_rms_mm`` is the scatter of the points about it, ``column_rms_px`` the same in projector columns
    and ``column_limit_px`` what that may be (in older records what lenses and line profiles leave);
    ``step_error_mm`` is how far the plane stands from where the stage says, relative to the other positions,
    and ``step_limit_mm`` what that may be (in older records what a stage leaves, not a ruler).
    """

    position_mm: float
    tilt_deg: float
    distance_mm: float
    plane_rms_mm: float
    column_rms_px: float
    column_limit_px: float = 0.03
    step_error_mm: float
    step_std_mm: float
    step_limit_mm: float = 0.1

    @property
    def plane_limit_mm(self) -> float:
        """What the scatter may be in mm at this distance."""
        return self.column_limit_px * self.plane_rms_mm / max(self.column_rms_px, 1e-9)


class FilterSeen(Record):
    """First orders through one filter: effective wavelength, and how far they are from the fitted film.

    ``shift_px`` is the median over the image, one number a position; ``tiles`` counts those that were used.
    """

    filter_nm: float
    effective_nm: float
    measured: bool
    shift_px: tuple[float, ...]
    tiles: int


class HeldOutError(Record):
    """Root mean square error (px) of first-order columns that a fit never saw.

    ``grating_px`` is that of the film alone, ``hybrid_px`` with the smooth residual. The noise of the samples
    themselves, ``noise_px``, is part of both.
    """

    kept_out: str
    grating_px: float
    hybrid_px: float
    noise_px: float


class DepthStageCalibration(Record):
    """Refined lenses and pose, the film with its smooth residual, and what a diffuser says of the chain.

    ``geometry_covariance`` is that of the 24 parameters of lenses and pose (None where it was not known
    before, and the geometry is as it was); ``column_std_px`` and ``depth_std_mm`` are what it leaves open in
    columns of the zero order and in depth; ``geometry_pull`` is how far it moved, in its deviations before.
    ``lean_px`` is how far the mean of a line's light was from its median (None in older records): columns may
    be counted from either, and the geometry follows what is seen.
    ``bow_mm`` is by how much the target seems to bulge towards the camera over 300 mm, alike at all positions
    (None in older records).
    ``film_std`` are deviations by the film's fields, what the geometry leaves open included. ``scatter_px``
    is that of single samples of first orders. ``filter_index`` is the effective index of the filters, with
    its deviation, by how their light shifts with the angle of view; None where it does not;
    ``filter_index_before`` is what the bandpass calibration found.
    ``lateral_colour`` is that of both lenses, None where none is seen; red and blue light of a line are
    ``colours_apart_px`` columns from each other, with its deviation. ``frames`` counts the exposures.
    """

    schema_version: Literal[1] = 1
    camera: Lens
    projector: Lens
    pose: Pose
    geometry_covariance: GeometryCovariance | None = None
    column_std_px: float
    depth_std_mm: float
    geometry_pull: float
    lean_px: float | None = None
    bow_mm: float | None = None
    bow_std_mm: float = 0.0
    positions: tuple[StagePosition, ...]
    film: Film
    film_std: dict[str, float]
    scatter_px: float
    filter_index: tuple[float, float] | None = None
    filter_index_before: tuple[float, float] | None = None
    filters: tuple[FilterSeen, ...]
    lateral_colour: LateralColour | None = None
    colours_apart_px: tuple[float, float] | None = None
    residual: ColumnResidual
    held_out: tuple[HeldOutError, ...]
    correspondence: CorrespondenceGrid | None = None
    chain: ChainCorrection | None = None
    frames: int
    warnings: tuple[str, ...] = ()

    @property
    def held_out_px(self) -> float:
        """Error of the model with residual over everything that was left out, rms, px."""
        squares = [error.hybrid_px**2 for error in self.held_out]
        return float((sum(squares) / len(squares)) ** 0.5)


def apply_depth_stage(record: DepthStageCalibration, rig: Rig) -> Rig:
    """The rig with refined geometry, film, residual, data-driven grid and chain as far as they were found."""
    known = rig.model_copy(
        update={
            "camera": record.camera,
            "projector": record.projector,
            "pose": record.pose,
            "geometry_covariance": record.geometry_covariance,
            "fitted_lean_px": record.lean_px if record.geometry_covariance is not None else None,
            "column_std_px": record.column_std_px,
            "film": record.film,
            "residual": record.residual,
            "correspondence": record.correspondence,
            "lateral_colour": record.lateral_colour,
        }
    )
    return known if record.chain is None else apply_chain(record.chain, known)
