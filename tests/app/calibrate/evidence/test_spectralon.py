"""The evidence of a Spectralon: emission with bands, the flat field as a picture, signals of white."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from dsl_app.calibrate.wizard.state import Fit
from dsl_app.shared.theme import Theme
from pytestqt.qtbot import QtBot

from dsl_core.model.calibration.accepted import AcceptedCalibration
from dsl_core.model.calibration.spectralon import (
    MeasuredEmission,
    PlaneQuality,
    SpectralonCalibration,
    WhiteSignals,
)
from dsl_core.model.rig import FlatField
from dsl_core.model.spectral import SpectralCurve
from tests.app.calibrate.evidence_bench import NM, THEMES, bump, curves, row_texts, session_of, shown

EVEN = FlatField(rows_px=(50.0,), columns_px=(80.0,), gain=((1.0,),))
GAIN = ((0.98, 1.0, 0.98), (1.0, 1.04, 1.0))


def calibration(**changes: Any) -> SpectralonCalibration:
    made = SpectralonCalibration(
        reflectance=SpectralCurve.of(NM, np.full(len(NM), 0.99)),
        emission=MeasuredEmission(
            curves=(bump(630, 10), bump(540, 30, 0.6), bump(460, 12, 0.9)),
            smoothing_nm=(10, 10, 10),
            additivity=1.002,
            additivity_std=0.004,
            readings=16,
            end_share=0.01,
        ),
        white=WhiteSignals(
            signal=((210.0, 50.0, 8.0), (52.0, 345.0, 37.0), (6.0, 69.0, 228.0)),
            rel_std=((0.01, 0.01, 0.01),) * 3,
            white_over_sum=(1.0, 0.999, 1.001),
        ),
        plane=PlaneQuality(distance_mm=701.2, tilt_deg=1.25, rms_mm=0.1),
        saturated_share=0.0,
        filled_share=1.0,
        unevenness=0.0012,
        flat_field=FlatField(rows_px=(0.0, 100.0), columns_px=(0.0, 80.0, 160.0), gain=GAIN),
        flat_field_std=((0.001,) * 3,) * 2,
        flat_field_chi_square=3.0,
    )
    return made.model_copy(update=changes)


@pytest.mark.parametrize("theme", THEMES)
def test_emission_field_and_white_are_shown(qtbot: QtBot, theme: Theme) -> None:
    widget = shown(qtbot, "spectralon", calibration(), theme=theme)
    drawn = curves(widget.emission)
    assert [int(NM[values.argmax()]) for values in drawn] == [630, 540, 460]
    assert np.array_equal(widget.image.image, GAIN)
    low, high = widget.bar.levels()
    assert (low, high) == pytest.approx((0.96, 1.04))
    rect = widget.image.mapRectToParent(widget.image.boundingRect())
    assert (rect.left(), rect.top(), rect.width(), rect.height()) == pytest.approx((-40, -50, 240, 200))
    assert row_texts(widget.table, 0) == ["red", "210.0 ± 2.1", "50.00 ± 0.50", "8.000 ± 0.080", "1.0000"]
    assert "1.0020 ± 0.0040, from 16 readings" in widget.words.text()
    assert "701 mm away, tilted by 1.2°" in widget.words.text()


def test_an_even_camera_is_said_in_words(qtbot: QtBot) -> None:
    widget = shown(qtbot, "spectralon", calibration(flat_field=EVEN))
    assert widget.field.sentence.isVisible()
    assert "The camera is even" in widget.field.sentence.text()
    widget.show_fit(Fit(AcceptedCalibration(name="spectralon", title=""), calibration(), session_of({})))
    qtbot.waitUntil(lambda: not widget.field.sentence.isVisible())
