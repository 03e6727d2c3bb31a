"""The look at a Spectralon tells an even middle from one with an edge or a shadow in it."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.calibration.light.spectralon_figures import (
    LOOK_UNEVEN_PERCENT,
    spectralon_figures,
    unevenness_of_middle,
)
from dsl_core.model.calibration.spectralon import (
    MeasuredEmission,
    PlaneQuality,
    SpectralonCalibration,
    WhiteSignals,
)
from dsl_core.model.rig import FlatField
from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.sensor import bayer_channels
from dsl_core.simulation.published_rig import published_rig

RIG = published_rig()
#: Colours of a mosaic differ, which is not unevenness.
MOSAIC = np.array([1.0, 2.0, 0.5])[bayer_channels(RIG.sensor.bayer, 80, 120)]


def test_only_the_middle_counts() -> None:
    picture = MOSAIC.copy()
    picture[:18], picture[:, 100:] = 0.0, 9.0
    found = unevenness_of_middle(picture, RIG)
    assert found.value == pytest.approx(0.0, abs=1e-9)
    assert found.passed


def test_a_monochrome_camera_is_judged_by_its_one_colour() -> None:
    rig = RIG.model_copy(update={"sensor": RIG.sensor.model_copy(update={"bayer": "MONO"})})
    assert unevenness_of_middle(np.ones((80, 120)), rig).passed
    assert not unevenness_of_middle(MOSAIC, rig).passed


def test_a_shadow_over_a_part_of_the_middle_fails() -> None:
    picture = MOSAIC.copy()
    picture[:, 30:40] *= 0.6
    found = unevenness_of_middle(picture, RIG)
    assert found.value == pytest.approx(40.0, abs=1.0)
    assert found.high == LOOK_UNEVEN_PERCENT
    assert not found.passed


def record() -> SpectralonCalibration:
    """Numbers that differ in every place."""
    peak = SpectralCurve.of([500.0, 600.0], [2.0, 1.0], std=[0.01, 0.03])
    sharp = SpectralCurve.of([500.0, 600.0], [1.0, 4.0])
    return SpectralonCalibration(
        reflectance=sharp,
        emission=MeasuredEmission(
            curves=(peak, sharp, sharp), smoothing_nm=(1.0, 1.0, 1.0), additivity=1.01, additivity_std=0.002,
            readings=3, end_share=0.015,
        ),
        white=WhiteSignals(
            signal=((1.0, 2.0, 3.0), (1.0, 1.0, 2.0), (5.0, 3.0, 2.0)),
            rel_std=((0.01, 0.01, 0.0), (0.0, 0.0, 0.005), (0.003, 0.0, 0.0)),
            white_over_sum=(1.01, 0.97, 1.0),
        ),
        plane=PlaneQuality(distance_mm=700.0, tilt_deg=12.0, rms_mm=0.5),
        saturated_share=0.0005, filled_share=0.95, unevenness=0.004,
        flat_field=FlatField(rows_px=(0.0, 1.0), columns_px=(0.0, 1.0), gain=((0.9, 1.0), (1.0, 1.15))),
        flat_field_std=((0.0, 0.0), (0.0, 0.0)),
        flat_field_chi_square=1.0,
        flat_field_unsure=0.012,
        light_change=(0.001, 1e-5),
        bulge_mm=(-1.5, 0.5),
    )  # fmt: skip


def test_a_calibration_is_judged_by_its_figures_and_their_limits() -> None:
    figures = {each.name: each for each in spectralon_figures(record())}
    found = {name: (each.value, each.low, each.high, each.unit) for name, each in figures.items()}
    wanted: dict[str, tuple[float, float | None, float | None, str]] = {
        "white over red + green + blue": (1.01, 0.97, 1.03, "1"),
        "deviation of the emission, of its peak": (1.5, None, 1.0, "%"),
        "emission at the ends of the range, of its peak": (1.5, None, 2.0, "%"),
        "saturated pixels": (0.05, None, 0.1, "%"),
        "middle filled by the Spectralon": (95.0, 90.0, None, "%"),
        "tilt of the Spectralon": (12.0, None, 15.0, "degrees"),
        "unevenness after the flat field": (0.4, None, 1.0, "%"),
        "white over red + green + blue in the pictures, largest difference": (3.0, None, 2.0, "%"),
        "deviation of white": (100 * np.hypot(0.01, 0.02) / 6, None, 0.5, "%"),
        "range of the flat field": (25.0, None, None, "%"),
        "deviation of the flat field, where it is known least": (1.2, None, 2.0, "%"),
        "change of ambient light during the pictures": (0.1, -0.2, 0.2, "% of white"),
        "bulge of the Spectralon over 300 mm": (-1.5, -2.0, 2.0, "mm"),
        "stated reflectance of the Spectralon, which no picture shows": (250.0, None, None, "%"),
    }
    assert set(found) == set(wanted)
    for name, (value, *limits) in wanted.items():
        assert found[name][0] == pytest.approx(value), name
        assert list(found[name][1:]) == limits, name
    assert figures["white over red + green + blue"].std == 0.002
    unmet = {name for name, each in figures.items() if not each.passed}
    assert unmet == {"deviation of the emission, of its peak", *list(wanted)[7:8]}


def test_the_deviation_of_white_is_that_of_the_colours_a_camera_has() -> None:
    nothing = (0.0, 0.0, 0.0)
    white = WhiteSignals(
        signal=(nothing, (1.0, 1.0, 2.0), nothing),
        rel_std=(nothing, (0.0, 0.0, 0.005), nothing),
        white_over_sum=(1.0, 1.0, 1.0),
    )
    figures = spectralon_figures(record().model_copy(update={"white": white}))
    found = next(each for each in figures if each.name == "deviation of white")
    assert found.value == pytest.approx(0.25)
