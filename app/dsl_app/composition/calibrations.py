"""Keeps the calibration in use the same on Calibrate page, Scan page and in the settings. No Qt."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dsl_app.calibrate.state import CalibrateState
    from dsl_app.scan.controller import ScanController
    from dsl_app.shared.notify import Notifier
    from dsl_app.shared.settings import Settings


class CalibrationInUse:
    """Serves whichever of the two pages have been opened."""

    def __init__(
        self, settings: Settings, notifier: Notifier, save: Callable[[], object] = lambda: None
    ) -> None:
        """``save`` writes the settings: the choice must outlive a computer that loses its power."""
        self._settings, self._notifier, self._save = settings, notifier, save
        self._library: CalibrateState | None = None
        self._scans: ScanController | None = None
        #: The calibration in use of which was told that the library has lost it.
        self._lost = ""

    def serve_library(self, state: CalibrateState) -> None:
        """Let scans use what is chosen on the Calibrate page."""
        self._library = state
        state.in_use.changed.connect(self._use)
        state.library.changed.connect(lambda _: self._use(state.in_use.value))

    def serve_scans(self, scans: ScanController) -> None:
        """Let scans use the calibration in use, now and when it changes."""
        self._scans = scans
        if self._settings.calibration:
            self._choose(scans, self._settings.calibration)
        scans.state.calibration.changed.connect(lambda choice: self._chosen(choice.key))
        # What was chosen on the other page is not in use either.
        scans.state.refused.connect(lambda _: self._chosen(scans.state.calibration.value.key))

    def _use(self, key: str) -> None:
        self._remember(key)
        if self._scans is not None and key:
            self._choose(self._scans, key)

    def _choose(self, scans: ScanController, key: str) -> None:
        from dsl_app.scan.state import CalibrationChoice
        from dsl_core.io.calibration_library import CalibrationLibrary

        used, gone = scans.state.calibration.value, f"The library no longer has the calibration {key!r}."
        if key.partition("@")[0] in CalibrationLibrary().names():
            self._lost = ""
            scans.plans.choose_calibration(CalibrationChoice(key, key))
        elif key != used.key:
            self._notifier.tell("warning", f"{gone} {used.in_use}")
            self._chosen(used.key)
        elif key != self._lost:
            self._lost = key
            still = "Scans use it until you choose another one or close the window."
            self._notifier.tell("warning", f"{gone} {still}")

    def _chosen(self, key: str) -> None:
        """Remember what was chosen on the Scan page."""
        self._remember(key)
        if self._library is not None:
            self._library.in_use.set(key)

    def _remember(self, key: str) -> None:
        if key != self._settings.calibration:
            self._settings.calibration = key
            self._save()
