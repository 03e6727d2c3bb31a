"""The evidence of bandpass filters: a row for each, efficiency with points, bound of second orders."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from dsl_app.shared.theme import Theme
from pytestqt.qtbot import QtBot

from dsl_core.model.calibration.bandpass import BandpassCalibration, FilterSample, OrderSample
from dsl_core.model.spectral import SpectralCurve
from tests.app.calibrate.evidence_bench import NM, THEMES, bump, curves, points, row_texts, shown
from tests.cases.bandpass_record import bandpass_record


def order(number: int, ratio: float) -> OrderSample:
    return OrderSample(
        order=number, ratio=ratio, ratio_std=0.002, offset_px=200.0 * number, offset_std_px=0.2
    )


def sample(nm: float, found_nm: float | None, std_nm: float | None = 0.6) -> FilterSample:
    return FilterSample(
        filter_nm=nm,
        effective_nm=nm + 1,
        found_nm=found_nm,
        found_std_nm=std_nm,
        curve_measured=nm < 500,
        zero_dn_per_ms=(1.0, 2.0, 3.0),
        orders=(order(-1, nm / 10_000), order(1, nm / 5_000), order(2, 0.001)),
    )


def calibration(**changes: Any) -> BandpassCalibration:
    slope = SpectralCurve.of(NM, 0.2 - NM / 5000).model_copy(update={"std": (0.001,) * len(NM)})
    warning = "the filter of 550 nm: its first orders stand where 590 nm belongs; put the right one in"
    made = bandpass_record(
        (sample(450.0, 451.2), sample(550.0, 590.0), sample(650.0, None)),
        slope,
        (bump(600, 30), bump(540, 30), bump(460, 30)),
        warnings=(warning,),
    )
    return made.model_copy(update=changes)


@pytest.mark.parametrize("theme", THEMES)
def test_filters_and_efficiency_are_shown_with_deviations(qtbot: QtBot, theme: Theme) -> None:
    widget = shown(qtbot, "bandpass", calibration(), theme=theme)
    assert row_texts(widget.table, 0) == [
        "450", "451.0", "451.2 ± 0.6", "+0.2", "−1, +1", "measured", "as requested"
    ]  # fmt: skip
    assert row_texts(widget.table, 1)[2:4] == ["590.0 ± 0.6", "+39.0"]
    assert (
        row_texts(widget.table, 1)[6] == "Its first orders stand where 590 nm belongs; put the right one in"
    )
    assert row_texts(widget.table, 2)[2:4] == ["not found", ""]
    assert widget.table.item(1, 6).foreground().color().name() == theme.warn
    plus, minus = points(widget.efficiency)
    assert np.allclose(plus, [(451, 0.09), (551, 0.11), (651, 0.13)])
    assert np.allclose(minus, [(451, 0.045), (551, 0.055), (651, 0.065)])
    values = calibration().efficiency[1].values
    drawn = curves(widget.efficiency)
    assert np.allclose(drawn[0], values)
    assert np.allclose(drawn[2], (0.04 + 1.96 * 0.01) * np.array(values))
    assert widget.warnings.text().startswith("The filter of 550 nm: its first orders")
    assert "3.96" not in widget.seconds.text()
    assert "4.0 ± 1.0 % of the first, at most 5.96 % (95 %)" in widget.seconds.text()


def test_without_doubts_no_warning_is_shown(qtbot: QtBot) -> None:
    widget = shown(qtbot, "bandpass", calibration(warnings=()))
    assert not widget.warnings.isVisible()
    assert row_texts(widget.table, 1)[6] == "as requested"


def test_a_record_without_deviations_of_filters_is_shown(qtbot: QtBot) -> None:
    widget = shown(qtbot, "bandpass", calibration(filters=(sample(450.0, 451.2, None),)))
    assert row_texts(widget.table, 0)[2] == "451.2"
