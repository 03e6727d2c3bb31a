"""Small captures of other programs, made from a scene with known columns."""

from __future__ import annotations

from pathlib import Path

from dsl_app.importing.captures.state import CaptureRequest

from dsl_core.model.captured_code import Stripes
from tests.cases.foreign_captures import frames, write

PROJECTOR, CAMERA = (32, 24), (64, 48)


def make_capture(folder: Path, projector: tuple[int, int] = PROJECTOR) -> Path:
    """White, black and a Gray code of five digits with inverses: 12 pictures."""
    pictures, white, black = frames([("columns", Stripes(bits=5))], projector=projector, camera=CAMERA)
    named = {f"im_{place:02d}.png": each for place, each in enumerate([white, black, *pictures])}
    return write(folder, named)


def request_for(folder: Path, tmp_path: Path) -> CaptureRequest:
    """Import a capture into a temporary folder."""
    return CaptureRequest(folder, tmp_path / "a.dsl", PROJECTOR)
