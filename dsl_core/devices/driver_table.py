"""Drivers of single devices by kind and name, from which rig profiles put rigs together.

A driver's module has one constant, a `Driver`, and a line here; a package of one's own adds it through the
entry-point group ``dsl_scan.drivers`` under the name ``KIND.NAME``, such as ``camera.my-maker``. No driver
is imported before it is asked for, and none imports its maker's library before it opens a device.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.metadata import EntryPoint
from typing import Any, Literal, get_args

from pydantic import ValidationError

from dsl_core.devices.base import Camera, Device, Projector, Spectroradiometer, Stage
from dsl_core.devices.plugin_points import points_of
from dsl_core.errors import DeviceError, DslError
from dsl_core.model.base import Record, problems_in_words

Kind = Literal["camera", "projector", "stage", "spectroradiometer"]
KINDS: tuple[Kind, ...] = get_args(Kind)
GROUP = "dsl_scan.drivers"
#: Name of each driver of this program, and the module under `dsl_core.devices.drivers` with its ``DRIVER``.
_BUILT_IN = {
    "camera.aravis": "aravis",
    "camera.basler": "basler",
    "camera.gentl": "gentl",
    "camera.uvc": "uvc",
    "projector.none": "no_projector",
    "projector.screen": "screen",
    "spectroradiometer.jeti": "jeti_specbos",
    "spectroradiometer.ocean": "ocean",
    "stage.thorlabs-lts": "thorlabs_lts",
    "stage.zaber": "zaber",
}
BUILT_IN = tuple(
    EntryPoint(name, f"dsl_core.devices.drivers.{module}:DRIVER", GROUP) for name, module in _BUILT_IN.items()
)
_CLASSES: dict[str, type[Device]] = {
    "camera": Camera,
    "projector": Projector,
    "stage": Stage,
    "spectroradiometer": Spectroradiometer,
}


@dataclass(frozen=True)
class FoundDevice:
    """A device that a driver sees now: the settings that choose it, and words by which people know it."""

    settings: Mapping[str, object]
    words: str


@dataclass(frozen=True)
class Driver:
    """How one driver opens its devices.

    ``settings`` is the record that a profile's settings are validated by, each field with a description and
    all but the address with a default. ``open`` takes such a record and returns the device. ``find`` looks
    for devices that are plugged in; it raises `DeviceError` where it cannot look, None where there is nothing
    to look for. ``brings`` says what installs the library that the driver needs; empty where it needs none.
    """

    summary: str
    settings: type[Record]
    open: Callable[[Any], Device]
    find: Callable[[], list[FoundDevice]] | None = None
    brings: str = ""


@dataclass(frozen=True)
class DriverEntry:
    """A line of the table: a driver, or ``error``: why its module cannot be imported."""

    kind: Kind
    name: str
    driver: Driver | None = None
    error: str = ""


def list_drivers() -> list[DriverEntry]:
    """All drivers of all installed packages, by kind and name; broken ones with the reason."""
    found = []
    for kind in KINDS:
        for name in driver_names(kind):
            try:
                found.append(DriverEntry(kind, name, find_driver(kind, name)))
            except DeviceError as error:
                found.append(DriverEntry(kind, name, error=str(error)))
    return found


def driver_names(kind: Kind) -> list[str]:
    """Names of the drivers of a kind; quick, as none is imported."""
    prefix = f"{kind}."
    return sorted({point.name.removeprefix(prefix) for point in _points() if point.name.startswith(prefix)})


def find_driver(kind: Kind, name: str) -> Driver:
    """A driver by name; raises `DeviceError` when there is none, or when its module is broken."""
    points = [point for point in _points() if point.name == f"{kind}.{name}"]
    if not points:
        known = ", ".join(driver_names(kind)) or "none"
        raise DeviceError(
            f"There is no driver {name!r} for a {kind}; there are: {known}. Choose one of these, or install"
            " the package that provides it."
        )
    if len(points) > 1:
        values = " and ".join(point.value for point in points)
        raise DeviceError(f"{values} both provide the {kind} driver {name!r}. Uninstall one of them.")
    try:
        driver = points[0].load()
    except Exception as error:
        raise DeviceError(
            f"The {kind} driver {name!r} cannot be loaded from {points[0].value} ({type(error).__name__}:"
            f" {error}). Update or reinstall its package."
        ) from error
    if not isinstance(driver, Driver):
        raise DeviceError(f"{points[0].value} is not a Driver. Update or reinstall its package.")
    return driver


def read_settings(kind: Kind, name: str, settings: Mapping[str, object]) -> Record:
    """The settings of a driver, validated; raises `DeviceError` naming every field that is wrong."""
    record = find_driver(kind, name).settings
    try:
        return record.model_validate(dict(settings))
    except ValidationError as error:
        known = ", ".join(record.model_fields) or "none"
        raise DeviceError(
            f"The settings of the {kind} driver {name!r} are not valid: {problems_in_words(error, most=5)}."
            f" Its settings are: {known}."
        ) from error


def open_device(kind: Kind, name: str, settings: Mapping[str, object]) -> Device:
    """Open a device by its driver's name and settings; raises `DeviceError` with what to do."""
    chosen, driver = read_settings(kind, name, settings), find_driver(kind, name)
    try:
        device = driver.open(chosen)
    except DslError:
        raise
    except Exception as error:
        raise DeviceError(
            f"The {kind} driver {name!r} failed to open: {type(error).__name__}: {error}."
            " Check the connection and its settings."
        ) from error
    if not isinstance(device, _CLASSES[kind]):
        if isinstance(device, Device):
            device.close()
        raise DeviceError(
            f"The {kind} driver {name!r} returned {type(device).__name__} instead of a {kind}."
            " Update or reinstall its package."
        )
    return device


def _points() -> list[EntryPoint]:
    return points_of(GROUP, BUILT_IN)
