from __future__ import annotations

import numpy as np
from dsl_app.shared.evented import Event, Value, follow_any


def test_listeners_hear_until_they_stop() -> None:
    event: Event[int] = Event()
    heard: list[int] = []
    stop = event.connect(heard.append)
    event.emit(1)
    stop()
    stop()
    event.emit(2)
    assert heard == [1]


def test_a_value_tells_of_changes_only() -> None:
    value = Value(3)
    heard: list[int] = []
    value.follow(heard.append)
    value.set(3)
    value.set(4)
    assert heard == [3, 4]


def test_any_of_several_values_is_followed() -> None:
    number, text, calls = Value(1), Value(""), list[tuple[int, str]]()
    stops = follow_any(lambda: calls.append((number.value, text.value)), number, text)
    number.set(2)
    text.set("a")
    for stop in stops:
        stop()
    number.set(3)
    assert calls == [(1, ""), (2, ""), (2, "a")]


def test_arrays_are_told_every_time() -> None:
    value = Value(np.zeros(2))
    heard: list[object] = []
    value.changed.connect(heard.append)
    value.set(np.zeros(2))
    assert len(heard) == 1


def test_nothing_can_follow_an_array() -> None:
    value: Value[object] = Value(np.zeros(2))
    for each in (None, np.zeros(3), "text", np.zeros(2), 0):
        value.set(each)
        assert value.value is each
