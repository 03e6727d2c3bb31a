"""A scan with the exposures that its camera said were in force, where they are not those of its plan."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.io.scan.folder import ScanReader
from dsl_core.model.plan import Setting, Shot
from dsl_core.model.rig import Sensor
from dsl_core.optics.sensor import EVEN, as_if_exposed

#: Share of an exposure that is no other one: clocks of cameras count in steps.
SAME = 1e-4


class _AsExposed(ScanReader):
    """A reader whose plan has the exposures in force, and whose frames have the light of these."""

    def __init__(
        self,
        reader: ScanReader,
        settings: tuple[Setting, ...],
        shares: dict[int, float],
        sensor: Sensor | None,
    ) -> None:
        """Frames get these ``shares`` of their exposures, by the indices of their shots."""
        vars(self).update(vars(reader))
        plan = reader.plan.model_copy(update={"settings": settings})
        self.manifest = reader.manifest.model_copy(update={"plan": plan})
        self._shares, self._sensor = shares, sensor

    def read(
        self, shot: Shot, out: NDArray[np.uint16] | None = None, verify: bool = True
    ) -> NDArray[np.uint16]:
        pixels = super().read(shot, out, verify)
        share = self._shares.get(shot.index)
        if share is None or self._sensor is None:
            return pixels
        exposed = as_if_exposed(pixels, share, self._sensor)
        if out is None:
            return exposed
        out[:] = exposed
        return out

    def read_rows(self, shot: Shot, rows: slice) -> NDArray[np.uint16]:
        # Where values end is known of whole pictures.
        is_even = shot.index not in self._shares
        return super().read_rows(shot, rows) if is_even else self.read(shot, verify=False)[rows]


def as_exposed(reader: ScanReader, sensor: Sensor | None = None) -> ScanReader:
    """The reader, or one whose plan has the exposures in force, the median over the frames of each setting.

    A camera may round exposures; light is measured by those that it had. Frames that were exposed for longer
    or shorter than that are read as if they were not, by the ``sensor``, or that of the scan's calibration.
    """
    settings = tuple(
        _in_force(reader, number, setting) for number, setting in enumerate(reader.plan.settings)
    )
    if sensor is None and reader.calibration is not None:
        sensor = reader.calibration.sensor
    shares = _shares(reader, settings) if sensor else {}
    if settings == reader.plan.settings and not shares:
        return reader
    return _AsExposed(reader, settings, shares, sensor)


def _shares(reader: ScanReader, settings: tuple[Setting, ...]) -> dict[int, float]:
    """Exposures in force over those of frames that had others, by the indices of their shots."""
    logged = ((shot, reader.entries.get(shot.index)) for shot in reader.plan.shots())
    every = {
        shot.index: settings[shot.setting].exposure_ms / entry.exposure_ms
        for shot, entry in logged
        if entry is not None and entry.exposure_ms > 0
    }
    return {index: share for index, share in every.items() if abs(share - 1.0) > EVEN}


def _in_force(reader: ScanReader, number: int, setting: Setting) -> Setting:
    own = (shot.index for shot in reader.plan.shots() if shot.setting == number)
    logged_ms = [reader.entries[index].exposure_ms for index in own if index in reader.entries]
    if not logged_ms:
        return setting
    exposure_ms = float(np.median(logged_ms))
    if abs(exposure_ms - setting.exposure_ms) <= SAME * setting.exposure_ms:
        return setting
    return setting.model_copy(update={"exposure_ms": exposure_ms})
