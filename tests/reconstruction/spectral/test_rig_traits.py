"""What a calibration measured beyond the simple model is said with its figure; a usual rig has nothing."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.model.calibration.accepted import CalibrationNote
from dsl_core.model.calibration.lateral_colour import LateralColour
from dsl_core.model.calibration.selftest import OFF_CURVE, OFF_POWER_LAW
from dsl_core.model.figure import Figure
from dsl_core.model.projector.tone_curve import ToneCurve
from dsl_core.model.rig import ColumnResidual, FilmShape, FlatField, Rig
from dsl_core.model.spectral import SpectralCurve
from dsl_core.reconstruction.spectral.rig_traits import film_columns_px, measured_traits, traits_in_words
from dsl_core.simulation.published_rig import published_rig


def calibrated(**changes: object) -> Rig:
    other = Figure(name="gamma, difference between colours", value=0.9, unit="%")
    note = CalibrationNote(name="selftest", title="Self-test", accepted="2026-03-01", figures=(other,))
    return published_rig().model_copy(update={"calibrations": (note,), **changes})


def residual(constant_px: float) -> ColumnResidual:
    return ColumnResidual(
        orders=(1, -1),
        column_range_px=(0.0, 890.0),
        row_range_px=(0.0, 580.0),
        depth_range_mm=(500.0, 1000.0),
        wavelength_range_nm=(430.0, 660.0),
        degrees=((0, 0, 0, 0),),
        coefficients_px=((constant_px,), (-constant_px,)),
    )


def with_second_orders(share: float) -> Rig:
    efficiency = published_rig().efficiency
    for order in (1, -1):
        curve = efficiency[order]
        values = share * np.array(curve.values)
        efficiency = {**efficiency, 2 * order: SpectralCurve.of(np.array(curve.wavelengths_nm), values)}
    return calibrated(efficiency=efficiency)


def with_tone(second: float) -> Rig:
    response = published_rig().projector_response
    tone = ToneCurve(coefficients=(response.gamma, second), lowest_level=0.2)
    return calibrated(projector_response=response.model_copy(update={"tone": tone}))


def with_ramps(percent: float, std: float, name: str = OFF_POWER_LAW) -> Rig:
    figure = Figure(name=name, value=percent, std=std, unit="%")
    note = CalibrationNote(name="selftest", title="Self-test", accepted="", figures=(figure,))
    return calibrated(calibrations=(note,))


def with_gain(corner: float) -> Rig:
    return calibrated(flat_field=FlatField(rows_px=(0.0,), columns_px=(0.0, 800.0), gain=((1.0, corner),)))


def with_colours(apart_px: float) -> Rig:
    per_nm = apart_px / 180 / (published_rig().projector.width_px / 2)
    colour = LateralColour(camera=(1.0, 1.0, 1.0), projector_per_nm=-per_nm, white_nm=(600.0, 540.0, 460.0))
    return calibrated(lateral_colour=colour)


@pytest.mark.parametrize(
    ("rig", "said"),
    [
        (with_tone(0.01), "up to 2.6% off a power law of the drive level"),
        (with_ramps(0.62, 0.05), "light is 0.62 % (rms) off a power law"),
        (with_ramps(0.36, 0.03, OFF_CURVE), "light is 0.36 % (rms) off a smooth curve"),
        (with_second_orders(0.08), "second orders have 8.0% of the light of the first"),
        (calibrated(residual=residual(0.3)), "lie 0.30 columns (rms, at most 0.30)"),
        (with_colours(0.25), "red and blue light lie 0.25 columns apart"),
        (with_gain(0.92), "differs by 8.0% over the picture"),
    ],
)
def test_each_trait_is_told_with_its_figure(rig: Rig, said: str) -> None:
    (found,) = measured_traits(rig)
    assert said in found
    assert traits_in_words(rig) == f"Measured by the calibration, and followed: {found}."


@pytest.mark.parametrize(
    "rig",
    [
        calibrated(),
        with_tone(0.001),
        with_ramps(0.15, 0.01),
        with_ramps(0.62, 0.3),
        with_second_orders(0.05),
        calibrated(residual=residual(0.05)),
        with_colours(0.05),
        with_gain(0.98),
        with_second_orders(0.08).model_copy(update={"calibrations": ()}),
    ],
)
def test_a_usual_rig_and_one_that_nobody_calibrated_have_no_traits(rig: Rig) -> None:
    assert traits_in_words(rig) == ""


def test_a_film_with_a_shape_displaces_its_orders() -> None:
    film = published_rig().film.model_copy(update={"shape": FilmShape(factors=(0.002, 0, 0, 0, 0, 0))})
    twisted = film_columns_px(calibrated(film=film))
    assert np.ptp(twisted) > 0.2
    assert film_columns_px(calibrated()).size == 0
