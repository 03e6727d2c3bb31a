"""What a fit rests on, to be looked at before it is accepted: one widget for each calibration."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QVBoxLayout, QWidget

from dsl_app.shared.theme import DARK, Theme
from dsl_app.shared.widgets.forms import label

if TYPE_CHECKING:
    from dsl_core.campaign.session import CalibrationSession
    from dsl_core.model.base import Record
    from dsl_core.model.calibration.accepted import AcceptedCalibration


class Evidence(QWidget):
    """Shows the record of a fit.

    ``settings_requested`` holds settings of the recipe, as texts, that the person changed on the evidence,
    such as ``{"left_out": "pose-03"}``: a fit with them replaces the one that is shown.
    """

    settings_requested = Signal(dict)

    def __init__(self) -> None:
        super().__init__()
        self._theme = DARK

    def show_fit(self, fitted: AcceptedCalibration, record: Record, session: CalibrationSession) -> None:
        """Show a fit that waits to be accepted; quick enough for the thread of the window."""
        raise NotImplementedError

    def show_captures(self, session: CalibrationSession) -> bool:
        """Show captures that no fit came of, where a person can help by looking; False where not."""
        return False

    def apply_theme(self, theme: Theme) -> None:
        """Take the colours of a theme."""
        self._theme = theme


class PlainEvidence(Evidence):
    """Of a calibration without a widget of its own: its figures say all that is known."""

    def __init__(self) -> None:
        super().__init__()
        self.words = label("", "muted")
        self.words.setWordWrap(True)
        column = QVBoxLayout(self)
        column.addWidget(self.words)
        column.addStretch(1)

    def show_fit(self, fitted: AcceptedCalibration, record: Record, session: CalibrationSession) -> None:
        """Say that the figures are all there is."""
        self.words.setText(
            f"{fitted.title} has nothing to draw. Its figures, with their limits, say how good it is."
        )


#: Module and class by the name of the recipe; imported when they are first wanted.
_WIDGETS = {
    "selftest": ("dsl_app.calibrate.evidence.selftest", "SelfTestEvidence"),
    "geometry": ("dsl_app.calibrate.evidence.geometry", "GeometryEvidence"),
    "spectralon": ("dsl_app.calibrate.evidence.spectralon", "SpectralonEvidence"),
    "color-checker": ("dsl_app.calibrate.evidence.color_checker", "ColorCheckerEvidence"),
    "bandpass": ("dsl_app.calibrate.evidence.bandpass", "BandpassEvidence"),
    "depth-stage": ("dsl_app.calibrate.evidence.depth_stage", "DepthStageEvidence"),
}


def make_evidence(name: str) -> Evidence:
    """The widget of a recipe's name; one without a widget of its own says so in words."""
    if name not in _WIDGETS:
        return PlainEvidence()
    module, kind = _WIDGETS[name]
    made = getattr(import_module(module), kind)()
    assert isinstance(made, Evidence)
    return made
