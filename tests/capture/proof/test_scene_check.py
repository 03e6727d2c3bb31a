"""Which pictures are captured again to see whether anything moved."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from dsl_core.capture.proof.scene_check import SceneCheck
from tests.cases.proof_rules import SHOTS, counts, known


def test_there_are_no_controls_before_the_code() -> None:
    assert SceneCheck(known()).controls() == ()


def test_the_first_pictures_are_named_once_the_code_is_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    scan: Any = known()
    check = SceneCheck(scan)
    assert check.first_pictures() == ()
    scan.code = SimpleNamespace(lit=object())
    assert check.first_pictures() == (), "it is not there"
    scan.kept[0] = scan.kept[2] = counts(300)
    assert check.first_pictures() == (SHOTS[0],)
    monkeypatch.setattr("dsl_core.capture.proof.scene_check.MANY_SHOTS", len(SHOTS))
    assert check.first_pictures() == (SHOTS[0], SHOTS[2])
    assert [shot.index for shot in check.code_after(SHOTS[2])] == list(range(3, 12))


def test_a_control_shows_the_inverse_of_its_pattern(monkeypatch: pytest.MonkeyPatch) -> None:
    scan: Any = known()
    check = SceneCheck(scan)
    assert not check.shows_inverse(SHOTS[2], counts(300).reshape(18, 32)), "its inverse is not there"
    monkeypatch.setattr(type(scan), "code_pairs", lambda scan: {0: (counts(300), counts(900))})
    scan.kept[3] = counts(900)
    monkeypatch.setattr(
        "dsl_core.capture.proof.scene_check.is_same", lambda seen, before, *_: bool((seen == before).all())
    )
    assert check.shows_inverse(SHOTS[2], counts(900).reshape(18, 32))
    assert not check.shows_inverse(SHOTS[2], counts(300).reshape(18, 32))
