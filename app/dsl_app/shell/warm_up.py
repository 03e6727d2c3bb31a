"""Imports and compiles what the window soon needs, in a thread, so that no click waits for it. No Qt here."""

from __future__ import annotations

import ctypes
import gc
import importlib
import importlib.util
import logging
import os
import sys
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from itertools import chain
from pathlib import Path

from dsl_app.shared.paths import is_file

_log = logging.getLogger(__name__)
#: What every page needs.
_SHARED = ("dsl_app.connection.controller", "dsl_app.rig.projector_screens", "dsl_app.session.restore")
#: What each page is made of.
PAGE_MODULES = {
    "start": (*_SHARED, "dsl_app.start.page"),
    "rig": (*_SHARED, "dsl_core.devices.registry", "dsl_app.rig.page"),
    "scan": (
        *_SHARED,
        "dsl_app.scan.controller",
        "dsl_app.scan.forecast.controller",
        "dsl_app.scan.effects.controller",
        "dsl_app.scan.page",
    ),
    "results": (*_SHARED, "dsl_app.results.controller", "dsl_app.results.page"),
    "calibrate": (*_SHARED, "dsl_app.calibrate.controller", "dsl_app.calibrate.page"),
    "compare": (
        *_SHARED,
        "dsl_app.compare.pair.controller",
        "dsl_app.compare.series.controller",
        "dsl_app.compare.page",
    ),
}
#: What a first look at a result needs, which takes least time.
_LOOK = (*PAGE_MODULES["results"], "zarr", "dsl_core.io.result.stored_arrays")
#: What the first comparison of colours needs, which a person does soon; it would block the window then.
_COMPARE = ("dsl_core.optics.colour", "scipy.interpolate")
#: What connecting a rig needs.
_FIRST = (
    "scipy.linalg",
    "scipy.ndimage",
    "scipy.optimize",
    "cv2",
    "torch",
    "dsl_core.simulation.sim_devices",
    "dsl_core.simulation.rendering.kernels",
    "dsl_core.pipeline",
    "dsl_core.simulation.rehearsal:rehearse",
)
#: Calibrations, results and the 3D view.
_LAST = (
    "pandas",
    "xarray",
    "dsl_app.calibrate.wizard.window",
    "dsl_core.workflows.scans",
    "dsl_core.campaign.recipes",
    "dsl_app.calibrate.evidence.selftest",
    "dsl_app.calibrate.evidence.geometry",
    "dsl_app.calibrate.evidence.spectralon",
    "dsl_app.calibrate.evidence.color_checker",
    "dsl_app.calibrate.evidence.bandpass",
    "dsl_app.calibrate.evidence.depth_stage",
    "matplotlib.figure",
    "pyvista",
    "pyvista.plotting",
    "vtkmodules.vtkInteractionWidgets",
    "vtkmodules.vtkViewsContext2D",
    "vtkmodules.vtkInteractionStyle",
)
#: What a first reconstruction on a computer would wait for; kept on the disk from then on.
_COMPILED = ("dsl_core.reconstruction.spectral.solving.lane_solver:compile_early",)
STEPS = tuple(
    dict.fromkeys(
        (*_LOOK, *_COMPARE, *_FIRST, *chain.from_iterable(PAGE_MODULES.values()), *_LAST, *_COMPILED)
    )
)
#: Pause between two steps, s, and how long all of them may be kept waiting by what a person waits for.
REST_S, PATIENCE_S = 0.05, 20.0
#: When a step that has not ended is asked again to, s.
AGAIN_S = 0.5
#: Large libraries of some packages: while the system loads them, Python's lock is free.
_BULK = {"torch": "lib/libtorch_cpu.so", "cv2": "cv2.abi3.so"}


class WarmUp:
    """Runs the steps once; `stop` ends after the current step. A step is a module, or ``module:function``.

    No step begins while ``gives_way``, called in the thread, says that a person waits for something else:
    imports keep Python's lock, which would double the time to the first picture of a live view.
    """

    def __init__(self, steps: Sequence[str] = STEPS, gives_way: Callable[[], bool] = lambda: False) -> None:
        self._steps, self._gives_way = steps, gives_way
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="warm-up")

    @property
    def is_over(self) -> bool:
        """Whether it has ended."""
        return self._thread.ident is not None and not self._thread.is_alive()

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def stop(self) -> None:
        """End, within the current step where that is in Python, and wait for it: the program ends next.

        Compiling takes ten seconds, most of them in Python; the process would linger without a window.
        """
        self._stop.set()
        interrupt = ctypes.pythonapi.PyThreadState_SetAsyncExc
        while self._thread.ident is not None and self._thread.is_alive():
            interrupt(ctypes.c_ulong(self._thread.ident), ctypes.py_object(SystemExit))
            # Compilers call back into Python, where an exception is lost.
            self._thread.join(AGAIN_S)

    def _run(self) -> None:
        with suppress(SystemExit):  # of `stop`
            self._take_steps()

    def _take_steps(self) -> None:
        given_way_s = 0.0
        for name in self._steps:
            if self._stop.wait(REST_S):
                return
            while given_way_s < PATIENCE_S and self._gives_way():
                given_way_s += REST_S
                if self._stop.wait(REST_S):
                    return
            try:
                _do(name)
            except Exception as error:  # the module that needs it fails with a message
                _log.debug("%s could not be done early: %s", name, error)


def _do(step: str) -> None:
    name, _, function = step.partition(":")
    _import(name)
    if function:
        getattr(sys.modules[name], function)()


def import_early(names: Sequence[str]) -> None:
    """Import modules, in a thread, before they are needed."""
    for name in names:
        _import(name)


def _import(name: str) -> None:
    if name in sys.modules:
        return
    # Objects of modules are permanent. Collecting garbage among all of them, again and again, would hold
    # Python's lock longer than anything else here.
    was_on = gc.isenabled()
    gc.disable()
    try:
        _load_bulk(name)
        importlib.import_module(name)
        gc.freeze()
    finally:
        if was_on:
            gc.enable()


def _load_bulk(name: str) -> None:
    found = importlib.util.find_spec(name) if name in _BULK and sys.platform == "linux" else None
    if found is None or found.origin is None:
        return
    load = ctypes.CDLL(None).dlopen  # unlike ctypes.CDLL(path), a function that is called frees the lock
    load.restype = ctypes.c_void_p
    path = Path(found.origin).parent / _BULK[name]
    if is_file(path):
        load(str(path).encode(), os.RTLD_NOW | os.RTLD_GLOBAL)
