"""What the dialog says is decided without a window."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from dsl_app.importing.captures.fields import first_mapping
from dsl_app.importing.captures.state import (
    NO_FILE,
    NOMINAL,
    CaptureRequest,
    CapturesState,
    Decoded,
    Listing,
    Place,
    Stated,
    captures_view,
    target_trouble,
)

MAPPING = first_mapping(12, (32, 24))


def state_of(tmp_path: Path) -> CapturesState:
    state = CapturesState(tmp_path)
    state.request.set(CaptureRequest(tmp_path / "in", tmp_path / "out.dsl"))
    state.stated.set(Stated(MAPPING, is_guessed=True))
    state.listing.set(Listing((("a.png", "white"),), "No depth."))
    return state


def test_an_empty_dialog_asks_for_a_folder(tmp_path: Path) -> None:
    view = captures_view(CapturesState(tmp_path))
    assert view.folder.text.startswith("Choose the folder")
    assert (view.can_guess, view.can_change, view.can_import) == (False, False, False)


def test_a_guess_can_be_imported(tmp_path: Path) -> None:
    view = captures_view(state_of(tmp_path))
    assert view.can_import
    assert view.folder.text == "1 picture, mapping guessed from the pictures."
    assert (view.mapping.text, view.calibration.text) == ("Nothing is unsure.", "No depth.")
    assert view.target.text == "Creates out.dsl."


def test_pictures_that_are_absent_are_not_counted(tmp_path: Path) -> None:
    state = state_of(tmp_path)
    state.listing.set(Listing((("a.png", "white"), (NO_FILE, "bit 3: missing")), "No depth."))
    assert captures_view(state).folder.text == "1 picture and 1 absent, mapping guessed from the pictures."


def test_what_is_wrong_with_a_file_is_said_once(tmp_path: Path) -> None:
    state = state_of(tmp_path)
    state.trouble.set(tuple((place, "a.png cannot be decoded.") for place in (Place.FOLDER, Place.MAPPING)))
    view = captures_view(state)
    assert (view.folder.role, view.mapping.role) == ("bad", "muted")


@pytest.mark.slow
@pytest.mark.parametrize("place", list(Place))
def test_a_trouble_is_said_beside_what_it_is_about_and_prevents_the_import(
    tmp_path: Path, place: Place
) -> None:
    state = state_of(tmp_path)
    state.trouble.set(((place, "Wrong."),))
    view = captures_view(state)
    assert not view.can_import
    said = {where: getattr(view, where.value) for where in Place}
    assert [where for where, each in said.items() if each.role == "bad"] == [place]
    assert said[place].text == "Wrong."


def test_doubts_are_told_without_options_of_commands(tmp_path: Path) -> None:
    state = state_of(tmp_path)
    doubts = ("a projector of 32 x 24 px is assumed; give --projector", "rows fall")
    state.stated.set(Stated(MAPPING.model_copy(update={"unsure": doubts})))
    said = captures_view(state).mapping
    assert said.text == "Unsure: a projector of 32 × 24 px is assumed; rows fall."
    assert said.role == "warn"


@pytest.mark.parametrize(
    ("share", "lit", "role", "words"),
    [
        (0.97, 0.8, "good", "97 % of the lit pixels have a column, from 3 to 9"),
        (0.7, 0.8, "warn", "too fine or too dark"),
        (0.2, 0.8, "bad", "the order of its digits"),
        (0.0, 0.0, "bad", "No pixel is lit"),
    ],
)
def test_columns_are_judged(tmp_path: Path, share: float, lit: float, role: str, words: str) -> None:
    state = state_of(tmp_path)
    state.decoded.set(Decoded(np.array([[3.0, np.nan, 9.0]], np.float32), share, lit))
    said = captures_view(state).columns
    assert said.role == role
    assert words in said.text


def test_values_are_told_and_what_to_do_first(tmp_path: Path) -> None:
    state = state_of(tmp_path)
    decoded = Decoded(np.array([[3.0, 9.0]], np.float32), 0.97, 0.8, values="linear in light: 1 %")
    state.decoded.set(decoded)
    said = captures_view(state).values
    assert (said.text, said.role) == ("Values are linear in light: 1 %.", "muted")
    state.decoded.set(replace(decoded, values="not linear", advice="set encoding of the mapping to srgb"))
    said = captures_view(state).values
    assert said.text == "Set encoding of the mapping to srgb. Values are not linear."
    assert said.role == "warn"


def test_nothing_that_exists_is_replaced(tmp_path: Path) -> None:
    request = CaptureRequest(tmp_path, tmp_path / "a.dsl")
    assert target_trouble(request) == ""
    (tmp_path / "a.zarr").mkdir()
    assert target_trouble(request) == ""
    assert "a.zarr already exists" in target_trouble(replace(request, calibration=NOMINAL))
    (tmp_path / "a.dsl").mkdir()
    assert "a.dsl already exists" in target_trouble(request)
    assert target_trouble(replace(request, target=tmp_path / ".dsl")) == "Enter a name."
