from __future__ import annotations

import pytest
from dsl_app.shared.notify import describe_seconds, sentence_of

from dsl_core.errors import DeviceError


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.4, "0 s"),
        (89.4, "89 s"),
        (90, "2 min"),
        (5369, "89 min"),
        (5400, "1 h 30 min"),
        (7261, "2 h 1 min"),
    ],
)
def test_durations_are_said_as_people_say_them(seconds: float, text: str) -> None:
    assert describe_seconds(seconds) == text


def test_only_unexpected_errors_are_named_by_their_class() -> None:
    assert sentence_of(DeviceError("Check its cable.")) == "Check its cable."
    assert sentence_of(OSError("no room")) == "OSError: no room"
