"""Values that tell listeners when they change; plain Python, so that controllers need no window."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Generic, TypeVar

T = TypeVar("T")


class Event(Generic[T]):
    """Calls every listener with what happened, in the order in which they connected."""

    def __init__(self) -> None:
        self._listeners: list[Callable[[T], object]] = []

    def connect(self, listener: Callable[[T], object]) -> Callable[[], None]:
        """Listen from now on; the returned function stops it, and may be called twice."""
        self._listeners.append(listener)

        def disconnect() -> None:
            if listener in self._listeners:
                self._listeners.remove(listener)

        return disconnect

    def once(self, listener: Callable[[T], object], if_: Callable[[T], bool]) -> None:
        """Call a listener for the first event from now on that meets a condition."""

        def judge(value: T) -> None:
            if if_(value):
                stop()
                listener(value)

        stop = self.connect(judge)

    def emit(self, value: T) -> None:
        """Call all current listeners; one that disconnects meanwhile is still called."""
        for listener in tuple(self._listeners):
            listener(value)


_COMPARED = (str, int, float, bool, tuple, frozenset)


class Value(Generic[T]):
    """A value with an event; setting an equal value calls no listener."""

    def __init__(self, value: T) -> None:
        self._value = value
        self.changed: Event[T] = Event()

    @property
    def value(self) -> T:
        """The current value."""
        return self._value

    def set(self, value: T) -> None:
        """Change the value and call the listeners."""
        if value is self._value:
            return
        # Arrays and data sets have no single result of ``==``: setting or replacing one calls the listeners.
        if isinstance(value, _COMPARED) and isinstance(self._value, _COMPARED) and value == self._value:
            return
        self._value = value
        self.changed.emit(value)

    def follow(self, listener: Callable[[T], object]) -> Callable[[], None]:
        """Call a listener now and at every change; the returned function stops it."""
        listener(self._value)
        return self.changed.connect(listener)


def follow_any(act: Callable[[], object], *values: Value[Any]) -> list[Callable[[], None]]:
    """Call ``act`` now and whenever one of the values changes; the returned functions stop it."""
    act()
    return [value.changed.connect(lambda _: act()) for value in values]
