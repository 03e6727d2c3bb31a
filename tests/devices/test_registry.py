"""Rigs of other packages are found, opened, and told apart from broken ones."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from dsl_core.capture.runner import Runner
from dsl_core.devices.registry import list_rigs, open_rig
from dsl_core.errors import DeviceError, PlanError
from dsl_core.model.plan import CapturePlan, GrayCode, LineComb, Setting
from dsl_core.patterns.images import pattern_image
from tests.cases.memory_sink import MemorySink

Install = Callable[..., None]

DRIVER = '''
"""A rig whose camera reads the mean of the pattern."""
import numpy as np
from pydantic import BaseModel, Field
from dsl_core.devices.base import Camera, CameraInfo, DeviceRig, Projector, ProjectorInfo
from dsl_core.errors import PlanError
from dsl_core.model.frames import Frame


class MeanCamera(Camera):
    def __init__(self, projector):
        self.projector, self.exposure_ms, self.count = projector, 1.0, 0

    @property
    def info(self):
        return CameraInfo("mean", "1", 12, 8, "RGGB", 12, (1.0, 100.0))

    def configure(self, exposure_ms):
        self.exposure_ms = exposure_ms
        return exposure_ms

    def snap(self, timeout_ms=5000.0):
        self.count += 1
        pixels = np.full((8, 12), int(self.projector.image.mean()), np.uint16)
        return Frame(pixels, self.exposure_ms, float(self.count), self.count)


class MeanProjector(Projector):
    image = np.zeros((18, 32), np.uint8)

    @property
    def info(self):
        return ProjectorInfo("mean", "2", 32, 18, 0.0, 16.0)

    def show(self, image):
        self.image = image


class MeanOptions(BaseModel):
    port: str = Field(description="where it is plugged in")
    gain: float = Field(default=2.0, description="gain of the camera")
    light: bool = Field(default=True, description="on or off")
    serial: str | None = None


def open_rig(options):
    """Reads the mean of every pattern.

    More about it.
    """
    if "wrong" in options:
        raise PlanError("The rig does not know the option wrong.")
    if "broken" in options:
        raise KeyError("no such port")
    projector = MeanProjector()
    return DeviceRig("mean", MeanCamera(projector), projector)


open_rig.options = MeanOptions


def open_nothing(options):
    return None


not_a_function = 3
'''


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Install:
    """Put a package with its metadata on the path, as an installer would."""
    site = tmp_path / "site"
    monkeypatch.syspath_prepend(str(site))

    def add(package: str, source: str = DRIVER, **points: str) -> None:
        (site / package).mkdir(parents=True)
        (site / package / "__init__.py").write_text(source)
        info = site / f"{package}-1.2.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.2\n")
        lines = "".join(f"{name} = {value}\n" for name, value in points.items())
        (info / "entry_points.txt").write_text(f"[dsl_scan.rigs]\n{lines}")
        monkeypatch.delitem(sys.modules, package, raising=False)

    return add


def test_the_rigs_of_this_package_are_listed() -> None:
    found = {entry.name: entry for entry in list_rigs()}
    for name in ("twin", "replay"):
        assert found[name].package == "dsl-scan"
        assert found[name].error == ""
        assert found[name].description
        assert all(option.meaning for option in found[name].options)
    twin = {option.name: option for option in found["twin"].options}
    assert (twin["noise"].default, twin["tolerance"].default, twin["truth"].default) == ("on", "1DN", "")
    assert [option.name for option in found["replay"].options] == ["scan"]


def test_a_rig_of_another_package_is_listed_and_scanned(install: Install) -> None:
    install("mean_rig", mean="mean_rig:open_rig")
    entry = next(entry for entry in list_rigs() if entry.name == "mean")
    assert (entry.package, entry.version) == ("mean_rig", "1.2")
    assert (entry.description, entry.error) == ("Reads the mean of every pattern.", "")
    assert [(option.name, option.default, option.meaning) for option in entry.options] == [
        ("port", "", "where it is plugged in"),
        ("gain", "2", "gain of the camera"),
        ("light", "on", "on or off"),
        ("serial", "", ""),
    ]
    plan = CapturePlan(
        camera_size_px=(12, 8),
        projector_size_px=(32, 18),
        code=GrayCode(rows=False),
        spectral=LineComb(width_px=2, step_px=2, period_px=8),
        settings=(Setting(exposure_ms=10.0, level=0.4),),
        code_settings=(0,),
    )
    sink = MemorySink(plan)
    with open_rig("mean") as rig:
        Runner(rig, plan, sink, pattern_image).run()
    for shot in plan.shots():
        assert sink.read(shot).max() == int(pattern_image(plan, shot).mean())


def test_an_unknown_name_lists_what_there_is(install: Install) -> None:
    install("mean_rig", mean="mean_rig:open_rig")
    with pytest.raises(DeviceError, match="no rig 'twinn'; installed rigs: mean, replay, twin"):
        open_rig("twinn")


@pytest.mark.parametrize(
    ("value", "reason"),
    [
        ("faulty:missing", "AttributeError"),
        ("faulty.absent:open_rig", "ModuleNotFoundError"),
        ("faulty:not_a_function", "not a function"),
    ],
)
def test_a_broken_entry_point_is_named_and_the_others_listed(
    install: Install, value: str, reason: str
) -> None:
    install("faulty", bad=value)
    install("mean_rig", mean="mean_rig:open_rig")
    found = {entry.name: entry for entry in list_rigs()}
    assert found["mean"].error == ""
    assert "package faulty 1.2" in found["bad"].error
    assert reason in found["bad"].error
    with pytest.raises(DeviceError, match=r"package faulty 1.2"):
        open_rig("bad")


def test_a_package_that_crashes_on_import_is_named(install: Install) -> None:
    install("faulty", source="1 / 0", bad="faulty:open_rig")
    entry = next(entry for entry in list_rigs() if entry.name == "bad")
    assert "ZeroDivisionError" in entry.error


@pytest.mark.parametrize(
    ("source", "sentence"),
    [
        ("def open_rig(options: dict)", r"SyntaxError.*line 1.*correct it and start dsl-scan again"),
        ("import fancycam.usb", "Install fancycam, which it needs"),
    ],
)
def test_the_author_of_a_package_is_told_what_to_do_about_it(
    source: str, sentence: str, install: Install
) -> None:
    install("faulty", source=source, bad="faulty:open_rig")
    with pytest.raises(DeviceError, match=sentence):
        open_rig("bad")


def test_failures_while_opening_name_the_package_unless_they_speak_for_themselves(install: Install) -> None:
    install("mean_rig", mean="mean_rig:open_rig", nothing="mean_rig:open_nothing")
    with pytest.raises(PlanError, match="does not know the option wrong"):
        open_rig("mean", {"wrong": "1"})
    with pytest.raises(DeviceError, match=r"mean_rig 1.2 failed to open: KeyError.* cables.* reinstall"):
        open_rig("mean", {"broken": "1"})
    with pytest.raises(DeviceError, match="opened as NoneType instead of DeviceRig"):
        open_rig("nothing")


def test_two_packages_with_one_name_are_told_apart(install: Install) -> None:
    install("mean_rig", mean="mean_rig:open_rig")
    install("other_rig", mean="other_rig:open_rig")
    with pytest.raises(DeviceError, match="packages mean_rig and other_rig both provide a rig 'mean'"):
        open_rig("mean")


def test_a_wrong_option_is_told_by_its_name_and_blames_no_cables(install: Install) -> None:
    source = DRIVER + (
        "\n\nclass Own(BaseModel):\n    level: int\n\n\n"
        "def open_checked(options):\n    MeanOptions.model_validate(options)\n"
        "    Own(level=options['gain'])\n\n\n"
        "open_checked.options = MeanOptions\n"
    )
    install("checked_rig", source=source, checked="checked_rig:open_checked")
    with pytest.raises(DeviceError) as raised:
        open_rig("checked", {"gain": "loud"})
    assert str(raised.value) == (
        "The rig 'checked' cannot have these options: port is missing; gain must be a number (given 'loud')."
        " 'dsl-scan rigs' lists them."
    )
    # A record of the package's own is no option of a person.
    with pytest.raises(DeviceError, match=r"checked_rig 1.2 failed to open: Own: level must be .*2.5") as own:
        open_rig("checked", {"gain": "2.5", "port": "1"})
    assert "cables" not in str(own.value)
