"""The rig of the last session is connected once, and not while a first example is opened."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from dsl_app.composition.first_connection import FirstConnection
from dsl_app.connection.controller import RigController
from dsl_app.connection.state import Link, RigChoice, RigState
from PySide6.QtCore import QObject, QTimer, Signal

from tests.app.support.doubles import InlineRunner, RecordingNotifier


class Window(QObject):
    """What it asks of a window."""

    opened = Signal(str)

    def __init__(self) -> None:
        super().__init__()
        self.page = "start"
        self.parts = SimpleNamespace(runner=SimpleNamespace(active=()))


class Bench:
    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.waiting: list[Any] = []
        monkeypatch.setattr(QTimer, "singleShot", lambda ms, owner, act: self.waiting.append(act))
        notifier = RecordingNotifier()
        self.window = Window()
        self.rig = RigController(RigState(RigChoice("twin")), InlineRunner(notifier), notifier)
        self.asked: list[RigChoice] = []
        monkeypatch.setattr(self.rig, "connect", self.asked.append)
        self.first = FirstConnection(self.window, self.rig)  # type: ignore[arg-type]

    def tick(self) -> None:
        self.waiting.pop()()


@pytest.fixture
def bench(qapp: object, monkeypatch: pytest.MonkeyPatch) -> Bench:
    return Bench(monkeypatch)


def test_a_rig_that_was_named_or_a_page_that_needs_it_waits_for_nothing(bench: Bench) -> None:
    bench.first.begin(at_once=True)
    assert len(bench.asked) == 1
    assert bench.waiting == []


@pytest.mark.parametrize("page", ["start", "results"])
def test_an_example_is_opened_first(bench: Bench, page: str) -> None:
    bench.window.page = page
    bench.first.begin(at_once=False)
    bench.window.parts.runner.active = ("Open the example face",)
    bench.window.opened.emit("results")
    bench.tick()
    assert bench.asked == []
    bench.window.parts.runner.active = ()
    bench.tick()
    assert len(bench.asked) == 1
    assert bench.waiting == []


def test_the_rig_page_connects_and_who_disconnects_wants_it_so(bench: Bench) -> None:
    bench.first.begin(at_once=False)
    bench.window.opened.emit("rig")
    assert len(bench.asked) == 1
    bench.rig.state.link.set(Link.OPEN)
    bench.rig.state.link.set(Link.CLOSED)
    bench.window.opened.emit("rig")
    bench.tick()
    assert len(bench.asked) == 1
