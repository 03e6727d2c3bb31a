"""Two folders exchange their names at once, or nothing changes."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest

from dsl_core.io.swap import exchange


@pytest.fixture
def folders(tmp_path: Path) -> tuple[Path, Path]:
    for name in ("one", "other"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "name").write_text(name)
    return tmp_path / "one", tmp_path / "other"


@pytest.mark.skipif(sys.platform != "linux", reason="calls the Linux kernel")
def test_names_are_exchanged(folders: tuple[Path, Path]) -> None:
    if not exchange(*folders):
        pytest.skip("not on this file system")
    assert [(folder / "name").read_text() for folder in folders] == ["other", "one"]


def test_what_is_missing_is_not_exchanged(folders: tuple[Path, Path]) -> None:
    assert exchange(folders[0], folders[0].with_name("missing")) is False
    assert (folders[0] / "name").read_text() == "one"


@pytest.mark.parametrize(
    ("platform", "call"),
    [
        ("linux", ("renameat2", (-100, b"one", -100, b"other", 2))),
        ("darwin", ("renamex_np", (b"one", b"other", 2))),
    ],
)
@pytest.mark.parametrize(("code", "done"), [(0, True), (-1, False)])
def test_each_system_is_asked_in_its_own_words(
    monkeypatch: pytest.MonkeyPatch, platform: str, call: tuple[str, Any], code: int, done: bool
) -> None:
    asked: list[tuple[str, Any]] = []

    class Library:
        def __getattr__(self, name: str) -> Any:
            def answer(*given: Any) -> int:
                asked.append((name, given))
                return code

            return answer

    monkeypatch.setattr("ctypes.CDLL", lambda *_, **__: Library())
    monkeypatch.setattr(sys, "platform", platform)
    assert exchange(Path("one"), Path("other")) is done
    assert asked == [call]


def test_a_system_that_cannot_says_so(monkeypatch: pytest.MonkeyPatch, folders: tuple[Path, Path]) -> None:
    monkeypatch.setattr("ctypes.CDLL", lambda *_, **__: object())
    assert exchange(*folders) is False
    monkeypatch.setattr(sys, "platform", "win32")
    assert exchange(*folders) is False
