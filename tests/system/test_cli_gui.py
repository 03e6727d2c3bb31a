"""The window is opened by name, with the options it was given, and a missing one is a sentence."""

from __future__ import annotations

from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from dsl_core.cli import gui

from .conftest import Give


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    seen: list[list[str]] = []

    def main(words: list[str]) -> int:
        seen.append(words)
        return 3

    monkeypatch.setattr(EntryPoint, "load", lambda self: main)
    return seen


def test_the_window_gets_every_option(
    give: Give, asked: list[list[str]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    ending = give("gui", "leaf.zarr")
    assert (ending.code, asked) == (2, [])
    assert "leaf.zarr does not exist" in ending.sentence
    Path("leaf.zarr").mkdir()
    ending = give(
        "gui",
        "leaf.zarr",
        "--rig",
        "twin",
        "-O",
        "scene=box",
        "-O",
        "size=64x48",
        "--demo",
        "--theme",
        "dark",
    )
    assert ending.code == 3
    assert asked == [
        ["leaf.zarr", "--rig", "twin", "--option", "scene=box", "--option", "size=64x48", "--demo", "--theme",
         "dark"]
    ]  # fmt: skip


def test_without_options_the_window_decides(give: Give, asked: list[list[str]]) -> None:
    give("gui")
    assert asked == [[]]


def test_a_missing_window_is_a_sentence(give: Give, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gui, "WINDOW", EntryPoint("dsl-scan-gui", "no_such_window:main", "gui_scripts"))
    ending = give("gui")
    assert ending.code == 2
    assert 'pip install "dsl-scan[gui]"' in ending.sentence


def test_without_a_screen_the_window_says_so(give: Give, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "QT_QPA_PLATFORM"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("sys.platform", "linux")
    ending = give("gui")
    assert ending.code == 2
    assert "There is no screen" in ending.sentence
