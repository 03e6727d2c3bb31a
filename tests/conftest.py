"""Settings of every test run: no window, no screen, one thread for small arrays."""

import gc
import os
import signal

import pytest

from dsl_core.solve.heap import keep_freed_memory
from tests.cases.memory import do_not_wait_for_the_disk, keep_temporary_folders_in_memory

os.environ.setdefault("QT_API", "pyside6")
os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
os.environ.setdefault("MPLBACKEND", "Agg")
# Threads that wait for each other on a busy machine make the twin's small images seven times slower.
os.environ.setdefault("OMP_NUM_THREADS", "1")
# A run in the background of a script ignores Ctrl-C, and so would every program that the tests interrupt.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# Collecting all the objects of torch, numba and a thousand tests takes a tenth of a run's time, for nothing.
gc.set_threshold(50_000, 20, 50)

keep_freed_memory()
do_not_wait_for_the_disk()
keep_temporary_folders_in_memory()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the tests of the calibrated campaign: one process makes it, and no other has to wait for it.

    Processes share the tests in their order, and take over from the end of each other's.
    """
    items.sort(key=lambda item: "calibrated" not in getattr(item, "fixturenames", ()))
