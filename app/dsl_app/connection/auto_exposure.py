"""Sets the live exposure by what live frames show, one frame after the other. No Qt."""

from __future__ import annotations

from collections.abc import Callable

from dsl_app.connection.state import RigState
from dsl_app.shared.notify import Notifier
from dsl_core.capture.auto_exposure import ExposureSearch
from dsl_core.model.frames import Frame

#: x, y, width, height in pixels of the camera.
Region = tuple[int, int, int, int]
#: A frame belongs to the exposure asked for if it was exposed so long, as a share: cameras round.
SAME_EXPOSURE = 0.02


class AutoExposer:
    """Idle until `begin`; `judge` gets every live frame."""

    def __init__(self, state: RigState, notifier: Notifier, set_exposure: Callable[[float], None]) -> None:
        self._state, self._notifier, self._set = state, notifier, set_exposure
        self._search: ExposureSearch | None = None
        self._region: Region | None = None

    def begin(self, region: Region | None) -> None:
        """Look for the exposure that suits a region, or the whole picture."""
        devices = self._state.devices.value
        if devices is None:
            return
        info, known = devices.camera.info, devices.calibration
        self._region = region
        self._search = search = ExposureSearch(
            info.exposure_range_ms,
            2**info.bit_depth - 1,
            self._state.cycle_ms,
            0.0 if known is None else known.sensor.black_level_dn,
        )
        self._state.is_exposing.set(True)
        self._set(search.start_from(self._state.exposure_ms.value))

    def judge(self, frame: Frame) -> None:
        """Look at a frame, unless it was exposed before the exposure was changed."""
        search, asked_ms = self._search, self._state.exposure_ms.value
        if search is None or abs(frame.exposure_ms - asked_ms) > SAME_EXPOSURE * asked_ms:
            return
        pixels = frame.pixels
        if self._region is not None:
            x, y, width, height = self._region
            pixels = pixels[y : y + height, x : x + width]
        # What the box rounds is not what was judged: the search goes on from what was asked for.
        following_ms = search.judge(pixels, asked_ms)
        if not search.is_over:
            self._set(following_ms)
            return
        self.end()
        if search.trouble:
            self._notifier.tell("warning", search.trouble)
        else:
            self._notifier.tell("info", f"Exposed for {asked_ms:.4g} ms.")

    def end(self) -> None:
        """Look no further."""
        self._search = None
        self._state.is_exposing.set(False)
