"""Memory that was freed is used again, and goes back to the system when it is asked to."""

from __future__ import annotations

import subprocess
import sys

import psutil
import pytest

from dsl_core.solve.heap import trim_memory

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="other systems have other heaps")

#: Makes arrays of 40 MB one after another and prints how many pages the system had to bring for the last ten.
ARRAYS = """
import resource
from dsl_core.solve.heap import keep_freed_memory
keep_freed_memory()
for number in range(12):
    if number == 2:
        before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    array = b"x" * 40_000_000
    del array
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


def test_arrays_use_the_pages_of_those_before() -> None:
    done = subprocess.run([sys.executable, "-c", ARRAYS], capture_output=True, text=True, check=True)
    # Even in pages of 2 MB, ten arrays are two hundred.
    assert int(done.stdout) < 100


def test_freed_memory_goes_back_to_the_system() -> None:
    process = psutil.Process()
    blocks = [bytearray(20_000) for _ in range(5_000)]
    last = bytearray(20_000)
    full = process.memory_info().rss
    del blocks
    trim_memory()
    assert len(last) == 20_000
    assert full - process.memory_info().rss > 60e6
