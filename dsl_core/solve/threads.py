"""How many threads a kernel uses."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import torch


@contextmanager
def one_kernel_thread() -> Iterator[None]:
    """Run each torch kernel of a block on the thread that calls it.

    Kernels of a millisecond lose more by meeting at barriers than they gain by sharing: a little on a quiet
    machine, a factor of ten and more on a busy one, where waiting threads keep the cores from working ones.
    """
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)
