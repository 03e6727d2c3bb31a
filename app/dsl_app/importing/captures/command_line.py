"""The commands that import captures as the dialog does. No Qt."""

from __future__ import annotations

from dsl_app.importing.captures.state import NOMINAL, NONE, STEREO_SUFFIXES, CaptureRequest, Size, Stated
from dsl_core.words import quoted


def command_of(request: CaptureRequest, stated: Stated | None, camera_px: Size | None = None) -> str:
    """The commands that do the same; a mapping that is in no file yet has to be saved first."""
    if request.folder is None or stated is None:
        return ""
    lines: list[str] = []
    words = ["dsl-scan import", quoted(request.folder)]
    size = _times(stated.mapping.projector_size_px)
    if stated.is_guessed:
        words.append("--guess")
        words += [f"--projector {size}"] if all(request.projector_px) else []
        words += [f"--set {quoted(request.chosen)}"] if request.chosen else []
    else:
        if stated.file is None:
            lines.append("# Save the mapping first, with the button 'Save mapping'.")
        words.append(f"--mapping {quoted(stated.file or f'{request.target.stem}.mapping.json')}")
    lines.append(" ".join([*words, "-o", quoted(request.target)]))
    rig = request.calibration
    if rig == NOMINAL:
        lines.append("# The nominal rig is that of the publication; save it as a rig's file to name it here.")
    elif is_stereo(rig):
        made = request.target.with_name(f"{request.target.stem}-rig.json")
        unit = "" if request.unit_mm == 1 else f" --unit-mm {request.unit_mm:g}"
        sizes = f"--camera-size {_times(camera_px or (0, 0))} --projector {size}"
        way = " --from-projector" if request.from_projector else ""
        for option, path in (("camera", request.camera_curves), ("led", request.led_curves)):
            way += "" if path is None else f" --{option}-curves {quoted(path)}"
        lines.append(f"dsl-scan import {quoted(rig)} {sizes}{unit}{way} -o {quoted(made)}")
        rig = str(made)
    if rig not in (NONE, NOMINAL):
        lines.append(f"dsl-scan reconstruct {quoted(request.target)} --calibration {quoted(rig)}")
    return "\n".join(lines)


def is_stereo(calibration: str) -> bool:
    """Whether a calibration is by its ending a file of another program; JSON may be that or a rig of ours."""
    return calibration.lower().endswith(STEREO_SUFFIXES[:-1])


def _times(size: Size) -> str:
    return f"{size[0]}x{size[1]}"
