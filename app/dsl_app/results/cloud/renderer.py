"""Draws a cloud in a thread of its own, so that no picture, however slow, stops the window. No Qt here."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from queue import Empty, SimpleQueue

from dsl_app.results.cloud.points import Points
from dsl_app.results.cloud.render_window import Colours, Easel, MouseButton, Picture, Place

#: How long after the last move the whole cloud comes back, s.
SETTLE_S = 0.25

Act = Callable[[], object]


class Artist:
    """Does what it is asked to in its thread, in order, and draws when nothing more waits.

    The cloud is coarse while it is turned and while marks move; at rest it grows until pictures get slow.
    ``drawn`` is called in that thread when there is a picture to `take` and the one before was taken.
    """

    def __init__(self, drawn: Act) -> None:
        self._drawn = drawn
        self._waiting: SimpleQueue[Act] = SimpleQueue()
        self._asked = self._done = 0
        self._lock = threading.Lock()
        self._picture: Picture | None = None
        self._picture_s = 0.0
        #: When the cloud is to be whole again, on the monotonic clock; None while it is, or is turned.
        self._rest_at: float | None = None
        self._is_held, self._is_grown, self._is_over = False, True, False
        #: Whether the next picture takes in new points, which tells nothing of how long later ones take.
        self._is_fresh = False
        #: How many points of the cloud are drawn at rest.
        self.shown = 0
        self._easel: Easel
        self._thread = threading.Thread(target=self._run, name="3d-view", daemon=True)
        self._thread.start()

    # Asked for by the window -----------------------------------------------------------------------

    @property
    def is_at_rest(self) -> bool:
        """Whether all that was asked for is drawn, with as many points as this machine draws in time."""
        return self._done == self._asked and self._patience_s() is None

    def take(self) -> Picture | None:
        """The latest picture, once."""
        with self._lock:
            picture, self._picture = self._picture, None
        return picture

    def show(self, points: Points, colours: Colours, anew: bool = True) -> None:
        """Show a cloud; other points than before are looked at ``anew``, or from where one is."""
        self._ask(partial(self._show, points, colours, anew))

    def mark(self, name: str, points: Points, colours: Colours, size_px: int, moves: bool = False) -> None:
        """Mark points; the cloud is coarse for a while where the mark ``moves``."""
        self._ask(partial(self._mark, name, points, colours, size_px, moves))

    def set_background(self, colour: str) -> None:
        """The colour behind the cloud."""
        self._ask(lambda: self._easel.set_background(colour))

    def resize(self, width: int, height: int) -> None:
        """The size of pictures, px."""
        self._ask(lambda: self._easel.resize(width, height))

    def press(self, button: MouseButton, at: Place, shift: bool, control: bool) -> None:
        """A button of the mouse goes down."""
        self._ask(partial(self._press, button, at, shift, control))

    def move(self, at: Place, shift: bool, control: bool) -> None:
        """The mouse moves."""
        self._ask(lambda: self._easel.move(at, shift, control))

    def release(self, button: MouseButton, at: Place) -> None:
        """A button of the mouse goes up."""
        self._ask(partial(self._release, button, at))

    def turn(self, right: int, up: int) -> None:
        """Turn the view by so many steps."""
        self._ask(partial(self._step, lambda: self._easel.turn(right, up)))

    def zoom(self, steps: float) -> None:
        """Move nearer by so many steps, or away."""
        self._ask(partial(self._step, lambda: self._easel.zoom(steps)))

    def reset(self) -> None:
        """Look from where the camera stood."""
        self._ask(lambda: self._easel.reset())

    def close(self) -> None:
        """End after the picture at hand, and wait for that."""
        self._ask(self._end)
        self._thread.join()

    def _ask(self, act: Act) -> None:
        self._asked += 1
        self._waiting.put(act)

    # In the thread ---------------------------------------------------------------------------------

    def _run(self) -> None:
        self._easel = Easel()
        while not self._is_over:
            acts = self._wait()
            for act in acts:
                act()
            if not acts:
                self._go_on()
            if not self._is_over:
                self._draw()
            self._done += len(acts)

    def _end(self) -> None:
        self._is_over = True
        self._easel.close()

    def _wait(self) -> list[Act]:
        """All that waits; nothing where it is time to go on unasked."""
        acts = []
        try:
            acts.append(self._waiting.get(timeout=self._patience_s()))
            while True:
                acts.append(self._waiting.get_nowait())
        except Empty:
            return acts

    def _patience_s(self) -> float | None:
        if self._rest_at is not None:
            return max(self._rest_at - time.monotonic(), 0.0)
        return None if self._is_grown or self._is_held else 0.0

    def _go_on(self) -> None:
        if self._rest_at is not None:
            self._rest()
        elif self._is_fresh:
            self._is_fresh = False
        else:
            self._is_fresh = self._easel.cloud.grow(self._picture_s)
            self._is_grown = not self._is_fresh

    def _draw(self) -> None:
        begun = time.perf_counter()
        picture = self._easel.draw()
        self._picture_s, self.shown = time.perf_counter() - begun, self._easel.cloud.shown
        with self._lock:
            is_taken, self._picture = self._picture is None, picture
        if is_taken:
            # Who looked at it may be gone by now.
            with suppress(RuntimeError):
                self._drawn()

    def _show(self, points: Points, colours: Colours, anew: bool) -> None:
        self._easel.show(points, colours, anew)
        self._is_fresh, self._is_grown = True, False

    def _mark(self, name: str, points: Points, colours: Colours, size_px: int, moves: bool) -> None:
        self._easel.cloud.mark(name, points, colours, size_px)
        if moves:
            self._be_coarse()

    def _step(self, act: Act) -> None:
        act()
        self._be_coarse()

    def _press(self, button: MouseButton, at: Place, shift: bool, control: bool) -> None:
        self._easel.press(button, at, shift, control)
        self._is_held = True
        self._be_coarse()

    def _release(self, button: MouseButton, at: Place) -> None:
        self._easel.release(button, at)
        self._is_held = False
        self._rest()

    def _be_coarse(self) -> None:
        """Show a part of the cloud until nothing moves for a while, and as long as a button is held."""
        self._easel.cloud.be_coarse(True)
        self._rest_at = None if self._is_held else time.monotonic() + SETTLE_S

    def _rest(self) -> None:
        self._rest_at = None
        self._easel.cloud.be_coarse(False)
