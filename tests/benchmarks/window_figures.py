"""Single figures of the window: to the screen, cursor to spectrum, change of band, frames of a cloud, memory.

Each is given by the clock and as computing time of the window's thread, which a busy machine leaves alone.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import psutil
from dsl_app.results.cloud.views import InteractiveCloud
from dsl_app.results.page import ResultsPage
from PySide6.QtCore import QEvent, QPoint, QPointF, Qt
from PySide6.QtGui import QMouseEvent
from PySide6.QtWidgets import QApplication, QWidget

from tests.screens.stage import Stage

#: Between two moves of a mouse, s.
REST_S = 0.03
#: Between two moves of a mouse, s.
MOUSE_S = 0.008
#: Runs in a process of its own, up to the first picture on the screen, and to that of the first page.
TO_THE_SCREEN = """
import os, time
import dsl_app.__main__
from dsl_app.shell.application import ExceptionHook, make_application
from dsl_app.composition.window import Composition, StartOptions
application = make_application([])
composition = Composition(StartOptions())
window = composition.open_window(in_background=True)
seen = []
note = lambda: seen.append((time.time(), sum(os.times()[:2])))
window.painted.connect(note)
window.show()
while not seen or not window.stack.count():
    application.processEvents()
    time.sleep(0.001)
application.processEvents()
note()
import psutil
begun = psutil.Process().create_time()
for clock, computed in seen:
    print(clock - begun, computed)
window.close()
"""


def start_figures(home: Path, times: int = 3) -> dict[str, tuple[float, float]]:
    """Milliseconds (clock, computing) until the window, and its page, are on the screen; the best."""
    found = []
    for _ in range(times):
        out = subprocess.run(
            [sys.executable, "-c", TO_THE_SCREEN],
            env={**os.environ, "DSL_SCAN_HOME": str(home)},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        found.append([1000 * float(word) for word in out.split()])
    window_s, window_cpu, page_s, page_cpu = (min(column) for column in zip(*found, strict=True))
    return {"window on screen": (window_s, window_cpu), "its first page": (page_s, page_cpu)}


def result_figures(stage: Stage, count: int = 40) -> dict[str, tuple[float, float]]:
    """Milliseconds (clock, computing) of what a mouse does on a result that is open; medians."""
    page = stage.window.open_page("results")
    assert isinstance(page, ResultsPage)
    state, control = page._state, page._control
    assert state.result.value is not None
    rows, columns = state.result.value.shape
    stage.window.do("view_colour")
    stage.settle()
    rng = np.random.default_rng(0)
    spots = [(int(rng.integers(columns)), int(rng.integers(rows // 10, rows))) for _ in range(count)]
    figures = {"cursor to spectrum": _timed([partial(control.point_at, at) for at in spots])}
    stage.window.do("view_band")
    stage.settle()
    last = len(state.result.value.wavelengths_nm)
    figures["change of band"] = _timed([partial(state.band.set, b % last) for b in range(3, 3 + count)])
    return figures


def turn_cloud(stage: Stage, seconds: float = 2.0) -> tuple[float, float, float]:
    """Pictures/s while a cloud is dragged, the longest wait for one, and for the one at rest, ms."""
    page = stage.window.open_page("results")
    assert isinstance(page, ResultsPage)
    stage.window.do("view_cloud")
    stage.idle()
    view = page.cloud.view
    assert isinstance(view, InteractiveCloud), "nothing draws in 3D here"
    stage.wait(lambda: view.renderer.is_at_rest)
    at = view.rect().center()
    _mouse(view, QEvent.Type.MouseButtonPress, at)
    seen, begun = [time.perf_counter()], time.perf_counter()
    shown = view.projection()
    while time.perf_counter() < begun + seconds:
        at += QPoint(3 if len(seen) % 20 < 10 else -3, 1)
        _mouse(view, QEvent.Type.MouseMove, at)
        QApplication.processEvents()
        time.sleep(MOUSE_S)
        if view.projection() is not shown:
            shown = view.projection()
            seen.append(time.perf_counter())
    left = time.perf_counter()
    _mouse(view, QEvent.Type.MouseButtonRelease, at)
    stage.wait(lambda: view.renderer.is_at_rest)
    return len(seen) / seconds, 1000 * float(np.diff(seen).max()), 1000 * (time.perf_counter() - left)


def _mouse(widget: QWidget, kind: QEvent.Type, at: QPoint) -> None:
    left, none = Qt.MouseButton.LeftButton, Qt.MouseButton.NoButton
    changed = none if kind is QEvent.Type.MouseMove else left
    held = none if kind is QEvent.Type.MouseButtonRelease else left
    where = QPointF(at)
    event = QMouseEvent(kind, where, QPointF(widget.mapToGlobal(at)), changed, held, Qt.KeyboardModifier(0))
    QApplication.sendEvent(widget, event)


def memory_of(stage: Stage, path: Path) -> tuple[float, float]:
    """Megabytes that the program grows by when a result is opened, and those of the result itself."""
    page = stage.window.open_page("results")
    assert isinstance(page, ResultsPage)
    state, process = page._state, psutil.Process()
    state.result.set(None)
    stage.settle()
    before = process.memory_info().rss
    stage.window.open_path(path)
    stage.wait(lambda: state.result.value is not None)
    stage.idle()
    stage.settle()
    assert state.result.value is not None
    arrays = state.result.value.arrays.values()
    return (process.memory_info().rss - before) / 1e6, sum(values.nbytes for values in arrays) / 1e6


def _timed(acts: list[Callable[[], object]]) -> tuple[float, float]:
    clocks, computed = [], []
    for act in acts:
        # A hand is slower than the screen, which must not still be busy with the move before.
        time.sleep(REST_S)
        clock, cpu = time.perf_counter(), time.thread_time()
        act()
        QApplication.processEvents()
        clocks.append(1000 * (time.perf_counter() - clock))
        computed.append(1000 * (time.thread_time() - cpu))
    return float(np.median(clocks)), float(np.median(computed))
