"""With which parameters a scan is reconstructed again, and under which name the result is kept."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Protocol

from PySide6.QtWidgets import (
    QCheckBox,
    QFileDialog,
    QFormLayout,
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QPushButton,
    QWidget,
)

from dsl_app.results.again.state import OWN, AgainOrder, AgainState
from dsl_app.shared.widgets.dialogs import OrderCommands, OrderDialog
from dsl_app.shared.widgets.forms import ChoiceBox, NumberBox, label, push_button
from dsl_app.shared.widgets.help_window import add_help_key
from dsl_core.model.options import MODELS, SOLVERS, SpectralChoice

LOW_NM, HIGH_NM = 380.0, 780.0
DEVICES = (("cpu", "Processor (CPU)"), ("cuda", "Graphics card (CUDA)"))


class AgainCommands(OrderCommands, Protocol):
    """What the dialog asks of its controller."""

    def change(self, **what: Any) -> None:
        """Change fields of the order."""


class AgainDialog(OrderDialog):
    """Follows an `AgainState` whose scan was looked at; the controller reconstructs."""

    def __init__(self, state: AgainState, commands: AgainCommands, parent: QWidget) -> None:
        super().__init__(commands, parent)
        source = state.source.value
        assert source is not None
        self._state, self._commands, self._source = state, commands, source
        self.setWindowTitle(f"Reconstruct {source.session.name} again")
        self.resize(620, 420)
        add_help_key(self, "reconstructing-again")
        self._make_parameters(state.order.value)
        self._make_target(state.order.value)
        self._lay_out()
        self._connect()
        self.stops = [
            state.order.follow(self._show_order),
            state.trouble.follow(lambda _: self._judge()),
            state.cost.changed.connect(lambda _: self._judge()),
        ]
        self.name.setFocus()
        self.name.selectAll()

    # Make ------------------------------------------------------------------------------------------

    def _make_parameters(self, order: AgainOrder) -> None:
        self.spectra = QCheckBox("Spectra")
        self.spectra.setToolTip("Without them the result holds depth only, in a fraction of the time")
        self.first = _nanometres("First band", order.start_nm, "Centre of the first band, nm")
        self.last = _nanometres(
            "Last band", order.stop_nm, "Centre of the last band, nm; a whole number of steps from the first"
        )
        self.step = NumberBox(
            "Step of the bands", 0.5, 50, order.step_nm, "nm", 1,
            "Distance of two bands, nm; half the step is twice the bytes and about twice the time",
        )  # fmt: skip
        self.model = _choices("Correspondence", "Where each wavelength falls", MODELS)
        self.solver = _choices("Solver", "How spectra are found in the frames", SOLVERS)
        self.refine = QCheckBox("Columns below one pixel")
        self.refine.setToolTip(
            "Finer depth by the lines; without it depth is quicker, and whole columns only"
        )
        self.calibration = ChoiceBox("Calibration", "The scan's own, one of the library, or a file")
        own = self._source.calibration
        self.calibration.addItem(f"The scan's own: {own}" if own else "The scan holds none", OWN)
        for name in self._source.library:
            self.calibration.addItem(name, name)
        self.file = push_button("&File…", "Choose the file of a calibration (.json)")
        self.override = QCheckBox("Use it although settings differ")
        self.override.setToolTip(
            "Without this, a calibration is refused whose camera or projector was set otherwise"
        )
        self.device = ChoiceBox("Computed on", "A graphics card is quicker where torch finds one")
        for key, text in DEVICES:
            if key == "cpu" or self._source.has_cuda:
                self.device.addItem(text, key)
        self.device.setEnabled(self._source.has_cuda)

    def _make_target(self, order: AgainOrder) -> None:
        self.name = QLineEdit(order.name)
        self.name.setAccessibleName("Name of the result")
        self.name.setToolTip("The result is kept as NAME.zarr beside the scan, whose frames it needs")
        self.replace = QCheckBox("Replace the one of this name")
        self.replace.setToolTip("Without this, nothing that exists is touched")
        self.name_buttons(
            "Reconstruct",
            "Turn the frames into a new result; the scan and other results stay as they are",
            "Do nothing (Escape)",
        )

    def _lay_out(self) -> None:
        form = QFormLayout()
        form.addRow("Scan", label(str(self._source.session.name), "muted"))
        form.addRow("", self.spectra)
        to, every = label("to", "muted"), label("every", "muted")
        form.addRow("Bands", _row(self.first, to, self.last, every, self.step))
        form.addRow("Correspondence", self.model)
        form.addRow("Solver", self.solver)
        form.addRow("", self.refine)
        form.addRow("Calibration", _row(self.calibration, self.file))
        form.addRow("", self.override)
        form.addRow("Computed on", self.device)
        form.addRow("Name", self.name)
        form.addRow("", self.replace)
        self.column.addLayout(form)
        self.column.addStretch(1)
        self.close_column()

    def _connect(self) -> None:
        change = self._commands.change
        for box, field in (
            (self.spectra, "spectra"),
            (self.refine, "refine"),
            (self.override, "override"),
            (self.replace, "replace"),
        ):
            box.toggled.connect(lambda on, field=field: change(**{field: on}))
        for number, field in ((self.first, "start_nm"), (self.last, "stop_nm"), (self.step, "step_nm")):
            number.valueChanged.connect(lambda value, field=field: change(**{field: value}))
        for choice, field in (
            (self.model, "model"),
            (self.solver, "solver"),
            (self.device, "device"),
            (self.calibration, "calibration"),
        ):
            choice.currentIndexChanged.connect(
                lambda index, choice=choice, field=field: change(**{field: choice.itemData(index)})
            )
        self.name.textChanged.connect(lambda text: change(name=text.strip()))
        self.file.clicked.connect(self._choose_file)

    # Show ------------------------------------------------------------------------------------------

    def _show_order(self, order: AgainOrder) -> None:
        for box, on in (
            (self.spectra, order.spectra),
            (self.refine, order.refine),
            (self.override, order.override),
            (self.replace, order.replace),
        ):
            box.setChecked(on)
        for widget in (self.first, self.last, self.step, self.model, self.solver):
            widget.setEnabled(order.spectra)
        self.override.setEnabled(order.calibration != OWN)

    def _judge(self) -> None:
        self.judge(self._state.trouble.value, self._state.cost.value)

    # Do --------------------------------------------------------------------------------------------

    def _choose_file(self) -> None:
        folder = str(self._source.session.parent)
        name, _ = QFileDialog.getOpenFileName(self, "Choose a calibration", folder, "Calibrations (*.json)")
        if not name:
            return
        if self.calibration.findData(name) < 0:
            self.calibration.addItem(Path(name).name, name)
        self.calibration.setCurrentIndex(self.calibration.findData(name))


def _nanometres(name: str, value: float, tip: str) -> NumberBox:
    return NumberBox(name, LOW_NM, HIGH_NM, value, "nm", 1, tip)


def _choices(name: str, tip: str, choices: tuple[SpectralChoice, ...]) -> ChoiceBox:
    """A box whose entries say what they do and cost, and so does its tooltip."""
    box = ChoiceBox(name, "\n".join([f"{tip}:", *(f"{each.title}: {each.about}" for each in choices)]))
    for each in choices:
        box.addItem(each.title, each.name)
    return box


def _row(*widgets: QWidget) -> QHBoxLayout:
    row = QHBoxLayout()
    for widget in widgets:
        row.addWidget(widget, 0 if isinstance(widget, QLabel | QPushButton) else 1)
    return row
