"""What the dialog of a rig profile shows: the draft, devices that were found, and what trying them said."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from dsl_app.rig.profiles.draft import NEEDED, Draft
from dsl_app.shared.evented import Event, Value
from dsl_core.devices.doctor import Finding, Grade
from dsl_core.devices.driver_table import FoundDevice, Kind


@dataclass(frozen=True)
class Found:
    """A device that a driver sees now."""

    kind: Kind
    driver: str
    device: FoundDevice


class ProfileState:
    """Values that the controller sets and the dialog follows.

    ``opened`` is the draft as it was read, before anything was changed.
    ``drivers`` are the names of drivers by kind, ``found`` the devices they see, None before anybody looked.
    ``findings`` is what trying
    the devices said, ``tried`` the draft that was tried. ``busy`` says what is being done (empty: nothing),
    ``trouble`` what is wrong. ``saved`` fires with the file.
    """

    def __init__(self) -> None:
        self.draft = Value(Draft())
        self.opened = Draft()
        self.drivers: Value[Mapping[Kind, tuple[str, ...]]] = Value({})
        self.found: Value[tuple[Found, ...] | None] = Value(None)
        self.findings: Value[tuple[Finding, ...]] = Value(())
        self.tried: Value[Draft | None] = Value(None)
        self.busy = Value("")
        self.trouble = Value("")
        self.saved: Event[Path] = Event()

    @property
    def is_unsaved(self) -> bool:
        """Whether leaving would lose what a person chose or typed."""
        return self.draft.value != self.opened


@dataclass(frozen=True)
class ProfileView:
    """What the dialog says and which buttons can be used; ``verdict`` sums up what was tried.

    ``following`` is what a person does next: look, try or save.
    """

    trouble: str
    remark: str
    verdict: str
    verdict_role: str
    can_act: bool
    following: str


def profile_view(state: ProfileState) -> ProfileView:
    """The dialog's texts for what is known now."""
    draft, busy, findings = state.draft.value, state.busy.value, state.findings.value
    remark = f"{busy}…" if busy else f"Saves {draft.target}." if draft.name else ""
    verdict, role = "Try opens every device and says what is wrong. Nothing is moved.", "muted"
    if findings:
        bad = sum(each.grade is Grade.BAD for each in findings)
        warnings = sum(each.grade is Grade.WARNING for each in findings)
        verdict, role = "Every device works.", "good"
        if bad:
            verdict, role = f"{bad} of {len(findings)} findings prevent a scan.", "bad"
        elif warnings:
            verdict, role = "Every device answers; see the warnings.", "warn"
        if state.tried.value is not draft:
            verdict, role = f"Before the last change: {verdict[0].lower()}{verdict[1:]}", "muted"
    return ProfileView(state.trouble.value, remark, verdict, role, not busy, _following(state))


def _following(state: ProfileState) -> str:
    draft = state.draft.value
    if not all(draft.part(kind).driver for kind in NEEDED):
        return "look"
    return "save" if state.tried.value is draft else "try"
