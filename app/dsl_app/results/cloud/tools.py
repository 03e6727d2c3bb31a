"""The row of tools below the 3D view: what is drawn, from where, and what is measured."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QMenu, QSlider, QToolButton, QWidget

from dsl_app.results.cloud.look import Look, Side
from dsl_app.results.cloud.measuring import Measure
from dsl_app.shared.plain_tip import plain_tip
from dsl_app.shared.widgets.forms import ChoiceBox, named
from dsl_app.shared.widgets.layouts import STRETCH, row_of

SIDES = (
    (Side.CAMERA, "From the camera (Home)"),
    (Side.FRONT, "Front"),
    (Side.TOP, "Top"),
    (Side.LEFT, "Left"),
    (Side.RIGHT, "Right"),
)
SWITCHES = (
    ("light", "Light", "Shade the surface by a lamp at the eye; off shows plain colours"),
    ("depth_shade", "Depth shading", "Darken what has something nearer next to it, so that edges stand out"),
    ("parallel", "Parallel projection", "Draw equal lengths equally long, wherever they are"),
    ("box", "Box with lengths", "Draw a box around nearly all points, with its lengths in mm"),
)
#: Shares of the points that stay when the farthest and nearest are hidden, %.
SHARES = (100, 99, 95, 90)
MEASURES = (
    ("Measure…", Measure.NOTHING),
    ("Distance", Measure.DISTANCE),
    ("Section", Measure.SECTION),
    ("Plane", Measure.PLANE),
)
#: The slider's steps a factor of two, and its range in steps.
STEPS, REACH = 8, 16


class CloudTools(QWidget):
    """Emits what is chosen: a `Look`, a `Side`, a share of points in percent, a `Measure`."""

    look_chosen = Signal(object)
    side_chosen = Signal(object)
    share_chosen = Signal(int)
    measure_chosen = Signal(object)

    def __init__(self) -> None:
        super().__init__()
        self.look = Look()
        tip = "Draw the surface between neighbouring points, cut at depth jumps, or the points alone"
        choices = (("Surface", True), ("Points", False))
        self.kind = ChoiceBox("Surface or points", tip, choices, lambda on: self._change(surface=on))
        self.point_size = named(QSlider(Qt.Orientation.Horizontal), "Size of points", "Size of points")
        self.point_size.setRange(-REACH, REACH)
        self.point_size.setFixedWidth(72)
        self.point_size.valueChanged.connect(lambda step: self._change(size=2.0 ** (step / STEPS)))
        self.sides, self.switches = QMenu(self), QMenu(self)
        for side, text in SIDES:
            self._add(self.sides, text, lambda side=side: self.side_chosen.emit(side))  # type: ignore[misc]
        self.switch: dict[str, QAction] = {}
        for key, text, tip in SWITCHES:
            self.switch[key] = self._switch(key, text, tip)
        self.switches.addSeparator()
        for share in SHARES:
            text = "All depths" if share == 100 else f"Middle {share} % of depths"
            self._add(self.switches, text, lambda share=share: self.share_chosen.emit(share))  # type: ignore[misc]
        self.view_button = self._menu_button("View", "Look at the points from a side", self.sides)
        self.show_button = self._menu_button("Show", "Light, projection, box and depths", self.switches)
        tip = "Measure on the points: a distance, a section along a line, or a plane"
        self.measure = ChoiceBox("Measure", tip, MEASURES, self.measure_chosen.emit)
        row = (self.kind, self.point_size, self.view_button, self.show_button, self.measure, STRETCH)
        row_of(*row, on=self, margins=0, spacing=6)
        self._show()

    def _add(self, menu: QMenu, text: str, do: Callable[[], object]) -> None:
        menu.addAction(text).triggered.connect(do)

    def _switch(self, key: str, text: str, tip: str) -> QAction:
        # One that the menu makes itself was once found deleted under its Python object.
        action = QAction(text, self)
        self.switches.addAction(action)
        action.setCheckable(True)
        action.setChecked(bool(getattr(self.look, key)))
        action.setToolTip(plain_tip(tip))
        action.toggled.connect(lambda on: self._change(**{key: on}))
        return action

    def _menu_button(self, text: str, tip: str, menu: QMenu) -> QToolButton:
        button = named(QToolButton(), text, tip)
        button.setText(text)
        button.setProperty("role", "menu")
        button.setMenu(menu)
        button.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        button.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        menu.setToolTipsVisible(True)
        return button

    def _change(self, **parts: bool | float) -> None:
        self.look = replace(self.look, **parts)  # type: ignore[arg-type]
        self._show()
        self.look_chosen.emit(self.look)

    def _show(self) -> None:
        self.kind.choose(self.look.surface)
        self.point_size.setVisible(not self.look.surface)
        self.switch["light"].setEnabled(self.look.surface)
