"""Finds devices, tries those of a draft, and saves it as a rig profile. No Qt."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

from dsl_app.rig.profiles.draft import (
    Draft,
    DraftPart,
    caption,
    draft_of,
    part_of,
    profile_of,
    wrong_settings,
)
from dsl_app.rig.profiles.state import Found, ProfileState
from dsl_app.shared.jobs.base import Job, JobRunner
from dsl_app.shared.notify import sentence_of
from dsl_core.devices.doctor import Finding
from dsl_core.devices.driver_table import KINDS, Kind, driver_names, list_drivers
from dsl_core.devices.profile import RigProfile
from dsl_core.errors import DeviceError, DslError, TakenError
from dsl_core.io.rig_profile import load_profile, save_profile
from dsl_core.progress import Progress
from dsl_core.words import quoted

T = TypeVar("T")


class ProfileController:
    """Fills a `ProfileState`; ``is_in_use`` tells whether a rig is connected, whose devices are taken."""

    def __init__(self, state: ProfileState, runner: JobRunner, is_in_use: Callable[[], bool]) -> None:
        self.state, self._runner, self._is_in_use = state, runner, is_in_use
        state.drivers.set({kind: tuple(driver_names(kind)) for kind in KINDS})

    def open(self, path: Path | None) -> None:
        """Edit the profile of a file; None begins a new one."""
        self.state.findings.set(())
        self.state.trouble.set("")
        self.state.wrong.set({})
        self.state.opened = Draft()
        if path is not None:
            try:
                self.state.opened = draft_of(load_profile(path), path)
            except DslError as error:
                self.state.trouble.set(sentence_of(error))
        self.state.draft.set(self.state.opened)

    # Edit ------------------------------------------------------------------------------------------

    def change(self, **what: Any) -> None:
        """Change name, nominal rig or note."""
        self._set(replace(self.state.draft.value, **what))

    def set_driver(self, kind: Kind, driver: str) -> None:
        """Choose a driver, whose settings are then its own; empty for no device."""
        if self.state.draft.value.part(kind).driver != driver:
            self._set(self.state.draft.value.with_part(kind, DraftPart(driver)))

    def set_text(self, kind: Kind, setting: str, text: str) -> None:
        """Set a setting; an empty text leaves it at its default."""
        part = self.state.draft.value.part(kind)
        texts = {key: value for key, value in part.texts.items() if key != setting}
        if text.strip():
            texts[setting] = text
        self._set(self.state.draft.value.with_part(kind, DraftPart(part.driver, texts)))

    def choose_device(self, found: Found) -> None:
        """Take over driver and address of a device that was found."""
        part = part_of(found.device, found.driver, self.state.draft.value.part(found.kind))
        self._set(self.state.draft.value.with_part(found.kind, part))

    def _set(self, draft: Draft) -> None:
        self.state.trouble.set("")
        if self.state.wrong.value:
            self.state.wrong.set(wrong_settings(draft))
        self.state.draft.set(draft)

    # Look and try ----------------------------------------------------------------------------------

    def look(self) -> None:
        """Look for devices with every driver; those that cannot look find none."""

        def done(found: tuple[Found, ...]) -> None:
            self.state.found.set(found)

        self._run("Look for devices", find_devices, done)

    def try_devices(self) -> None:
        """Open and try every device of the draft."""
        from dsl_core.devices.doctor import examine
        from dsl_core.io.rig_profile import read_nominal

        if self._is_in_use():
            self.state.trouble.set("A rig is connected, and its devices are taken. Disconnect it, then try.")
            return
        draft = self.state.draft.value
        # What a rig is called says nothing of its devices.
        profile = self._profile(draft if draft.name else replace(draft, name="rig"))
        if profile is None:
            return

        def work(_progress: Progress) -> list[Finding]:
            nominal, trouble = read_nominal(profile, draft.target.parent)
            return [*examine(profile, nominal), *trouble]

        def done(found: Any) -> None:
            self.state.tried.set(draft)
            self.state.findings.set(tuple(found))

        self._run(f"Try the devices of {profile.name}", work, done)

    def _profile(self, draft: Draft) -> RigProfile | None:
        """The profile that a draft means; None where it means none, and then why."""
        wrong = wrong_settings(draft)
        self.state.wrong.set(wrong)
        try:
            if not wrong:
                return profile_of(draft)
            told = (f"{caption(name)} {said[name]}" for said in wrong.values() for name in said)
            self.state.trouble.set(f"{'; '.join(told)}.")
        except DslError as error:
            self.state.trouble.set(sentence_of(error))
        return None

    def _run(self, title: str, work: Callable[[Progress], T], done: Callable[[T], object]) -> None:
        if self.state.busy.value:
            return
        self.state.busy.set(title)
        self.state.trouble.set("")
        self._runner.submit(
            Job(
                title,
                work,
                done,
                lambda error: self.state.trouble.set(sentence_of(error)),
                is_minor=True,
                on_ended=lambda: self.state.busy.set(""),
            )
        )

    # Save ------------------------------------------------------------------------------------------

    def save(self) -> bool:
        """Save the profile, whole or not at all; says why where that is not possible."""
        draft = self.state.draft.value
        profile = self._profile(draft)
        if profile is None:
            return False
        try:
            # What was opened is replaced; nothing else is.
            save_profile(profile, draft.target, overwrite=draft.target == draft.path)
        except TakenError:
            self.state.trouble.set(f"There is a rig profile {draft.name!r} already. Enter another name.")
            return False
        except (DslError, OSError) as error:
            self.state.trouble.set(sentence_of(error))
            return False
        self.state.saved.emit(draft.target)
        return True

    def command_line(self) -> str:
        """The command that tries the devices of the saved profile."""
        return f"dsl-scan rigs doctor {quoted(self.state.draft.value.target)}"


def find_devices(progress: Progress) -> tuple[Found, ...]:
    """The devices that all drivers see now."""
    found: list[Found] = []
    entries = list_drivers()
    for done, entry in enumerate(entries):
        progress.report(f"{entry.kind} {entry.name}", done, len(entries))
        if entry.driver is None or entry.driver.find is None:
            continue
        try:
            found += [Found(entry.kind, entry.name, device) for device in entry.driver.find()]
        except DeviceError:
            # Its library is not installed, or nothing of its kind is plugged in.
            continue
    return tuple(found)
