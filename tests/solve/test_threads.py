"""Blocks of single-threaded kernels restore the number of threads, however they overlap."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator

import pytest
import torch

from dsl_core.solve.threads import one_kernel_thread, share_no_small_matrices

BEFORE = 3


@pytest.fixture(autouse=True)
def several_threads() -> Iterator[None]:
    """Torch with a number of threads that no block sets."""
    own = torch.get_num_threads()
    torch.set_num_threads(BEFORE)
    yield
    torch.set_num_threads(own)


def in_new_thread(ask: Callable[[], int]) -> int:
    found: list[int] = []
    thread = threading.Thread(target=lambda: found.append(ask()))
    thread.start()
    thread.join(10)
    return found[0]


def test_nested_blocks_stay_single_until_the_outermost_ends() -> None:
    with one_kernel_thread():
        with one_kernel_thread():
            assert torch.get_num_threads() == 1
        assert torch.get_num_threads() == 1
        assert in_new_thread(torch.get_num_threads) == 1
    assert torch.get_num_threads() == BEFORE
    assert in_new_thread(torch.get_num_threads) == BEFORE


def test_an_error_ends_a_block_too() -> None:
    with pytest.raises(ValueError, match="inside"), one_kernel_thread():
        raise ValueError("inside")
    assert torch.get_num_threads() == BEFORE


class Worker(threading.Thread):
    """A thread in a block that begins and ends when it is told, and what it sees then and afterwards."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.begun, self.leave, self.left = threading.Event(), threading.Event(), threading.Event()
        self.ask = threading.Event()
        self.inside = self.after = 0

    def run(self) -> None:
        """Enter, wait, leave, wait, look."""
        with one_kernel_thread():
            self.inside = torch.get_num_threads()
            self.begun.set()
            self.leave.wait(10)
        self.left.set()
        self.ask.wait(10)
        self.after = torch.get_num_threads()

    def begin(self) -> None:
        """Return when the thread is in its block."""
        self.start()
        self.begun.wait(10)

    def end(self) -> None:
        """Return when the thread has left its block."""
        self.leave.set()
        self.left.wait(10)

    def look(self) -> int:
        """How many threads kernels use in this one now."""
        self.ask.set()
        self.join(10)
        return self.after


@pytest.mark.parametrize("first_in_first_out", [True, False])
def test_overlapping_blocks_leave_what_was_there_before(first_in_first_out: bool) -> None:
    one, two = Worker(), Worker()
    one.begin()
    two.begin()
    assert one.inside == two.inside == 1
    first, last = (one, two) if first_in_first_out else (two, one)
    first.end()
    # A block is still open: threads that its work starts now have one kernel thread each.
    assert in_new_thread(torch.get_num_threads) == 1
    last.end()
    assert in_new_thread(torch.get_num_threads) == BEFORE
    assert one.look() == two.look() == BEFORE


@pytest.mark.parametrize("start", ["dsl_core.cli", "dsl_app.__main__"])
def test_what_a_program_starts_with_loads_no_numpy_before_its_threads_are_limited(start: str) -> None:
    code = (
        f"import os, sys; import {start}; from dsl_core.solve.threads import share_no_small_matrices;"
        "assert 'numpy' not in sys.modules; share_no_small_matrices();"
        "assert os.environ['OPENBLAS_NUM_THREADS'] == '1'"
    )
    environment = {k: v for k, v in os.environ.items() if k != "OPENBLAS_NUM_THREADS"}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, check=False)
    assert done.returncode == 0, done.stderr


def test_a_number_of_threads_that_the_user_set_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "3")
    share_no_small_matrices()
    assert os.environ["OPENBLAS_NUM_THREADS"] == "3"
