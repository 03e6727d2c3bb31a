"""What the Rig page decides: the live view, its exposure, and trial pictures. No Qt."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import replace

from dsl_app.connection.controller import RigController
from dsl_app.connection.state import Link, RigState
from dsl_app.rig.state import LEVEL, Drawn, FrameCounts, LiveState, exposure_text
from dsl_app.shared.notify import Notifier, sentence_of
from dsl_core.capture.auto_exposure import ExposureSearch
from dsl_core.capture.overexposure import full_scale_dn
from dsl_core.devices.base import DeviceRig
from dsl_core.errors import DeviceError
from dsl_core.model.frames import Frame
from dsl_core.patterns.trial_pictures import KINDS, PictureKind, trial_picture
from dsl_core.progress import Progress

#: x, y, width, height in pixels of the camera.
Region = tuple[int, int, int, int]
#: A trial picture: its kind, its drive level and its column, px.
Picture = tuple[PictureKind, float, int]
NO_CAMERA = "No camera is connected. Connect a rig first."
#: Lost frames in a row after which a camera counts as lost.
LOST_AFTER = 3
#: Shortest time between two live frames, s: without it, the simulated rig would keep a core busy.
LIVE_PERIOD_S = 1 / 30
#: Drive level of a dimmed picture over the one before, and the lowest worth trying.
DIMMER, LEAST_LEVEL = 0.7, 0.05
#: Live frames that may be on their way when the picture changes.
STALE_FRAMES = 2
#: Less than this share of full scale after a long exposure is worth a word.
DIM = 0.5
#: The longest exposure that is sought, ms: what needs more is dark, and its picture hardly live.
LONGEST_MS = 2000.0
#: What to do where there is little light.
BLACK = "The projector shows black: choose White as the picture, then expose again."
DARK = "The scene is dark: open the aperture, or raise the projector's intensity."


class LiveController:
    """Shows what the camera of a connected rig sees, and pictures on its projector."""

    def __init__(self, rig: RigController, notifier: Notifier) -> None:
        self.rig, self.state, self._notifier = rig, LiveState(), notifier
        self._lock = threading.Lock()
        #: The newest frame, the exposure that was requested for it, ms, and its picture.
        self._latest: tuple[Frame, float, Drawn | None] | None = None
        self._counts = FrameCounts()
        #: The devices that were exposed for since they were connected, or are being.
        self._looked_at: DeviceRig | None = None
        #: What the panel names before anything is chosen on it.
        self._picture: Picture = KINDS[0], LEVEL, 0
        #: What the projector has yet to show.
        self._wanted: Picture | None = None
        self._exposer = AutoExposer(
            rig.state, self.state, notifier, self.set_exposure, self._dim, lambda: self._picture[0] == "black"
        )
        rig.state.devices.follow(self._devices_changed)
        rig.state.live.changed.connect(self._live_changed)

    def _devices_changed(self, devices: DeviceRig | None) -> None:
        self.set_exposure(self.state.exposure_ms.value)
        # A twin of full size that nobody uses any more would keep 180 MB of its scene.
        self._looked_at = None
        # What another camera saw would pass for a picture of this one.
        self._forget_latest()
        self.state.frame.set(None)

    # Live view -------------------------------------------------------------------------------------

    def start(self) -> None:
        """Show frames as they come until `stop`."""
        devices = self.rig.state.devices.value
        if devices is None:
            self._notifier.tell("info", NO_CAMERA)
        else:
            self.rig.start_live(lambda progress: self._look(devices, progress))

    def begin(self) -> None:
        """Project the picture that was asked for last, find the exposure for it and start the live view."""
        if not self.rig.state.used_by.value:
            self._looked_at = self.rig.state.devices.value
            self._want(*self._picture)
            self.expose_automatically(None)

    def look(self) -> None:
        """Start the live view with the picture that the panel names, exposed for it on devices new to it."""
        state = self.rig.state
        if state.devices.value is not self._looked_at and not state.used_by.value:
            self.begin()
            return
        if state.devices.value is not None and not state.used_by.value:
            self._want(*self._picture)
        self.start()

    def begin_when_open(self) -> None:
        """`begin` as soon as the rig that is being opened is open; not at all where it cannot be opened."""
        link = self.rig.state.link
        if link.value is Link.OPENING:
            link.changed.once(
                lambda now: self.begin() if now is Link.OPEN else None, lambda now: now is not Link.OPENING
            )
        elif link.value is Link.OPEN:
            self.begin()

    def stop(self) -> None:
        """Stop after the current frame."""
        self.rig.stop_live()

    def _live_changed(self, is_live: bool) -> None:
        if not is_live:
            if self.state.is_exposing.value:
                # What a search that was cut off leaves suits nothing: the next look searches again.
                self._looked_at = None
            self._exposer.end()
            # The next live view begins with its own: this one may be of another rig, or of another picture.
            self._forget_latest()

    def _forget_latest(self) -> None:
        with self._lock:
            self._latest = None

    def fetch_frame(self) -> None:
        """Publish the newest frame to the page; called by the window's clock."""
        with self._lock:
            latest, self._latest = self._latest, None
        if latest is not None:
            frame, requested_ms, self.state.drawn = latest
            self.state.frame.set(frame)
            self.state.counts.set(self._counts)
            self._exposer.judge(frame, requested_ms)

    def _look(self, devices: DeviceRig, progress: Progress) -> None:
        lost, self._counts = 0, FrameCounts()
        if devices.put_back is not None:
            # The page names the scene, and the target of the last calibration may still stand before it.
            devices.put_back()
        while True:
            self._show_wanted(devices)
            progress.report("", self._counts.shown, 0)
            start = time.monotonic()
            try:
                requested_ms = self.state.exposure_ms.value
                devices.camera.configure(requested_ms)
                frame = devices.camera.snap()
            except DeviceError:
                lost += 1
                self._counts = replace(self._counts, lost=self._counts.lost + 1)
                if lost >= LOST_AFTER:
                    raise
                continue
            lost = 0
            self._post(frame, requested_ms)
            time.sleep(max(LIVE_PERIOD_S - (time.monotonic() - start), 0))

    def _post(self, frame: Frame, requested_ms: float) -> None:
        """Keep a frame and its picture for `fetch_frame`; one that was not fetched meanwhile is skipped."""
        draw = self.state.draw.value
        drawn = None if draw is None else (draw, draw(frame.pixels))
        with self._lock:
            skipped = int(self._latest is not None)
            self._latest = frame, requested_ms, drawn
        counts = self._counts
        self._counts = replace(counts, shown=counts.shown + 1 - skipped, skipped=counts.skipped + skipped)

    # Exposure --------------------------------------------------------------------------------------

    def expose_automatically(self, region_px: Region | None) -> None:
        """Find the exposure that suits a region of the picture; starts the live view if it is off."""
        if self.rig.state.devices.value is None:
            self._notifier.tell("info", NO_CAMERA)
            return
        self.start()
        if self.rig.state.live.value:
            self._exposer.begin(region_px)

    def set_exposure(self, exposure_ms: float) -> None:
        """Set the exposure of live frames, limited to what the camera can do."""
        camera = self.rig.state.camera
        if camera is not None:
            low, high = camera.exposure_range_ms
            exposure_ms = min(max(exposure_ms, low), high)
        if not self.state.is_exposing.value:
            # What a person sets is not searched for again.
            self._looked_at = self.rig.state.devices.value
        self.state.exposure_ms.set(exposure_ms)

    # Projector -------------------------------------------------------------------------------------

    def show_again(self) -> None:
        """Project the picture that was asked for last, as a newly chosen screen is black."""
        if self.rig.state.devices.value is not None:
            self.show(*self._picture)

    def show(self, kind: PictureKind, level: float = 1.0, column_px: int = 0) -> None:
        """Project a trial picture, unless it would spoil frames: the live view does, or a job of its own."""
        devices = self.rig.state.devices.value
        if not self._want(kind, level, column_px) or self.rig.state.live.value:
            return
        assert devices is not None
        self.rig.do_briefly("Show a picture", lambda: self._show_wanted(devices), self._not_shown)

    def _want(self, kind: PictureKind, level: float, column_px: int) -> bool:
        """Note a picture that the live view shows next; False, and a message, where none can be shown."""
        self._picture = kind, level, column_px
        self.state.level.set(level)
        user = self.rig.state.used_by.value
        if user:
            self._notifier.tell("info", f"{user} is using the projector. Wait until it ends, or cancel it.")
            return False
        if self.rig.state.devices.value is None:
            self._notifier.tell("info", "No projector is connected. Connect a rig first.")
            return False
        with self._lock:
            self._wanted = self._picture
        return True

    def _show_wanted(self, devices: DeviceRig) -> None:
        """Project what was asked for last; called where a projector that hangs holds up nothing else."""
        with self._lock:
            wanted, self._wanted = self._wanted, None
        if wanted is not None:
            info, (kind, level, column_px) = devices.projector.info, wanted
            size = info.width_px, info.height_px
            devices.projector.show(trial_picture(kind, size, level, column_px))

    def _not_shown(self, error: Exception) -> None:
        self.rig.lose_by(error)
        self._notifier.tell("error", sentence_of(error))

    def _dim(self) -> bool:
        """Project the picture with about half the light; False where that is not possible or too little."""
        kind, level, column_px = self._picture
        if self.rig.state.used_by.value or kind == "black" or DIMMER * level < LEAST_LEVEL:
            return False
        self.show(kind, round(DIMMER * level, 2), column_px)
        return True


class AutoExposer:
    """Sets the live exposure by what live frames show; idle until `begin`, then `judge` gets every frame.

    ``dim`` lowers the projector's intensity where even the shortest exposure saturates; False when it cannot.
    ``is_black`` says whether the projector shows nothing. A search that fails for want of light leaves the
    exposure as it was.
    """

    def __init__(
        self,
        rig: RigState,
        state: LiveState,
        notifier: Notifier,
        set_exposure: Callable[[float], None],
        dim: Callable[[], bool],
        is_black: Callable[[], bool],
    ) -> None:
        self._rig, self._state, self._notifier, self._set, self._dim = rig, state, notifier, set_exposure, dim
        self._is_black = is_black
        #: The exposure before the search, ms.
        self._before_ms = state.exposure_ms.value
        #: Frames to leave out, as they may show the picture before it was dimmed.
        self._stale = 0
        self._search: ExposureSearch | None = None
        self._region: Region | None = None

    def begin(self, region: Region | None) -> None:
        """Search for the exposure that suits a region, or the whole picture."""
        devices = self._rig.devices.value
        if devices is None:
            return
        info, known = devices.camera.info, devices.calibration
        self._region, self._stale = region, 0
        self._before_ms = self._state.exposure_ms.value
        shortest_ms, longest_ms = info.exposure_range_ms
        self._search = search = ExposureSearch(
            (shortest_ms, max(min(longest_ms, LONGEST_MS), shortest_ms)),
            full_scale_dn(devices),
            self._rig.cycle_ms,
            0.0 if known is None else known.sensor.black_level_dn,
        )
        self._state.is_exposing.set(True)
        self._set(search.start_from(self._state.exposure_ms.value))

    def judge(self, frame: Frame, requested_ms: float) -> None:
        """Take a frame into account, unless it was exposed before the exposure was changed.

        Which one was requested tells, not the frame's own: a camera may round by some per cent.
        """
        search = self._search
        if search is None or requested_ms != self._state.exposure_ms.value:
            return
        if self._stale:
            self._stale -= 1
            return
        pixels = frame.pixels
        if self._region is not None:
            x, y, width, height = self._region
            pixels = pixels[y : y + height, x : x + width]
        following_ms = search.judge(pixels, requested_ms)
        if not search.is_over:
            self._set(following_ms)
            return
        if search.is_too_bright and self._dim():
            self.begin(self._region)
            self._stale = STALE_FRAMES
            return
        self.end()
        if search.is_too_dark:
            self._set(self._before_ms)
            self._notifier.tell("warning", BLACK if self._is_black() else search.trouble)
        elif search.trouble:
            self._notifier.tell("warning", search.trouble)
        else:
            self._tell_found(requested_ms, search.share)

    def _tell_found(self, exposure_ms: float, share: float) -> None:
        text = f"Exposed for {exposure_text(exposure_ms)} at intensity {self._state.level.value:.2f}"
        if share >= DIM or exposure_ms < LONGEST_MS / 2:
            self._notifier.tell("info", f"{text}.")
            return
        advice = BLACK if self._is_black() else DARK
        reached = f"where the brightest reach only {100 * share:.0f} % of full scale"
        self._notifier.tell("warning", f"{text}, {reached}. {advice}")

    def end(self) -> None:
        """Stop the search."""
        self._search = None
        self._state.is_exposing.set(False)
