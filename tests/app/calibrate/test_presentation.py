"""What the Calibrate page shows for each state, decided without a window."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest
from dsl_app.calibrate.presentation import (
    campaign_head,
    figure_words,
    kept_version,
    library_selection,
    main_button,
    row_display,
    short_date,
    stamp_date,
    version_texts,
)
from dsl_app.calibrate.state import About, CalibrateState, CampaignFacts, DriftVerdict, Row, RowState
from dsl_app.connection.state import RigChoice

from dsl_core.devices.base import DeviceRig
from dsl_core.io.calibration_library import LibraryEntry, LibraryLine
from dsl_core.model.calibration.accepted import AcceptedCalibration, CalibrationNote
from dsl_core.model.figure import Figure
from dsl_core.simulation.published_rig import published_rig

GOOD = Figure(name="shift", value=-0.2, std=0.01, unit="px", low=-0.5, high=0.5)
BAD = GOOD.model_copy(update={"value": -0.8})
ROW = Row("geometry", About("Geometry", "Lenses"))
FACTS = CampaignFacts(Path("/data/rigs/room-12"), RigChoice("twin", (("size", "32x24"),)))
BY_ITSELF = cast(DeviceRig, SimpleNamespace(place=print))
BY_HAND = cast(DeviceRig, SimpleNamespace(place=None))


def page(**values: Any) -> CalibrateState:
    """The state of a page whose campaign is open and half calibrated."""
    made = CalibrateState()
    made.campaign.set(FACTS)
    made.rows.set((replace(ROW, state=RowState.GOOD), ROW))
    for name, value in values.items():
        getattr(made, name).set(value)
    return made


def test_without_a_campaign_only_new_and_open_can_be_used() -> None:
    head = campaign_head(CalibrateState(), BY_ITSELF)
    assert head.title == "Calibrate"
    assert head.place.startswith("No campaign is open. First choose New campaign")
    assert "choose Calibrate everything" in head.place
    assert head.new.is_enabled
    assert head.open.is_enabled
    assert not head.keep.is_visible
    assert not head.everything.is_enabled
    assert (head.new.is_primary, head.everything.is_primary) == (True, False)


def test_without_a_campaign_a_rig_placed_by_hand_is_calibrated_row_by_row() -> None:
    for devices in (BY_HAND, None):
        place = campaign_head(CalibrateState(), devices).place
        assert "Then work through rows 1 to 6." in place
        assert "everything" not in place


def test_a_row_that_is_not_done_says_what_it_needs() -> None:
    for row in CalibrateState().rows.value:
        assert row_display(row).reason.text.startswith("Needs the " if row.name != "selftest" else "Needs a ")
    needy = replace(ROW, about=replace(ROW.about, needs="Needs a board."))
    assert row_display(needy).reason.text == "Needs a board."
    assert row_display(replace(needy, state=RowState.GOOD)).reason.text == ""
    assert row_display(needy, running="white, 3 of 8").reason.text == "white, 3 of 8"


def test_the_head_names_campaign_folder_and_rig() -> None:
    head = campaign_head(page(), None)
    assert head.title == "room-12"
    assert head.place.replace(chr(0x200B), "") == "in /data/rigs  ·  rig twin, size 32x24"


NOTHING_GOOD: dict[str, object] = {"rows": (ROW,)}


@pytest.mark.parametrize(
    ("values", "devices", "keep", "everything"),
    [
        ({}, BY_ITSELF, True, True),
        ({}, BY_HAND, True, False),
        ({}, None, False, False),
        ({"foreign": True}, BY_ITSELF, False, False),
        ({"campaign": None}, BY_ITSELF, False, False),
        (NOTHING_GOOD, BY_ITSELF, False, True),
    ],
)
def test_what_can_be_done_with_the_whole_campaign(
    values: dict[str, object], devices: DeviceRig | None, keep: bool, everything: bool
) -> None:
    head = campaign_head(page(**values), devices)
    assert (head.keep.is_enabled, head.everything.is_enabled) == (keep, everything)
    assert head.everything.is_visible
    assert not head.cancel.is_visible


ALL_GOOD: dict[str, object] = {"rows": (replace(ROW, state=RowState.GOOD),)}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("values", "devices", "main"),
    [
        ({"campaign": None}, BY_ITSELF, "new"),
        ({}, BY_ITSELF, "everything"),
        ({}, BY_HAND, "geometry"),
        # Starting everything again would end there again.
        ({"refused": "geometry"}, BY_ITSELF, "geometry"),
        ({"refused": "selftest"}, BY_ITSELF, "everything"),
        ({"rows": (replace(ROW, has_candidate=True),)}, BY_ITSELF, "geometry"),
        ({}, None, ""),
        (ALL_GOOD, BY_ITSELF, "keep"),
        ({"foreign": True}, BY_ITSELF, ""),
        ({"everything": "Geometry: fit, 2 of 8"}, BY_ITSELF, ""),
    ],
)
def test_the_blue_button_is_what_a_person_does_next(
    values: dict[str, object], devices: DeviceRig | None, main: str
) -> None:
    state = page(**values)
    assert main_button(state, devices) == main
    head = campaign_head(state, devices)
    blue = [name for name in ("new", "keep", "everything") if getattr(head, name).is_primary]
    assert blue == [main] * (main in ("new", "keep", "everything"))
    assert row_display(ROW, is_next=main == "geometry").run.is_primary is (main == "geometry")


def test_what_is_kept_is_used_for_scans_next() -> None:
    time = "2026-03-01T10:20:30+00:00"
    state = page(rows=(replace(ROW, state=RowState.GOOD, accepted=time),))
    others, own = version(), version()
    for line, accepted in ((others, "2026-01-01T00:00:00+00:00"), (own, time)):
        assert line.entry is not None
        note = CalibrationNote(name="geometry", title="Geometry", accepted=accepted)
        rig = line.entry.rig.model_copy(update={"calibrations": (note,)})
        object.__setattr__(line, "entry", line.entry.model_copy(update={"rig": rig}))
    state.library.set((others,))
    assert main_button(state, BY_ITSELF) == "keep", "something else is kept by now"
    state.library.set((others, own))
    assert kept_version(state) == own
    assert main_button(state, BY_ITSELF) == "use"
    assert not campaign_head(state, BY_ITSELF).scan.is_visible
    assert not campaign_head(state, BY_ITSELF).keep.is_primary
    state.in_use.set("room-12")
    assert main_button(state, BY_ITSELF) == "scan"
    assert main_button(state, None) == "scan"
    head = campaign_head(state, BY_ITSELF)
    assert (head.scan.is_visible, head.scan.is_primary) == (True, True)


def test_while_everything_runs_it_can_only_be_stopped() -> None:
    for progress, role in (("Geometry: fit, 2 of 8", "muted"), ("stopping", "warn")):
        head = campaign_head(page(everything=progress), BY_ITSELF)
        assert (head.progress.text, head.progress.role) == (progress, role)
        assert head.cancel.is_visible
        assert not head.keep.is_visible
        assert not head.everything.is_visible
        assert not head.new.is_enabled
        assert not head.open.is_enabled


@pytest.mark.parametrize(
    ("row", "word", "role"),
    [
        (ROW, "Run…", "muted"),
        (replace(ROW, state=RowState.BEGUN), "Continue…", "warn"),
        (replace(ROW, state=RowState.GOOD, accepted="2026-03-01T10:20:30+00:00"), "Open…", "good"),
        (
            replace(ROW, state=RowState.GOOD, accepted="2026-03-01T10:20:30+00:00", has_candidate=True),
            "Continue…",
            "good",
        ),
        (replace(ROW, state=RowState.OUTSIDE, accepted="2026-03-01T10:20:30+00:00"), "Open…", "warn"),
        (replace(ROW, state=RowState.OTHER_RIG, accepted="2026-03-01T10:20:30+00:00"), "Open…", "bad"),
        (replace(ROW, state=RowState.DAMAGED), "Run…", "bad"),
    ],
)
def test_the_button_of_a_row_says_what_the_wizard_does(row: Row, word: str, role: str) -> None:
    shown = row_display(row)
    assert (shown.run.text, shown.state.role) == (word, role)
    assert shown.run.name == f"{word[:-1]} Geometry"
    assert shown.run.is_enabled
    assert not row_display(row, is_busy=True).run.is_enabled


def test_a_row_shows_its_figure_and_reason() -> None:
    good = row_display(replace(ROW, figure=GOOD, reason="2 captured"))
    # A number and its unit stay in one line.
    kept = "shift −0.200_±_0.010_px  (−0.5_to_0.5_px)".replace("_", "\N{NO-BREAK SPACE}")
    assert (good.figure.text, good.figure.role) == (kept, "")
    assert good.reason.text == "2 captured"
    bad = row_display(replace(ROW, figure=BAD))
    assert bad.figure.role == "bad"
    assert row_display(ROW).figure.text == row_display(ROW).date == ""
    others = [row_display(ROW, is_busy=True, opening=title).run.text for title in (ROW.about.title, "Other")]
    assert others == ["Opening…", "Run…"]
    running = row_display(replace(ROW, figure=GOOD), is_busy=True, running="Self-test: white, 3 of 8")
    assert running.state.text == "▶ running"
    assert running.reason.text == "Self-test: white, 3 of 8"
    assert running.figure.text == ""


def test_times_are_shown_to_the_minute() -> None:
    assert short_date("") == ""
    assert short_date("2026-03-01T10:20:59+00:00")[4:] == stamp_date("20260301-102059-000400")[4:]
    assert stamp_date("not a time") == "not a time"
    free = Figure(name="corners", value=77.0, unit="")
    assert figure_words(free) == "corners 77"


def version(is_current: bool = True) -> LibraryLine:
    entry = LibraryEntry(name="room-12", stored="2026-03-01T10:20:30+00:00", rig=published_rig())
    return LibraryLine("room-12", "20260301-102030-000000", is_current, entry)


@pytest.mark.parametrize(
    ("is_current", "in_use", "use"),
    [
        (True, "", "current"),
        (False, "", ""),
        (True, "room-12", "scans"),
        (False, "room-12", ""),
        (False, "room-12@20260301-102030-000000", "scans"),
        (True, "room-12@20260301-102030-000000", "scans"),
    ],
)
def test_a_version_says_whether_scans_use_it(is_current: bool, in_use: str, use: str) -> None:
    assert version_texts(version(is_current), in_use)[2] == use


def test_what_can_be_done_with_a_version() -> None:
    none, now, old = library_selection(None), library_selection(version()), library_selection(version(False))
    assert (none.key, none.can_use, none.can_restore) == ("", False, False)
    assert "library is empty" in none.details
    assert (now.key, now.can_use, now.can_restore) == ("room-12", True, False)
    assert (old.key, old.can_use, old.can_restore) == ("room-12@20260301-102030-000000", True, True)
    broken = LibraryLine("<lab>", "20260301-102030-000000", False, error="It is cut off.")
    damaged = library_selection(broken)
    assert not damaged.can_use
    assert not damaged.can_restore
    assert damaged.details == "<p><b>&lt;lab&gt;</b></p><p>It is cut off.</p>"
    assert version_texts(broken, "")[3:] == ("damaged", "", "")


def test_the_details_say_with_which_settings_in_words() -> None:
    line, note = (
        version(),
        CalibrationNote(name="geometry", title="Geometry", accepted="2026-03-01T10:20:30+00:00"),
    )
    assert line.entry is not None
    board = '{"kind":"charuco","columns":9,"rows":6,"square_mm":20.5,"marker_mm":15.0,"legacy":false}'
    settings = {
        "rig": "twin",
        "board": board,
        "positions_mm": "650,700",
        "grid": "true",
        "corners_px": "[[1, 2]]",
    }
    accepted = AcceptedCalibration(name="geometry", title="Geometry", settings=settings)
    rig = line.entry.rig.model_copy(update={"calibrations": (note,)})
    entry = line.entry.model_copy(update={"rig": rig, "accepted": (accepted,)})
    details = library_selection(replace(line, entry=entry)).details
    assert (
        "Board: 9 × 6 squares with markers, squares of 20.5 mm, markers of 15 mm; Positions of the"
        " stage: 650, 700 mm; Model columns from the data, too: yes; Corners of the chart by hand: (1, 2) px"
    ) in details


def test_a_drift_check_is_passed_when_all_figures_are() -> None:
    good, bad = DriftVerdict("room 12", (GOOD,)), DriftVerdict("room 12", (GOOD, BAD))
    assert (good.passed, bad.passed) == (True, False)
    assert good.sentence == "The rig matches the calibration room 12."
    assert bad.sentence == "The rig does not match the calibration room 12."
