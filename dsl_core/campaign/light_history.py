"""What drift checks found of a rig's light, kept with its calibration in the library."""

from __future__ import annotations

from collections.abc import Iterable

from dsl_core.calibration.drift.light import white_signal
from dsl_core.io.calibration_library import CalibrationLibrary
from dsl_core.model.calibration.light_check import LightCheck
from dsl_core.model.conditions import COLOUR_NAMES
from dsl_core.model.figure import Figure
from dsl_core.model.rig import Rig
from dsl_core.reconstruction.calibration_age import light_calibrated


def light_check(rig: Rig, figures: Iterable[Figure], checked: str) -> LightCheck | None:
    """What the figures of a drift check at a time (ISO 8601) say of the light; None without Spectralon."""
    by_name = {figure.name: figure for figure in figures}
    # A monochrome camera has one figure for the light of all LEDs together.
    whites = [by_name.get(white_signal(name), by_name.get(white_signal(""))) for name in COLOUR_NAMES]
    red, green, blue = whites
    if red is None or green is None or blue is None:
        return None
    return LightCheck(
        checked=checked,
        calibrated=light_calibrated(rig),
        levels=(red.value, green.value, blue.value),
        std=max(figure.std or 0.0 for figure in (red, green, blue)),
    )


def keep_check(library: CalibrationLibrary, key: str, figures: Iterable[Figure], checked: str) -> bool:
    """Keep what a drift check found of the light as a new version of a name of the library.

    Returns whether it was kept: not if the check says nothing of the light, and not for an old version, which
    would become the current one. Raises `StoreError`.
    """
    entry = library.find(key)
    found = light_check(entry.rig, figures, checked)
    if found is None or library.find(entry.name).stamp != entry.stamp:
        return False
    rig = entry.rig.model_copy(update={"light_checks": (*entry.rig.light_checks, found)})
    library.store(entry.name, rig, entry.accepted, entry.history)
    return True
