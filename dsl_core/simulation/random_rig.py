"""Rigs drawn around the published one: what a calibration does not know."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.geometry import Lens, Pose
from dsl_core.model.rig import Film, FlatField, Rgb, Rig
from dsl_core.model.spectral import SpectralCurve

Floats = NDArray[np.float64]
#: Lenses: relative deviation of the focal lengths, of each distortion coefficient, and of the centre as a
#: share of the width.
FOCAL, DISTORTION, CENTRE = 0.01, 0.1, 0.008
ROTATION_DEG, TRANSLATION_MM = 1.0, 3.0
#: Curves: relative amplitude of the smooth factor, its correlation length, and a shift, nm.
AMPLITUDE, CORRELATION_NM, SHIFT_NM = 0.1, 60.0, 2.0


def random_rig(seed: int, around: Rig) -> Rig:
    """A rig whose every part deviates from another's; the same seed draws the same rig."""
    rng = np.random.default_rng([seed, 7919])

    def spread(low: float, high: float) -> float:
        return float(rng.uniform(low, high))

    camera, projector = _lens(around.camera, rng), _lens(around.projector, rng)
    pose = _pose(around.pose, rng)
    film = Film(
        distance_mm=spread(27, 31),
        lines_per_mm=spread(470, 510),
        tilt_x_deg=spread(-0.6, 0.6),
        tilt_y_deg=spread(-0.6, 0.6),
        roll_deg=spread(-0.3, 0.3),
        bend_per_mm=spread(0, 0.004),
    )
    light = around.projector_response
    response = light.model_copy(
        update={
            "gamma": spread(2.0, 2.4),
            "black_fraction": light.black_fraction * spread(0.5, 1.5),
            "blur_px": spread(0.5, 0.7),
            "halo_peak_per_px": light.halo_peak_per_px * spread(0.7, 1.3),
            "halo_decay_px": light.halo_decay_px * spread(0.85, 1.15),
        }
    )
    sensor = around.sensor.model_copy(
        update={
            "black_level_dn": around.sensor.black_level_dn * spread(0.85, 1.15),
            "electrons_per_dn": around.sensor.electrons_per_dn * spread(0.85, 1.15),
            "read_noise_dn": around.sensor.read_noise_dn * spread(0.85, 1.15),
        }
    )
    first = {order: _curve(around.efficiency[order], rng, 0.15, 0.0) for order in (1, -1)}
    share = float(np.median(np.array(around.efficiency[2].values) / np.array(around.efficiency[1].values)))
    second = {2 * order: _times(curve, share * spread(0.8, 1.2)) for order, curve in first.items()}
    return around.model_copy(
        update={
            "name": f"twin {seed}",
            "camera": camera,
            "projector": projector,
            "pose": pose,
            "film": film,
            "projector_response": response,
            "sensor": sensor,
            "response": _rgb(around.response, rng),
            "emission": _rgb(around.emission, rng),
            "efficiency": {**first, **second},
            "flat_field": _vignetting(camera, spread(0.05, 0.10)),
            "white_scale": around.white_scale * spread(0.9, 1.1),
            "provenance": around.provenance.model_copy(
                update={"camera_serial": f"TWIN-C{seed}", "projector_serial": f"TWIN-P{seed}"}
            ),
        }
    )


def _vignetting(lens: Lens, loss: float) -> FlatField:
    """Gain that falls with the square of the distance from the centre, by ``loss`` in the far corner."""
    rows = np.linspace(0, lens.height_px - 1, 17)
    columns = np.linspace(0, lens.width_px - 1, 25)
    x, y = columns - lens.cx_px, rows[:, None] - lens.cy_px
    square = x**2 + y**2
    gain = 1 - loss * square / square.max()
    return FlatField(
        rows_px=tuple(rows.tolist()),
        columns_px=tuple(columns.tolist()),
        gain=tuple(tuple(row) for row in gain.tolist()),
    )


def _lens(lens: Lens, rng: np.random.Generator) -> Lens:
    focal = 1 + rng.uniform(-FOCAL, FOCAL, 2)
    shift = lens.width_px * rng.uniform(-CENTRE, CENTRE, 2)
    distortion = np.array(lens.distortion) * (1 + rng.uniform(-DISTORTION, DISTORTION, 5))
    return lens.model_copy(
        update={
            "fx_px": lens.fx_px * float(focal[0]),
            "fy_px": lens.fy_px * float(focal[1]),
            "cx_px": lens.cx_px + float(shift[0]),
            "cy_px": lens.cy_px + float(shift[1]),
            "distortion": tuple(distortion.tolist()),
        }
    )


def _pose(pose: Pose, rng: np.random.Generator) -> Pose:
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_rotvec(np.radians(rng.uniform(-ROTATION_DEG, ROTATION_DEG, 3))).as_matrix()
    moved = np.array(pose.translation_mm) + rng.uniform(-TRANSLATION_MM, TRANSLATION_MM, 3)
    return Pose.model_validate({"rotation": (turn @ pose.matrix).tolist(), "translation_mm": moved.tolist()})


def _rgb(curves: Rgb, rng: np.random.Generator) -> Rgb:
    red, green, blue = (_curve(curve, rng, AMPLITUDE, SHIFT_NM) for curve in curves)
    return red, green, blue


def _curve(
    curve: SpectralCurve, rng: np.random.Generator, amplitude: float, shift_nm: float
) -> SpectralCurve:
    """The curve, moved along the axis and times a smooth random factor."""
    nm = np.array(curve.wavelengths_nm)
    moved = curve.at(nm - rng.uniform(-shift_nm, shift_nm))
    return SpectralCurve.of(nm, moved * _smooth_factor(rng, amplitude)(nm))


def _smooth_factor(rng: np.random.Generator, amplitude: float) -> Callable[[Floats], Floats]:
    """A cubic through random values, one per correlation length, uniform within the amplitude of one."""
    from scipy.interpolate import CubicSpline

    knots = np.arange(360.0, 760.0, CORRELATION_NM)
    spline = CubicSpline(knots, 1 + rng.uniform(-amplitude, amplitude, len(knots)))
    return lambda nm: np.asarray(spline(nm))


def _times(curve: SpectralCurve, factor: float) -> SpectralCurve:
    return SpectralCurve.of(curve.wavelengths_nm, np.array(curve.values) * factor)
