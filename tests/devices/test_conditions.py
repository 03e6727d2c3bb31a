from __future__ import annotations

from dataclasses import replace

import pytest

from dsl_core.devices.conditions import check_conditions, current_conditions, with_calibration
from dsl_core.devices.registry import open_rig
from dsl_core.errors import CalibrationError
from dsl_core.model.conditions import CaptureConditions, differences
from tests.cases.small_rig import small_rig

TWIN = {"size": "48x36", "scene": "plane"}


def test_a_calibration_for_these_settings_is_used_and_the_rig_of_the_caller_stays() -> None:
    with open_rig("twin", TWIN) as devices:
        before = replace(devices)
        known = small_rig().model_copy(update={"conditions": current_conditions(devices)})
        calibrated, overridden = with_calibration(devices, known)
        assert devices == before
    assert calibrated == replace(devices, calibration=known)
    assert overridden == ()


def test_a_calibration_for_other_settings_needs_an_override() -> None:
    with open_rig("twin", TWIN) as devices:
        now = current_conditions(devices)
        other = now.model_copy(update={"camera": now.camera.model_copy(update={"binning": 4})})
        known = small_rig().model_copy(update={"conditions": other})
        assert check_conditions(known, devices) == ("the camera's binning was 4 and is 1",)
        with pytest.raises(CalibrationError, match="binning was 4 and is 1"):
            with_calibration(devices, known)
        calibrated, overridden = with_calibration(devices, known, override=True)
    assert calibrated.calibration == small_rig()
    assert overridden == check_conditions(known, devices)


def test_a_picture_that_is_mirrored_otherwise_needs_an_override_where_both_say_so() -> None:
    with open_rig("twin", TWIN) as devices:
        now = current_conditions(devices)

    def turned(mirrored: str | None) -> CaptureConditions:
        return now.model_copy(update={"camera": now.camera.model_copy(update={"mirrored": mirrored})})

    said = ("the camera's mirroring was off and is top to bottom",)
    assert differences(turned("off"), turned("top to bottom")) == said
    assert differences(turned("off"), turned("off")) == ()
    # Calibrations and drivers of before do not say.
    assert differences(turned(None), turned("top to bottom")) == ()
    assert differences(turned("off"), turned(None)) == ()
