"""Rigs by name: profiles of this computer, and what packages add by the entry-point group ``dsl_scan.rigs``.

The value of an entry point is a function ``open(options: dict[str, str]) -> DeviceRig`` whose
docstring starts with one line for the list of rigs. Its attribute ``options``, if it has one, is a pydantic
model whose fields are listed with their defaults and descriptions; see `with_options`. With the attribute
``on_callers_thread``, drivers are called on whatever thread needs them, and may then hold it up for ever.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from dsl_core.devices.base import DeviceRig
from dsl_core.devices.device_thread import DeviceThread
from dsl_core.devices.guard import guarded, open_on
from dsl_core.devices.plugin_points import points_of
from dsl_core.errors import DeviceError, DslError
from dsl_core.extras import missing_package
from dsl_core.model.base import problems_in_words
from dsl_core.version import __version__

GROUP = "dsl_scan.rigs"
#: What keeps most devices from being opened.
UNPLUGGED = "Check the cables and the power of its devices, and that no other program uses them."
#: What a driver itself is mostly at fault for, and what its author does then.
OF_CODE = (SyntaxError, NameError, AttributeError, TypeError, ImportError)
WRITTEN_WRONG = "If it is your own, correct it and start dsl-scan again."
#: Stands for the package of rigs that are profiles.
PROFILE = "profile"
#: Rigs of this package, so that they are there in a source tree or a frozen app without metadata too.
BUILT_IN = (
    EntryPoint("replay", "dsl_core.io.replay:open_replay", GROUP),
    EntryPoint("twin", "dsl_core.simulation.sim_devices:open_twin", GROUP),
)
#: Profiles are files, which is not this layer's business; imported when one is asked for.
_PROFILES = "dsl_core.io.rig_profile"
OpenRig = Callable[[dict[str, str]], DeviceRig]


@dataclass(frozen=True)
class OptionEntry:
    """An option of a rig, with its default as text; an empty one means that it is not given."""

    name: str
    default: str
    meaning: str


@dataclass(frozen=True)
class RigEntry:
    """A rig that can be opened by name, or ``error``: why it cannot."""

    name: str
    package: str
    version: str
    description: str = ""
    error: str = ""
    options: tuple[OptionEntry, ...] = ()


def with_options(record: type[BaseModel]) -> Callable[[OpenRig], OpenRig]:
    """Declares what options an opener reads: the fields of a pydantic model, each with a description."""

    def declare(function: OpenRig) -> OpenRig:
        function.options = record  # type: ignore[attr-defined]
        return function

    return declare


def list_rigs() -> list[RigEntry]:
    """All rigs of all installed packages, then this computer's profiles; broken ones with their error."""
    points = _points()
    return [_describe(point) for point in points] + [
        _describe_profile(name) for name in _profiles_but(points)
    ]


def rig_names() -> list[str]:
    """Names of all rigs and profiles, broken ones too; quick, as no package is loaded."""
    points = _points()
    return sorted({point.name for point in points} | set(_profiles_but(points)))


def default_options(name: str) -> dict[str, str]:
    """The options that a rig has where they are not given, as text; none for a profile, or if it lists none.

    >>> default_options("twin")["film"]
    'on'
    """
    points = [point for point in _points() if point.name == name]
    options = _options(_load(points[0])) if points else ()
    return {option.name: option.default for option in options if option.default}


def is_built_in(name: str) -> bool:
    """Whether a rig comes with this program, and so controls no devices."""
    return any(point.name == name for point in BUILT_IN)


def open_rig(name: str, options: dict[str, str] | None = None) -> DeviceRig:
    """Open the devices of a rig, by its name or by the path of a profile, which ends in ``.json``.

    Those that control hardware come behind guards, on a thread of their own.

    Raises `DeviceError` when there is no rig of that name (and says which there are), when its package
    is broken, and when its devices cannot be opened.
    """
    points = [point for point in _points() if point.name == name]
    profile = None if points else _profiles().profile_path(name)
    if profile is not None:
        return _open_profile(profile, options)
    if not points:
        known = ", ".join(rig_names()) or "none"
        raise DeviceError(
            f"There is no rig {name!r}; installed rigs: {known}. Install the package that provides it, give"
            " the path of a rig profile (NAME.json), or choose one of these."
        )
    if len(points) > 1:
        packages = " and ".join(_package(point)[0] for point in points)
        raise DeviceError(f"The packages {packages} both provide a rig {name!r}. Uninstall one of them.")
    function = _load(points[0])
    is_unguarded = is_built_in(name)
    here = is_unguarded or getattr(function, "on_callers_thread", False)
    thread = None if here else DeviceThread(name)
    try:
        rig = open_on(thread, name, lambda: function(dict(options or {})))
    except DslError:
        raise
    except ValidationError as error:
        raise DeviceError(_refused(points[0], function, error)) from error
    except Exception as error:
        first = f"{UNPLUGGED} {WRITTEN_WRONG}" if isinstance(error, OF_CODE) else UNPLUGGED
        raise DeviceError(
            _fault(points[0], f"failed to open: {type(error).__name__}: {error}", first)
        ) from error
    if not isinstance(rig, DeviceRig):
        raise DeviceError(_fault(points[0], f"opened as {type(rig).__name__} instead of DeviceRig"))
    return rig if is_unguarded else guarded(rig, thread)


def _refused(point: EntryPoint, function: OpenRig, error: ValidationError) -> str:
    """Which options a rig refuses; a record that is none of its options is a fault of its package."""
    record = getattr(function, "options", None)
    if record is None or error.title != record.__name__:
        return _fault(point, f"failed to open: {error.title}: {problems_in_words(error)}", WRITTEN_WRONG)
    words = problems_in_words(error, len(error.errors()), "all of them together")
    return f"The rig {point.name!r} cannot have these options: {words}. 'dsl-scan rigs' lists them."


def _profiles() -> Any:
    return import_module(_PROFILES)


def _profiles_but(points: Sequence[EntryPoint]) -> list[str]:
    """Names of this computer's profiles, but for those of installed rigs."""
    taken = {point.name for point in points}
    return [name for name in _profiles().profile_names() if name not in taken]


def _open_profile(path: Path, options: dict[str, str] | None) -> DeviceRig:
    if options:
        raise DeviceError(
            f"The rig profile {path} takes no options, given: {', '.join(options)}. Change its settings in"
            " the file instead."
        )
    thread = DeviceThread(path.stem)
    rig: DeviceRig = open_on(thread, path.stem, lambda: _profiles().open_profile(path))
    return guarded(rig, thread)


def _describe_profile(name: str) -> RigEntry:
    path = _profiles().profile_path(name)
    try:
        profile = _profiles().load_profile(path)
    except DslError as error:
        return RigEntry(name, PROFILE, "", error=str(error))
    drivers = ", ".join(f"{kind} {part.driver}" for kind, part in profile.parts().items())
    return RigEntry(name, PROFILE, "", f"{profile.note or profile.name}: {drivers}")


def _points() -> list[EntryPoint]:
    return points_of(GROUP, BUILT_IN)


def _package(point: EntryPoint) -> tuple[str, str]:
    if point.dist is None:
        return "dsl-scan", __version__
    return point.dist.name, point.dist.version


def _load(point: EntryPoint) -> OpenRig:
    """Import the function behind an entry point; whatever its package raises becomes a `DeviceError`."""
    try:
        function = point.load()
    except Exception as error:
        missing = missing_package(error) if isinstance(error, ModuleNotFoundError) else None
        if missing is not None:
            raise missing from error
        reason = f"cannot be loaded from {point.value} ({type(error).__name__}: {error})"
        first = WRITTEN_WRONG if isinstance(error, OF_CODE) else ""
        if isinstance(error, ModuleNotFoundError) and error.name:
            first = f"Install {error.name.partition('.')[0]}, which it needs."
        raise DeviceError(_fault(point, reason, first)) from error
    if not callable(function):
        raise DeviceError(_fault(point, f"is {point.value}, which is not a function"))
    return function  # type: ignore[no-any-return]


def _fault(point: EntryPoint, what: str, first: str = "") -> str:
    name, version = _package(point)
    last = "If that does not help, update" if first else "Update"
    story = f"The rig {point.name!r} of package {name} {version} {what}"
    return " ".join(filter(None, (f"{story.rstrip('.')}.", first, f"{last} or reinstall that package.")))


def _describe(point: EntryPoint) -> RigEntry:
    package, version = _package(point)
    try:
        function = _load(point)
    except DslError as error:
        return RigEntry(point.name, package, version, error=str(error))
    lines = (inspect.getdoc(function) or "").splitlines()
    return RigEntry(
        point.name, package, version, description=lines[0] if lines else "", options=_options(function)
    )


def _options(function: OpenRig) -> tuple[OptionEntry, ...]:
    """The options that an opener declares; none if it declares no pydantic model."""
    record = getattr(function, "options", None)
    if not (inspect.isclass(record) and issubclass(record, BaseModel)):
        return ()
    return tuple(
        OptionEntry(
            name,
            "" if field.is_required() else _as_text(field.get_default(call_default_factory=True)),
            field.description or "",
        )
        for name, field in record.model_fields.items()
    )


def _as_text(value: object) -> str:
    """A default as a person types it."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return "on" if value else "off"
    return f"{value:g}" if isinstance(value, float) else str(value)
