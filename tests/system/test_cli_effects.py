"""``dsl-scan effects`` and ``--effects``: the table, and what a scan notes of it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from dsl_core.cli import main
from dsl_core.io.scan.manifest import read_manifest

SMALL = ["-O", "size=64x42"]


def test_effects_says_what_a_scene_needs(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["effects", "--scene", "wax", *SMALL, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    on = {effect["name"]: effect["on"] for effect in found["effects"]}
    assert on["subsurface"]
    assert not on["led-cycle"]
    assert found["left_out_bound"] < 1
    assert found["frames"] == 748, "as 'plan' and 'scan' without a choice: with shots that are repeated"
    assert main(["effects", "--scene", "plane", *SMALL]) == 0
    text = capsys.readouterr().out
    assert "No surface in view faces another." in text
    assert "with all effects" in text


@pytest.mark.parametrize("scene", [["plane", "-O", "reflectance=0"], ["filters", "-O", "background=0"]])
def test_black_materials_have_effects_too(scene: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["effects", "--scene", *scene, *SMALL, "--json"]) == 0
    found = {each["name"]: each for each in json.loads(capsys.readouterr().out)["effects"]}
    assert (found["film-bend"]["bound_dn"] > 0) == (scene[0] == "filters")


def test_leds_are_judged_by_the_exposures_of_a_scan(capsys: pytest.CaptureFixture[str]) -> None:
    """A scan exposes for whole cycles of the LEDs, so their flashing changes nothing."""
    assert main(["effects", "--scene", "plane", *SMALL, "-O", "led_cycle_hz=50", "--json"]) == 0
    found = {each["name"]: each for each in json.loads(capsys.readouterr().out)["effects"]}
    assert not found["led-cycle"]["on"]


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["effects", "--effects", "sparkle"], "no effect 'sparkle'"),
        (["effects", "--tolerance", "much"], "0.5DN"),
        (["effects", "--scene", "plane", "-O", "scene=box"], "not both"),
        (["scan", "s.dsl", "--effects", "all", "-O", "effects=none"], "not both"),
    ],
)
def test_wrong_choices_are_told(arguments: list[str], told: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*arguments, *SMALL]) == 2
    assert told in capsys.readouterr().err


@pytest.mark.slow
def test_a_scan_notes_its_effects(tmp_path: Path) -> None:
    target = tmp_path / "s.dsl"
    plan = ["--code", "columns", "--comb", "20x20x320", "--setting", "100@0.5"]
    chosen = ["--effects", "auto", "--tolerance", "2DN", "-O", "scene=plane"]
    assert main(["scan", str(target), *plan, *chosen, *SMALL]) == 0
    notes = read_manifest(target).notes
    assert json.loads(str(notes["effects"]))["tolerance"] == "2 DN"
    assert json.loads(str(notes["scanned_with_options"]))["effects"] == "auto"
