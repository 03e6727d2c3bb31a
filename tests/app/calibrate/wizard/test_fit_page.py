"""The page of the fit: its evidence is made when it is seen."""

from __future__ import annotations

import pytest
from dsl_app.calibrate.evidence.base import PlainEvidence
from dsl_app.calibrate.wizard.fit_page import NO_FIT, FitPage
from dsl_app.calibrate.wizard.state import Fit, WizardState
from pytestqt.qtbot import QtBot

from dsl_core.campaign.session import CalibrationSession
from dsl_core.model.base import Record
from dsl_core.model.calibration.accepted import AcceptedCalibration
from tests.app.calibrate.evidence_bench import session_of


def test_captures_without_a_fit_are_shown_where_that_helps(
    qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[object] = []

    class Helpful(PlainEvidence):
        def show_captures(self, session: CalibrationSession) -> bool:
            seen.append(session)
            return True

    for kind, helps in ((Helpful, True), (PlainEvidence, False)):
        monkeypatch.setattr("dsl_app.calibrate.wizard.fit_page.make_evidence", lambda name, kind=kind: kind())
        state = WizardState("color-checker", "Color Checker")
        page = FitPage(state)
        qtbot.addWidget(page)
        page.show()
        assert page.figures.isVisible()
        assert page.figures.empty_text == NO_FIT
        session = session_of({})
        state.misfit.set(session)
        assert page.evidence is not None
        assert page.evidence.isVisible() == helps
        assert not page.figures.isVisible()
    assert len(seen) == 1


def test_evidence_waits_until_the_page_is_seen(qtbot: QtBot) -> None:
    state = WizardState("another", "Another")
    fitted = AcceptedCalibration(name="another", title="Another")
    state.fit.set(Fit(fitted, Record(), session_of({})))
    page = FitPage(state)
    qtbot.addWidget(page)
    assert page.findChildren(PlainEvidence) == []
    page.show()
    assert page.findChildren(PlainEvidence) == []
    qtbot.waitUntil(lambda: bool(page.findChildren(PlainEvidence)))
    assert page.findChildren(PlainEvidence)[0].isVisible()
    state.fit.set(None)
    assert not page.findChildren(PlainEvidence)[0].isVisible()
