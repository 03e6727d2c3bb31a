"""What a wizard's jobs do in the background: open, look, capture, fit, accept. No Qt."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dsl_app.calibrate.campaign_status import Recipes
from dsl_app.calibrate.wizard.ghost import PointsPx, as_points, ghost, shared_part
from dsl_app.calibrate.wizard.settings import changed_settings, setting_rows
from dsl_app.calibrate.wizard.state import Fit, Look, Seen, SettingRow
from dsl_app.shared.notify import sentence_of
from dsl_core.campaign.common.recipe import AnyRecipe, Step
from dsl_core.campaign.guide import calibrated_rig
from dsl_core.campaign.products import Products, write_products
from dsl_core.campaign.session import CalibrationSession, StepStatus
from dsl_core.capture.display import Display
from dsl_core.capture.preview import MANY_SATURATED, quick_picture, statistics
from dsl_core.devices.base import Camera, CameraInfo, DeviceRig
from dsl_core.errors import CalibrationError, Cancelled, DslError, StoreError
from dsl_core.io.calibration_library import CalibrationLibrary
from dsl_core.io.campaign_folder import CampaignFolder
from dsl_core.model.figure import failures
from dsl_core.model.frames import Frame
from dsl_core.progress import Progress

#: Frames darker than this share of the brightest recent one are those between patterns; they would flicker.
DARK_SHARE = 0.5
#: Frames darker than this share even of a saturated one are black.
BLACK_SHARE = 0.1
#: The most of full scale that a camera adds to black; its darkest frame says how much it is.
MOST_OFFSET = 0.1
#: How long the brightest frame is remembered, s.
MEMORY_S = 3.0
#: How frames are shown: white targets are white; what is brighter and what is not stays to be judged.
AS_SEEN = Display(balance=True)


@dataclass(frozen=True)
class Opened:
    """A calibration as it was found on disk."""

    statuses: tuple[StepStatus, ...]
    settings: tuple[SettingRow, ...]
    fit: Fit | None
    places_itself: bool
    outlines: Mapping[str, PointsPx]
    keeps_frames: bool = True


@dataclass(frozen=True)
class Captured:
    """State of the steps after a capture; ``error`` is why it failed, None when it did not."""

    statuses: tuple[StepStatus, ...]
    error: Exception | None = None


class BackgroundWork:
    """One calibration on open devices; `open` comes first. Only one job at a time may use it."""

    def __init__(self, name: str, path: Path, devices: DeviceRig, recipes: Recipes) -> None:
        self._name, self._path, self._recipes = name, path, recipes
        self.camera = WatchedCamera(devices.camera)
        # A copy, so that the rig of the window keeps its own camera.
        self._devices = replace(devices, camera=self.camera)
        self._session: CalibrationSession | None = None
        self._all: Sequence[AnyRecipe] = ()
        self._placed = ""

    @property
    def session(self) -> CalibrationSession:
        """The session that is open."""
        assert self._session is not None
        return self._session

    def open(self, progress: Progress) -> Opened:
        """Read the calibration from disk; raises `CalibrationError` and `StoreError`."""
        progress.report("read the campaign", 0, 0)
        return self._take(CampaignFolder.open(self._path))

    def change(self, values: Mapping[str, str], progress: Progress) -> Opened:
        """Read it again with other settings, which the campaign keeps if they are right."""
        progress.report("read the campaign", 0, 0)
        campaign = CampaignFolder.open(self._path)
        recipe = self._recipe(self._recipes(campaign))
        rows = setting_rows(recipe, campaign.info.settings.get(self._name, {}))
        changed = campaign.with_settings(self._name, changed_settings(rows, values))
        opened = self._take(changed)
        changed.save()
        return opened

    def _take(self, campaign: CampaignFolder) -> Opened:
        recipes = self._recipes(campaign)
        recipe = self._recipe(recipes)
        session = CalibrationSession(recipe, self._devices, campaign, recipes)
        statuses = session.statuses()
        # Nothing is kept before all of it has been read.
        self._session, self._all = session, recipes
        first = next((each.placement for each in session.steps), None)
        settings = setting_rows(recipe, campaign.info.settings.get(self._name, {}), first)
        places = self._devices.place is not None
        camera = session.bench.rig.camera
        outlines = {each.key: ghost(each.placement, camera) for each in session.steps}
        keeps = self.session.recipe.keeps_frames
        return Opened(statuses, settings, self._found(), places, outlines, keeps)

    def _recipe(self, recipes: Sequence[AnyRecipe]) -> AnyRecipe:
        return next(recipe for recipe in recipes if recipe.name == self._name)

    def _found(self) -> Fit | None:
        """The fit that waits, else the accepted one that is good; None if its record cannot be read."""
        waits, accepted = self.session.candidate(), self.session.accepted()
        fitted = waits or accepted
        if fitted is None:
            return None
        try:
            return Fit(fitted, self.session.record(fitted), self.session, waits is None)
        except CalibrationError:
            return None

    def place(self, step: Step) -> None:
        """Let the rig place the target if it can, once for each step."""
        if self._placed != step.key:
            self._placed = ""
            # What stood there before may be brighter, and would be shown below what is found now.
            self.camera.forget()
            self.session.place(step)
            self._placed = step.key

    def look(self, step: Step, progress: Progress) -> Look:
        """Look once; a target that cannot be measured is part of the look, a lost device is an error."""
        progress.report(step.title, 0, 0)
        self.place(step)
        seen: list[PointsPx] = []
        try:
            figures = self.session.look(step, lambda points_px: seen.append(as_points(points_px)))
        except CalibrationError as error:
            return Look(step.key, (), sentence_of(error))
        points_px = seen[-1] if seen else ()
        wanted = ghost(step.placement, self.session.bench.rig.camera)
        return Look(step.key, figures, "", points_px, shared_part(wanted, points_px))

    def capture(self, step: Step, again: bool, is_checked: bool, progress: Progress) -> Captured:
        """Capture a step, or capture it ``again``; ``is_checked`` looks first and refuses what is not right.

        Returns where all steps stand, whatever happens; only `Cancelled` is raised.
        """
        try:
            self.place(step)
            if is_checked:
                _require_good(step, self.look(step, progress))
            if again:
                self.session.redo(step, progress)
            else:
                self.session.capture(step, progress)
        except Cancelled:
            raise
        except (DslError, OSError) as error:
            return Captured(self.session.statuses(), error)
        return Captured(self.session.statuses())

    def kept_picture(self, step: Step) -> Seen | None:
        """What the camera saw when a step was captured; None where no frames of it are kept."""
        try:
            scan = self.session.bench.scan_of(step)
            shots = list(scan.plan.shots())
            # Lit by lines a target is dark: in the middle of the frame they are most likely to be on it.
            white = next((shot for shot in shots if shot.role == "white"), shots[len(shots) // 2])
            pixels = scan.read(white)
        except StoreError:
            return None
        return self.camera.as_seen(pixels)

    def fit(self, progress: Progress) -> Fit:
        """Fit the captures of all steps."""
        fitted = self.session.fit(progress)
        return Fit(fitted, self.session.record(fitted), self.session)

    def accept(self) -> Fit:
        """Accept the fit that waits."""
        accepted = self.session.accept()
        return Fit(accepted, self.session.record(accepted), self.session, is_accepted=True)

    def write(self, library_name: str | None, library: CalibrationLibrary) -> Products:
        """Assemble the rig of everything accepted so far and write it with its report."""
        campaign = self.session.campaign
        rig = calibrated_rig(campaign, self._devices, library_name or "", self._all)
        return write_products(campaign, rig, library_name, recipes=self._all, library=library)

    def discard(self) -> Fit | None:
        """Discard the fit that waits; the accepted one is found again, if there is one."""
        self.session.discard()
        return self._found()


def _require_good(step: Step, look: Look) -> None:
    if look.trouble:
        raise CalibrationError(look.trouble)
    wrong = failures(look.figures)
    if wrong:
        advice = " ".join(f"{figure}: {figure.advice}" for figure in wrong)
        raise CalibrationError(f"The step {step.title!r} does not look right: {advice}")


class WatchedCamera(Camera):
    """A camera that passes every call on and keeps the latest frame worth showing."""

    def __init__(self, camera: Camera, clock: Callable[[], float] = time.monotonic) -> None:
        self._camera, self._clock = camera, clock
        self._lock = threading.Lock()
        self._frame: Frame | None = None
        self._best_at, self._brightest_dn = 0.0, 0.0
        #: Of the best frame: mean, and the share that saturation leaves of its worth.
        self._best = 0.0, 1.0
        self._offset_dn: float = MOST_OFFSET * 2**camera.info.bit_depth

    @property
    def info(self) -> CameraInfo:
        """The camera's own."""
        return self._camera.info

    def configure(self, exposure_ms: float) -> float:
        """Set the exposure."""
        return self._camera.configure(exposure_ms)

    def prepare(self, shot_index: int, attempt: int = 0) -> None:
        """Tell the camera what the next frame is for."""
        self._camera.prepare(shot_index, attempt)

    def snap(self, timeout_ms: float = 5000.0) -> Frame:
        """Take a frame and keep it to be shown."""
        frame = self._camera.snap(timeout_ms)
        now = self._clock()
        is_old = now - self._best_at > MEMORY_S
        if is_old:
            self._brightest_dn = 0.0
        thin = frame.pixels[::7, ::7]
        saturated = float(np.mean(thin >= 2**self.info.bit_depth - 1))
        seen = float(np.mean(thin)), 0.01 if saturated > MANY_SATURATED else 1.0
        self._brightest_dn = max(self._brightest_dn, seen[0])
        # Without it, black would be worth half of a target that fills little of the picture.
        self._offset_dn = min(self._offset_dn, seen[0])
        worth, best = self._worth(*seen), self._worth(*self._best)
        with self._lock:
            if worth > best or is_old:
                self._best, self._best_at, best = seen, now, worth
            if worth >= DARK_SHARE * best:
                self._frame, self._best_at = frame, now
        return frame

    def _worth(self, mean_dn: float, share: float) -> float:
        """How well a frame shows the target: bright, but not saturated; black shows nothing."""
        light_dn = mean_dn - self._offset_dn
        if light_dn < BLACK_SHARE * (self._brightest_dn - self._offset_dn):
            return 0.0
        return light_dn * share

    def forget(self) -> None:
        """Forget what was seen: another target comes, and its first frame is worth showing."""
        with self._lock:
            self._frame = None
            self._best, self._brightest_dn = (0.0, 1.0), 0.0

    def take_frame(self) -> Frame | None:
        """The latest frame since the last call; None without one."""
        with self._lock:
            frame, self._frame = self._frame, None
        return frame

    def take_seen(self) -> Seen | None:
        """The latest frame since the last call as people look at it; None without one."""
        frame = self.take_frame()
        return None if frame is None else self.as_seen(frame.pixels)

    def as_seen(self, pixels: NDArray[np.uint16]) -> Seen:
        """A raw mosaic of this camera, shape (rows, columns), as people look at it."""
        full_scale = 2**self.info.bit_depth - 1
        picture = quick_picture(pixels, self.info.bayer, full_scale, True, AS_SEEN)
        return Seen(picture, max(statistics(pixels, self.info.bayer, full_scale).saturated))

    def close(self) -> None:
        """Close the camera."""
        self._camera.close()
