"""The commands of a dialog are those that do the same in a terminal."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from dsl_app.importing.captures.command_line import command_of
from dsl_app.importing.captures.fields import first_mapping
from dsl_app.importing.captures.state import CaptureRequest, Stated

MAPPING = first_mapping(12, (32, 24))


def test_the_command_does_the_same() -> None:
    request = CaptureRequest(Path("in"), Path("out.dsl"), (32, 24), "cam 1")
    guessed = Stated(MAPPING, is_guessed=True)
    assert (
        command_of(request, guessed)
        == "dsl-scan import in --guess --projector 32x24 --set 'cam 1' -o out.dsl"
    )
    saved = Stated(MAPPING, file=Path("m.json"))
    assert command_of(request, saved) == "dsl-scan import in --mapping m.json -o out.dsl"
    assert command_of(request, Stated(MAPPING)).startswith("# Save the mapping first")
    stereo = replace(request, calibration="s.yml", unit_mm=1000, from_projector=True)
    lines = command_of(stereo, saved, (64, 48)).splitlines()
    assert lines[1:] == [
        "dsl-scan import s.yml --camera-size 64x48 --projector 32x24 --unit-mm 1000 --from-projector"
        " -o out-rig.json",
        "dsl-scan reconstruct out.dsl --calibration out-rig.json",
    ]
    curves = replace(stereo, camera_curves=Path("c.csv"), led_curves=Path("my leds.csv"))
    assert " --camera-curves c.csv --led-curves 'my leds.csv' -o" in command_of(curves, saved, (64, 48))
    assert command_of(CaptureRequest(None, Path("out.dsl")), None) == ""
