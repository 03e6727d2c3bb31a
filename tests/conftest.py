"""Settings of every test run: no window, no screen, one thread for small arrays."""

import os

os.environ.setdefault("QT_API", "pyside6")
os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
os.environ.setdefault("MPLBACKEND", "Agg")
# Threads that wait for each other on a busy machine make the twin's small images seven times slower.
os.environ.setdefault("OMP_NUM_THREADS", "1")
