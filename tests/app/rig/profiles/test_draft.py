"""What is typed into the form of a rig profile, and the profile that it means."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from dsl_app.rig.profiles.draft import Draft, DraftPart, draft_of, part_of, profile_of, text_of, value_of

from dsl_core.devices.driver_table import FoundDevice, find_driver
from dsl_core.devices.profile import DevicePart, RigProfile
from dsl_core.errors import DeviceError

WEBCAM = DraftPart("uvc", {"index": "1", "size_px": "1280 x 720"})
SCREEN = DraftPart("screen", {"screen": "2", "latency_ms": "60"})
DRAFT = Draft("lab", {"camera": WEBCAM, "projector": SCREEN}, note="a room")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("driver", "setting", "text", "value"),
    [
        ("uvc", "index", " 2 ", 2),
        ("uvc", "size_px", "640 × 480", [640, 480]),
        ("uvc", "exposure_range_ms", "[0.1, 500]", [0.1, 500]),
        ("aravis", "adc_bits", "12", 12),
        ("aravis", "id", "14120001", "14120001"),
        ("aravis", "features", '{"GevSCPSPacketSize": 9000}', {"GevSCPSPacketSize": 9000}),
        ("uvc", "index", "two", "two"),
    ],
)
def test_a_text_means_what_its_setting_takes(driver: str, setting: str, text: str, value: Any) -> None:
    field = find_driver("camera", driver).settings.model_fields[setting]
    assert value_of(text, field) == value
    assert text_of(value) == text.strip() or value_of(text_of(value), field) == value


def test_truth_is_yes_or_no() -> None:
    field = find_driver("stage", "thorlabs-lts").settings.model_fields["towards_camera"]
    assert (value_of("yes", field), value_of("Off", field), text_of(True)) == (True, False, "yes")


def test_a_draft_is_the_profile_that_it_was_read_from() -> None:
    profile = profile_of(DRAFT)
    assert profile.camera == DevicePart(driver="uvc", settings={"index": 1, "size_px": [1280, 720]})
    assert profile.projector.settings == {"screen": "2", "latency_ms": 60}
    assert profile.stage is None
    again = draft_of(profile, Path("/rigs/lab.json"))
    assert profile_of(again) == profile
    assert again.target == Path("/rigs/lab.json")
    assert replace(again, name="other").target.name == "other.json"


@pytest.mark.parametrize(
    ("draft", "words"),
    [
        (replace(DRAFT, name="a/b"), "The name of the rig is 'a/b'.* Enter a name of letters"),
        (replace(DRAFT, name=""), "The rig has no name"),
        (replace(DRAFT, name="twin"), "'twin' is the name of a rig of this program"),
        (DRAFT.with_part("camera", DraftPart()), "has no camera. Choose its driver"),
        (
            DRAFT.with_part("camera", DraftPart("uvc", {"index": "-1", "size_px": "wide"})),
            r"index must be at least 0 \(given -1\); size_px.*Its settings are: index",
        ),
        (DRAFT.with_part("stage", DraftPart("nothing")), "There is no driver 'nothing' for a stage"),
    ],
)
def test_nonsense_is_refused_with_what_is_wanted(draft: Draft, words: str) -> None:
    with pytest.raises(DeviceError, match=words):
        profile_of(draft)


def test_a_found_device_brings_its_address_and_keeps_other_settings() -> None:
    found = FoundDevice({"index": 3}, "webcam 3")
    assert part_of(found, "uvc", WEBCAM).texts == {"index": "3", "size_px": "1280 x 720"}
    assert part_of(found, "uvc", DraftPart("aravis", {"id": "7"})).texts == {"index": "3"}


def test_a_profile_of_all_devices_is_shown_whole() -> None:
    stage = DevicePart(driver="thorlabs-lts", settings={"port": "/dev/ttyUSB0", "towards_camera": True})
    camera, projector = DevicePart(driver="uvc"), DevicePart(driver="none")
    profile = RigProfile(name="x", camera=camera, projector=projector, stage=stage)
    draft = draft_of(profile, Path("room 12.json"))
    assert draft.name == "room 12"
    assert draft.part("stage").texts == {"port": "/dev/ttyUSB0", "towards_camera": "yes"}
    assert draft.part("spectroradiometer") == DraftPart()
