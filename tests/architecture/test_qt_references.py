"""The installed PySide6 keeps the references of True and None.

PySide6 6.12.0 loses one of True at every signal and one of None at every call that returns None. After
some thousands of them Python 3.11 aborts ("deallocating True or False"), far away from the cause. From
Python 3.12 on both are immortal (PEP 683) and their count says nothing.
"""

from __future__ import annotations

import sys

import pytest
from PySide6 import QtCore

pytestmark = pytest.mark.skipif(sys.version_info >= (3, 12), reason="True and None are immortal here")

CALLS = 200
TOLERANCE = 20  # other threads of the test run may take or give a few


class Sender(QtCore.QObject):
    fired = QtCore.Signal()


def test_emitting_a_signal_keeps_the_references_of_true() -> None:
    sender = Sender()
    before = sys.getrefcount(True)
    for _ in range(CALLS):
        sender.fired.emit()
    assert abs(sys.getrefcount(True) - before) < TOLERANCE


def test_a_call_that_returns_none_keeps_the_references_of_none() -> None:
    thing = QtCore.QObject()
    before = sys.getrefcount(None)
    for _ in range(CALLS):
        thing.setObjectName("name")
    assert abs(sys.getrefcount(None) - before) < TOLERANCE
