"""The dialog to reconstruct a scan again: parameters and the name of the new result."""

from __future__ import annotations

from pathlib import Path

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

from dsl_app.results.reconstruct_again.controller import ReconstructionController
from dsl_app.results.reconstruct_again.state import OWN, ReconstructionRequest, ReconstructionState
from dsl_app.shared.evented import follow_any
from dsl_app.shared.widgets.dialogs import JobDialog
from dsl_app.shared.widgets.forms import ChoiceBox, NumberBox, check_box, label, named, push_button
from dsl_app.shared.widgets.help_window import add_help_key
from dsl_app.shared.widgets.layouts import row_of
from dsl_core.model.options import MODELS, SOLVERS, SpectralChoice

LOW_NM, HIGH_NM = 380.0, 780.0
DEVICES = (("Processor (CPU)", "cpu"), ("Graphics card (CUDA)", "cuda"))


WIDTH_PX = 620


class ReconstructionDialog(JobDialog):
    """Follows a `ReconstructionState` whose scan has been read; the controller reconstructs."""

    def __init__(
        self, state: ReconstructionState, control: ReconstructionController, parent: QWidget
    ) -> None:
        super().__init__(control.start, control.command_line, parent)
        source = state.source.value
        assert source is not None
        self._state, self._control, self._source = state, control, source
        self.setWindowTitle(f"Reconstruct {source.session.name} again")
        add_help_key(self, "reconstructing-again")
        self._make_parameters(state.request.value)
        self._make_target(state.request.value)
        #: Boxes by the field of the request that they tick.
        self._ticks = {name: getattr(self, name) for name in ("spectra", "refine", "override", "replace")}
        self._lay_out()
        self._connect()
        self.stops = [
            state.request.follow(self._show_request),
            *follow_any(self._judge, state.trouble, state.cost),
        ]
        self.name.setFocus()
        self.name.selectAll()
        self.resize(WIDTH_PX, self.sizeHint().height())

    # Make ------------------------------------------------------------------------------------------

    def _make_parameters(self, request: ReconstructionRequest) -> None:
        self.spectra = QCheckBox("Spectra")
        self.spectra.setToolTip("If not ticked, the result has depth only, in a fraction of the time")
        self.first = _nanometres("First band", request.start_nm, "Centre of the first band, nm")
        self.last = _nanometres(
            "Last band",
            request.stop_nm,
            "Centre of the last band, nm; a whole number of steps from the first",
        )
        self.step = NumberBox(
            "Band step", 0.5, 50, request.step_nm, "nm", 1,
            "Spacing of the bands, nm; half the step doubles the size and roughly doubles the time",
        )  # fmt: skip
        self.model = _choices("Correspondence", "Where each wavelength falls", MODELS)
        self.solver = _choices("Solver", "How spectra are computed from the frames", SOLVERS)
        self.refine = check_box(
            "Subpixel columns",
            "Refine depth with the lines; if not ticked, depth is quicker, but in whole columns",
        )
        own = self._source.calibration
        known = [(f"The scan's own: {own}" if own else "The scan has none", OWN)]
        known += [(name, name) for name in self._source.library]
        self.calibration = ChoiceBox("Calibration", "The scan's own, one from the library, or a file", known)
        self.file = push_button("&File…", "Choose a calibration file (.json)", self._choose_file)
        self.override = check_box(
            "Ignore different settings",
            "Use the calibration even if its camera or projector settings differ from those of the scan",
        )
        tip = "A graphics card is faster; it is offered if torch finds one"
        self.device = ChoiceBox("Compute on", tip, DEVICES if self._source.has_cuda else DEVICES[:1])
        self.device.setEnabled(self._source.has_cuda)

    def _make_target(self, request: ReconstructionRequest) -> None:
        tip = "The result is saved as NAME.zarr next to the scan, whose frames it refers to"
        self.name = named(QLineEdit(request.name), "Name of the result", tip)
        self.replace = QCheckBox("Replace an existing result")
        self.replace.setToolTip("If not ticked, existing results are never replaced")
        self.name_buttons(
            "Reconstruct",
            "Compute a new result; the scan and other results stay as they are",
            "Close without computing (Escape)",
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
        form.addRow("Compute on", self.device)
        form.addRow("Name", self.name)
        form.addRow("", self.replace)
        self.column.addLayout(form)
        self.column.addStretch(1)
        self.close_column()

    def _connect(self) -> None:
        change = self._control.change
        for field, box in self._ticks.items():
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

    # Show ------------------------------------------------------------------------------------------

    def _show_request(self, request: ReconstructionRequest) -> None:
        for field, box in self._ticks.items():
            box.setChecked(getattr(request, field))
        for widget in (self.first, self.last, self.step, self.model, self.solver):
            widget.setEnabled(request.spectra)
        self.override.setEnabled(request.calibration != OWN)

    def _judge(self) -> None:
        self.show_status(self._state.trouble.value, self._state.cost.value)

    # Do --------------------------------------------------------------------------------------------

    def _choose_file(self) -> None:
        folder = str(self._source.session.parent)
        name, _ = QFileDialog.getOpenFileName(self, "Choose a calibration", folder, "Calibrations (*.json)")
        if not name:
            return
        if self.calibration.findData(name) < 0:
            self.calibration.addItem(Path(name).name, name)
        self.calibration.choose(name)


def _nanometres(name: str, value: float, tip: str) -> NumberBox:
    return NumberBox(name, LOW_NM, HIGH_NM, value, "nm", 1, tip)


def _choices(name: str, tip: str, choices: tuple[SpectralChoice, ...]) -> ChoiceBox:
    """A choice whose tooltip says what each entry does and costs."""
    tips = [f"{tip}:", *(f"{each.title}: {each.about}" for each in choices)]
    return ChoiceBox(name, "\n".join(tips), [(each.title, each.name) for each in choices])


def _row(*widgets: QWidget) -> QHBoxLayout:
    return row_of(*((widget, 0 if isinstance(widget, QLabel | QPushButton) else 1) for widget in widgets))
