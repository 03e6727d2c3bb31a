"""Drivers are found by kind and name, their settings validated, and broken ones named."""

from __future__ import annotations

from importlib.metadata import EntryPoint

import pytest

from dsl_core.devices import driver_table
from dsl_core.devices.base import Projector, Stage
from dsl_core.devices.driver_table import Driver, driver_names, find_driver, list_drivers, open_device
from dsl_core.errors import DeviceError
from dsl_core.model.base import Record


class PortSettings(Record):
    port: str


class Trolley(Stage):
    """A stage whose port says how it fails."""

    range_mm = (0.0, 1.0)
    position_mm = 0.0

    def __init__(self, settings: PortSettings) -> None:
        if settings.port == "broken":
            raise KeyError("no such port")

    def move_to(self, position_mm: float) -> float:
        return position_mm


GOOD = Driver("a trolley", PortSettings, Trolley)
NOT_A_DRIVER = 3


@pytest.fixture(autouse=True)
def _lines(monkeypatch: pytest.MonkeyPatch) -> None:
    """Add lines to the table: one sound driver, and others that are not."""
    values = {
        "stage.trolley": "GOOD",
        "projector.trolley": "GOOD",
        "stage.number": "NOT_A_DRIVER",
        "stage.gone": "MISSING",
        "stage.twice": "GOOD",
    }
    lines = [EntryPoint(name, f"{__name__}:{value}", "x") for name, value in values.items()]
    lines.append(EntryPoint("stage.twice", f"{__name__}:PortSettings", "x"))
    monkeypatch.setattr(driver_table, "BUILT_IN", (*driver_table.BUILT_IN, *lines))


def test_drivers_of_this_program_can_all_be_imported_and_describe_their_settings() -> None:
    for entry in list_drivers():
        if entry.name in ("number", "gone", "twice"):
            assert entry.error
            continue
        assert entry.driver is not None, entry.error
        assert entry.driver.summary
        if entry.driver is not GOOD:
            for name, field in entry.driver.settings.model_fields.items():
                assert field.description, f"{entry.kind} {entry.name}: {name}"


def test_a_device_is_opened_by_name_and_settings() -> None:
    device = open_device("stage", "trolley", {"port": "a"})
    assert isinstance(device, Trolley)
    assert isinstance(open_device("projector", "none", {"size_px": [64, 48]}), Projector)


def test_an_unknown_name_lists_what_there_is() -> None:
    assert "trolley" in driver_names("stage")
    with pytest.raises(DeviceError, match=r"no driver 'trolly' for a stage; there are: .*trolley"):
        find_driver("stage", "trolly")


@pytest.mark.parametrize(
    ("name", "reason"),
    [("gone", "AttributeError"), ("number", "not a Driver"), ("twice", "both provide")],
)
def test_a_broken_driver_is_named(name: str, reason: str) -> None:
    with pytest.raises(DeviceError, match=reason):
        find_driver("stage", name)


def test_wrong_settings_name_each_field_and_what_there_is() -> None:
    with pytest.raises(DeviceError, match=r"port is missing.*baud.*Its settings are: port"):
        open_device("stage", "trolley", {"baud": 3})


def test_failures_while_opening_become_sentences() -> None:
    with pytest.raises(DeviceError, match="'trolley' failed to open: KeyError"):
        open_device("stage", "trolley", {"port": "broken"})
    with pytest.raises(DeviceError, match="returned Trolley instead of a projector"):
        open_device("projector", "trolley", {"port": "a"})
