"""What a fit rests on, to be judged before it is accepted: one widget for each calibration."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from queue import SimpleQueue
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from PySide6.QtCore import QObject, Qt, QThreadPool, QTimer, Signal
from PySide6.QtWidgets import QSplitter, QWidget

from dsl_app.shared.theme import DARK, Theme
from dsl_app.shared.widgets.forms import label
from dsl_app.shared.widgets.inside import apply_theme_inside
from dsl_app.shared.widgets.layouts import STRETCH, boxed, column_of, row_of, splitter
from dsl_core.model.base import Record

if TYPE_CHECKING:
    from dsl_app.calibrate.wizard.state import Fit
    from dsl_core.campaign.session import CalibrationSession

R = TypeVar("R", bound=Record)

#: How often to look whether something was read, ms.
LOOK_MS = 30


class Evidence(QWidget, Generic[R]):
    """Shows the record of a fit, which is of one type.

    ``settings_requested`` holds settings of the recipe, as texts, that the person changed on the evidence,
    such as ``{"left_out": "pose-03"}``: a fit with them replaces the one that is shown.
    """

    settings_requested = Signal(dict)

    def __init__(self, record_type: type[R]) -> None:
        super().__init__()
        self._theme, self._record_type = DARK, record_type
        self._record: R | None = None

    def show_fit(self, fit: Fit) -> None:
        """Show a fit; quick enough for the thread of the window."""
        assert isinstance(fit.record, self._record_type)
        self._record = fit.record
        self._begin(fit.record, fit.session)
        self._draw()

    def _begin(self, record: R, session: CalibrationSession) -> None:
        """Get ready for another fit; what is slow to read is read in the background."""

    def show_captures(self, session: CalibrationSession) -> bool:
        """Show captures that gave no fit, where a person can help by looking; False where not."""
        return False

    def apply_theme(self, theme: Theme) -> None:
        """Take the colours of a theme."""
        self._theme = theme
        apply_theme_inside(self, theme)
        self._draw()

    def _draw(self) -> None:
        if self._record is not None:
            self._draw_record(self._record)

    def _draw_record(self, record: R) -> None:
        """Draw a fit in the colours of the theme."""


class PlainEvidence(Evidence[Record]):
    """For a calibration without a widget of its own: its figures say all that is known."""

    def __init__(self) -> None:
        super().__init__(Record)
        self.words = label("", "muted", wraps=True)
        column_of(self.words, STRETCH, on=self)

    def show_fit(self, fit: Fit) -> None:
        """Say that the figures are all there is."""
        self.words.setText(
            f"{fit.fitted.title} has no plots. Its figures, with their limits, show how good it is."
        )


#: Module and class by the name of the recipe; imported when they are first needed.
_WIDGETS = {
    "selftest": ("dsl_app.calibrate.evidence.selftest", "SelfTestEvidence"),
    "geometry": ("dsl_app.calibrate.evidence.geometry", "GeometryEvidence"),
    "spectralon": ("dsl_app.calibrate.evidence.spectralon", "SpectralonEvidence"),
    "color-checker": ("dsl_app.calibrate.evidence.color_checker", "ColorCheckerEvidence"),
    "bandpass": ("dsl_app.calibrate.evidence.bandpass", "BandpassEvidence"),
    "depth-stage": ("dsl_app.calibrate.evidence.depth_stage", "DepthStageEvidence"),
}


def make_evidence(name: str) -> Evidence[Any]:
    """The widget for a recipe's name; `PlainEvidence` if it has none of its own."""
    if name not in _WIDGETS:
        return PlainEvidence()
    module, kind = _WIDGETS[name]
    made = getattr(import_module(module), kind)()
    assert isinstance(made, Evidence)
    return made


def side_by_side(*widgets: QWidget) -> QWidget:
    """Widgets in a row that share the room equally."""
    return boxed(row_of(*((widget, 1) for widget in widgets), margins=0))


def stacked(top: QWidget, bottom: QWidget, sizes: tuple[int, int]) -> QSplitter:
    """Two widgets above each other, with a handle between them."""
    return splitter(Qt.Orientation.Vertical, (top, 0), (bottom, 0), sizes=sizes)


class BackgroundReader(QObject):
    """Reads something in another thread and shows it in the window's; only the latest is shown."""

    def __init__(self, parent: QObject) -> None:
        super().__init__(parent)
        self._number = 0
        self._show: Callable[[Any], object] | None = None
        self._ended: SimpleQueue[tuple[int, object, Exception | None]] = SimpleQueue()
        self._timer = QTimer(self, interval=LOOK_MS)
        self._timer.timeout.connect(self._look)

    @property
    def is_busy(self) -> bool:
        """Whether something is still being read."""
        return self._show is not None

    def read(self, work: Callable[[], Any], show: Callable[[Any], object]) -> None:
        """Call ``show`` with what ``work`` returns, or with the exception that it raised."""
        self._number, self._show = self._number + 1, show
        number, ended = self._number, self._ended

        def run() -> None:
            # A signal of this object would crash the program if that was deleted just now, with its wizard.
            try:
                ended.put((number, work(), None))
            except Exception as error:  # shown in the window, never lost in a thread
                ended.put((number, None, error))

        QThreadPool.globalInstance().start(run)
        self._timer.start()

    def _look(self) -> None:
        while not self._ended.empty():
            self._finish(*self._ended.get())
        if not self.is_busy:
            self._timer.stop()

    def _finish(self, number: int, found: object, trouble: Exception | None) -> None:
        if number != self._number or self._show is None:
            return
        show, self._show = self._show, None
        show(found if trouble is None else trouble)
