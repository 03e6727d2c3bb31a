"""Keeps the calibration in use the same on Calibrate page, Scan page and in the settings. No Qt."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dsl_app.calibrate.state import CalibrateState
    from dsl_app.scan.controller import ScanController
    from dsl_app.shared.settings import Settings

_log = logging.getLogger(__name__)


class CalibrationInUse:
    """Serves whichever of the two pages have been opened."""

    def __init__(self, settings: Settings, save: Callable[[], object] = lambda: None) -> None:
        """``save`` writes the settings: the choice must outlive a computer that loses its power."""
        self._settings, self._save = settings, save
        self._library: CalibrateState | None = None
        self._scans: ScanController | None = None

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

    def _use(self, key: str) -> None:
        self._remember(key)
        if self._scans is not None and key:
            self._choose(self._scans, key)

    @staticmethod
    def _choose(scans: ScanController, key: str) -> None:
        from dsl_app.scan.state import CalibrationChoice
        from dsl_core.io.calibration_library import CalibrationLibrary

        if key.partition("@")[0] in CalibrationLibrary().names():
            scans.plans.choose_calibration(CalibrationChoice(key, key))
        else:
            _log.warning("The library no longer has a calibration %r; scans use the rig's own.", key)

    def _chosen(self, key: str) -> None:
        """Remember what was chosen on the Scan page."""
        self._remember(key)
        if self._library is not None:
            self._library.in_use.set(key)

    def _remember(self, key: str) -> None:
        if key != self._settings.calibration:
            self._settings.calibration = key
            self._save()
