"""Tests of the application run without a screen; those marked ``gl`` want a virtual one.

As in the program, garbage is collected in the window's thread only: a job's thread that came upon widgets
would delete them there, and wait for Qt while Qt waits for Python.
"""

from __future__ import annotations

import gc
import os
from collections.abc import Generator, Iterator
from pathlib import Path

import pytest

from tests.app.support.questions import answering_questions, no_dialog_waits_for_ever

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
os.environ.setdefault("QT_API", "pyside6")

#: Tests from one full collection to the next, which takes long.
TESTS_PER_FULL = 100
_ended = 0


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup() -> None:
    """Let no thread collect garbage by itself."""
    gc.disable()


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_teardown(item: pytest.Item, nextitem: pytest.Item | None) -> Generator[None]:
    """Collect what the test left, and give collection back after the last test of the window.

    Nothing of a window may be left by then: the threads of other tests collect what they come upon. A window
    that a failed test leaves at work asks before it closes, and nobody would ever answer.
    """
    global _ended
    with answering_questions():
        yield
    _ended += 1
    is_last = nextitem is None or Path(__file__).parent not in nextitem.path.parents
    gc.collect(2 if is_last or _ended % TESTS_PER_FULL == 0 else 1)
    if is_last:
        gc.enable()


@pytest.fixture(autouse=True)
def _answered() -> Iterator[None]:
    """Fail a test with a dialog that it does not answer, and go on with the others."""
    with no_dialog_waits_for_ever() as given_up:
        yield
    assert not given_up, "nobody answered these dialogs"
