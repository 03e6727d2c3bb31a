"""The columns that a flat target on a stage shows a camera, as a function of all that is uncertain.

Fitted numbers: the 24 of lenses and pose, whitened by their prior; the plane's slopes ``a, b`` and its
distance ``d`` at the first position; ``gain``, by which share more than along the camera axis the stage
moves the plane; and a step error for each position. The plane is ``(a x + b y + z) / sqrt(1 + a^2 + b^2) =
distance``; a step ``s`` of the stage along the axis moves it by ``s / sqrt(1 + a^2 + b^2)``.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.common.tiles import ColumnSamples
from dsl_core.calibration.geometry.bundle import CAMERA, PROJECTOR, SHARED, STEREO, rotation_of, vector_of
from dsl_core.calibration.geometry.solve import lens_of
from dsl_core.errors import CalibrationError
from dsl_core.model.calibration.geometry import GeometryCalibration
from dsl_core.model.figure import with_std
from dsl_core.model.geometry import Lens
from dsl_core.model.rig import Rig
from dsl_core.optics.pinhole import distort, rays_at
from dsl_core.optics.shading import Plane

Floats = NDArray[np.float64]

#: Places of the plane's numbers behind those of the geometry.
SLOPES, DISTANCE, GAIN, STEPS = slice(SHARED, SHARED + 2), SHARED + 2, SHARED + 3, SHARED + 4
#: Place of the column of the projector's principal point.
ZERO = PROJECTOR.start + 2
#: Planes of the stage that fit no parallel ones are at another angle from so many degrees on.
TURNED_DEG = 1.0
#: A stage askew to the camera axis by 0.8 degrees moves a plane by this share too little.
GAIN_STD = 1e-4
#: Half of the width over which a bulge is stated.
BOW_RADIUS_MM = 150.0
#: Tiles a position needs.
MIN_TILES = 30
#: What a stage may be off (mm) before it is taken as wrong, and by how much its scale; what its steps may be
#: off in the end; and in deviations that are stated for it, such as those of a ruler, the larger.
MAX_STEP_ERROR_MM, MAX_SCALE_ERROR, MAX_STEP_MM, STAGE_SIGMAS = 0.3, 0.02, 0.1, 3.0
#: What a board leaves open of the scale.
UNSURE_SCALE = 0.002
#: How far columns may scatter about a plane: what models of lenses and of line profiles leave (px), the share
#: of a camera pixel that an unevenly sampled line moves by, and so many deviations of their own noise.
MODEL_PX, SAMPLING_SHARE, NOISE_SIGMAS = 0.03, 0.01, 3.0
#: Columns that scatter more about a plane (px) are not those of a plane at all.
NO_PLANE_PX = 0.5
#: How far planes may pull the geometry, in its own deviations (rms).
MAX_PULL = 4.0


def shared_parameters(rig: Rig | GeometryCalibration) -> Floats:
    """The 24 numbers of lenses and pose, in the order of `GeometryCalibration.covariance`."""

    def numbers(lens: Lens) -> list[float]:
        return [lens.fx_px, lens.fy_px, lens.cx_px, lens.cy_px, *lens.distortion]

    turn = vector_of(rig.pose.matrix)
    return np.array([*numbers(rig.camera), *numbers(rig.projector), *turn, *rig.pose.translation_mm])


def plane_of(slopes: Floats, distance_mm: float) -> Plane:
    """The plane of two slopes and a distance along its normal (mm)."""
    return Plane(np.array([*slopes, 1.0]) / np.sqrt(1 + slopes @ slopes) / distance_mm)


def rays_through(camera: Floats, pixels: Floats) -> Floats:
    """Rays (3, n) with z = 1 of sub-pixel positions (n, 2) through a lens of nine numbers."""
    # The size of the image plays no part in where a ray goes.
    return rays_at(lens_of(camera, (1, 1)), pixels[:, 0], pixels[:, 1])


def columns_at(shared: Floats, points_mm: Floats) -> Floats:
    """Zero-order columns (n,) of points (3, n) in camera coordinates."""
    moved = rotation_of(shared[STEREO][:3]) @ points_mm + shared[STEREO][3:, None]
    lens = shared[PROJECTOR]
    u, _ = distort(moved[0] / moved[2], moved[1] / moved[2], tuple(lens[4:].tolist()))
    return np.asarray(u * lens[0] + lens[2])


class StageProblem:
    """Columns of all positions in one array, with the prior of the numbers they depend on."""

    def __init__(
        self,
        rig: Rig,
        positions_mm: Sequence[float],
        samples: Sequence[ColumnSamples],
        covariance: Floats | None,
        stage_std_mm: float,
    ) -> None:
        """``covariance`` (24, 24) of lenses and pose; None holds them fixed."""
        self.mean = shared_parameters(rig)
        self.root = np.zeros((SHARED, SHARED)) if covariance is None else covariance_root(covariance)
        self.steps_mm = np.asarray(positions_mm, float) - positions_mm[0]
        self.position_of = np.repeat(np.arange(len(samples)), [len(part) for part in samples])
        self.camera_px = np.concatenate([part.camera_px for part in samples])
        self.column_px = np.concatenate([part.column_px for part in samples])
        self.std_px = np.concatenate([part.std_px for part in samples])
        count = STEPS + len(positions_mm)
        self.prior_weight = np.zeros(count)
        self.prior_weight[:SHARED] = 1.0
        self.prior_weight[GAIN] = 1 / GAIN_STD
        self.prior_weight[STEPS:] = 1 / stage_std_mm

    def shared(self, numbers: Floats) -> Floats:
        """Lenses and pose of fitted numbers."""
        return np.asarray(self.mean + self.root @ numbers[:SHARED])

    def distances_mm(self, numbers: Floats) -> Floats:
        """Distance of the plane at every position."""
        slopes = numbers[SLOPES]
        along = (1 + numbers[GAIN]) / np.sqrt(1 + slopes @ slopes)
        return np.asarray(numbers[DISTANCE] + along * self.steps_mm + numbers[STEPS:])

    def points_mm(self, numbers: Floats) -> Floats:
        """Points (3, n) of the plane where the samples see it."""
        rays = rays_through(self.shared(numbers)[CAMERA], self.camera_px)
        slopes = numbers[SLOPES]
        along = (slopes @ rays[:2] + rays[2]) / np.sqrt(1 + slopes @ slopes)
        return np.asarray(rays * (self.distances_mm(numbers)[self.position_of] / along))

    def residual_px(self, numbers: Floats) -> Floats:
        """Seen minus predicted columns (n,)."""
        return np.asarray(self.column_px - columns_at(self.shared(numbers), self.points_mm(numbers)))

    def bulge(self, numbers: Floats) -> Floats:
        """Change of predicted columns (n,) for a target whose middle is 1 mm in front of its rim.

        The rim is a circle of `BOW_RADIUS_MM` about the middle of all points; a bulge about another place
        differs by slopes and distance, which are fitted.
        """
        points = self.points_mm(numbers)
        middle = points[:2] - points[:2].mean(1, keepdims=True)
        back_mm = (middle**2).sum(0) / BOW_RADIUS_MM**2
        farther = 1 + back_mm / self.distances_mm(numbers)[self.position_of]
        shared = self.shared(numbers)
        return np.asarray(columns_at(shared, points * farther) - columns_at(shared, points))

    def jacobian(self, numbers: Floats, free: NDArray[np.int64]) -> Floats:
        """Change of predicted columns (n, free numbers) by central differences."""
        steps = np.full(len(numbers), 1e-3)
        steps[SLOPES], steps[GAIN] = 1e-5, 1e-5
        found = np.empty((len(self.column_px), len(free)))
        for i, k in enumerate(free):
            ahead, behind = numbers.copy(), numbers.copy()
            ahead[k] += steps[k]
            behind[k] -= steps[k]
            found[:, i] = (self.residual_px(behind) - self.residual_px(ahead)) / (2 * steps[k])
        return found


def covariance_root(covariance: Floats) -> Floats:
    """A square root of a covariance whose parameters have very different sizes."""
    scale = np.sqrt(np.diag(covariance).clip(1e-300))
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    return np.asarray(scale[:, None] * vectors * np.sqrt(values.clip(0)))


def with_unsure_zero(covariance: Floats, zero_std_px: float) -> Floats:
    """The covariance (24, 24) if columns of lines may be counted from another place than those of a board.

    All of them are then off alike, which is as if the projector's principal point were.
    """
    unsure = covariance.copy()
    unsure[ZERO, ZERO] += zero_std_px**2
    return unsure


def require_tiles(positions_mm: Sequence[float], samples: Sequence[ColumnSamples]) -> None:
    """Raise `CalibrationError` unless there are two positions with enough tiles each."""
    if len(samples) < 2:
        raise CalibrationError(
            f"The depth stage needs a plane at two or more positions, not {len(samples)}. Add positions."
        )
    for position, part in zip(positions_mm, samples, strict=True):
        require_enough(position, part)


def require_enough(position_mm: float, samples: ColumnSamples) -> None:
    """Raise `CalibrationError` when a position shows too few tiles."""
    if len(samples) < MIN_TILES:
        raise CalibrationError(
            f"At the stage's position {position_mm:g} mm only {len(samples)} tiles of the image show"
            f" columns of the projector; {MIN_TILES} are needed. Check that the plane fills the view."
        )


def require_steps(
    positions_mm: Sequence[float], distances_mm: Sequence[float] | Floats, stage_std_mm: float
) -> float:
    """How many times as far apart as the stage says the planes stand by the geometry before it is refined.

    Raises `CalibrationError` when that is far from one, or one of them stands elsewhere, beyond what the
    stage's own deviation explains.
    """
    positions = np.asarray(positions_mm, float)
    own_mm = STAGE_SIGMAS * stage_std_mm
    tolerance = max(MAX_STEP_ERROR_MM, own_mm) + UNSURE_SCALE * float(np.ptp(positions))
    most_scale = max(MAX_SCALE_ERROR, own_mm / float(np.linalg.norm(positions - positions.mean())))
    distances = np.asarray(distances_mm, float)
    rise, offset = np.polyfit(positions - positions.mean(), distances, 1)
    bent = np.abs(distances - offset - rise * (positions - positions.mean())).max() > tolerance
    if rise < 0:
        raise CalibrationError(
            f"At the stage's positions {', '.join(f'{p:g}' for p in positions)} mm the planes are"
            f" {', '.join(f'{d:.1f}' for d in distances)} mm away: the stage counts towards the camera, and"
            " positions are distances from it. Set towards_camera for the stage in the rig's profile, or"
            " state positions that grow with the distance; if planes were exchanged, capture them again."
        )
    off = distances - positions
    off -= np.median(off)
    worst = int(np.abs(off).argmax())
    if bent and abs(off[worst]) > tolerance:
        raise CalibrationError(
            f"The plane at the stage's position {positions[worst]:g} mm is {off[worst]:+.2f} mm from"
            " where the other positions put it. Check that the stage reached it and that nothing else"
            " moved, that all was captured with this rig, and capture this position again."
        )
    if abs(rise - 1) > most_scale:
        raise CalibrationError(
            f"The planes are {rise:.3f} times as far apart as the stage's positions"
            f" {', '.join(f'{p:g}' for p in positions)} mm. Check the unit of the stage, that it moves along"
            " the camera's axis, and the printed size of the board that the geometry was calibrated with."
        )
    return float(rise)


def column_limit_px(samples: ColumnSamples) -> float:
    """How far the columns of a flat target may scatter about their plane (rms, px).

    A limit in millimetres would mean another error of columns at every distance. It follows the capture: its
    noise, and by how many columns its camera pixels are apart.
    """
    x, y = (samples.camera_px - samples.camera_px.mean(0)).T
    slope = np.linalg.lstsq(np.stack([x, y], 1), samples.column_px - samples.column_px.mean(), rcond=None)[0]
    sampling_px = SAMPLING_SHARE * float(np.hypot(*slope))
    noise_px = NOISE_SIGMAS * float(np.sqrt(np.mean(samples.std_px**2)))
    return float(np.sqrt(MODEL_PX**2 + sampling_px**2 + noise_px**2))


def require_one_angle(positions_mm: Sequence[float], slopes: Floats, rms_px: Floats) -> None:
    """Raise `CalibrationError` naming the position whose target stands at another angle than the others.

    ``slopes`` (positions, 2) are those of each plane for itself, and ``rms_px`` (positions,) how far columns
    are off planes that are parallel: only where these do not fit is anything said.
    """
    if rms_px.max() <= NO_PLANE_PX:
        return
    turned_deg = np.degrees(np.hypot(*(np.arctan(slopes) - np.median(np.arctan(slopes), axis=0)).T))
    worst = int(turned_deg.argmax())
    if turned_deg[worst] > TURNED_DEG:
        raise CalibrationError(
            f"The target at the stage's position {positions_mm[worst]:g} mm stands at an angle of"
            f" {turned_deg[worst]:.1f} degrees to those at others; a stage carries it without turning it."
            " Fasten the target, see that nobody moved it, camera or projector meanwhile, and capture this"
            " position again, or all of them if they are two."
        )


def require_plane(positions_mm: Sequence[float], rms_px: Floats) -> None:
    """Raise `CalibrationError` naming the position whose columns are not those of a plane at all.

    Smaller errors are a figure of the calibration, which a person may accept.
    """
    worst = int(rms_px.argmax())
    if rms_px[worst] > NO_PLANE_PX:
        raise CalibrationError(
            f"The columns at the stage's position {positions_mm[worst]:g} mm are {rms_px[worst]:.2f} px RMS"
            f" off those of a plane; beyond {NO_PLANE_PX:g} px nothing can be fitted. Check that a flat"
            " target fills the view, that nothing stands before it, and that this position was captured with"
            " this rig; capture it again."
        )


def require_agreement(pull: float, bow_mm: float, bow_std_mm: float, rise: float) -> None:
    """Raise `CalibrationError` when planes would need other lenses than the board's, far beyond its doubts.

    A target that bulges alike at every position looks like lenses that distort otherwise, and steps that are
    all too long, by the ratio ``rise``, like devices that stand farther apart.
    """
    if pull > MAX_PULL:
        raise CalibrationError(
            f"The planes contradict the geometry calibration: it would have to move by {pull:.1f} of"
            f" its own standard deviations, {MAX_PULL:g} are allowed. Check that the target is flat: it seems"
            f" to bulge towards the camera by {with_std(bow_mm, bow_std_mm, 2)} mm over 300 mm. Compared with"
            f" the printed board, the stage's steps are {rise:.3f} times as long as reported: check both."
            " Calibrate the geometry again if the camera or projector has been touched since."
        )
