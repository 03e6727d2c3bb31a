"""Evidence of the geometry: where corners were, the errors of every pose, and poses to leave out."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QGraphicsRectItem, QTableWidgetItem

from dsl_app.calibrate.evidence.base import Evidence, side_by_side, stacked
from dsl_app.calibrate.evidence.charts import BAR, DOT, Bars, ChartBox, draw_bars, like_a_picture
from dsl_app.calibrate.evidence.tables import Cell, NumberTable, with_spread
from dsl_app.shared.widgets.forms import label, push_button, quiet, set_role
from dsl_app.shared.widgets.layouts import column_of, row_of
from dsl_core.calibration.geometry.pose_series import CELLS, GOOD_RMS_PX, MIN_POSES
from dsl_core.model.calibration.geometry import GeometryCalibration, PoseQuality

if TYPE_CHECKING:
    from dsl_core.campaign.session import CalibrationSession

HEADS = (
    ("Pose", "Untick a pose to solve again without it"),
    ("Corners", "Corners of the board that were found, and how many of them are outliers"),
    ("Camera, px", "RMS error of the corners in the camera's picture"),
    ("Projector, px", "RMS error of the corners in the projector's picture"),
    ("At, mm", "Mean distance of the board along the camera's axis"),
    ("Tilt, °", "Angle between board and image plane"),
    ("Square, mm", "Side of a square, triangulated, with its deviation"),
    ("Plane, mm", "RMS distance of the triangulated corners from their best plane"),
    ("Verdict", "Whether the pose is used, and why not"),
)


class GeometryEvidence(Evidence[GeometryCalibration]):
    """Coverage and errors above a table of poses; unticked poses are left out when it is solved again."""

    def __init__(self) -> None:
        super().__init__(GeometryCalibration)
        self._keys: dict[str, str] = {}
        self._unticked: frozenset[str] = frozenset()
        self.coverage = ChartBox(
            "Corners over the camera's picture",
            "Each dot is a corner of the board; shaded cells contain one. The selected pose is marked.",
            "Row (px)",
            "Column (px)",
            prepare=like_a_picture,
        )
        self.errors = ChartBox(
            "Error of each pose",
            f"RMS distance of corners from their expected positions; below {GOOD_RMS_PX} px is good.",
            "RMS error (px)",
            "Pose",
            left_width=60,
        )
        self.table = NumberTable("Poses", HEADS, words=(0, 8))
        self.diagnosis = label("", "muted", wraps=True)
        self.again = push_button(
            "Solve again", "Fit lenses and pose again with the ticked poses; captures of the others are kept"
        )
        self.again.setAccessibleName("Solve again with the ticked poses")
        self.again.clicked.connect(self._ask)
        self.table.itemChanged.connect(self._ticked)
        self.table.itemSelectionChanged.connect(self._draw_coverage)
        self._lay_out()

    def _lay_out(self) -> None:
        charts = side_by_side(self.coverage, self.errors)
        charts.setContentsMargins(0, 0, 0, 6)
        foot = row_of((self.diagnosis, 1), (self.again, 0, Qt.AlignmentFlag.AlignTop))
        column_of((stacked(charts, self.table, (260, 200)), 1), foot, on=self, margins=0)

    def _begin(self, record: GeometryCalibration, session: CalibrationSession) -> None:
        self._keys = {step.title: step.key for step in session.steps}
        self._unticked = frozenset(each.name for each in record.left_out if each.by_hand)
        self._fill(record)

    # Poses to leave out ----------------------------------------------------------------------------

    def _fill(self, record: GeometryCalibration) -> None:
        rows = {pose.name: _row(pose) for pose in record.poses}
        rows |= {each.name: [each.name, *[""] * 7, (each.reason, "warn")] for each in record.left_out}
        order = [*(name for name in self._keys if name in rows), *(n for n in rows if n not in self._keys)]
        with quiet(self.table):
            self.table.fill([rows[name] for name in order])
            unreadable = {each.name for each in record.left_out if not each.by_hand}
            for item in self._names():
                if item.text() in self._keys and item.text() not in unreadable:
                    ticked = item.text() not in self._unticked
                    item.setCheckState(Qt.CheckState.Checked if ticked else Qt.CheckState.Unchecked)
        self._ticked()

    def _names(self) -> list[QTableWidgetItem]:
        found = [self.table.item(row, 0) for row in range(self.table.rowCount())]
        return [item for item in found if item is not None]

    def _choices(self) -> list[QTableWidgetItem]:
        """The names that have a box."""
        return [item for item in self._names() if item.data(Qt.ItemDataRole.CheckStateRole) is not None]

    def _is_ticked(self, item: QTableWidgetItem) -> bool:
        return item.checkState() == Qt.CheckState.Checked

    def _ticked(self) -> None:
        choices = self._choices()
        ticked = sum(self._is_ticked(item) for item in choices)
        changed = frozenset(i.text() for i in choices if not self._is_ticked(i)) != self._unticked
        self.again.setEnabled(changed and ticked >= MIN_POSES)
        self.again.setText(f"Solve again with {ticked} poses" if changed else "Solve again")
        self._diagnose(changed and ticked < MIN_POSES)

    def _ask(self) -> None:
        keys = [self._keys[item.text()] for item in self._choices() if not self._is_ticked(item)]
        self.settings_requested.emit({"left_out": ",".join(keys)})

    def _diagnose(self, too_few: bool) -> None:
        record = self._record
        assert record is not None
        words, role = "There are no doubts about these poses.", "muted"
        if record.warnings:
            words, role = " ".join(record.warnings), "warn"
        if too_few:
            words, role = f"At least {MIN_POSES} poses are needed; tick more of them.", "bad"
        self.diagnosis.setText(words)
        set_role(self.diagnosis, role)

    # Charts ----------------------------------------------------------------------------------------

    def _draw_record(self, record: GeometryCalibration) -> None:
        self.coverage.draw(self._draw_coverage)
        self.errors.draw(lambda: self._draw_errors(record))

    def _draw_coverage(self) -> None:
        record = self._record
        if record is None:
            return
        known = [pose for pose in record.poses if pose.corners_px]
        if not known:
            self.coverage.say("This calibration was made before corners were kept. Fit it again to see them.")
            return
        theme, size = self._theme, (record.camera.width_px, record.camera.height_px)
        self.coverage.begin()
        used = np.concatenate([pose.corners_px for pose in known if pose.used])
        self.coverage.item.addItem(_cells(used, size, theme.accent))
        rows = self.table.selectionModel().selectedRows()
        chosen = {item.text() for item in self._names() if item.row() in {each.row() for each in rows}}
        for pose in known:
            colour = theme.warn if pose.name in chosen else theme.text if pose.used else theme.muted
            self.coverage.item.addItem(
                pg.ScatterPlotItem(
                    pos=np.array(pose.corners_px),
                    size=6 if pose.name in chosen else 3,
                    brush=colour if pose.used else None,
                    pen=None if pose.used else pg.mkPen(colour),
                )
            )
        frame = QGraphicsRectItem(-0.5, -0.5, *size)
        frame.setPen(pg.mkPen(theme.muted, width=1))
        self.coverage.item.addItem(frame)
        self.coverage.item.setRange(xRange=(0, size[0]), yRange=(0, size[1]), padding=0.02)
        covered = f"covered, {100 * record.camera_coverage:.0f} % of the cells"
        chosen_keys = [(name, theme.warn, DOT) for name in sorted(chosen)]
        self.coverage.name_curves((covered, theme.accent, BAR), *chosen_keys)

    def _draw_errors(self, record: GeometryCalibration) -> None:
        is_pale = [not pose.used for pose in record.poses]
        camera = np.array([pose.camera_rms_px for pose in record.poses])
        projector = np.array([pose.projector_rms_px for pose in record.poses])
        kinds = (
            Bars(f"camera, {record.camera_rms_px:.3f} px in all", self._theme.pins[0], camera, is_pale),
            Bars(f"projector, {record.projector_rms_px:.3f} px", self._theme.pins[1], projector, is_pale),
        )
        names = [pose.name.removeprefix("Pose ") for pose in record.poses]
        draw_bars(self.errors, kinds, names, GOOD_RMS_PX, self._theme)


def _row(pose: PoseQuality) -> list[Cell]:
    corners = f"{pose.corners}" + (f" ({pose.outliers} off)" if pose.outliers else "")
    return [
        pose.name,
        corners,
        f"{pose.camera_rms_px:.3f}",
        f"{pose.projector_rms_px:.3f}",
        f"{pose.distance_mm:.0f}",
        f"{pose.tilt_deg:.0f}",
        with_spread(pose.measured.square_mm, pose.measured.square_std_mm),
        f"{pose.measured.plane_rms_mm:.3f}",
        ("used", "good") if pose.used else ("does not fit the others", "bad"),
    ]


def _cells(corners_px: Any, size: tuple[int, int], colour: str) -> Any:
    """The cells of the picture that hold a corner, tinted."""
    held, _, _ = np.histogram2d(
        corners_px[:, 1], corners_px[:, 0], bins=CELLS, range=((-0.5, size[1] - 0.5), (-0.5, size[0] - 0.5))
    )
    picture = np.zeros((CELLS, CELLS, 4), np.uint8)
    picture[held > 0] = (*bytes.fromhex(colour[1:]), 60)
    image = pg.ImageItem(picture, axisOrder="row-major")
    image.setRect(-0.5, -0.5, *size)
    return image
