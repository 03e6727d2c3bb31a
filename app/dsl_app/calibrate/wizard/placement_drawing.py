"""What to place where in a step of a calibration, drawn from above and as the camera sees it."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QFontMetricsF, QPainter, QPaintEvent, QPen, QPolygonF
from PySide6.QtWidgets import QSizePolicy, QWidget

from dsl_app.calibrate.wizard.placement_scene import (
    NAMES,
    PICTURE_ASPECT,
    Face,
    Part,
    Point,
    film_text,
    in_words,
)
from dsl_app.shared.plain_tip import plain_tip
from dsl_app.shared.theme import DARK, Theme
from dsl_core.model.placement import Placement
from dsl_core.optics.colour import CIE_1931_XYZ, CIE_NM, xyz_to_srgb

#: The farthest that the view from above shows, mm.
FARTHEST_MM = 1000.0
#: Where camera and projector stand, and half the width of a target of 400 mm, as shares of that view's width.
CAMERA_AT, PROJECTOR_AT, TARGET_HALF = 0.3, 0.72, 0.4
PAD = 8.0
#: Luminance of pure colours: bright enough to tell red from violet.
PURE_LUMINANCE = 0.55


class PlacementDrawing(QWidget):
    """Camera, projector, film, filter and target of a placement; describes in words what it draws."""

    def __init__(self) -> None:
        super().__init__()
        self._theme = DARK
        self._placement = Placement()
        self.setMinimumSize(260, 200)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setAccessibleName("Drawing of what to place where")
        self.show_placement(self._placement)

    def sizeHint(self) -> QSize:
        """A comfortable size next to an instruction; it takes what room there is besides."""
        return QSize(420, 220)

    def show_placement(self, placement: Placement) -> None:
        """Draw a placement."""
        self._placement = placement
        words = in_words(placement)
        self.setAccessibleDescription(words)
        self.setToolTip(plain_tip(words))
        self.update()

    def apply_theme(self, theme: Theme) -> None:
        """Take the colours of a theme."""
        self._theme = theme
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        """Draw from above, and next to it what the camera sees of the target."""
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        area = QRectF(self.rect()).adjusted(0.5, 0.5, -0.5, -0.5)
        painter.setPen(QPen(QColor(self._theme.line), 1))
        painter.setBrush(QColor(self._theme.base))
        painter.drawRoundedRect(area, 4, 4)
        face = Face.of(self._placement)
        inner = area.adjusted(PAD, PAD, -PAD, -PAD)
        if face is None:
            self._from_above(painter, inner, None)
            return
        share = 0.56 if inner.width() < 1.9 * inner.height() else 0.48
        above = QRectF(inner.left(), inner.top(), inner.width() * share, inner.height())
        self._from_above(painter, above, face)
        left = above.right() + PAD
        self._as_seen(painter, QRectF(left, inner.top(), inner.right() - left, inner.height()), face)

    # From above ------------------------------------------------------------------------------------

    def _from_above(self, painter: QPainter, area: QRectF, face: Face | None) -> None:
        line = QFontMetricsF(self.font()).height()
        self._text(painter, QPointF(area.left(), area.top()), "from above", self._theme.muted, "left")
        floor = area.bottom() - 2 * line - 4
        device = min(26.0, area.width() * 0.13)
        camera = QPointF(area.left() + area.width() * CAMERA_AT, floor - device)
        projector = QPointF(area.left() + area.width() * PROJECTOR_AT, floor - device)
        depth_px = (camera.y() - area.top() - 1.6 * line) / FARTHEST_MM
        ends = self._ends(area, camera, depth_px, face)
        self._beams(painter, camera, projector, ends, face is not None)
        self._target(painter, ends, face)
        if face is not None:
            self._distance(painter, camera, ends, face)
        self._camera(painter, camera, device)
        self._projector(painter, projector, device)
        self._filter(painter, camera, device)
        self._film(painter, projector, device)
        text, muted = self._theme.text, self._theme.muted
        nm = self._placement.filter_nm
        self._text(painter, QPointF(camera.x(), floor + 4), "camera", text)
        self._text(painter, QPointF(projector.x(), floor + 4), "projector", text)
        below = floor + 4 + line
        self._text(painter, QPointF(camera.x(), below), "no filter" if nm is None else f"{nm:g} nm", muted)
        self._text(painter, QPointF(projector.x(), below), film_text(self._placement), muted)

    def _ends(
        self, area: QRectF, camera: QPointF, depth_px: float, face: Face | None
    ) -> tuple[QPointF, QPointF]:
        """The target's left and right end as seen from above."""
        middle = area.left() + area.width() * (CAMERA_AT + PROJECTOR_AT) / 2
        if face is None:
            y = camera.y() - 700 * depth_px
            half = area.width() * TARGET_HALF * 0.75
            return QPointF(middle - half, y), QPointF(middle + half, y)
        across_px = area.width() * TARGET_HALF / 200.0
        half_mm = min(face.half_mm[0], 200.0)
        flat = Face(face.target, face.middle_mm, face.tilt_x_deg, face.tilt_y_deg, 0.0, face.half_mm)
        (left, _, near), (right, _, far) = flat.at(-half_mm, 0), flat.at(half_mm, 0)

        def seen(x: float, z: float) -> QPointF:
            # Depth changes across the target are as many pixels as widths, so that angles look right.
            turn = (z - face.middle_mm[2]) * across_px
            shift = min(max(x, -190.0), 190.0) * across_px * 0.85
            return QPointF(middle + shift, camera.y() - min(face.middle_mm[2], FARTHEST_MM) * depth_px - turn)

        return seen(left, near), seen(right, far)

    def _beams(
        self, painter: QPainter, camera: QPointF, projector: QPointF, ends: tuple[QPointF, QPointF], lit: bool
    ) -> None:
        painter.setPen(Qt.PenStyle.NoPen)
        if lit:
            light = QColor(self._theme.accent)
            light.setAlpha(34)
            painter.setBrush(light)
            painter.drawPolygon(QPolygonF([projector, *ends]))
        painter.setPen(QPen(QColor(self._theme.line), 1, Qt.PenStyle.DashLine))
        for end in ends:
            painter.drawLine(camera, end)

    def _target(self, painter: QPainter, ends: tuple[QPointF, QPointF], face: Face | None) -> None:
        above = QPointF((ends[0].x() + ends[1].x()) / 2, min(end.y() for end in ends) - 4)
        name = NAMES[self._placement.target]
        if face is None:
            painter.setPen(QPen(QColor(self._theme.muted), 1.5, Qt.PenStyle.DashLine))
            if self._placement.target == "as it is":
                painter.drawLine(*ends)
        else:
            painter.setPen(_bar(self._theme.text, 5))
            painter.drawLine(*ends)
        self._text(painter, above, name, self._theme.text, "above")

    def _distance(
        self, painter: QPainter, camera: QPointF, ends: tuple[QPointF, QPointF], face: Face
    ) -> None:
        x = camera.x()
        share = (x - ends[0].x()) / max(ends[1].x() - ends[0].x(), 1.0)
        share = min(max(share, 0.0), 1.0)
        top = QPointF(x, ends[0].y() + share * (ends[1].y() - ends[0].y()) + 4)
        start = QPointF(x, camera.y() - 14)
        painter.setPen(QPen(QColor(self._theme.accent), 1.2))
        painter.drawLine(start, top)
        for at, way in ((start, -4.0), (top, 4.0)):
            painter.drawLine(at, QPointF(x - 3, at.y() + way))
            painter.drawLine(at, QPointF(x + 3, at.y() + way))
        metrics = QFontMetricsF(self.font())
        words = face.distance_text
        middle = QPointF(x, (start.y() + top.y()) / 2 - metrics.height() / 2)
        width = metrics.horizontalAdvance(words) + 6
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor(self._theme.base))
        painter.drawRect(QRectF(middle.x() - width / 2, middle.y(), width, metrics.height()))
        self._text(painter, middle, words, self._theme.text)

    def _camera(self, painter: QPainter, at: QPointF, size: float) -> None:
        self._solid(painter)
        painter.drawRoundedRect(QRectF(at.x() - size / 2, at.y(), size, size), 3, 3)
        painter.drawRect(QRectF(at.x() - size * 0.28, at.y() - size * 0.28, size * 0.56, size * 0.3))

    def _projector(self, painter: QPainter, at: QPointF, size: float) -> None:
        self._solid(painter)
        painter.drawRoundedRect(QRectF(at.x() - size * 0.8, at.y(), size * 1.6, size), 3, 3)
        painter.setBrush(QColor(self._theme.accent))
        painter.drawEllipse(QPointF(at.x(), at.y() + size * 0.2), size * 0.16, size * 0.16)

    def _solid(self, painter: QPainter) -> None:
        painter.setPen(QPen(QColor(self._theme.text), 1.4))
        painter.setBrush(QColor(self._theme.raised))

    def _filter(self, painter: QPainter, camera: QPointF, size: float) -> None:
        nm = self._placement.filter_nm
        if nm is None:
            return
        painter.setPen(QPen(QColor(self._theme.text), 1))
        painter.setBrush(QColor(colour_of_light(nm)))
        painter.drawRect(QRectF(camera.x() - size * 0.5, camera.y() - size * 0.28 - 7, size, 5))

    def _film(self, painter: QPainter, projector: QPointF, size: float) -> None:
        y = projector.y() - 8
        if self._placement.film:
            painter.setPen(_bar(self._theme.warn, 3))
        else:
            painter.setPen(QPen(QColor(self._theme.muted), 1.2, Qt.PenStyle.DotLine))
        painter.drawLine(QPointF(projector.x() - size * 0.9, y), QPointF(projector.x() + size * 0.9, y))

    # As the camera sees it -------------------------------------------------------------------------

    def _as_seen(self, painter: QPainter, area: QRectF, face: Face) -> None:
        metrics = QFontMetricsF(self.font())
        line = metrics.height()
        self._text(painter, area.topLeft(), "camera's view", self._theme.muted, "left")
        width = min(area.width(), (area.height() - 4.5 * line) * PICTURE_ASPECT)
        picture = QRectF(area.left(), area.top() + 1.4 * line, width, width / PICTURE_ASPECT)
        painter.save()
        painter.setClipRect(picture)
        painter.fillRect(picture, QColor("#26282d"))
        for part in (face.sheet, *face.parts()):
            painter.setPen(Qt.PenStyle.NoPen)
            painter.setBrush(QColor(part.colour))
            painter.drawPolygon(self._polygon(part, face, picture))
        painter.restore()
        painter.setBrush(Qt.BrushStyle.NoBrush)
        painter.setPen(QPen(QColor(self._theme.line), 1))
        painter.drawRect(picture)
        painter.setPen(QColor(self._theme.text))
        below = QRectF(area.left(), picture.bottom() + 4, area.width(), area.bottom() - picture.bottom() - 4)
        # Numbers stay with their word where lines break.
        words = "\n".join(face.turns).replace(" by ", " by\u00a0") or "facing the camera"
        painter.drawText(below, Qt.AlignmentFlag.AlignLeft | Qt.TextFlag.TextWordWrap, words)

    @staticmethod
    def _polygon(part: Part, face: Face, picture: QRectF) -> QPolygonF:
        def on_screen(at: Point) -> QPointF:
            x, y = face.in_picture(*at)
            return QPointF(picture.left() + x * picture.width(), picture.top() + y * picture.height())

        return QPolygonF([on_screen(corner) for corner in part.corners])

    def _text(self, painter: QPainter, at: QPointF, words: str, colour: str, how: str = "middle") -> None:
        """Words below a point, ``above`` it, or below and to its right (``left``), within the drawing."""
        metrics = QFontMetricsF(painter.font())
        width = metrics.horizontalAdvance(words) + 2
        left = at.x() if how == "left" else at.x() - width / 2
        left = min(max(left, PAD / 2), self.width() - width - PAD / 2)
        top = at.y() - metrics.height() if how == "above" else at.y()
        painter.setPen(QColor(colour))
        painter.drawText(QRectF(left, top, width, metrics.height()), Qt.AlignmentFlag.AlignLeft, words)


def _bar(colour: str, width: float) -> QPen:
    """A pen for thick lines that end where they end."""
    return QPen(QColor(colour), width, Qt.PenStyle.SolidLine, Qt.PenCapStyle.FlatCap)


@lru_cache(maxsize=512)
def colour_of_light(nm: float) -> str:
    """The screen colour (``#rrggbb``) nearest to monochromatic light of a wavelength."""
    xyz = np.array([np.interp(np.clip(nm, 400, 690), CIE_NM, row) for row in CIE_1931_XYZ])
    red, green, blue = (
        (np.clip(xyz_to_srgb(xyz / xyz.sum() * PURE_LUMINANCE), 0, 1) * 255 + 0.5).astype(int).tolist()
    )
    return f"#{red:02x}{green:02x}{blue:02x}"
