"""How many threads a kernel uses."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager

_lock = threading.Lock()
#: How deep each thread is in such blocks; how many threads are; and what torch had before the first came.
_own, _threads, _before = threading.local(), 0, 1


def share_no_small_matrices() -> None:
    """Let numpy and scipy do their linear algebra on the thread that asks; before either is imported.

    Matrices here are small, and threads that wait for a share of one keep the cores from working ones: two
    and a half times the processor time of a scan on a busy machine. A number that the user has set stays.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def share_cores(threads: int) -> None:
    """Let the kernels of this process use so many threads; before torch or numba are imported.

    For one of several processes that share the cores. A number that the user has set stays.
    """
    share_no_small_matrices()
    for name in ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
        os.environ.setdefault(name, str(threads))


@contextmanager
def one_kernel_thread() -> Iterator[None]:
    """Run each torch kernel of a block on the thread that calls it.

    Kernels of a millisecond lose more by meeting at barriers than they gain by sharing: a little on a quiet
    machine, a factor of ten and more on a busy one, where waiting threads keep the cores from working ones.
    Blocks may be nested, and may overlap in several threads: the last to end restores what was there before
    the first began.
    """
    _enter()
    try:
        yield
    finally:
        _leave()


def _enter() -> None:
    global _threads, _before
    import torch

    with _lock:
        _own.depth = getattr(_own, "depth", 0) + 1
        if _own.depth > 1:
            return
        if _threads == 0:
            _before = torch.get_num_threads()
        _threads += 1
        torch.set_num_threads(1)


def _leave() -> None:
    global _threads
    import torch

    with _lock:
        _own.depth -= 1
        if _own.depth > 0:
            return
        _threads -= 1
        # Torch keeps a number for each thread that has called it, and one for threads still to come.
        torch.set_num_threads(_before)
        if _threads > 0:
            later = threading.Thread(target=torch.set_num_threads, args=(1,))
            later.start()
            later.join()
