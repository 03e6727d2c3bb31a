"""What is shown and how: the five views, the tools, and the controls of the view at hand."""

from __future__ import annotations

from PySide6.QtCore import QSize, Qt
from PySide6.QtWidgets import (
    QButtonGroup,
    QCheckBox,
    QFrame,
    QHBoxLayout,
    QLabel,
    QSlider,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from dsl_app.results.commands import ResultCommands
from dsl_app.results.state import Quality, ResultsState, Tool, View
from dsl_app.shared.theme import Theme
from dsl_app.shared.widgets.forms import ChoiceBox, NumberBox, label
from dsl_app.shared.widgets.icons import icon
from dsl_app.shared.widgets.pictures import spread_of
from dsl_core.optics.relighting import LIGHTS

VIEWS = (
    (View.COLOUR, "sRGB", "Colours as the eye sees them under a light"),
    (View.BAND, "Band", "Reflectance of one band"),
    (View.DEPTH, "Depth", "Depth along the camera axis"),
    (View.QUALITY, "Quality", "Why pixels are limited, which order measured a band, and deviations"),
    (View.CLOUD, "3D cloud", "The points in space; drag to turn, wheel to zoom"),
)
TOOLS = (
    (Tool.PIN, "Pin", "Click to pin the spectrum of a pixel; drag to pan"),
    (Tool.RECTANGLE, "Rectangle", "Drag a rectangle: mean and deviation of its pixels"),
    (Tool.ELLIPSE, "Ellipse", "Drag the box around an ellipse: mean and deviation of its pixels"),
    (
        Tool.POLYGON,
        "Polygon",
        "Click the corners; double click, Enter or a right click closes, Escape gives up",
    ),
    (Tool.LASSO, "Lasso", "Draw around pixels, in the picture or in the cloud"),
)
#: What the cloud can be coloured by.
CLOUD_COLOURS = ((View.COLOUR, "sRGB"), (View.BAND, "Band"), (View.DEPTH, "Depth"), (View.QUALITY, "Quality"))
#: Sides of the tools' icons, and how narrow a choice may become, px.
ICON_PX, CHOICE_PX = 18, 110
_NEEDS_BAND = (Quality.ORDERS, Quality.SHARE, Quality.SPREAD)


class ViewBar(QWidget):
    """Follows a state and asks a controller."""

    def __init__(self, state: ResultsState, commands: ResultCommands) -> None:
        super().__init__()
        self._state, self._commands = state, commands
        self.views = {
            view: self._button(text, f"{tip} ({i})") for i, (view, text, tip) in enumerate(VIEWS, 1)
        }
        # Drawn and not written, as the smallest window has no room for the words.
        self.tools = {tool: self._button(text, f"{text}. {tip}") for tool, text, tip in TOOLS}
        for view, text, _ in VIEWS:
            self.views[view].setText(text)
        self._groups = [self._group(list(each.values())) for each in (self.views, self.tools)]
        self.slider = QSlider(Qt.Orientation.Horizontal)
        self.slider.setAccessibleName("Band")
        self.slider.setToolTip("Wavelength of the band (comma and full stop step it)")
        self.slider.setMinimumWidth(64)
        self.slider.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.nm = label("")
        self.nm.setMinimumWidth(self.nm.fontMetrics().horizontalAdvance("000.0 nm"))
        self.light = ChoiceBox("Light", "The light under which the colours are computed")
        for key, text in LIGHTS.items():
            self.light.addItem(text, key)
        self.adapted = QCheckBox("adapted eyes")
        self.adapted.setToolTip("White stays white, as to eyes used to the light; else as beside daylight")
        self.quality = ChoiceBox("Quality", "What the quality view shows")
        for each in Quality:
            self.quality.addItem(each.value[0].upper() + each.value[1:], each)
        self.cloud_by = ChoiceBox("Colour of the cloud", "What the points are coloured by")
        for view, text in CLOUD_COLOURS:
            self.cloud_by.addItem(text, view)
        hides = "what lies {} is hidden in the depth image and the cloud, whatever colours it"
        self.near, self.far = (
            NumberBox(f"{name} depth", 0.0, 1e5, 0.0, "mm", 1, f"{name} depth shown; {hides.format(beyond)}")
            for name, beyond in (("Nearest", "before it"), ("Farthest", "behind it"))
        )
        for box in (self.near, self.far):
            # Narrow, with the choice of a colour beside them: arrow keys step as well as buttons would.
            box.setButtonSymbols(NumberBox.ButtonSymbols.NoButtons)
            box.setFixedWidth(box.fontMetrics().horizontalAdvance("00000.0 mm") + 16)
        self.automatic = QCheckBox("auto")
        self.automatic.setAccessibleName("Automatic limits of depth")
        self.automatic.setToolTip(
            "Show all depths; colours cover nearly all pixels, and outliers take the ends"
        )
        for choice in (self.light, self.quality):
            # They may be narrower than their longest words; the list that opens is not.
            choice.setMinimumWidth(CHOICE_PX)
            choice.view().setMinimumWidth(choice.sizeHint().width())
        self._lay_out()
        self._connect()

    def apply_theme(self, theme: Theme) -> None:
        """Draw the tools in the colours of a theme."""
        for tool, button in self.tools.items():
            button.setIcon(icon(tool.value, theme.text, theme.on_accent))
            button.setIconSize(QSize(ICON_PX, ICON_PX))

    def _button(self, name: str, tip: str) -> QToolButton:
        button = QToolButton()
        button.setToolTip(tip)
        button.setAccessibleName(name)
        button.setProperty("role", "choice")
        button.setCheckable(True)
        button.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        return button

    def _group(self, buttons: list[QToolButton]) -> QButtonGroup:
        group = QButtonGroup(self)
        for button in buttons:
            group.addButton(button)
        return group

    def _lay_out(self) -> None:
        top = QHBoxLayout()
        top.setSpacing(4)
        for button in self.views.values():
            top.addWidget(button)
        line = QFrame()
        line.setFrameShape(QFrame.Shape.VLine)
        top.addSpacing(6)
        top.addWidget(line)
        top.addSpacing(6)
        for button in self.tools.values():
            top.addWidget(button)
        top.addStretch(1)
        self._light_label, self._cloud_label = QLabel("Light"), QLabel("Colour by")
        self._quality_label = QLabel("Show")
        depth, colours = QWidget(), QWidget()
        self._rows = depth, colours
        cloud = (self._cloud_label, self.cloud_by)
        limits = (QLabel("Depth"), self.near, QLabel("to"), self.far, self.automatic)
        light = (self._light_label, self.light, self.adapted)
        quality = (self._quality_label, self.quality)
        for holder, widgets in ((depth, (*cloud, *limits)), (colours, (*light, *quality, self.nm))):
            row = QHBoxLayout(holder)
            row.setContentsMargins(0, 0, 0, 0)
            row.setSpacing(8)
            for widget in widgets:
                row.addWidget(widget)
            if holder is colours:
                row.addWidget(self.slider, 1000)
            row.addStretch(1)
            # Both have one height, so that the picture does not jump between views.
            row.addStrut(self.light.sizeHint().height())
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.addLayout(top)
        for holder in self._rows:
            column.addWidget(holder)

    def _connect(self) -> None:
        state = self._state
        for view, button in self.views.items():
            button.clicked.connect(lambda _checked, view=view: self._show_view(view))
        for tool, button in self.tools.items():
            button.clicked.connect(lambda _checked, tool=tool: state.tool.set(tool))
        self.slider.valueChanged.connect(state.band.set)
        self.light.activated.connect(lambda _: self._relight())
        self.adapted.clicked.connect(lambda _: self._relight())
        self.quality.activated.connect(lambda _: state.quality.set(Quality(self.quality.currentData())))
        self.cloud_by.activated.connect(lambda _: state.cloud_by.set(View(self.cloud_by.currentData())))
        for box in (self.near, self.far):
            box.valueChanged.connect(lambda _: self._limit_depth())
        self.automatic.clicked.connect(self._limit_automatically)
        state.depth_limits.changed.connect(lambda _: self._show_limits())
        state.result.follow(lambda _: self._new_result())
        state.tool.follow(lambda tool: self.tools[tool].setChecked(True))
        state.band.follow(lambda _: self._show_band())
        state.light.changed.connect(lambda light: self.light.setCurrentIndex(self.light.findData(light)))
        state.adapted.follow(self.adapted.setChecked)
        for value in (state.view, state.quality, state.cloud_by):
            value.changed.connect(lambda _: self._show_controls())
        self._show_controls()

    def _show_view(self, view: View) -> None:
        self._commands.show(view)
        self.views[self._state.view.value].setChecked(True)

    def _relight(self) -> None:
        self._commands.relight(self.light.currentData(), self.adapted.isChecked())

    def _limit_automatically(self, automatic: bool) -> None:
        if automatic:
            self._commands.limit_depth(None)
        else:
            self._limit_depth()

    def _limit_depth(self) -> None:
        self._commands.limit_depth((self.near.value(), self.far.value()))
        # Limits that were refused go back.
        self._show_limits()

    def _show_limits(self) -> None:
        """Show the limits of the state; without any, those of the colours."""
        result, limits = self._state.result.value, self._state.depth_limits.value
        self.automatic.setChecked(limits is None)
        if limits is None and result is not None:
            limits = spread_of(result["depth_mm"])
        for box, value in zip((self.near, self.far), limits or (), strict=False):
            box.blockSignals(True)
            box.setValue(value)
            box.blockSignals(False)

    def _new_result(self) -> None:
        self._show_limits()
        result = self._state.result.value
        if result is not None and result.has_spectra:
            self.slider.setRange(0, len(result.wavelengths_nm) - 1)
        self._show_band()
        self._show_controls()

    def _show_band(self) -> None:
        result = self._state.result.value
        if result is not None and result.has_spectra:
            self.slider.setValue(self._state.band.value)
            self.nm.setText(f"{result.wavelengths_nm[self._state.band.value]:g} nm")

    def _show_controls(self) -> None:
        state = self._state
        self.views[state.view.value].setChecked(True)
        cloud = state.view.value is View.CLOUD
        shown = state.cloud_by.value if cloud else state.view.value
        self.cloud_by.setCurrentIndex(self.cloud_by.findData(state.cloud_by.value))
        self.quality.setCurrentIndex(self.quality.findData(state.quality.value))
        for widgets, visible in (
            ((self._light_label, self.light, self.adapted), shown is View.COLOUR),
            ((self._quality_label, self.quality), shown is View.QUALITY),
            ((self._cloud_label, self.cloud_by), cloud),
            (
                (self.nm, self.slider),
                shown is View.BAND or (shown is View.QUALITY and state.quality.value in _NEEDS_BAND),
            ),
        ):
            for widget in widgets:
                widget.setVisible(visible)
        depth, colours = self._rows
        depth.setVisible(cloud or shown is View.DEPTH)
        colours.setVisible(shown is not View.DEPTH)
