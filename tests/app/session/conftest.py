from __future__ import annotations

import subprocess
import sys

import pytest


@pytest.fixture
def gone() -> int:
    """The number of a process that ended."""
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    return ended.pid
