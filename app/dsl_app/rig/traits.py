"""In what the connected rig is unlike the usual, by the calibration that scans use. No Qt."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from dsl_app.connection.state import RigState
from dsl_app.shared.evented import Value
from dsl_app.shared.jobs.base import Job, JobRunner

if TYPE_CHECKING:
    from dsl_core.devices.base import DeviceRig
    from dsl_core.progress import Progress


class TraitsReader:
    """Reads it in a worker; ``words`` is a sentence, empty where there is nothing to tell.

    ``in_use`` gives the library's name of the calibration that scans use, empty for the rig's own.
    """

    def __init__(self, rig: RigState, runner: JobRunner, in_use: Callable[[], str]) -> None:
        self.words = Value("")
        self._rig, self._runner, self._in_use = rig, runner, in_use

    def read(self) -> None:
        """Read it again: rig or calibration may be others than before."""
        devices, key = self._rig.devices.value, self._in_use()
        if devices is None:
            self.words.set("")
            return

        def work(progress: Progress) -> str:
            progress.report("read", 0, 0)
            return traits_of(devices, key)

        def done(words: str) -> None:
            # Another rig may have been connected meanwhile.
            if self._rig.devices.value is devices:
                self.words.set(words)

        self._runner.submit(
            Job("Read the rig's calibration", work, done, lambda _: self.words.set(""), is_minor=True)
        )


def traits_of(devices: DeviceRig, key: str) -> str:
    """In what a rig is unlike the usual; nothing by a calibration of other devices or settings.

    Raises `StoreError` when the library no longer has the calibration.
    """
    from dsl_core.devices.conditions import check_conditions
    from dsl_core.io.calibration_library import CalibrationLibrary

    known = CalibrationLibrary().find(key).rig if key else devices.calibration
    if known is None or not known.calibrations or check_conditions(known, devices):
        return ""
    from dsl_core.reconstruction.spectral.rig_traits import traits_in_words

    return traits_in_words(known)
