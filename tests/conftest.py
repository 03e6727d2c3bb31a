"""Settings of every test run: no window, no screen, one thread for small arrays."""

import os
import signal

os.environ.setdefault("QT_API", "pyside6")
os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
os.environ.setdefault("MPLBACKEND", "Agg")
# Threads that wait for each other on a busy machine make the twin's small images seven times slower.
os.environ.setdefault("OMP_NUM_THREADS", "1")
# A run in the background of a script ignores Ctrl-C, and so would every program that the tests interrupt.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


def _written(fd: object) -> None:
    """No test pulls the plug, and waiting for the disk would take a tenth of the suite's time.

    The tests that need `os.fsync` to be called or to fail put their own in its place.
    """


os.fsync = _written
