"""The bar above the picture: the five views, the tools, and the controls of the current view."""

from __future__ import annotations

from dataclasses import dataclass

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QBoxLayout, QButtonGroup, QFrame, QLabel, QLayout, QSlider, QToolButton, QWidget

from dsl_app.results.controller import ResultsController
from dsl_app.results.state import NEED_SPECTRA, QualityMap, ResultsState, ResultView, Tool
from dsl_app.shared.evented import follow_any
from dsl_app.shared.plain_tip import plain_tip
from dsl_app.shared.theme import Theme
from dsl_app.shared.widgets.forms import ChoiceBox, NumberBox, check_box, label, named, quiet
from dsl_app.shared.widgets.icons import icon
from dsl_app.shared.widgets.layouts import STRETCH, boxed, column_of, row_of
from dsl_core.optics.levels import spread_of
from dsl_core.optics.relighting import LIGHTS
from dsl_core.words import capitalised

VIEWS = (
    (ResultView.COLOUR, "Colour", "Colours as the eye sees them under a light source, or any three bands"),
    (ResultView.BAND, "Band", "Reflectance of one band"),
    (ResultView.DEPTH, "Depth", "Depth along the camera axis"),
    (
        ResultView.QUALITY,
        "Quality",
        "Why pixels are limited, the orders that measured a band, and deviations",
    ),
    (ResultView.CLOUD, "3D cloud", "The points in space; drag to rotate, wheel to zoom"),
)
TOOLS = (
    (Tool.PIN, "Pin", "Click to pin the spectrum of a pixel; drag to pan"),
    (Tool.RECTANGLE, "Rectangle", "Drag a rectangle: mean and standard deviation of its pixels"),
    (
        Tool.ELLIPSE,
        "Ellipse",
        "Drag a box for an ellipse: mean and standard deviation of its pixels",
    ),
    (
        Tool.POLYGON,
        "Polygon",
        "Click the corners; double-click, right-click or Enter to close, Escape to cancel",
    ),
    (Tool.LASSO, "Lasso", "Draw around pixels in the picture or the cloud"),
)
#: Views that can colour the cloud.
CLOUD_COLOURS = tuple((text, view) for view, text, _ in VIEWS if view is not ResultView.CLOUD)
#: Size of the tools' icons, and the smallest width of a choice, px.
ICON_PX, CHOICE_PX = 18, 110
#: Between the views and the tools, px.
_GAP_PX = 6
_NEEDS_BAND = (QualityMap.ORDERS, QualityMap.SHARE, QualityMap.SPREAD)


class ViewBar(QWidget):
    """Follows a state and asks its controller."""

    def __init__(self, state: ResultsState, control: ResultsController) -> None:
        super().__init__()
        self._state, self._control = state, control
        self.views = {
            view: self._button(text, f"{tip} ({i})") for i, (view, text, tip) in enumerate(VIEWS, 1)
        }
        # Icons, as the smallest window has no room for text.
        self.tools = {tool: self._button(text, f"{text}. {tip}") for tool, text, tip in TOOLS}
        for view, text, _ in VIEWS:
            self.views[view].setText(text)
        self._groups = [self._group(list(each.values())) for each in (self.views, self.tools)]
        tip = "Wavelength of the band (comma and full stop change it)"
        self.slider = named(QSlider(Qt.Orientation.Horizontal), "Band", tip)
        self.slider.setMinimumWidth(64)
        self.slider.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.nm = label("")
        self.nm.setMinimumWidth(self.nm.fontMetrics().horizontalAdvance("000.0 nm"))
        self.colours = ChoiceBox(
            "Colours",
            "True colours are what the eye sees; three bands show any three as red, green and blue",
            [("True colour", False), ("Three bands", True)],
            control.contrast.show_three_bands,
        )
        self.bands = tuple(self._band_box(place, name) for place, name in enumerate(("Red", "Green", "Blue")))
        self.contrast = self._button(
            "Contrast", "Contrast. Show the histogram of the picture and set its contrast on it"
        )
        lights = [(text, key) for key, text in LIGHTS.items()]
        self.light = ChoiceBox("Light", "The light source that colours are computed for", lights)
        self.adapted = check_box(
            "Adapted eyes",
            "White stays white under any light; if not ticked, colours look as they do to eyes adapted to"
            " daylight",
        )
        maps = [(capitalised(each.value), each) for each in QualityMap]
        self.quality = ChoiceBox("Quality", "What the quality view shows", maps, state.quality.set)
        tip = "What the points are coloured by"
        self.cloud_by = ChoiceBox("Colour of the cloud", tip, CLOUD_COLOURS, state.cloud_by.set)
        hides = "points {} are hidden in the depth image and in the cloud"
        self.near, self.far = (
            NumberBox(f"{name} depth", 0.0, 1e5, 0.0, "mm", 1, f"{name} depth shown; {hides.format(beyond)}")
            for name, beyond in (("Nearest", "in front of it"), ("Farthest", "behind it"))
        )
        for box in (self.near, self.far):
            # Narrow, as the colour choice is in the same row; arrow keys replace the buttons.
            box.setButtonSymbols(NumberBox.ButtonSymbols.NoButtons)
        self.automatic = check_box(
            "Auto", "Show all depths; the colours cover nearly all pixels, outliers get the end colours"
        )
        self.automatic.setAccessibleName("Automatic depth limits")
        for choice in (self.light, self.quality):
            # They may be narrower than their longest entry; the list that opens is not.
            choice.setMinimumWidth(CHOICE_PX)
            choice.view().setMinimumWidth(choice.sizeHint().width())
        self._lay_out()
        self._connect()

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Put the tools below the views where there is no room beside them: no word is cut."""
        super().resizeEvent(event)
        are_beside = self.width() >= self._beside_px
        way = QBoxLayout.Direction
        self._top.setDirection(way.LeftToRight if are_beside else way.TopToBottom)
        self._line.setVisible(are_beside)

    def apply_theme(self, theme: Theme) -> None:
        """Draw the icons in the colours of a theme."""
        drawn = {tool.value: button for tool, button in self.tools.items()} | {"contrast": self.contrast}
        for name, button in drawn.items():
            button.setIcon(icon(name, theme.text, theme.on_accent))
            button.setIconSize(QSize(ICON_PX, ICON_PX))

    def _button(self, name: str, tip: str) -> QToolButton:
        button = named(QToolButton(), name, tip)
        button.setProperty("role", "choice")
        button.setCheckable(True)
        button.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        return button

    def _band_box(self, channel: int, colour: str) -> ChoiceBox:
        tip = f"The band that is shown as {colour.lower()}, in nm"
        return ChoiceBox(
            f"{colour} band", tip, do=lambda band: self._control.contrast.choose_band(channel, band)
        )

    def _group(self, buttons: list[QToolButton]) -> QButtonGroup:
        group = QButtonGroup(self)
        for button in buttons:
            group.addButton(button)
        return group

    def _lay_out(self) -> None:
        line = QFrame()
        line.setFrameShape(QFrame.Shape.VLine)
        views = boxed(row_of(*self.views.values(), margins=0, spacing=2))
        tools = boxed(row_of(line, 4, *self.tools.values(), 4, self.contrast, STRETCH, margins=0, spacing=2))
        self._line, self._beside_px = line, views.sizeHint().width() + tools.sizeHint().width() + _GAP_PX
        for button in self.views.values():
            button.setMinimumWidth(button.sizeHint().width())
        self._top = QBoxLayout(QBoxLayout.Direction.LeftToRight)
        self._top.setSpacing(_GAP_PX)
        self._top.setContentsMargins(0, 0, 0, 0)
        self._top.addWidget(views, 0, Qt.AlignmentFlag.AlignLeft)
        self._top.addWidget(tools, 1)
        # Side by side they must not be what keeps the bar so wide that they never come below each other.
        self._top.setSizeConstraint(QLayout.SizeConstraint.SetNoConstraint)
        top = boxed(self._top)
        top.setMinimumWidth(views.sizeHint().width())
        self._light_label, self._cloud_label = QLabel("Light"), QLabel("Colour by")
        self._quality_label = QLabel("Show")
        cloud = (self._cloud_label, self.cloud_by)
        limits = (QLabel("Depth"), self.near, QLabel("to"), self.far, self.automatic)
        light = (self._light_label, self.light, self.adapted)
        self._band_labels = tuple(label(letter) for letter in "RGB")
        triples = zip(self._band_labels, self.bands, strict=True)
        three = (self.colours, 4, *(part for pair in triples for part in pair))
        quality = (self._quality_label, self.quality)
        depth = row_of(*cloud, *limits, STRETCH, margins=0, spacing=6)
        colours = row_of(
            *three, *light, *quality, self.nm, (self.slider, 1000), STRETCH, margins=0, spacing=8
        )
        for row in (depth, colours):
            # Both have the same height, so that the picture does not move between views.
            row.addStrut(self.light.sizeHint().height())
        self._rows = boxed(depth), boxed(colours)
        column_of(top, *self._rows, on=self, margins=0)

    def _connect(self) -> None:
        state = self._state
        for view, button in self.views.items():
            button.clicked.connect(lambda _checked, view=view: self._show_view(view))
        for tool, button in self.tools.items():
            button.clicked.connect(lambda _checked, tool=tool: state.tool.set(tool))
        self.contrast.clicked.connect(state.contrast.set)
        state.contrast.follow(self.contrast.setChecked)
        state.bands.changed.connect(lambda _: self._show_controls())
        self.slider.valueChanged.connect(state.band.set)
        self.light.activated.connect(lambda _: self._relight())
        self.adapted.clicked.connect(lambda _: self._relight())
        for box in (self.near, self.far):
            box.valueChanged.connect(lambda _: self._limit_depth())
        self.automatic.clicked.connect(self._limit_automatically)
        state.depth_limits.changed.connect(lambda _: self._show_limits())
        state.result.follow(lambda _: self._new_result())
        state.tool.follow(lambda tool: self.tools[tool].setChecked(True))
        state.band.follow(lambda _: self._show_band())
        state.light.changed.connect(self.light.choose)
        state.adapted.follow(self.adapted.setChecked)
        follow_any(self._show_controls, state.view, state.quality, state.cloud_by)

    def _show_view(self, view: ResultView) -> None:
        self._control.show(view)
        self.views[self._state.view.value].setChecked(True)

    def _relight(self) -> None:
        self._control.relight(self.light.currentData(), self.adapted.isChecked())

    def _limit_automatically(self, automatic: bool) -> None:
        if automatic:
            self._control.limit_depth(None)
        else:
            self._limit_depth()

    def _limit_depth(self) -> None:
        self._control.limit_depth((self.near.value(), self.far.value()))
        # The controller may have refused the limits.
        self._show_limits()

    def _show_limits(self) -> None:
        """Show the limits of the state, or those of the colours if there are none."""
        result, limits = self._state.result.value, self._state.depth_limits.value
        self.automatic.setChecked(limits is None)
        nearly_all = (0.0, 1000.0) if result is None else spread_of(result["depth_mm"])
        for box, value in zip((self.near, self.far), limits or nearly_all, strict=True):
            with quiet(box):
                box.fit(*nearly_all, 1)
                box.setValue(value)
            longest = max("0000.0 mm", box.text(), key=len)
            box.setFixedWidth(box.fontMetrics().horizontalAdvance(longest) + 14)

    def _new_result(self) -> None:
        self._show_limits()
        result = self._state.result.value
        if result is not None and result.has_spectra:
            self.slider.setRange(0, len(result.wavelengths_nm) - 1)
            for box in self.bands:
                box.clear()
                for band, nm in enumerate(result.wavelengths_nm):
                    box.addItem(f"{nm:g} nm", band)
        self._show_band()
        self._show_controls()

    def _show_band(self) -> None:
        result = self._state.result.value
        if result is not None and result.has_spectra:
            self.slider.setValue(self._state.band.value)
            self.nm.setText(f"{result.wavelengths_nm[self._state.band.value]:g} nm")

    def _offer_views(self) -> None:
        """Offer what the open result can show; why it cannot show the others is in their tooltips."""
        reason = self._state.no_spectra
        for number, (view, _, tip) in enumerate(VIEWS, 1):
            if view in NEED_SPECTRA:
                self.views[view].setEnabled(not reason)
                self.views[view].setToolTip(plain_tip(reason or f"{tip} ({number})"))
                self.cloud_by.offer(view, not reason)

    def _show_controls(self) -> None:
        state = self._state
        self._offer_views()
        self.views[state.view.value].setChecked(True)
        bands = state.bands.value
        needed = controls_for(state.view.value, state.cloud_by.value, state.quality.value, bands is not None)
        self.colours.choose(bands is not None)
        for box, band in zip(self.bands, bands or (), strict=False):
            box.choose(band)
        self.cloud_by.choose(state.cloud_by.value)
        self.quality.choose(state.quality.value)
        for widgets, visible in (
            ((self.colours,), needed.colours),
            ((*self._band_labels, *self.bands), needed.three_bands),
            ((self._light_label, self.light, self.adapted), needed.light),
            ((self._quality_label, self.quality), needed.quality),
            ((self._cloud_label, self.cloud_by), needed.cloud),
            ((self.nm, self.slider), needed.band),
            (self._rows[:1], needed.depth_row),
            (self._rows[1:], needed.colour_row),
        ):
            for widget in widgets:
                widget.setVisible(visible)


@dataclass(frozen=True)
class ViewControls:
    """Which controls a view needs, and which of the two rows they are in."""

    colours: bool
    three_bands: bool
    light: bool
    quality: bool
    band: bool
    cloud: bool
    depth_row: bool
    colour_row: bool


def controls_for(
    view: ResultView, cloud_by: ResultView, quality: QualityMap, three_bands: bool = False
) -> ViewControls:
    """The controls of a view; the cloud has those of the view that colours it as well.

    ``three_bands`` says that the colours are those of three bands, which no light changes.
    """
    cloud = view is ResultView.CLOUD
    shown = cloud_by if cloud else view
    by_quality = shown is ResultView.QUALITY
    return ViewControls(
        colours=shown is ResultView.COLOUR,
        three_bands=shown is ResultView.COLOUR and three_bands,
        light=shown is ResultView.COLOUR and not three_bands,
        quality=by_quality,
        band=shown is ResultView.BAND or (by_quality and quality in _NEEDS_BAND),
        cloud=cloud,
        depth_row=cloud or shown is ResultView.DEPTH,
        colour_row=shown is not ResultView.DEPTH,
    )
