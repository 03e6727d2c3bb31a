"""What differs between a true rig and its record: curves, second orders, vignetting, and drive levels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.rig import FlatField, ProjectorResponse, Rgb, Rig
from dsl_core.model.spectral import SpectralCurve
from dsl_core.simulation.foreign.variants import Foreign

Floats = NDArray[np.float64]
#: Largest relative deviation of a curve, and how far apart its turns are, nm.
CURVE_SHARE, CURVE_TURNS_NM = 0.05, 70.0
#: Where red begins, and how far from there it has risen to three quarters, nm; what remains below.
EDGE_NM, EDGE_WIDTH_NM, BELOW_EDGE = 575.0, 4.4, 0.002
#: What the first order's efficiency gives the second beyond what the record says.
SECOND_SHARE = 0.04
#: Loss of gain in the farthest corner; it rises with the square of the distance from the middle.
CORNER_LOSS = 0.08
#: Largest relative deviation of each LED's light from the power law, at half drive.
LED_SHARES = (0.02, -0.012, -0.02)


def true_rig(rig: Rig, foreign: Foreign) -> Rig:
    """The rig that light goes through, of which the calibration is ``rig``."""
    update: dict[str, object] = {}
    response = rig.response
    if foreign.has("curves"):
        rng = np.random.default_rng([foreign.seed, 4099])
        response, update["emission"] = _wavy(rig.response, rng), _wavy(rig.emission, rng)
    if foreign.has("red-edge"):
        response = _with_edge(response[0]), *response[1:]
    if foreign.has("second-order"):
        update["efficiency"] = {
            **rig.efficiency,
            **{2 * m: _with_share(rig.efficiency[m], rig.efficiency.get(2 * m)) for m in (1, -1)},
        }
    if foreign.has("vignetting"):
        update["flat_field"] = _darker_corners(rig)
    return rig.model_copy(update={**update, "response": response})


def led_radiance(response: ProjectorResponse, levels: Floats, foreign: Foreign | None) -> Floats:
    """Radiance of each LED at its drive levels (3 or 1, n), 0 to 1, black included, shape (3, n)."""
    radiance = response.radiance(levels)
    if foreign is not None and (foreign.has("tone-s") or foreign.has("tone-srgb")):
        drive = np.round(255 * levels) / 255
        light = _s_curve(drive) if foreign.has("tone-s") else _srgb(drive)
        radiance = response.black_fraction + (1 - response.black_fraction) * light
    usual = np.broadcast_to(radiance, (3, levels.shape[1]))
    if foreign is None or not foreign.has("response-curve"):
        return usual
    light = usual - response.black_fraction
    arch = 4 * levels * (1 - levels)
    return np.asarray(response.black_fraction + light * (1 + np.array(LED_SHARES)[:, None] * arch))


def _s_curve(drive: Floats) -> Floats:
    """Light of a cell between crossed polarisers: a square at its foot, and saturated at full drive."""
    return np.asarray(drive**2 / (drive**2 + 0.4 * (1 - drive) ** 1.6))


def _srgb(drive: Floats) -> Floats:
    """IEC 61966-2-1."""
    return np.where(drive <= 0.04045, drive / 12.92, ((drive + 0.055) / 1.055) ** 2.4)


def _wavy(curves: Rgb, rng: np.random.Generator) -> Rgb:
    """Each curve times a smooth factor: sines of random phase, the largest deviation being the share."""
    found = []
    for curve in curves:
        nm = np.array(curve.wavelengths_nm)
        wave = sum(
            np.sin(2 * np.pi * nm / (CURVE_TURNS_NM * turns) + 2 * np.pi * rng.random())
            for turns in (1.0, 1.7, 2.9)
        )
        factor = 1 + CURVE_SHARE * wave / np.abs(wave).max()
        found.append(SpectralCurve.of(nm, np.array(curve.values) * factor))
    red, green, blue = found
    return red, green, blue


def _with_edge(red: SpectralCurve) -> SpectralCurve:
    nm = np.array(red.wavelengths_nm)
    risen = 1 / (1 + 3.0 ** ((EDGE_NM - nm) / EDGE_WIDTH_NM))
    return SpectralCurve.of(nm, np.array(red.values) * np.maximum(risen, BELOW_EDGE))


def _with_share(first: SpectralCurve, second: SpectralCurve | None) -> SpectralCurve:
    nm = np.array(first.wavelengths_nm)
    known = np.zeros(len(nm)) if second is None else second.at(nm)
    return SpectralCurve.of(nm, known + SECOND_SHARE * np.array(first.values))


def _darker_corners(rig: Rig) -> FlatField:
    """The rig's own gain times one that falls towards the corners."""
    lens = rig.camera
    rows, columns = np.linspace(0, lens.height_px - 1, 33), np.linspace(0, lens.width_px - 1, 49)
    square = (columns - lens.cx_px) ** 2 + (rows[:, None] - lens.cy_px) ** 2
    gain = 1 - CORNER_LOSS * square / square.max()
    known = rig.flat_field
    if known is not None:
        from dsl_core.optics.sensor import gain_at_pixels

        gain = (
            gain
            * gain_at_pixels(known, lens.height_px, lens.width_px)[
                np.ix_(rows.round().astype(int), columns.round().astype(int))
            ]
        )
    return FlatField(
        rows_px=tuple(rows.tolist()),
        columns_px=tuple(columns.tolist()),
        gain=tuple(tuple(row) for row in gain.tolist()),
    )
