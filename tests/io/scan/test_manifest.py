"""A scan is resumed only with the plan and the devices that it was started with."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from dsl_core.devices.base import CameraInfo, ProjectorInfo
from dsl_core.errors import StoreError
from dsl_core.io.scan.manifest import Manifest, _differences, _short, describe_scan, refuse_other_scan
from dsl_core.model.plan import CapturePlan

CAMERA = CameraInfo("fast", "1", 24, 16, "RGGB", 12, (1.0, 100.0))
PROJECTOR = ProjectorInfo("bright", "7", 32, 18, 5.0, 16.0)


@pytest.fixture
def stored(plan: CapturePlan) -> Manifest:
    return describe_scan(plan, None).model_copy(update={"camera": CAMERA, "projector": PROJECTOR})


def test_the_same_plan_and_devices_go_on(stored: Manifest, tmp_path: Path) -> None:
    refuse_other_scan(tmp_path, stored, stored)
    refuse_other_scan(tmp_path, stored, stored.model_copy(update={"camera": None, "projector": None}))


@pytest.mark.parametrize(
    ("update", "said"),
    [
        ({"camera": replace(CAMERA, serial="2")}, "camera is fast 1 in the scan and fast 2 now"),
        ({"camera": replace(CAMERA, model="slow")}, "camera is fast 1 in the scan and slow 1 now"),
        ({"projector": replace(PROJECTOR, serial="8")}, "projector is bright 7 in the scan and bright 8 now"),
        ({"camera": replace(CAMERA, binning=2)}, "binning"),
    ],
)
def test_another_device_is_refused_by_name(
    stored: Manifest, tmp_path: Path, update: dict[str, object], said: str
) -> None:
    with pytest.raises(StoreError, match=said):
        refuse_other_scan(tmp_path, stored, stored.model_copy(update=update))


def test_every_field_that_differs_is_named(stored: Manifest, tmp_path: Path) -> None:
    other = stored.plan.model_copy(update={"name": "second", "camera_size_px": (24, 18)})
    with pytest.raises(StoreError) as error:
        refuse_other_scan(tmp_path, stored, stored.model_copy(update={"plan": other}))
    assert "plan.name is reference in the scan and second now" in str(error.value)
    assert "plan.camera_size_px[1] is 16 in the scan and 18 now" in str(error.value)


def test_differences_are_found_in_depth() -> None:
    old, new = {"a": {"b": (1, 2)}, "c": 3, "d": (1,)}, {"a": {"b": (1, 5)}, "d": (1, 2), "e": None}
    assert list(_differences(old, new, "x")) == [
        "x.a.b[1] is 2 in the scan and 5 now",
        "x.c is 3 in the scan and absent now",
        "x.d is (1,) in the scan and (1, 2) now",
    ]
    assert (_short("y" * 60), _short("y" * 61)) == ("y" * 60, "y" * 57 + "...")
