from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.app.support.two_screens import missing_programs, two_screens

ROOT = Path(__file__).resolve().parents[3]


@pytest.mark.slow
@pytest.mark.skipif(bool(missing_programs()), reason=f"needs {', '.join(missing_programs())}")
@pytest.mark.timeout(900)
def test_a_day_at_the_rig_by_mouse_and_keys(tmp_path: Path) -> None:
    home = tmp_path / "home"
    home.mkdir()
    with two_screens() as display:
        done = subprocess.run(
            [sys.executable, "-m", "tests.app.composition.full_session", str(home)],
            env={
                **os.environ,
                "DISPLAY": display,
                "QT_QPA_PLATFORM": "xcb",
                "HOME": str(tmp_path),
                "DSL_SCAN_HOME": str(home),
                "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "app")]),
            },
            cwd=ROOT,
            capture_output=True,
            text=True,
            timeout=880,
        )
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stderr == ""
    for name in ("geometry", "spectralon", "color-checker", "bandpass", "depth-stage"):
        assert f"calibrated: {name}" in done.stdout
    assert "pulled out: The scan stopped: " in done.stdout
    assert "The projector's screen PROJECTOR was disconnected or mirrored." in done.stdout
    assert "differing pixels: 0" in done.stdout
    assert "pictures on the second screen: 0" not in done.stdout
    assert "exported: ['.csv', '.ply']" in done.stdout
    assert "opened again with: ['pin', 'region', 'reference']" in done.stdout
    assert "warnings: []" in done.stdout
