"""A rig profile as it is edited: every setting as the text that a person typed, and what that means."""

from __future__ import annotations

import json
import types
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Union, get_args, get_origin

from pydantic import ValidationError
from pydantic.fields import FieldInfo

from dsl_core.devices.driver_table import KINDS, FoundDevice, Kind, find_driver, read_settings
from dsl_core.devices.profile import DevicePart, RigProfile
from dsl_core.errors import DeviceError
from dsl_core.io.rig_profile import SUFFIX, profiles_folder
from dsl_core.model.base import what_is_wrong
from dsl_core.words import capitalised

#: Devices that a rig cannot do without.
NEEDED: tuple[Kind, ...] = ("camera", "projector")
_TRUTH = {"yes": True, "true": True, "on": True, "no": False, "false": False, "off": False}


@dataclass(frozen=True)
class DraftPart:
    """One device: its driver (empty: the rig has none), and settings as texts; others have their defaults."""

    driver: str = ""
    texts: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Draft:
    """A profile that is edited; ``path`` is the file that it was read from."""

    name: str = ""
    parts: Mapping[Kind, DraftPart] = field(default_factory=dict)
    nominal: str = ""
    note: str = ""
    path: Path | None = None

    def part(self, kind: Kind) -> DraftPart:
        """A device, which may be none."""
        return self.parts.get(kind, DraftPart())

    def with_part(self, kind: Kind, part: DraftPart) -> Draft:
        """The draft with another device of a kind."""
        return replace(self, parts={**self.parts, kind: part})

    @property
    def target(self) -> Path:
        """The file to save: the one that was read unless the name has changed, else one found by its name."""
        if self.path is not None and self.path.stem == self.name:
            return self.path
        return profiles_folder() / f"{self.name}{SUFFIX}"


def draft_of(profile: RigProfile, path: Path) -> Draft:
    """A profile as texts; files are found by their names, so the name is that of the file."""
    parts = {
        kind: DraftPart(part.driver, {key: text_of(value) for key, value in part.settings.items()})
        for kind, part in profile.parts().items()
    }
    return Draft(path.stem, parts, profile.nominal, profile.note, path)


def part_of(found: FoundDevice, driver: str, before: DraftPart) -> DraftPart:
    """A device that was found: its driver and address; other settings stay if the driver does."""
    kept = dict(before.texts) if before.driver == driver else {}
    return DraftPart(driver, {**kept, **{key: text_of(value) for key, value in found.settings.items()}})


def profile_of(draft: Draft) -> RigProfile:
    """The profile that a draft means; raises `DeviceError` saying what is wrong, where and what to do."""
    require_name(draft.name)
    parts: dict[str, Any] = {}
    for kind in KINDS:
        part = draft.part(kind)
        if part.driver:
            parts[kind] = DevicePart(driver=part.driver, settings=settings_of(kind, part))
        elif kind in NEEDED:
            raise DeviceError(f"The profile has no {kind}. Choose its driver, or a device that was found.")
    return RigProfile(name=draft.name, nominal=draft.nominal, note=draft.note, **parts)


def require_name(name: str) -> None:
    """Raise `DeviceError` for a name that cannot be that of a file, or is that of an installed rig."""
    from dsl_core.devices.registry import is_built_in

    if not name.strip():
        raise DeviceError(
            "The rig has no name, which is that of its file. Enter one of letters, digits, spaces and dashes."
        )
    if name != name.strip() or name.startswith(".") or set(name) & set('/\\:*?"<>|'):
        raise DeviceError(
            f"The name of the rig is {name!r}; it names the file of the profile. Enter a name of letters,"
            " digits, spaces and dashes."
        )
    if is_built_in(name):
        raise DeviceError(f"{name!r} is the name of a rig of this program. Enter another name.")


def settings_of(kind: Kind, part: DraftPart) -> dict[str, Any]:
    """The settings of a device, checked; raises `DeviceError` that names every one that is wrong."""
    fields = find_driver(kind, part.driver).settings.model_fields
    given = {
        key: value_of(text, fields[key]) if key in fields else text
        for key, text in part.texts.items()
        if text.strip()
    }
    read_settings(kind, part.driver, given)
    return given


def wrong_settings(draft: Draft) -> dict[Kind, dict[str, str]]:
    """What is wrong with settings that drivers refuse, in words, by kind of device and name of setting."""
    found: dict[Kind, dict[str, str]] = {}
    for kind in KINDS:
        try:
            if draft.part(kind).driver:
                settings_of(kind, draft.part(kind))
        except DeviceError as error:
            faults = error.__cause__.errors() if isinstance(error.__cause__, ValidationError) else []
            # A list is what a person writes with commas.
            said: dict[str, str] = {}
            for fault in faults:
                if fault["loc"]:
                    words = what_is_wrong(fault).replace("a list", "values separated by commas")
                    said.setdefault(str(fault["loc"][0]), words)
            if said:
                found[kind] = said
    return found


def value_of(text: str, setting: FieldInfo) -> Any:
    """What a text means for a setting: lists are separated by commas or ×, truth is yes or no.

    A text that means nothing of the setting's kind stays a text, which the setting then refuses.
    """
    text = text.strip()
    kinds = _kinds(setting.annotation)
    if bool in kinds and text.lower() in _TRUTH:
        return _TRUTH[text.lower()]
    if kinds & {tuple, list}:
        text = f"[{text.strip('[]()').replace('×', ',').replace(' x ', ',')}]"
    elif kinds <= {str}:
        return text
    try:
        return json.loads(text)
    except ValueError:
        return text


def _kinds(annotation: Any) -> set[Any]:
    """The plain types that an annotation allows, without None."""
    origin = get_origin(annotation)
    if origin in (Union, types.UnionType):
        return set().union(*(_kinds(each) for each in get_args(annotation)))
    return set() if annotation is type(None) else {origin or annotation}


def text_of(value: object) -> str:
    """A value as a person types it.

    >>> text_of([890, 580]), text_of(True), text_of(0.5)
    ('890, 580', 'yes', '0.5')
    """
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, str):
        return value
    if isinstance(value, list | tuple):
        return ", ".join(text_of(each) for each in value)
    return json.dumps(value)


#: Endings of names that are units.
_UNITS = {"ms": "ms", "s": "s", "px": "px", "mm": "mm", "db": "dB", "nm": "nm"}
#: Words of names that are initials.
_INITIALS = {"id", "adc"}


def caption(name: str) -> str:
    """The name of a setting as words, with its unit.

    >>> caption("frame_wait_s"), caption("gain_db"), caption("id"), caption("adc_bits")
    ('Frame wait (s)', 'Gain (dB)', 'ID', 'ADC bits')
    """
    words, _, end = name.rpartition("_")
    text, unit = (words, f" ({_UNITS[end]})") if words and end in _UNITS else (name, "")
    said = " ".join(word.upper() if word in _INITIALS else word for word in text.split("_"))
    return capitalised(said) + unit
