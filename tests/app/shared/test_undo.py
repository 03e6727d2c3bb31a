from __future__ import annotations

from dsl_app.shared.undo import Change, UndoStack


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


def test_changes_of_one_owner_are_forgotten_and_those_of_others_stay() -> None:
    stack, done, result = UndoStack(), list[str](), object()
    for text, owner in (("position", None), ("pin", result), ("plan", None), ("region", result)):
        stack.push(Change(text, lambda text=text: done.append(text), done.pop, owner=owner))  # type: ignore[misc]
    stack.undo()
    stack.forget(result)
    assert (stack.undo_text, stack.redo_text) == ("plan", "")
    stack.undo()
    assert stack.undo_text == "position"
