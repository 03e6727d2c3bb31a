"""A full-screen window on the projector's screen that shows exact pixels, and is a projector of the engine.

The window is a plain raster widget: on it, every pixel of a pattern equals a pixel of the frame buffer at any
display scaling. What the graphics card and the projector do afterwards (gamma, night light) only the
camera sees.
"""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QRect, Qt, QThread, QTimer, Signal
from PySide6.QtGui import QColor, QFont, QGuiApplication, QImage, QPainter, QPaintEvent, QScreen
from PySide6.QtWidgets import QWidget

from dsl_core.devices.base import Projector, ProjectorInfo
from dsl_core.errors import DeviceError

#: How long a pattern may take to be painted before the window counts as stuck, s.
PAINT_TIMEOUT_S = 2.0
#: How long to wait for the screens to settle after the layout of the desktop has changed, ms.
SETTLE_MS = 300
#: What is said of a screen that can no longer be covered.
LOST_SCREEN = (
    "The projector's screen {} was disconnected or mirrored. Extend the desktop onto it and choose it again"
    " on the Rig page."
)


@dataclass(frozen=True)
class ScreenId:
    """What tells a screen from others: its maker's data where the system knows them, else its name."""

    manufacturer: str
    model: str
    serial: str
    name: str

    @classmethod
    def of(cls, screen: QScreen) -> ScreenId:
        """Identity of a screen."""
        return cls(screen.manufacturer(), screen.model(), screen.serialNumber(), screen.name())


def pixel_size(screen: QScreen) -> tuple[int, int]:
    """Width and height of a screen in real pixels, whatever the display scaling."""
    ratio, area = screen.devicePixelRatio(), screen.geometry()
    return _real_pixels(area.width(), ratio), _real_pixels(area.height(), ratio)


def _real_pixels(scaled: int, ratio: float) -> int:
    """The size that a screen has whose scaled size is a whole number: several are rounded to the same.

    Sizes of screens are even, which leaves one up to 200 %. Of more, the smallest claims no pixel too many.

    >>> _real_pixels(731, 1.75), _real_pixels(781, 1.75), _real_pixels(1367, 1.0)
    (1280, 1366, 1367)
    """
    around = range(int((scaled - 1) * ratio), int((scaled + 1) * ratio) + 1)
    even = [size for size in around if size % 2 == 0 and int(size / ratio + 0.5) == scaled]
    return min(even, default=round(scaled * ratio))


def describe_screen(screen: QScreen) -> str:
    """A screen as people recognise it, such as ``HDMI-1, 1280 × 720 at 60 Hz, scaled 150 %``."""
    width, height = pixel_size(screen)
    scaled = round(100 * screen.devicePixelRatio())
    text = f"{screen.name()}, {width} × {height} at {screen.refreshRate():.0f} Hz"
    return text if scaled == 100 else f"{text}, scaled {scaled} %"


def mirrors(screen: QScreen) -> list[QScreen]:
    """Other screens that show some of the same area: patterns must not cover the desktop."""
    return [
        other
        for other in QGuiApplication.screens()
        if other is not screen and other.geometry().intersects(screen.geometry())
    ]


class ProjectorWindow(QWidget):
    """Shows one image on one screen, pixel by pixel, enlarged by a whole factor.

    ``lost`` tells that the screen was disconnected or mirrored (the window hides and stays hidden),
    ``restored`` that it is connected again.
    """

    lost = Signal(str)
    restored = Signal(str)
    #: As `show_pixels`, from any thread.
    requested = Signal(object, object)

    def __init__(self) -> None:
        super().__init__(
            None,
            Qt.WindowType.Window
            | Qt.WindowType.FramelessWindowHint
            | Qt.WindowType.WindowStaysOnTopHint
            | Qt.WindowType.WindowDoesNotAcceptFocus,
        )
        self.setWindowTitle("dsl-scan projector")
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)
        self.setAttribute(Qt.WidgetAttribute.WA_ShowWithoutActivating)
        # The program ends with its main window, whatever is on the projector.
        self.setAttribute(Qt.WidgetAttribute.WA_QuitOnClose, False)
        self.setCursor(Qt.CursorShape.BlankCursor)
        self._screen_id: ScreenId | None = None
        self._image: QImage | None = None
        self._buffer: NDArray[np.uint8] | None = None
        self._on_painted: threading.Event | None = None
        self.requested.connect(self.show_pixels)
        application = QGuiApplication.instance()
        assert isinstance(application, QGuiApplication)
        application.screenRemoved.connect(self._screen_removed)
        application.screenAdded.connect(self._screen_added)
        for screen in QGuiApplication.screens():
            screen.geometryChanged.connect(self._rearranged)

    def arm(self, screen: QScreen, alone: bool = False) -> None:
        """Cover a screen in black; raises `DeviceError` for a mirrored screen, or the only one.

        With ``alone``, the only screen may be covered: nobody works at this computer.
        """
        others = QGuiApplication.screens()
        if len(others) < 2 and not alone:
            raise DeviceError(
                "There is only one screen. Connect the projector and extend the desktop onto it;"
                " do not mirror it."
            )
        mirrored = mirrors(screen)
        if mirrored:
            names = " and ".join(other.name() for other in mirrored)
            raise DeviceError(
                f"The screen {screen.name()} shows the same as {names}."
                " Extend the desktop instead of mirroring it."
            )
        self._screen_id = ScreenId.of(screen)
        self._image = None
        self.create()
        handle = self.windowHandle()
        handle.setScreen(screen)
        self.setGeometry(screen.geometry())
        self.setWindowState(Qt.WindowState.WindowFullScreen)
        self.setVisible(True)

    def disarm(self) -> None:
        """Release the screen."""
        self._screen_id, self._image = None, None
        self.hide()

    @property
    def is_armed(self) -> bool:
        """Whether the window covers its screen."""
        return self._screen_id is not None and self.isVisible()

    @property
    def lost_screen(self) -> str:
        """Name of the screen that was lost while it was covered; empty once another is chosen."""
        screen = self._screen_id
        return screen.name if screen is not None and not self.isVisible() else ""

    def show_pixels(self, image: NDArray[np.uint8], painted: threading.Event | None = None) -> None:
        """Show drive levels, shape (height, width, 3), centred and enlarged by the largest whole factor.

        ``painted`` is set once this image, and not one before it, is on the screen.
        """
        self._buffer = np.ascontiguousarray(image)
        height, width = image.shape[:2]
        self._image = QImage(self._buffer.data, width, height, 3 * width, QImage.Format.Format_RGB888)
        self._on_painted = painted
        self.update()

    def factor(self, width: int, height: int) -> int:
        """Whole factor by which an image is enlarged on the armed screen; 0 when it does not fit."""
        screen = self.screen()
        across, down = pixel_size(screen)
        return min(across // width, down // height)

    def paintEvent(self, event: QPaintEvent) -> None:
        """Paint in real pixels, without smoothing or blending."""
        painter = QPainter(self)
        painter.setCompositionMode(QPainter.CompositionMode.CompositionMode_Source)
        ratio = self.devicePixelRatioF()
        # In units of real pixels, so that display scaling moves and stretches nothing.
        painter.scale(1 / ratio, 1 / ratio)
        across, down = pixel_size(self.screen())
        painter.fillRect(QRect(0, 0, across + 2, down + 2), QColor(0, 0, 0))
        if self._image is not None:
            k = max(self.factor(self._image.width(), self._image.height()), 1)
            width, height = k * self._image.width(), k * self._image.height()
            place = QRect((across - width) // 2, (down - height) // 2, width, height)
            painter.drawImage(place, self._image)
        painter.end()
        if self._on_painted is not None:
            self._on_painted.set()

    def _screen_removed(self, screen: QScreen) -> None:
        if self._screen_id is not None and ScreenId.of(screen) == self._screen_id:
            # Window managers move the window onto the operator's screen: it must be gone before.
            self.hide()
            self.lost.emit(screen.name())
        self._rearranged()

    def _rearranged(self) -> None:
        QTimer.singleShot(SETTLE_MS, self, self._leave_mirrored)

    def _leave_mirrored(self) -> None:
        """Hide where the desktop is covered, too, which `arm` refuses."""
        if self.is_armed and mirrors(self.screen()):
            self.hide()
            self.lost.emit(self.screen().name())

    def _screen_added(self, screen: QScreen) -> None:
        screen.geometryChanged.connect(self._rearranged)
        self._rearranged()
        if self._screen_id is not None and ScreenId.of(screen) == self._screen_id:
            self.restored.emit(screen.name())


class ScreenProjector(Projector):
    """A `Projector` on a `ProjectorWindow`; patterns may come from any thread.

    With ``behind``, another projector such as the twin's gets every pattern too, and its identity is told.
    """

    def __init__(
        self, window: ProjectorWindow, behind: Projector | None = None, latency_ms: float = 50.0
    ) -> None:
        self._window, self._behind, self._latency_ms = window, behind, latency_ms

    @property
    def info(self) -> ProjectorInfo:
        """Identity and logical size."""
        if self._behind is not None:
            return self._behind.info
        screen = self._window.screen()
        width, height = pixel_size(screen)
        identity = ScreenId.of(screen)
        return ProjectorInfo(
            identity.model or identity.name, identity.serial, width, height, self._latency_ms,
            1000.0 / screen.refreshRate(),
        )  # fmt: skip

    def show(self, image: NDArray[np.uint8]) -> None:
        """Show drive levels; returns when they are painted and the latency has passed."""
        self.info.require_image(image)
        if self._window.lost_screen:
            raise DeviceError(LOST_SCREEN.format(self._window.lost_screen))
        if not self._window.is_armed:
            if self._behind is None:
                raise DeviceError(
                    "No projector screen is in use. Connect the projector and choose its screen on the Rig"
                    " page."
                )
            self._behind.show(image)
            return
        self._require_room(image.shape[1], image.shape[0])
        self._on_screen(image if image.ndim == 3 else np.repeat(image[..., None], 3, axis=2))
        if self._behind is not None:
            self._behind.show(image)
        else:
            time.sleep(self._latency_ms / 1000)

    def _require_room(self, width: int, height: int) -> None:
        """Raise `DeviceError` for a screen that would cut a pattern, of which no picture would tell."""
        if self._window.factor(width, height) < 1:
            screen = self._window.screen()
            across, down = pixel_size(screen)
            raise DeviceError(
                f"The projector's screen {screen.name()} has {across} × {down} px, and patterns have"
                f" {width} × {height} px. Set the screen to the full size of the projector and a scaling of"
                " 100 %, or choose another one on the Rig page."
            )

    def _on_screen(self, image: NDArray[np.uint8]) -> None:
        if QThread.isMainThread():
            self._window.show_pixels(image)
            self._window.repaint()
            return
        painted = threading.Event()
        self._window.requested.emit(image, painted)
        if not painted.wait(PAINT_TIMEOUT_S):
            raise DeviceError(
                "The projector window did not show a pattern in time."
                " Check that its screen is on and not locked."
            )

    def close(self) -> None:
        """Close the projector behind; the window itself belongs to the application."""
        if self._behind is not None:
            self._behind.close()


class ScreenLabel(QWidget):
    """A large name on each screen for a moment, so that people can tell screens apart."""

    def __init__(self, screen: QScreen, text: str) -> None:
        super().__init__(None, Qt.WindowType.ToolTip | Qt.WindowType.WindowStaysOnTopHint)
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.setAttribute(Qt.WidgetAttribute.WA_ShowWithoutActivating)
        self.setAttribute(Qt.WidgetAttribute.WA_QuitOnClose, False)
        self._text = text
        area = screen.geometry()
        self.setGeometry(area.x() + area.width() // 4, area.y() + area.height() // 3, area.width() // 2, 160)

    def paintEvent(self, event: QPaintEvent) -> None:
        """White words on black."""
        painter = QPainter(self)
        painter.fillRect(self.rect(), QColor(0, 0, 0))
        painter.setPen(QColor(255, 255, 255))
        font = QFont(self.font())
        font.setPointSize(28)
        painter.setFont(font)
        painter.drawText(
            self.rect(), int(Qt.AlignmentFlag.AlignCenter | Qt.TextFlag.TextWordWrap), self._text
        )
        painter.end()
