from __future__ import annotations

import numpy as np
from dsl_app.shared.evented import Event, Value, follow_any
from dsl_app.shared.undo import Change, UndoStack


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


def test_undo_and_redo_in_turn() -> None:
    stack, pins = UndoStack(), [0]
    for pin in (1, 2):
        stack.push(Change(f"pin {pin}", lambda pin=pin: pins.append(pin), pins.pop))  # type: ignore[misc]
    stack.undo()
    assert (pins, stack.undo_text, stack.redo_text) == ([0, 1], "pin 1", "pin 2")
    stack.redo()
    assert (pins, stack.redo_text) == ([0, 1, 2], "")
    stack.undo()
    stack.push(Change("pin 3", lambda: pins.append(3), pins.pop))
    assert (pins, stack.redo_text) == ([0, 1, 3], "")


def test_nothing_to_undo_is_no_error() -> None:
    stack = UndoStack()
    stack.undo()
    stack.redo()
    assert stack.undo_text == ""


def test_a_change_that_cannot_be_taken_back_now_stays_and_says_why() -> None:
    reasons, pins = ["A scan runs."], [0]
    stack = UndoStack()
    stack.push(Change("pin", lambda: pins.append(1), pins.pop, lambda: reasons[0]))
    assert stack.undo() == "A scan runs."
    assert (pins, stack.undo_text, stack.redo_text) == ([0, 1], "pin", "")
    reasons[0] = ""
    assert stack.undo() == ""
    reasons[0] = "A scan runs."
    assert stack.redo() == "A scan runs."
    assert (pins, stack.undo_text, stack.redo_text) == ([0], "", "pin")
