"""Pictures of every page, wizard step and dialog: ``python -m tests.screens OUT``.

Each scene of the table opens the application again, brings it into a state as a person would, and takes
pictures of the whole screen. What scenes open (a calibrated campaign, results, a library) is made once, in a
folder that the next call finds again. ``OUT/index.html`` shows all pictures.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from tests.app.support.virtual_display import is_missing, virtual_display
from tests.screens.gallery import write_gallery
from tests.screens.look import SIZES, THEMES, Look, parse_size
from tests.screens.material import make_material

ROOT = Path(__file__).resolve().parents[2]


def main() -> int:
    """Take the pictures; returns how many looks went wrong."""
    wanted = _parser().parse_args()
    if is_missing():
        print("Xvfb is not installed; the pictures need a virtual display.", file=sys.stderr)
        return 2
    make_material(wanted.material)
    sizes = [wanted.size] if wanted.size else SIZES
    themes = [wanted.theme] if wanted.theme else THEMES
    wrong = 0
    for look in (Look(width, height, theme) for width, height in sizes for theme in themes):
        started = time.monotonic()
        wrong += _take(look, wanted.out, wanted.material, wanted.only)
        print(f"{look.name}: {time.monotonic() - started:.0f} s", flush=True)
    print(write_gallery(wanted.out))
    return wrong


def _take(look: Look, out: Path, material: Path, only: list[str]) -> bool:
    """Take the pictures of a look in a process of its own; whether something went wrong."""
    with virtual_display(look.width, look.height) as display:
        command = [sys.executable, "-m", "tests.screens.take", look.name, str(out), str(material), *only]
        environment = {
            **os.environ,
            "DISPLAY": display,
            "QT_QPA_PLATFORM": "xcb",
            "QT_API": "pyside6",
            "PYTHONPATH": os.pathsep.join(map(str, (ROOT, ROOT / "app"))),
        }
        return subprocess.run(command, env=environment, cwd=ROOT).returncode != 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m tests.screens", description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path, help="folder of the pictures")
    parser.add_argument("--only", action="append", default=[], metavar="NAME", help="scenes that begin so")
    parser.add_argument("--size", type=parse_size, metavar="WxH", help="one size instead of both")
    parser.add_argument("--theme", choices=THEMES, help="one theme instead of both")
    parser.add_argument(
        "--material",
        type=Path,
        default=Path(tempfile.gettempdir()) / "dsl-scan-screens",
        help="folder of what scenes open; remove it to have it made again",
    )
    return parser


if __name__ == "__main__":
    raise SystemExit(main())
