from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from dsl_app.results.controller import ResultsController
from dsl_app.results.page import ResultsPage
from dsl_app.results.state import ResultsState
from dsl_app.results.summary import Content, effects_text, summarise
from dsl_app.results.welcome import Welcome
from dsl_app.shared.evented import Value
from dsl_app.shared.settings import RecentFiles, Settings
from dsl_app.shared.undo import UndoStack
from dsl_app.shared.widgets.help_window import help_of
from pytestqt.qtbot import QtBot

from dsl_core.io.result.result_arrays import ResultArrays
from dsl_core.io.result.result_file import load_result, save_result
from dsl_core.model.fit import Fit, FitFinding
from tests.app.support.doubles import InlineRunner, RecordingNotifier
from tests.app.support.small_result import write_small_result

NOTE = {
    "choice": "auto",
    "tolerance": "1 DN",
    "frame_s": 0.01,
    "frame_with_all_s": 0.04,
    "effects": [
        {"name": "blur", "what": "blur", "on": True, "bound_dn": 30.0, "why": "Edges."},
        {"name": "specular", "what": "highlights", "on": False, "bound_dn": 0.0, "why": "Nothing is glossy."},
    ],
}


def test_effects_are_named_with_what_they_saved() -> None:
    short, long = effects_text({"effects": json.dumps(NOTE)})
    assert short == "effects auto within 1 DN: 1 of 2"
    assert "rendered blur" in long
    assert "left out specular" in long
    assert "75 % less" in long
    chosen = {**NOTE, "choice": "blur,halo"}
    assert effects_text({"effects": json.dumps(chosen)})[0] == "effects chosen: 1 of 2"


@pytest.mark.parametrize("attributes", [{}, {"effects": "{"}, {"effects": 3}])
def test_nothing_is_said_where_nothing_is_known(attributes: dict[str, object]) -> None:
    assert effects_text(attributes) == ("", "")


def make_page(qtbot: QtBot) -> ResultsPage:
    state, runner = ResultsState(), InlineRunner()
    control = ResultsController(state, runner, RecordingNotifier(), UndoStack())
    welcome = Welcome(RecentFiles(Settings()), lambda _: None, lambda: None, Value(False))
    page = ResultsPage(state, control, runner, welcome)
    qtbot.addWidget(page)
    return page


def test_the_results_page_says_which_effects_a_scan_had(qtbot: QtBot, tmp_path: Path) -> None:
    plain = load_result(write_small_result(tmp_path)).load()
    path = save_result(plain.assign_attrs(effects=json.dumps(NOTE)), tmp_path / "rendered.zarr")
    page = make_page(qtbot)
    page.open_path(path)
    assert "effects auto within 1 DN: 1 of 2" in page.about.text()
    assert "left out specular" in page.about.toolTip()
    assert help_of(page.pixel_info) == "hard-cases"
    page.release()


def test_a_person_who_waits_for_a_result_is_told_so(qtbot: QtBot) -> None:
    awaited = Value(True)
    welcome = Welcome(RecentFiles(Settings()), lambda _: None, lambda: None, awaited)
    qtbot.addWidget(welcome)
    assert welcome.title.text() == "A result is being computed"
    assert welcome.choose.property("role") == ""
    awaited.set(False)
    assert welcome.title.text() == "No result is open"
    assert welcome.choose.property("role") == "primary"


def result(**attributes: object) -> ResultArrays:
    arrays = {"depth_mm": np.zeros((48, 64)), "reflectance": np.zeros((24, 48, 64))}
    return ResultArrays(Path("/scans/leaf.zarr"), np.arange(430.0, 661.0, 10.0), arrays, attributes)


@pytest.mark.parametrize(
    ("has_result", "offer", "busy", "content", "message", "can_reconstruct"),
    [
        (False, None, "", Content.WELCOME, "", False),
        (True, None, "", Content.RESULT, "", False),
        (False, "cup.dsl", "", Content.OFFER, "cup.dsl has no result yet. Reconstruct it now?", True),
        (True, "cup.dsl", "", Content.OFFER, "cup.dsl has no result yet. Reconstruct it now?", True),
        (True, "cup.dsl", "Open cup", Content.OFFER, "Open cup…", False),
        (False, None, "Open leaf", Content.OFFER, "Open leaf…", False),
    ],
)
def test_the_page_shows_a_result_an_offer_or_the_welcome(
    has_result: bool, offer: str | None, busy: str, content: Content, message: str, can_reconstruct: bool
) -> None:
    found = summarise(result() if has_result else None, None if offer is None else Path(offer), busy)
    assert (found.content, found.message, found.can_reconstruct) == (content, message, can_reconstruct)
    # What is open behind an offer can be neither seen nor exported.
    assert found.has_result == (has_result and offer is None)
    assert found.title == ("cup" if offer else "leaf" if has_result else "Results")


def test_the_head_tells_size_bands_time_and_path() -> None:
    found = summarise(result(captured="2026-05-04T09:30:12"), None, "")
    assert found.about == "64 × 48 px · 24 bands · 2026-05-04 09:30 · /scans/leaf.zarr"
    assert found.details == "/scans/leaf.zarr"
    depth = ResultArrays(Path("a.zarr"), np.empty(0), {"depth_mm": np.zeros((48, 64))})
    assert summarise(depth, None, "").about == "64 × 48 px · depth only · a.zarr"


def test_the_head_tells_to_what_share_the_scale_of_reflectance_is_known() -> None:
    fit = Fit(scale_rel_std=0.025, scale="Scale of reflectance: known to 4.9%.")
    found = summarise(result(fit=fit.model_dump_json()), None, "")
    assert found.about == "64 × 48 px · 24 bands · scale of reflectance known to 4.9 % · /scans/leaf.zarr"
    assert fit.scale in found.details
    # It is so of every scan, and no reason for a warning.
    assert found.warning == found.advice == ""


def test_what_the_calibration_missed_stands_before_what_does_not_fit() -> None:
    missed = (
        "This rig's calibration 'Geometry' missed its limit: camera error 0.60 px (limit: at most 0.5 px).",
    )
    found = summarise(result(calibration_missed=json.dumps(missed)), None, "")
    assert found.warning == found.advice == missed[0]
    assert missed[0] in found.details
    finding = FitFinding(
        part="film", name="shift", value=0.1, unit="mm", limit=0.02, significant=True, sentence="It moved.",
    )  # fmt: skip
    fit = Fit.of([finding]).model_dump_json()
    both = summarise(result(calibration_missed=json.dumps(missed), fit=fit), None, "")
    assert both.warning.startswith(missed[0])
    assert "the place of the film" in both.warning


def test_pictures_in_doubt_come_before_all_else() -> None:
    doubts, missed = ("Stripes are blurred.", "Frame 7 is late."), ("A limit was missed.",)
    found = summarise(
        result(frames_in_doubt=json.dumps(doubts), calibration_missed=json.dumps(missed)), None, ""
    )
    assert found.warning == "Stripes are blurred. A limit was missed."
    assert found.advice == "Stripes are blurred.\nFrame 7 is late.\nA limit was missed."
    assert "Frame 7 is late." in found.details


def test_what_no_scan_shows_is_told_once_whether_the_model_fits_or_not() -> None:
    old = "The calibration is 21 days older than this scan."
    lost = FitFinding(
        part="film", name="shift", value=0.1, unit="mm", limit=0.02, significant=True, sentence="It moved.",
    )  # fmt: skip
    fits = summarise(result(fit=Fit(unseen=old).model_dump_json()), None, "")
    assert fits.warning == fits.advice == old
    both = summarise(result(fit=Fit(findings=(lost,), unseen=old).model_dump_json()), None, "")
    assert both.warning.endswith(old)
    assert both.advice.endswith(f"It moved.\n{old}")
    assert both.advice.count(old) == 1


def test_a_model_that_does_not_fit_is_told_in_a_line_of_its_own(qtbot: QtBot, tmp_path: Path) -> None:
    found = FitFinding(
        part="film", name="shift", value=0.1, unit="mm", limit=0.02, significant=True,
        sentence="The film has moved by 0.1 mm.", advice="Run the drift check.",
    )  # fmt: skip
    plain = load_result(write_small_result(tmp_path)).load()
    fits, doubts = (Fit.of(f).model_dump_json() for f in ((), (found,)))
    texts = []
    for name, fit in (("good", fits), ("bad", doubts)):
        path = save_result(plain.assign_attrs(fit=fit), tmp_path / f"{name}.zarr")
        page = make_page(qtbot)
        page.open_path(path)
        texts.append((page.warning.isVisibleTo(page), page.warning.text(), page.warning.toolTip()))
    assert texts[0] == (False, "", "")
    assert texts[1][0]
    assert "the place of the film" in texts[1][1]
    assert "moved by 0.1 mm. Run the drift check." in texts[1][2]
