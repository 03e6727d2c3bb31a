"""Renders a cloud in its own thread, so that slow pictures do not block the window. No Qt."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from queue import Empty, SimpleQueue

from dsl_app.results.cloud.look import Grid, Look, Points
from dsl_app.results.cloud.render_window import Colours, MouseButton, Place, Rendering, RenderWindow

_log = logging.getLogger(__name__)
#: Time after the last move until the whole cloud is drawn again, s.
SETTLE_S = 0.25

Act = Callable[[], object]
Change = Callable[[RenderWindow], object]


class CloudRenderer:
    """Handles requests in its thread, in order, and draws once none is waiting.

    The cloud is coarse while it is rotated and while marks move; at rest it grows until pictures get slow.
    ``drawn`` is called in the thread when there is a picture to `take` and the previous one was taken, and
    when drawing has failed, which `trouble` says.
    """

    def __init__(self, drawn: Act) -> None:
        self._drawn = drawn
        self._waiting: SimpleQueue[Act] = SimpleQueue()
        self._requested = self._done = 0
        self._lock = threading.Lock()
        self._picture: Rendering | None = None
        self._picture_s = 0.0
        #: When to draw the whole cloud again, by the monotonic clock; None if it is whole or being rotated.
        self._rest_at: float | None = None
        self._is_held, self._is_grown, self._is_over = False, True, False
        #: Whether the next picture uploads new points, so its duration says nothing about later ones.
        self._is_fresh = False
        #: Number of points drawn at rest.
        self.shown = 0
        #: Why nothing is drawn any more, empty while it is.
        self.trouble = ""
        self._window: RenderWindow
        self._thread = threading.Thread(target=self._run, name="3d-view", daemon=True)
        self._thread.start()

    # Requests of the window -------------------------------------------------------------------------

    @property
    def is_at_rest(self) -> bool:
        """Whether all requests are drawn, with as many points as this computer draws in time."""
        return self._done == self._requested and self._timeout_s() is None

    def take(self) -> Rendering | None:
        """The latest picture, once."""
        with self._lock:
            picture, self._picture = self._picture, None
        return picture

    def show(
        self, points: Points, colours: Colours, reset_view: bool = True, grid: Grid | None = None
    ) -> None:
        """Show a cloud; points other than before reset the view, or keep it."""

        def act() -> None:
            self._window.show(points, colours, reset_view, grid)
            self._is_fresh, self._is_grown = True, False

        self._request(act)

    def take_look(self, look: Look) -> None:
        """Draw something else of the cloud."""

        def act() -> None:
            self._window.take_look(look)
            self._is_fresh, self._is_grown = True, False

        self._request(act)

    def call(self, change: Change, moves: bool = False) -> None:
        """Change the render window in its thread, and draw; a cloud that ``moves`` is coarse for a while."""

        def act() -> None:
            change(self._window)
            if moves:
                self._be_coarse()

        self._request(act)

    def press(self, button: MouseButton, at: Place, shift: bool, control: bool) -> None:
        """Press a mouse button; the cloud is coarse until it is released."""

        def hold(window: RenderWindow) -> None:
            window.press(button, at, shift, control)
            self._is_held = True

        self.call(hold, moves=True)

    def release(self, button: MouseButton, at: Place) -> None:
        """Release a mouse button."""

        def act() -> None:
            self._window.release(button, at)
            self._is_held = False
            self._rest()

        self._request(act)

    def close(self) -> None:
        """End the thread after the current picture, and wait for it."""
        self._request(self._end)
        self._thread.join()

    def _request(self, act: Act) -> None:
        self._requested += 1
        self._waiting.put(act)

    # In the thread ---------------------------------------------------------------------------------

    def _run(self) -> None:
        try:
            self._work()
        except Exception as error:  # of a graphics driver: said in the window, never lost in a thread
            _log.exception("the 3D view cannot draw")
            self.trouble = str(error) or type(error).__name__
            with suppress(RuntimeError):
                self._drawn()

    def _work(self) -> None:
        self._window = RenderWindow()
        while not self._is_over:
            acts = self._wait()
            for act in acts:
                act()
            if not acts:
                self._refine()
            if not self._is_over:
                self._draw()
            self._done += len(acts)

    def _end(self) -> None:
        self._is_over = True
        self._window.close()

    def _wait(self) -> list[Act]:
        """All requests that wait; none when it is time to draw more unrequested."""
        acts = []
        try:
            acts.append(self._waiting.get(timeout=self._timeout_s()))
            while True:
                acts.append(self._waiting.get_nowait())
        except Empty:
            return acts

    def _timeout_s(self) -> float | None:
        if self._rest_at is not None:
            return max(self._rest_at - time.monotonic(), 0.0)
        return None if self._is_grown or self._is_held else 0.0

    def _refine(self) -> None:
        if self._rest_at is not None:
            self._rest()
        elif self._is_fresh:
            self._is_fresh = False
        else:
            self._is_fresh = self._window.grow(self._picture_s)
            self._is_grown = not self._is_fresh

    def _draw(self) -> None:
        begun = time.perf_counter()
        picture = self._window.draw()
        self._picture_s, self.shown = time.perf_counter() - begun, self._window.shown
        with self._lock:
            is_taken, self._picture = self._picture is None, picture
        if is_taken:
            # The widget may be deleted by now.
            with suppress(RuntimeError):
                self._drawn()

    def _be_coarse(self) -> None:
        """Show a part of the cloud until nothing has moved for a while, and while a button is held."""
        self._window.be_coarse(True)
        self._rest_at = None if self._is_held else time.monotonic() + SETTLE_S

    def _rest(self) -> None:
        self._rest_at = None
        self._window.be_coarse(False)
