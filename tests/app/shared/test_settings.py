from __future__ import annotations

import errno
import json
import os
from pathlib import Path

import pytest
from dsl_app.shared.settings import (
    RECENT_COUNT,
    RecentFiles,
    Settings,
    SettingsFile,
    demo_folder,
    folder_for,
    load_settings,
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


def test_a_file_that_cannot_be_read_for_a_moment_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, kept = tmp_path / "settings.json", Settings(theme="dark", rig="bench")
    save_settings(kept, path)

    def fail(*_: object, **__: object) -> None:
        raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))

    with monkeypatch.context() as patch:
        patch.setattr("dsl_app.shared.settings.read_json", fail)
        settings, trouble = load_settings(path)
        file = SettingsFile(settings, path)
        assert "could not be read" in trouble
        assert "could not be saved" in file.save()
        assert "could not be saved" in file.save_early()
    assert (settings, load_settings(path)) == (Settings(), (kept, ""))
    settings.tour_seen = True
    assert file.save() == ""
    assert load_settings(path)[0] == kept.model_copy(update={"tour_seen": True})


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
    now = load_settings(path)[0]
    file = SettingsFile(now, path)
    now.theme, now.page, now.rig = "light", "scan", "bench"
    now.rig_options, now.tour_seen = {"port": "3"}, True
    assert file.save_early() == ""
    expected = Settings(theme="dark", page="results", rig="bench", rig_options={"port": "3"}, tour_seen=True)
    assert load_settings(path) == (expected, "")


def _opened(path: Path) -> tuple[Settings, SettingsFile]:
    settings, trouble = load_settings(path)
    assert trouble == ""
    return settings, SettingsFile(settings, path)


def test_of_two_windows_each_keeps_what_was_chosen_in_the_other(tmp_path: Path) -> None:
    path = tmp_path / "settings.json"
    start = [str(tmp_path / name) for name in ("old.dsl", "older.dsl", "gone.dsl")]
    save_settings(Settings(recent=start, rig="bench", page="scan"), path)
    (first, first_file), (second, second_file) = _opened(path), _opened(path)
    second.theme, second.calibration = "light", "room 7"
    second.remember(tmp_path / "second.zarr")
    second.rig_options = {"port": "3"}
    assert second_file.save_early() == ""
    assert second_file.save() == ""
    first.page = "results"
    first.remember(tmp_path / "first.zarr")
    first.remember(tmp_path / "older.dsl")
    RecentFiles(first).forget(tmp_path / "gone.dsl")
    assert first_file.save_early() == ""
    assert first_file.save() == ""
    now = load_settings(path)[0]
    assert (now.theme, now.calibration, now.page) == ("light", "room 7", "results")
    assert (now.rig, now.rig_options) == ("bench", {"port": "3"})
    assert [Path(name).name for name in now.recent] == ["older.dsl", "first.zarr", "second.zarr", "old.dsl"]


def test_options_are_kept_with_the_rig_that_they_are_of(tmp_path: Path) -> None:
    path = tmp_path / "settings.json"
    save_settings(Settings(), path)
    (first, first_file), (second, second_file) = _opened(path), _opened(path)
    second.rig_options = {"scene": "box"}
    assert second_file.save() == ""
    first.rig = "bench"
    assert first_file.save() == ""
    now = load_settings(path)[0]
    assert (now.rig, now.rig_options) == ("bench", {})


def test_settings_are_written_whole_where_their_file_is_gone(tmp_path: Path) -> None:
    path = tmp_path / "settings.json"
    save_settings(Settings(theme="dark", rig="bench"), path)
    for save in (SettingsFile.save, SettingsFile.save_early):
        settings, file = _opened(path)
        settings.tour_seen = True
        path.unlink()
        assert save(file) == ""
        assert load_settings(path) == (Settings(theme="dark", rig="bench", tour_seen=True), "")


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
