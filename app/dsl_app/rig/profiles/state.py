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
    ``findings`` is what trying the devices said, ``tried`` the draft that was tried. ``busy`` says what is
    being done (empty: nothing), ``trouble`` what is wrong, and ``wrong`` what is so with settings, by kind
    and name. ``saved`` fires with the file.
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
        self.wrong: Value[Mapping[Kind, Mapping[str, str]]] = Value({})
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
    remark = f"{busy}…" if busy else (_not_found(state) or (f"Saves {draft.target}." if draft.name else ""))
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
    missing = _missing(state)
    if missing:
        is_found = state.found.value is not None and any(each.kind in missing for each in state.found.value)
        # What was found is there to be chosen: looking again would find the same.
        return "" if is_found else "look"
    works = all(each.grade is not Grade.BAD for each in state.findings.value)
    return "save" if state.tried.value is draft and works else "try"


def _missing(state: ProfileState) -> list[Kind]:
    """Devices that a rig needs and that have no driver yet."""
    return [kind for kind in NEEDED if not state.draft.value.part(kind).driver]


def _not_found(state: ProfileState) -> str:
    """What to do where nothing was found of what a rig needs; empty before anybody looked."""
    found = state.found.value
    if found is None:
        return ""
    absent = [kind for kind in _missing(state) if all(each.kind != kind for each in found)]
    if not absent:
        return ""
    what = " and no ".join(absent)
    return f"No {what} was found. Check cables and power and look again, or choose the driver."
