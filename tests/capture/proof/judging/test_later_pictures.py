"""Pictures of later settings are judged by those of the first one, and what they say counts once."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dsl_core.capture.proof.contest import Contest
from dsl_core.capture.proof.finding import Finding, Verdict
from dsl_core.capture.proof.judging.later_pictures import LaterPictures
from dsl_core.capture.proof.prediction import Expected
from dsl_core.capture.proof.raster import Counts
from dsl_core.model.plan import Shot
from tests.cases.proof_rules import LATER_LINE, LINE, SHOTS, WON, counts, known


def test_what_a_wrong_line_was_compared_with_is_taken_again_where_it_was_never_told() -> None:
    judge = LaterPictures(scan := known())
    found = Finding(LATER_LINE, Verdict.LATE, (LATER_LINE,))
    assert judge._with_doubtful(found) is found
    assert judge._with_doubtful(found).again == (LINE, LATER_LINE), "found wrong twice"
    judge = LaterPictures(scan := known())
    scan.untold.add(LINE.index)
    assert judge._with_doubtful(found).again == (LINE, LATER_LINE)
    # The first line may have changed places with the black picture before it.
    scan.untold.add(12)
    first = judge._with_doubtful(Finding(SHOTS[28], Verdict.LATE, (SHOTS[28],)))
    assert first.again == (SHOTS[11], SHOTS[12], SHOTS[28])
    code = Finding(SHOTS[17], Verdict.LATE, (SHOTS[17],))
    scan.untold.add(1)
    assert judge._with_doubtful(code) is code


def test_dark_pixels_are_asked_once_the_black_of_a_later_setting_is_there(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    scan, asked = known(), list[float]()
    judge = LaterPictures(scan)
    scan.kept.update({at: counts(2000 if at == 10 else 100 + at) for at in range(16)})

    def contest(*parts: Any) -> Contest:
        asked.append(0.0 if parts[4] is None else float(parts[4].max()))
        return WON

    monkeypatch.setattr("dsl_core.capture.proof.judging.later_pictures.contest_of_pictures", contest)
    judge.judge(SHOTS[16], counts(120))
    assert min(asked) > 0, "only what is bright can be relied on"
    scan.kept[27] = counts(111)
    asked.clear()
    judge.judge(SHOTS[16], counts(120))
    assert set(asked) == {0.0}
    asked.clear()
    judge.judge(SHOTS[27], counts(111))
    assert min(asked) > 0, "black cannot vouch for itself"


@pytest.mark.parametrize("wrong", [(True, False), (True, True), (False, True)])
def test_a_picture_judged_with_and_without_gained_black_counts_once(
    monkeypatch: pytest.MonkeyPatch, wrong: tuple[bool, bool]
) -> None:
    judge = LaterPictures(scan := known())
    monkeypatch.setattr(judge.expected, "gained", lambda shot: np.float32(3))

    def later(shot: Shot, seen: Counts, less_gained: bool = True) -> Finding:
        light = 0.8 if less_gained else 0.7
        scan.learned.usual.judge(shot, light)
        scan.learned.steps.judge(shot, light, None)
        scan.learned.places.judge(shot, {1: Contest(100, light)})
        is_wrong = wrong[not less_gained]
        if is_wrong:
            scan.learned.contested.add(less_gained)
        return Finding(shot, Verdict.DISPLACED, (shot,) if is_wrong else ())

    monkeypatch.setattr(judge, "_judge", later)
    is_first = wrong != (True, False)
    assert judge.judge(LATER_LINE, counts(5)).is_wrong == (wrong[0] and wrong[1])
    light = 0.8 if is_first else 0.7
    assert list(scan.learned.usual._known["spectral", 1]) == [light]
    assert list(scan.learned.steps._known["spectral", 1, True]) == [light]
    assert [votes for _, votes, _ in scan.learned.places._votes[1].values()] == [100 * light]
    assert scan.learned.contested == ({True} if wrong[0] and is_first else set())


def test_only_the_brightness_of_lines_is_asked_of_what_they_light(monkeypatch: pytest.MonkeyPatch) -> None:
    judge, wanted = LaterPictures(known()), Expected(np.ones(4, np.float32), np.ones(4, np.float32))
    monkeypatch.setattr(
        "dsl_core.capture.proof.judging.later_pictures.brightness_of_picture",
        lambda *parts: float(parts[-1] is not None),
    )
    for shot in (SHOTS[16], SHOTS[26], SHOTS[27], LATER_LINE):
        asked = judge._brightness(shot, counts(5), wanted, wanted.counts)
        assert asked == (shot.role == "spectral")
