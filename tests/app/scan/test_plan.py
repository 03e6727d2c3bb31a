from __future__ import annotations

import math
from pathlib import Path
from shutil import rmtree

import numpy as np
import pytest
from dsl_app.scan.plan_editor import PlanEditor
from dsl_app.scan.run import CalibrationBox
from dsl_app.scan.state import CalibrationChoice, Phase, preset_of
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from pytestqt.qtbot import QtBot

from dsl_core.errors import DeviceError
from dsl_core.io.plan_file import load_plan, save_plan
from dsl_core.model.frames import Frame
from dsl_core.model.plan import CapturePlan, Columns, LineComb, ScanLines, Setting
from dsl_core.model.presets import PRESETS, Preset, on_columns
from dsl_core.planning.designed import DesignedSet, packed, save_design
from dsl_core.simulation.sim_devices import SimCamera
from tests.app.support.scan_bench import COMB, SHORT, SMALL, TWIN, ScanBench, planned_bench


@pytest.fixture
def bench(tmp_path: Path) -> ScanBench:
    return planned_bench(tmp_path)


def design(folder: Path, width_px: int = 640) -> Path:
    levels = np.zeros((16, width_px, 3), np.uint8)
    levels[np.arange(width_px) % 16, np.arange(width_px)] = 255
    made = DesignedSet(
        name="designed 16", rig="twin", command="dsl-scan design", frames=16, width_px=width_px,
        lines="lines", comb_error=0.02, error=0.01, levels=packed(levels),
    )  # fmt: skip
    return save_design(made, folder / "set.json")


def test_a_saved_plan_is_planned_again_and_undone(bench: ScanBench, tmp_path: Path) -> None:
    bench.scans.plans.change_plan(COMB)
    bench.scans.plans.save_plan(tmp_path / "mine.json")
    assert load_plan(tmp_path / "mine.json") == bench.state.plan.value
    assert "--plan" in bench.scans.command_line()
    bench.scans.plans.choose_preset("quick")
    assert "--plan" not in bench.scans.command_line()
    assert bench.scans.open(tmp_path / "mine.json")
    assert bench.state.plan.value.spectral == COMB.spectral
    assert f"--plan {tmp_path / 'mine.json'}" in bench.scans.command_line()
    bench.undo.undo()
    assert bench.state.preset is not None
    assert bench.state.preset.key == "quick"


def test_a_plan_of_another_rig_is_fitted_and_then_no_longer_the_file(
    bench: ScanBench, tmp_path: Path
) -> None:
    path = save_plan(CapturePlan(), tmp_path / "plan.json")
    bench.scans.plans.open_plan(path)
    assert bench.state.plan.value.camera_size_px == (64, 48)
    assert "--plan" not in bench.scans.command_line()


def test_a_pattern_set_is_planned_at_the_settings_at_hand(bench: ScanBench, tmp_path: Path) -> None:
    before = bench.state.plan.value.settings
    assert bench.scans.open(design(tmp_path))
    plan = bench.state.plan.value
    assert isinstance(plan.spectral, Columns)
    assert (plan.name, plan.spectral_count, plan.settings) == ("designed 16", 16, before)
    command = bench.scans.command_line()
    assert command.startswith("# First save the plan")
    assert command.endswith("--plan plan.json")
    bench.scans.start()
    assert bench.state.phase.value is Phase.DONE


def test_a_pattern_set_of_another_projector_is_refused(bench: ScanBench, tmp_path: Path) -> None:
    before = bench.state.plan.value
    assert bench.scans.open(design(tmp_path, width_px=320))
    assert bench.state.plan.value is before
    assert "320 columns wide, but the projector has 640" in bench.notifier.told[-1][1]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ('{"spectral": {"kind": "lines", "width_px": 0}}', "width_px"),
        ('{"spectral": {}, "settings": []}', "not valid"),
        ('{"levels": "?", "frames": 2}', "cannot be read"),
        ("{", "not valid"),
        ("", "not valid"),
    ],
)
def test_a_wrong_file_gets_a_sentence(bench: ScanBench, tmp_path: Path, text: str, told: str) -> None:
    path, before = tmp_path / "wrong.json", bench.state.plan.value
    path.write_text(text)
    bench.scans.plans.open_plan(path)
    level, sentence = bench.notifier.told[-1]
    assert level == "error"
    assert told in sentence
    assert "wrong.json" in sentence
    assert bench.state.plan.value is before


def test_a_file_that_is_gone_and_a_folder_get_a_sentence(bench: ScanBench, tmp_path: Path) -> None:
    for path in (tmp_path / "gone.json", tmp_path):
        bench.scans.plans.open_plan(path)
        assert "cannot be read" in bench.notifier.told[-1][1]
    (tmp_path / "file").write_text("")
    bench.scans.plans.save_plan(tmp_path / "file" / "plan.json")
    assert bench.notifier.told[-1][0] == "error"


def test_while_a_scan_runs_its_plan_stays(bench: ScanBench, tmp_path: Path) -> None:
    path, before = save_plan(CapturePlan(), tmp_path / "plan.json"), bench.state.plan.value
    bench.state.phase.set(Phase.RUNNING)
    assert bench.scans.open(path)
    assert bench.state.plan.value is before
    assert "keeps its plan" in bench.notifier.told[-1][1]


def saved_comb(bench: ScanBench, folder: Path) -> None:
    bench.scans.plans.change_plan(COMB)
    bench.scans.plans.save_plan(folder / "comb.json")
    assert "--plan" in bench.scans.command_line()


def test_a_scan_that_is_opened_brings_another_plan_than_the_file(
    bench: ScanBench, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def lost(camera: SimCamera, timeout_ms: float = 5000.0) -> Frame:
        raise DeviceError("The power failed.")

    bench.plan(SHORT)
    bench.state.meters.set(False)
    with monkeypatch.context() as losing:
        losing.setattr(SimCamera, "snap", lost)
        bench.scans.start()
    bench.scans.plan_new_scan()
    saved_comb(bench, tmp_path)
    own = bench.state.plan.value
    assert bench.scans.open(tmp_path / "first.dsl")
    assert bench.state.preset is PRESETS[0]
    assert "--plan" not in bench.scans.command_line()
    # The plan from the file is that of the next scan again.
    bench.scans.plan_new_scan()
    assert bench.state.plan.value == own
    assert "--plan" in bench.scans.command_line()


def test_a_plan_that_is_fitted_to_another_rig_is_no_longer_the_file(bench: ScanBench, tmp_path: Path) -> None:
    saved_comb(bench, tmp_path)
    bench.rig.connect(TWIN)
    assert "--plan" in bench.scans.command_line()
    bench.rig.connect(SMALL)
    assert "--plan" not in bench.scans.command_line()


def test_combs_of_three_colours_stay_so_when_something_else_is_edited(qtbot: QtBot) -> None:
    editor = PlanEditor()
    qtbot.addWidget(editor)
    told: list[CapturePlan] = []
    editor.plan_changed.connect(told.append)
    comb = LineComb(period_px=64, shifts_px=(0, 21, 42))
    editor.set_plan(CapturePlan(spectral=comb), 1000 / 60)
    assert editor.patterns.currentText() == "Combs, one per colour"
    editor.code.setCurrentIndex(1)
    editor.code.activated.emit(1)
    editor.patterns.setCurrentIndex(0)
    editor.patterns.activated.emit(0)
    assert [each.spectral for each in told] == [comb, ScanLines()]


def test_designed_patterns_stay_so_when_something_else_is_edited(qtbot: QtBot) -> None:
    editor = PlanEditor()
    qtbot.addWidget(editor)
    told: list[CapturePlan] = []
    editor.plan_changed.connect(told.append)
    columns = Columns(levels=(((1.0, 0.0, 0.0),),))
    editor.set_plan(CapturePlan(spectral=columns), 1000 / 60)
    assert editor.patterns.currentText() == "Designed"
    assert not editor.step.isEnabled()
    assert editor._purpose.text().startswith("1 designed patterns.")
    editor.code.setCurrentIndex(1)
    editor.code.activated.emit(1)
    assert told[-1].spectral == columns
    editor.set_plan(CapturePlan(), 1000 / 60)
    assert editor.patterns.count() == 3


def test_what_is_not_edited_of_a_setting_stays_as_it_is(qtbot: QtBot) -> None:
    editor = PlanEditor()
    qtbot.addWidget(editor)
    told: list[CapturePlan] = []
    editor.plan_changed.connect(told.append)
    given = (Setting(exposure_ms=60_000.0, level=0.125), Setting(exposure_ms=1000 / 60, level=1 / 3))
    editor.set_plan(CapturePlan(settings=given, code_settings=(0,)), 1000 / 60, 10_000.0)
    shown = [[box.text() for box in row] for row in editor.settings._rows]
    assert shown == [["60000.0 ms", "0.125"], ["16.7 ms", "0.333"]]
    editor.settings._rows[0][1].setValue(0.5)
    assert told[-1].settings == (Setting(exposure_ms=60_000.0, level=0.5), given[1])
    editor.settings._rows[1][0].setValue(34)
    assert told[-1].settings == (given[0], Setting(exposure_ms=2 * 1000 / 60, level=1 / 3))


def test_the_least_level_that_can_be_typed_is_light(qtbot: QtBot) -> None:
    editor = PlanEditor()
    qtbot.addWidget(editor)
    editor.set_plan(CapturePlan(), 1000 / 60)
    changed: list[CapturePlan] = []
    editor.plan_changed.connect(changed.append)
    editor.settings._rows[0][1].setValue(0.001)
    assert changed[-1].settings[0].level == 0.002


def test_exposures_go_as_far_as_those_of_the_camera(bench: ScanBench, qtbot: QtBot) -> None:
    devices = bench.rig.state.devices.value
    assert devices is not None
    assert bench.state.longest_ms.value == devices.camera.info.exposure_range_ms[1]
    editor = PlanEditor()
    qtbot.addWidget(editor)
    for longest_ms, most_ms in ((120_000.0, 120_000.0), (math.inf, 3_600_000.0)):
        editor.set_plan(CapturePlan(), 1000 / 60, longest_ms)
        assert editor.settings._rows[0][0].maximum() == most_ms


def test_buttons_ask_for_files(qtbot: QtBot) -> None:
    editor = PlanEditor()
    qtbot.addWidget(editor)
    editor.show()
    for button, signal in ((editor.open, editor.open_requested), (editor.save, editor.save_requested)):
        with qtbot.waitSignal(signal):
            QTest.mouseClick(button, Qt.MouseButton.LeftButton)


def test_a_plan_is_not_a_custom_one_by_its_name_alone(qtbot: QtBot) -> None:
    editor = PlanEditor()
    qtbot.addWidget(editor)
    editor.set_plan(CapturePlan(), 1000 / 60)
    for key in ("reference", ""):
        editor.preset.choose(key)
        editor.preset.activated.emit(editor.preset.currentIndex())
        assert editor.preset.currentData() == "reference"


@pytest.mark.parametrize("preset", PRESETS, ids=lambda preset: preset.key)
def test_a_preset_is_known_on_a_projector_of_more_columns(preset: Preset) -> None:
    wide = on_columns(preset.plan, 1280).model_copy(update={"projector_size_px": (1280, 720)})
    assert preset_of(wide, 1000 / 60) == preset


def test_a_calibration_in_use_that_is_stored_again_is_scanned_with(bench: ScanBench) -> None:
    """By another window or the command line: the list shows its new date."""
    plans = bench.scans.plans
    first = bench.library.store("lab", bench.calibration.model_copy(update={"name": "first"}))
    plans.choose_calibration(CalibrationChoice("lab", "lab"))
    assert bench.state.calibration.value.date == first.stored
    second = bench.library.store("lab", bench.calibration.model_copy(update={"name": "second"}))
    bench.state.phase.set(Phase.RUNNING)
    plans.load_library()
    assert plans.calibration == first.rig
    assert [each.date for each in bench.state.calibrations.value[1:]] == [first.stored]
    bench.state.phase.set(Phase.DONE)
    plans.load_library()
    assert plans.calibration == second.rig
    assert [each.date for each in bench.state.calibrations.value[1:]] == [second.stored]
    assert bench.state.calibration.value == bench.state.calibrations.value[1]


def test_a_calibration_in_use_that_leaves_the_library_is_still_shown(bench: ScanBench, qtbot: QtBot) -> None:
    plans = bench.scans.plans
    bench.library.store("lab", bench.calibration)
    plans.choose_calibration(CalibrationChoice("lab", "lab"))
    rmtree(bench.library.home / "lab")
    plans.load_library()
    box = CalibrationBox(bench.state, bench.scans)
    qtbot.addWidget(box)
    assert box.choice.currentData() == bench.state.calibration.value.key == "lab"
    assert plans.calibration is not None
    for stop in box.stops:
        stop()
