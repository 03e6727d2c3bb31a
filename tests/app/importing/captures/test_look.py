"""What workers find out about real files."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from dsl_app.importing.captures.fields import first_mapping, with_field, with_part_field
from dsl_app.importing.captures.look import (
    decode,
    guess,
    list_files,
    require_sizes,
    small_pictures,
)
from dsl_app.importing.captures.state import DOUBT, NOMINAL, CaptureRequest, Place

from dsl_core.errors import CalibrationError, StoreError
from dsl_core.io.calibration_library import CalibrationLibrary
from dsl_core.io.pictures.source import open_pictures
from dsl_core.model.captured_code import Stripes
from dsl_core.progress import NoProgress
from dsl_core.workflows.thinned import Thinned
from tests.app.importing.captures.small_capture import CAMERA, PROJECTOR, request_for
from tests.cases.foreign_captures import counted_sinusoids, for_screens, frames, scene, write
from tests.cases.small_rig import small_rig

MAPPING = first_mapping(12, PROJECTOR)


def listed(request: CaptureRequest, tmp_path: Path) -> tuple[str, dict[Place, str]]:
    found = list_files(request, MAPPING, CalibrationLibrary(tmp_path / "library"))
    return found.calibration, dict(found.troubles)


def test_a_guess_is_what_was_captured(folder: Path, tmp_path: Path) -> None:
    found = guess(request_for(folder, tmp_path), NoProgress())
    assert found.trouble == ""
    assert found.stated.is_guessed
    assert found.stated.mapping.parts == MAPPING.parts
    assert found.sets == ("set",)


def test_pictures_that_make_no_sense_leave_a_mapping_to_correct(tmp_path: Path) -> None:
    noise = np.random.default_rng(1)
    named = {f"{i}.png": noise.integers(0, 255, (24, 32)).astype(np.uint16) for i in range(6)}
    request = request_for(write(tmp_path / "noise", named), tmp_path)
    found = guess(request, NoProgress())
    assert found.trouble
    assert not found.stated.is_guessed
    assert found.stated.mapping == first_mapping(6, PROJECTOR)


def test_a_guess_names_what_a_person_must_state(tmp_path: Path) -> None:
    folder, _ = counted_sinusoids(tmp_path / "set")
    found = guess(replace(request_for(folder, tmp_path), projector_px=(160, 96)), NoProgress())
    assert found.trouble.endswith("it must be known. Set Unit of the stripes and Fringes of the sinusoids.")
    assert found.stated.is_guessed


def test_a_folder_without_pictures_has_nothing_to_correct(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match="contains 0 pictures"):
        guess(request_for(tmp_path, tmp_path), NoProgress())


def test_columns_are_decoded_from_some_of_the_pixels(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dsl_core.workflows.thinned.PREVIEW_PIXELS", 64 * 48 // 4)
    found = decode(folder, MAPPING)
    assert found.column_px.shape == (24, 32)
    assert found.share > 0.9
    rows, columns = (np.arange(size)[np.arange(size) // 2 % 2 == 0] for size in (48, 64))
    truth = scene(CAMERA, PROJECTOR).columns[np.ix_(rows, columns)]
    known = np.isfinite(found.column_px)
    assert np.percentile(np.abs(found.column_px - truth)[known], 90) < 0.7


def test_thinning_keeps_a_mosaic(folder: Path) -> None:
    source = open_pictures(folder, MAPPING)
    thinned = Thinned(source, 3)
    shot = next(iter(thinned.plan.shots()))
    frame = thinned.read(shot)
    assert frame.shape[::-1] == thinned.plan.camera_size_px
    assert np.array_equal(frame[2:4, 2:4], source.read(shot)[6:8, 6:8])


def test_wrong_parts_are_seen_in_the_columns(folder: Path) -> None:
    wrong = with_part_field(MAPPING, 2, "first", "least")
    steps = [np.nanmean(np.abs(np.diff(decode(folder, each).column_px))) for each in (MAPPING, wrong)]
    assert steps[1] > 3 * steps[0]


def test_files_that_do_not_fit_are_listed_all_the_same(folder: Path, tmp_path: Path) -> None:
    more = with_part_field(MAPPING, 2, "bits", 6)
    found = list_files(request_for(folder, tmp_path), more, CalibrationLibrary(tmp_path))
    assert "has 12 pictures where the mapping wants 14" in dict(found.troubles)[Place.MAPPING]
    assert found.table[0] == ("im_00.png", "white")
    assert found.table[-1] == ("-", "columns, gray bit 0 inverse: no picture")
    less = with_part_field(MAPPING, 2, "bits", 4)
    assert list_files(request_for(folder, tmp_path), less, CalibrationLibrary(tmp_path)).table[-1] == (
        "im_11.png",
        "not in the mapping",
    )


def test_small_pictures_are_as_bright_as_each_other(folder: Path) -> None:
    small = small_pictures(
        folder, MAPPING, (("im_00.png", "white"), ("im_01.png", "black"), ("-", "missing"))
    )
    assert list(small) == ["im_00.png", "im_01.png"]
    assert small["im_00.png"].dtype == np.uint8
    assert small["im_00.png"].mean() > 5 * small["im_01.png"].mean()


def test_files_with_brackets_in_their_names_are_no_pictures_of_an_array(tmp_path: Path) -> None:
    dark, bright = np.zeros((24, 32), np.uint16), np.full((24, 32), 255, np.uint16)
    write(tmp_path, {"shot[00].png": dark, "set[1] shot[a].png": bright})
    np.save(tmp_path / "all[2].npy", np.stack([dark, bright]))
    names = ("shot[00].png", "set[1] shot[a].png", "all[2].npy[0]", "all[2].npy[1]")
    small = small_pictures(tmp_path, MAPPING, tuple((name, "") for name in names))
    assert list(small) == list(names)
    assert [each.max() > 0 for each in small.values()] == [False, True, False, True]


def test_what_a_calibration_lacks_is_named(folder: Path, tmp_path: Path) -> None:
    request = request_for(folder, tmp_path)
    assert "no depth" in listed(request, tmp_path)[0]
    matrix = [[50.0, 0, 16], [0, 50.0, 12], [0, 0, 1]]
    file = tmp_path / "stereo.json"
    parts = {"cam_K": matrix, "proj_K": matrix, "R": np.eye(3).tolist(), "T": [0.1, 0, 0]}
    file.write_text(json.dumps(parts))
    given = replace(request, calibration=str(file), unit_mm=1000.0)
    told, troubles = listed(given, tmp_path)
    assert not troubles
    assert "the projector is 100 mm from the camera" in told
    assert "Missing, so assumed: no camera distortion, no projector distortion." in told
    told, _ = listed(replace(given, unit_mm=20.0), tmp_path)
    assert told.startswith(
        f"{DOUBT}the projector would be 2 mm from the camera; if lengths are in metres, set"
    )
    _, troubles = listed(replace(given, unit_mm=1.0), tmp_path)
    assert "would be 0.1 mm from the camera; if lengths are in metres, set" in troubles[Place.CALIBRATION]
    file.write_text(json.dumps({key: parts[key] for key in ("cam_K", "R")}))
    assert "lacks projector matrix and translation" in listed(given, tmp_path)[1][Place.CALIBRATION]
    missing = replace(request, calibration=str(tmp_path / "none.json"))
    assert Place.CALIBRATION in listed(missing, tmp_path)[1]


def test_a_calibration_that_states_its_unit_is_read_in_that_until_another_is_set(
    folder: Path, tmp_path: Path
) -> None:
    """The box shows 1 mm before anybody has touched it, which is no statement against the file."""
    matrix = [[50.0, 0, 16], [0, 50.0, 12], [0, 0, 1]]
    file = tmp_path / "stereo.json"
    parts = {"cam_K": matrix, "proj_K": matrix, "R": np.eye(3).tolist(), "T": [0.1, 0, 0], "unit": "m"}
    file.write_text(json.dumps(parts))
    request = replace(request_for(folder, tmp_path), calibration=str(file))
    told, troubles = listed(request, tmp_path)
    assert not troubles
    assert "the projector is 100 mm from the camera" in told
    _, troubles = listed(replace(request, unit_mm=10.0), tmp_path)
    assert "which is 1000 mm, not 10 mm as given" in troubles[Place.CALIBRATION]


def test_a_calibration_for_other_sizes_is_refused(folder: Path, tmp_path: Path) -> None:
    nominal = replace(request_for(folder, tmp_path), calibration=NOMINAL)
    assert "The pictures are 64 × 48 px" in listed(nominal, tmp_path)[1][Place.CALIBRATION]
    rig = small_rig()
    camera_px = rig.camera.width_px, rig.camera.height_px
    with pytest.raises(CalibrationError, match="The projector of the mapping is 32 × 24 px"):
        require_sizes(rig, MAPPING, camera_px)


def test_values_for_screens_are_named_with_what_to_do(tmp_path: Path) -> None:
    pictures, white, black = frames([("columns", Stripes(bits=5))], projector=PROJECTOR)
    named = {f"{k:02d}.png": for_screens(each) for k, each in enumerate([white, black, *pictures])}
    root = write(tmp_path / "screen", named)
    found = decode(root, MAPPING)
    assert found.advice == "set encoding of the mapping to srgb"
    told = MAPPING.model_copy(update={"unsure": ("columns fall", f"values are {found.values}")})
    stated = with_field(told, "encoding", "srgb")
    assert stated.unsure == ("columns fall",), "what a person states is not unsure"
    found = decode(root, stated)
    assert (found.advice, found.values[:15]) == ("", "linear in light")


def test_curves_complete_a_calibration_or_are_refused_with_the_reason(folder: Path, tmp_path: Path) -> None:
    matrix = [[50.0, 0, 16], [0, 50.0, 12], [0, 0, 1]]
    file, table = tmp_path / "stereo.json", tmp_path / "leds.csv"
    parts = {"cam_K": matrix, "proj_K": matrix, "R": np.eye(3).tolist(), "T": [100, 0, 0]}
    file.write_text(json.dumps(parts))
    nm = np.arange(420, 671, 10)
    peaks = np.exp(-(((nm[:, None] - [620, 530, 460]) / 25) ** 2))
    np.savetxt(table, np.c_[nm, peaks], "%.4f", ",", header="nm,R,G,B", comments="")
    request = replace(request_for(folder, tmp_path), calibration=str(file), led_curves=table)
    told, troubles = listed(request, tmp_path)
    assert not troubles
    assert "curves of the LEDs: leds.csv, by their names, centred at R 620 nm, G 530 nm, B 460 nm" in told
    assert told.endswith("it has no curves.")
    told, _ = listed(replace(request, camera_curves=table), tmp_path)
    assert told.endswith("For depth.")
    np.savetxt(table, np.c_[nm, peaks[:, ::-1]], "%.4f", ",", header="nm,R,G,B", comments="")
    assert "red must have the longest" in listed(request, tmp_path)[1][Place.CALIBRATION]
