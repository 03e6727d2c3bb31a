"""Rig profiles on the command line: what there is to name, and what is wrong with a rig."""

from __future__ import annotations

import json
from pathlib import Path

from .conftest import Give


def test_drivers_are_listed_with_their_settings(give: Give) -> None:
    found = {
        f"{each['kind']} {each['name']}": each for each in give("rigs", "drivers", "--json").json["drivers"]
    }
    assert {"camera aravis", "camera uvc", "projector screen", "stage thorlabs-lts"} <= set(found)
    assert "gain_db" in found["camera aravis"]["settings"]["properties"]
    assert "apt install" in found["camera aravis"]["needs"]
    assert "webcams, for trials only" in give("rigs", "drivers").out


def test_the_doctor_tells_all_that_is_wrong_and_a_scan_the_first(give: Give, tmp_path: Path) -> None:
    path = tmp_path / "lab.json"
    profile = {
        "name": "lab",
        "camera": {"driver": "absent"},
        "projector": {"driver": "none", "settings": {"size_px": [64, 48]}},
        "stage": {"driver": "none"},
    }
    path.write_text(json.dumps(profile))
    ending = give("rigs", "doctor", path, "--json")
    assert (ending.code, ending.json["broken"]) == (2, 2)
    worst = {each["device"]: each["grade"] for each in ending.json["findings"]}
    assert worst == {"camera absent": "bad", "projector none": "good", "stage none": "bad"}
    assert "2 of 3 findings prevent a scan" in give("rigs", "doctor", path).out
    assert "no driver 'absent' for a camera" in give("scan", tmp_path / "a.dsl", "--rig", path).sentence


def test_a_profile_that_is_not_there_is_said_in_a_sentence(give: Give, tmp_path: Path) -> None:
    assert "cannot be read" in give("rigs", "doctor", tmp_path / "lost.json").sentence
    assert "There is no rig profile 'lost'" in give("rigs", "doctor", "lost").sentence
    assert "names end in .json" in give("rigs", "doctor", tmp_path).sentence
    assert "selftest --rig twin" in give("rigs", "doctor", "twin").sentence
