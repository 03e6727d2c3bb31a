"""Accuracy against time: the curve, a table of expected and measured figures, and the search for a plan."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtGui import QHideEvent, QShowEvent
from PySide6.QtWidgets import QAbstractItemView, QFrame, QHeaderView, QSizePolicy, QWidget

from dsl_app.scan.forecast.controller import ForecastController
from dsl_app.scan.forecast.figures import FIGURES
from dsl_app.scan.forecast.operating_curve import OperatingCurve
from dsl_app.scan.forecast.state import ForecastPoint, ForecastState, identity
from dsl_app.shared.evented import follow_any
from dsl_app.shared.plain_tip import plain_tip
from dsl_app.shared.widget_state import LabelState
from dsl_app.shared.widgets.deferred import Deferred
from dsl_app.shared.widgets.forms import ChoiceBox, NumberBox, allow, label, push_button, show_label
from dsl_app.shared.widgets.layouts import STRETCH, HighArea, boxed, column_of, row_of
from dsl_app.shared.widgets.read_table import LEFT, RIGHT, ReadTable, cell
from dsl_app.shared.widgets.ticker import Ticker

#: Interval at which new predictions are fetched, ms.
FETCH_MS = 200
BUDGET, ERROR = "budget", "error"
#: Height of a row of the table.
ROW_PX = 19
#: Least height of the curve, px.
CURVE_PX = 180
NOTHING_YET = (
    "Nothing is predicted yet. Predictions need a connected rig with a calibration, and no running scan."
)
READY = "Nothing is predicted yet. Predictions begin as soon as the rig is free."
_HEADS = ("Figure", "This plan", "Published", "Last scan")


class ForecastPanel(QWidget):
    """Shows a `ForecastState` and calls its controller."""

    def __init__(self, state: ForecastState, controller: ForecastController) -> None:
        super().__init__()
        self._state, self._controller = state, controller
        self._pointed: ForecastPoint | None = None
        self._is_fixed = False
        self.curve = Deferred(self._make_curve)
        self.scene = ChoiceBox("Scene", "The scene to predict for: a chart, or that of the last result")
        self.scene.addItems(("for a chart", "for the last scan"))
        self.scene.setEnabled(False)
        self.scene.be_narrow(100)
        self.table = _table()
        wishes = (("Time at most", BUDGET), ("Error at most", ERROR))
        self.wish = ChoiceBox("Limit", "The limit to plan for: capture time, or error", wishes)
        self.budget = NumberBox("Maximum time", 1, 36000, 60, "s", 0, "Time for the capture")
        self.error = NumberBox(
            "Maximum error", 0.001, 1, 0.02, "", 4, "Reflectance error (RMSE) of a single pixel"
        )
        tip = "Find the most accurate plan within that time, or the quickest within that error"
        self.ask = push_button("Find plan", tip, self._ask)
        tip = "Predict all plans that the planner considers, which takes about a minute"
        self.all = push_button("Predict all plans", tip, controller.predict_all)
        self._answer, self._note = label("", wraps=True), label("", "muted", wraps=True)
        self._timer = Ticker(self, FETCH_MS, controller.take_news)
        self._lay_out()
        self._connect()

    def _lay_out(self) -> None:
        wish = row_of(self.wish, self.budget, self.error, self.ask, STRETCH)
        self._below = boxed(
            column_of(
                self._note, row_of(self.all, STRETCH), wish, self._answer, self.table, margins=0, spacing=5
            )
        )
        # In a low window they scroll, and the curve can still be read.
        below = HighArea(self._below)
        below.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Maximum)
        self.curve.setMinimumHeight(CURVE_PX)
        column_of((self.curve, 1), below, on=self, margins=(0, 6, 0, 0), spacing=5)

    def place_table(self, elsewhere: QWidget | None) -> None:
        """Put the figures on another widget with a layout, or back below the curve for None."""
        layout = (self._below if elsewhere is None else elsewhere).layout()
        assert layout is not None
        layout.addWidget(self.table)
        self.table.show()

    def _connect(self) -> None:
        state = self._state
        self.scene.activated.connect(self._look)
        self.wish.currentIndexChanged.connect(lambda _: self._show_wish())
        for box in (self.budget, self.error):
            box.lineEdit().returnPressed.connect(self._ask)
        self._show_wish()
        self.stops = [
            *follow_any(self._show_points, state.points, state.current),
            *follow_any(self._show_figures, state.measured),
            *follow_any(self._show_note, state.progress, state.trouble, state.refusal, state.is_ready),
            *follow_any(self._show_rest, state.progress, state.left),
            *follow_any(self._show_scene, state.look, state.last_look),
            state.answer.follow(lambda text: show_label(self._answer, LabelState(text))),
        ]

    def _show_wish(self) -> None:
        wants_time = self.wish.currentData() == BUDGET
        self.budget.setVisible(wants_time)
        self.error.setVisible(not wants_time)

    def _ask(self) -> None:
        if self.wish.currentData() == BUDGET:
            self._controller.answer(budget_s=self.budget.value())
        else:
            self._controller.answer(error=self.error.value())

    def _look(self, index: int) -> None:
        self._controller.look(self._state.last_look.value if index else None)

    def _show_scene(self) -> None:
        look, latest = self._state.look.value, self._state.last_look.value
        self.scene.setCurrentIndex(0 if look is None else 1)
        self.scene.setEnabled(latest is not None)
        self._show_note()

    def _make_curve(self) -> OperatingCurve:
        made = OperatingCurve()
        made.figure.be_narrow(100)
        made.head.addWidget(self.scene)
        made.chosen.connect(self._controller.choose)
        made.pointed.connect(self._point)
        made.fix(self._is_fixed)
        self._draw(made)
        return made

    def _draw(self, curve: OperatingCurve) -> None:
        curve.show_points(self._state.points.value, self._state.current.value)

    def _point(self, point: ForecastPoint | None) -> None:
        self._pointed = point
        self._show_figures()

    def _show_points(self) -> None:
        if self.curve.made is not None:
            self._draw(self.curve.made)
        self._show_figures()
        self._show_note()

    def _show_figures(self) -> None:
        state = self._state
        shown = self._pointed or state.current.value
        scan, published = state.measured.value, state.published
        title = _HEADS[1] if self._pointed is None else "Pointed at"
        self.table.setHorizontalHeaderLabels((_HEADS[0], title, *_HEADS[2:]))
        self._label_columns(shown)
        expected = None if shown is None else shown.expected
        best = None if published is None else published.expected
        for row, figure in enumerate(FIGURES):
            for column, text in enumerate(
                (figure.expected(expected), figure.expected(best), figure.found(scan)), 1
            ):
                item = self.table.item(row, column)
                assert item is not None
                item.setText(text)

    def _label_columns(self, shown: ForecastPoint | None) -> None:
        """Name the plan and the scan of each column."""
        scan = self._state.measured.value
        same = scan is not None and shown is not None and identity(scan.plan) == shown.key
        told = {
            1: "Predicted" if shown is None else f"Predicted for {shown.title}",
            2: "Predicted for the published plan, on this rig",
            3: "No scan yet"
            if scan is None
            else f"Measured on {scan.name}" + ("" if same else ", which had another plan"),
        }
        for column, text in told.items():
            heading = self.table.horizontalHeaderItem(column)
            if heading is not None:
                heading.setToolTip(plain_tip(text))

    def _show_note(self) -> None:
        state = self._state
        done, total = state.progress.value
        self._timer.run_while(bool(total))
        if state.trouble.value:
            text = state.trouble.value
        elif state.refusal.value:
            text = state.refusal.value
        elif not state.points.value:
            text = "Predicting…" if total else READY if state.is_ready.value else NOTHING_YET
        else:
            chart = f"a Color Checker at {state.depth_mm.value:.0f} mm"
            scene = chart if state.look.value is None else f"the scene of {state.look.value.stem}"
            origin = f"Expected from the calibration, for {scene} (press F1 to read how)."
            text = f"{done} of {total} plans predicted. {origin}" if total > 1 else origin
            if state.current.value is not None:
                text = f"{text} {state.current.value.remark}".rstrip()
        self._note.setText(text)
        self._enable_search()

    def _show_rest(self) -> None:
        left, (_, total) = self._state.left.value, self._state.progress.value
        self.all.setText(f"Predict {left} more plans")
        self.all.setVisible(bool(left))
        self.all.setEnabled(not total and not self._is_fixed)

    def showEvent(self, event: QShowEvent) -> None:
        """Predictions are made while they can be seen."""
        super().showEvent(event)
        # The header has its height in this theme only now.
        head_px = self.table.horizontalHeader().sizeHint().height()
        self.table.setFixedHeight(head_px + len(FIGURES) * ROW_PX + 4)
        self._controller.open(True)

    def hideEvent(self, event: QHideEvent) -> None:
        """What runs goes on; nothing new is begun."""
        super().hideEvent(event)
        self._controller.open(False)

    def fix(self, fixed: bool) -> None:
        """Disable choices while a scan is running."""
        self._is_fixed = fixed
        if self.curve.made is not None:
            self.curve.made.fix(fixed)
        self._enable_search()
        self._show_rest()

    def _enable_search(self) -> None:
        for box in (self.wish, self.budget, self.error):
            box.setEnabled(not self._is_fixed)
        # The plan of a scan that runs, or that was begun, stays as it is.
        why = "The plan of a scan is fixed." if self._is_fixed else "Predict plans first."
        allow(self.ask, not self._is_fixed and bool(self._state.points.value), why)

    def release(self) -> None:
        """Disconnect from all state."""
        self._timer.stop()
        self._controller.close()


def _table() -> ReadTable:
    table = ReadTable(
        "Expected figures",
        "Expected figures of this plan and of the published one, and measured ones of the last scan",
        _HEADS,
        rows=len(FIGURES),
    )
    table.setSelectionMode(QAbstractItemView.SelectionMode.NoSelection)
    table.setFrameShape(QFrame.Shape.NoFrame)
    table.setVerticalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
    table.verticalHeader().setDefaultSectionSize(ROW_PX)
    table.verticalHeader().setMinimumSectionSize(ROW_PX)
    header = table.horizontalHeader()
    header.setDefaultAlignment(RIGHT)
    for column in range(1, len(_HEADS)):
        header.setSectionResizeMode(column, QHeaderView.ResizeMode.Stretch)
    header.setHighlightSections(False)
    for row, figure in enumerate(FIGURES):
        for column in range(len(_HEADS)):
            item = cell(figure.title if column == 0 else "", side=RIGHT if column else LEFT)
            item.setToolTip(plain_tip(figure.tip))
            table.setItem(row, column, item)
    first = table.horizontalHeaderItem(0)
    if first is not None:
        first.setTextAlignment(LEFT)
    return table
