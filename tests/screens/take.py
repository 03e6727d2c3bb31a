"""Takes the pictures of one look: ``python -m tests.screens.take LOOK OUT MATERIAL [SCENE...]``."""

from __future__ import annotations

import os
import sys
import tempfile
import time
import traceback
from pathlib import Path

from dsl_app.shell.application import make_application

from tests.screens.look import Look
from tests.screens.material import Material
from tests.screens.scenes import SCENES
from tests.screens.stage import Stage


def main(name: str, out: str, material: str, *only: str) -> int:
    """Take the pictures; returns how many scenes went wrong."""
    look = Look.of(name)
    folder = Path(out) / look.name
    folder.mkdir(parents=True, exist_ok=True)
    make_application([])
    wrong = 0
    for scene, play in SCENES.items():
        if only and not scene.startswith(only):
            continue
        started = time.monotonic()
        with tempfile.TemporaryDirectory(prefix="dsl-scan-") as home:
            os.environ["HOME"] = home
            stage = Stage(scene, Path(home), folder, Material(Path(material)), look)
            try:
                play(stage)
            except Exception:
                # The other scenes are needed all the same.
                traceback.print_exc()
                wrong += 1
            finally:
                stage.close()
        print(f"  {scene}: {time.monotonic() - started:.1f} s", flush=True)
    sys.stdout.flush()
    return wrong


if __name__ == "__main__":
    raise SystemExit(main(*sys.argv[1:]))
