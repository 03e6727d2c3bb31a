from __future__ import annotations

import json
from pathlib import Path

from dsl_app.shared.settings import (
    RECENT_COUNT,
    Settings,
    demo_folder,
    folder_for,
    load_settings,
    save_early,
    save_settings,
)


def test_settings_come_back(tmp_path: Path) -> None:
    settings = Settings(theme="dark", rig_options={"scene": "box"})
    assert save_settings(settings, tmp_path / "new" / "settings.json") == ""
    assert load_settings(tmp_path / "new" / "settings.json") == (settings, "")


def test_a_missing_file_is_a_first_start(tmp_path: Path) -> None:
    assert load_settings(tmp_path / "settings.json") == (Settings(), "")


def test_a_damaged_file_is_set_aside_and_told(tmp_path: Path) -> None:
    path = tmp_path / "settings.json"
    path.write_text('{"theme": "dar')
    settings, trouble = load_settings(path)
    assert settings == Settings()
    assert "could not be read" in trouble
    assert (tmp_path / "settings.damaged.json").read_text() == '{"theme": "dar'


def test_one_wrong_field_costs_only_itself(tmp_path: Path) -> None:
    path = tmp_path / "settings.json"
    path.write_text(json.dumps({"theme": "pink", "rig": "bench", "future": 1}))
    settings, trouble = load_settings(path)
    assert (settings.theme, settings.rig) == ("system", "bench")
    assert "theme" in trouble
    assert "future" not in trouble


def test_what_must_outlive_a_crash_is_written_alone(tmp_path: Path) -> None:
    path = tmp_path / "settings.json"
    save_settings(Settings(theme="dark", page="results"), path)
    now = Settings(theme="light", page="scan", rig="bench", rig_options={"port": "3"}, tour_seen=True)
    assert save_early(now, path) == ""
    expected = Settings(theme="dark", page="results", rig="bench", rig_options={"port": "3"}, tour_seen=True)
    assert load_settings(path) == (expected, "")


def test_a_folder_that_cannot_be_written_is_told(tmp_path: Path) -> None:
    blocker = tmp_path / "file"
    blocker.write_text("")
    assert "could not be saved" in save_settings(Settings(), blocker / "settings.json")


def test_recent_files_are_unique_and_few(tmp_path: Path) -> None:
    settings = Settings()
    for i in [*range(20), 5]:
        settings.remember(tmp_path / f"{i}.dsl")
    assert len(settings.recent) == RECENT_COUNT
    assert settings.recent[0].endswith("5.dsl")
    assert len(set(settings.recent)) == RECENT_COUNT


def test_files_of_an_example_are_offered_at_home_and_others_next_to_their_result(tmp_path: Path) -> None:
    assert folder_for(tmp_path / "leaf.zarr") == tmp_path
    assert folder_for(demo_folder() / "face.zarr") == Path.home()
