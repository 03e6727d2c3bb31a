"""A scan with the exposures that its camera said were in force, where they are not those of its plan."""

from __future__ import annotations

import copy

import numpy as np

from dsl_core.io.scan.folder import ScanReader
from dsl_core.model.plan import Setting

#: Share of an exposure that is no other one: clocks of cameras count in steps.
SAME = 1e-4


def as_exposed(reader: ScanReader) -> ScanReader:
    """The reader, or one whose plan has the exposures in force, the median over the frames of each setting.

    A camera may round exposures; light is measured by those that it had.
    """
    settings = reader.plan.settings
    found = tuple(_in_force(reader, number, setting) for number, setting in enumerate(settings))
    if found == settings:
        return reader
    exposed = copy.copy(reader)
    plan = reader.plan.model_copy(update={"settings": found})
    exposed.manifest = reader.manifest.model_copy(update={"plan": plan})
    return exposed


def _in_force(reader: ScanReader, number: int, setting: Setting) -> Setting:
    own = (shot.index for shot in reader.plan.shots() if shot.setting == number)
    logged_ms = [reader.entries[index].exposure_ms for index in own if index in reader.entries]
    if not logged_ms:
        return setting
    exposure_ms = float(np.median(logged_ms))
    if abs(exposure_ms - setting.exposure_ms) <= SAME * setting.exposure_ms:
        return setting
    return setting.model_copy(update={"exposure_ms": exposure_ms})
