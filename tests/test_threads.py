"""Tests run on one thread each, or those of several workers wait for each other for minutes."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PROBE = """
import sys
def pytest_load_initial_conftests(early_config):
    early_config.early = "numpy" in sys.modules
def pytest_configure(config):
    import os
    print("numpy came first:", config.early, "threads:", os.environ["OMP_NUM_THREADS"])
"""


def test_no_plugin_loads_numpy_before_its_threads_are_limited(tmp_path: Path) -> None:
    (tmp_path / "probe.py").write_text(PROBE)
    environment = {name: value for name, value in os.environ.items() if name != "OMP_NUM_THREADS"}
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "--co", "-q", "-p", "probe", "tests/test_resources.py"],
        cwd=ROOT,
        env=environment | {"PYTHONPATH": os.pathsep.join([str(tmp_path), environment.get("PYTHONPATH", "")])},
        capture_output=True,
        text=True,
        check=False,
    )
    assert "numpy came first: False threads: 1" in done.stdout, done.stdout + done.stderr
