"""A report says what a twin rendered, from the notes of the scan."""

from __future__ import annotations

import json
from typing import Any

import pytest

from dsl_core.evaluation.report.scan_report import render_report, report_content
from dsl_core.evaluation.summary import evaluate
from dsl_core.model.rendered_effects import RenderedEffects

NOTE = {
    "choice": "auto",
    "tolerance": "1 DN",
    "frame_s": 0.02,
    "frame_with_all_s": 0.05,
    "effects": [
        {"name": "halo", "what": "halo <x>", "on": True, "bound_dn": 300.0, "why": "Much."},
        {"name": "specular", "what": "highlights", "on": False, "bound_dn": 0.0, "why": "All is matte."},
    ],
}


def page(known: Any, **attributes: str) -> str:
    result = known.result.assign_attrs(attributes)
    return render_report(report_content("A scan", result, known.truth, evaluate(result, known.truth)))


def test_the_report_lists_effects_with_reasons_and_time_saved(known: Any) -> None:
    text = page(known, effects=json.dumps(NOTE))
    assert "What was rendered" in text
    assert "60 % are saved" in text
    assert "by 1 DN or more" in text
    assert "All is matte." in text
    assert "halo &lt;x&gt;" in text
    assert "frame_with_all_s" not in text


def test_a_scan_without_a_note_has_no_such_section(known: Any) -> None:
    assert "What was rendered" not in page(known)


@pytest.mark.parametrize("note", ["", "fine", "[]", '{"choice": "auto"}'])
def test_an_illegible_note_is_shown_as_it_is(known: Any, note: str) -> None:
    assert RenderedEffects.of_note(note) is None
    assert "What was rendered" not in page(known, effects=note)
