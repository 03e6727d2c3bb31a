"""Evidence in tests: records made by hand, a session that only knows its steps, and what was drawn."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pyqtgraph as pg
from dsl_app.calibrate.evidence.base import Evidence, make_evidence
from dsl_app.calibrate.evidence.charts import ChartBox
from dsl_app.calibrate.wizard.state import Fit
from dsl_app.shared.theme import DARK, LIGHT, Theme
from PySide6.QtWidgets import QTableWidget
from pytestqt.qtbot import QtBot

from dsl_core.campaign.session import CalibrationSession
from dsl_core.model.base import Record
from dsl_core.model.calibration.accepted import AcceptedCalibration
from dsl_core.model.spectral import SpectralCurve

THEMES = (LIGHT, DARK)
NM = np.arange(400.0, 701.0, 10.0)


def session_of(steps: dict[str, str]) -> CalibrationSession:
    """A session with steps of these keys and titles."""
    made = [SimpleNamespace(key=key, title=title) for key, title in steps.items()]
    return cast(CalibrationSession, SimpleNamespace(steps=tuple(made)))


def shown(
    qtbot: QtBot,
    name: str,
    record: Record,
    session: CalibrationSession | None = None,
    theme: Theme = LIGHT,
) -> Any:
    """The evidence of a recipe with a record in it, on screen, drawn on all of its tabs."""
    widget: Evidence[Any] = make_evidence(name)
    qtbot.addWidget(widget)
    widget.resize(700, 500)
    widget.apply_theme(theme)
    fitted = AcceptedCalibration(name=name, title=name.capitalize(), record=record.model_dump(mode="json"))
    widget.show_fit(Fit(fitted, record, session_of({}) if session is None else session))
    widget.show()
    for box in widget.findChildren(ChartBox):
        assert box.plot is not None
    return widget


def bump(centre_nm: float, width_nm: float, peak: float = 1.0, std: float | None = 0.01) -> SpectralCurve:
    """A curve with one peak, and the same deviation everywhere."""
    curve = SpectralCurve.of(NM, peak * np.exp(-0.5 * ((NM - centre_nm) / width_nm) ** 2))
    return curve if std is None else curve.model_copy(update={"std": (std,) * len(NM)})


def row_texts(table: QTableWidget, row: int) -> list[str]:
    """The texts of a row."""
    cells = [table.item(row, column) for column in range(table.columnCount())]
    return [each.text() if each is not None else "" for each in cells]


def items(box: ChartBox, kind: type) -> list[Any]:
    """What of a kind is drawn on a plot."""
    return [item for item in box.item.items if type(item) is kind]


def points(box: ChartBox) -> list[Any]:
    """Columns and rows of the points of every scatter on a plot."""
    return [np.stack(item.getData(), 1) for item in items(box, pg.ScatterPlotItem)]


def curves(box: ChartBox) -> list[Any]:
    """Values of the visible lines on a plot that are not limits of bands."""
    found = [item for item in items(box, pg.PlotCurveItem) if item.opts["pen"].widthF() > 1.1]
    return [np.asarray(item.getData()[1]) for item in found if np.isfinite(item.getData()[1]).any()]


def bars(box: ChartBox) -> list[list[float]]:
    """Heights of the bars on a plot."""
    return [[float(height) for height in item.opts["height"]] for item in items(box, pg.BarGraphItem)]
