from __future__ import annotations

from pathlib import Path

from dsl_app.importing.state import Found, ImportRequest, ImportState, import_view


def test_the_dialog_says_what_it_makes_and_what_prevents_it() -> None:
    state = ImportState()
    assert import_view(state).remark == ""
    state.request.set(ImportRequest(Path("leaf"), Path("home/leaf.dsl")))
    state.found.set(Found(Path("leaf"), "scan", (), ""))
    view = import_view(state)
    assert (view.trouble, view.remark, view.is_busy, view.asks_lengths) == (
        "",
        "Creates leaf.dsl.",
        False,
        False,
    )
    state.trouble.set("Enter a name.")
    assert import_view(state).trouble == "Enter a name."


def test_a_calibration_also_asks_its_size_and_goes_to_the_library() -> None:
    state = ImportState()
    state.request.set(ImportRequest(Path("rig"), Path("home/rig.json")))
    state.found.set(Found(Path("rig"), "calibration", (), ""))
    view = import_view(state)
    assert view.asks_lengths
    assert view.remark == "Creates rig.json. The calibration is also added to the library."
    state.library.set(("lab", "rig"))
    told = " That has one named rig already, of which this becomes the current version."
    assert import_view(state).remark == view.remark + told


def test_while_a_folder_is_checked_old_trouble_is_not_shown() -> None:
    state = ImportState()
    state.trouble.set("Enter a name.")
    state.busy.set("Checking leaf")
    view = import_view(state)
    assert (view.trouble, view.remark, view.is_busy) == ("", "Checking leaf…", True)
