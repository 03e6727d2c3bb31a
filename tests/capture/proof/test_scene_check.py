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
