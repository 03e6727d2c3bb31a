from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.app.support.two_screens import missing_programs, two_screens

ROOT = Path(__file__).resolve().parents[3]


@pytest.mark.skipif(bool(missing_programs()), reason=f"needs {', '.join(missing_programs())}")
@pytest.mark.parametrize("scale", ["1", "1.5"])
def test_pixels_are_exact_and_the_window_survives_unplugging(scale: str) -> None:
    with two_screens() as display:
        done = subprocess.run(
            [sys.executable, "-m", "tests.app.rig.projector_on_screen", display],
            env={
                **os.environ,
                "DISPLAY": display,
                "QT_QPA_PLATFORM": "xcb",
                "QT_SCALE_FACTOR": scale,
                "PYTHONPATH": str(ROOT),
            },
            cwd=ROOT,
            capture_output=True,
            text=True,
            timeout=110,
        )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "differing pixels at 1:1: 0" in done.stdout
    assert "differing pixels at 1:2: 0" in done.stdout
    assert "mirrored: The screen" in done.stdout
    assert "lost: The projector's screen PROJECTOR was disconnected." in done.stdout
