from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from dsl_app.connection.state import RigChoice
from dsl_app.scan.effects.controller import EffectsController
from dsl_app.scan.effects.panel import EffectsPanel
from dsl_app.scan.effects.state import EffectsState
from dsl_app.scan.state import Phase
from dsl_app.shared.theme import LIGHT
from dsl_app.shared.widgets.inside import apply_theme_to, stop_following
from numpy.typing import NDArray
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from pytestqt.qtbot import QtBot

from dsl_core.io.scan.folder import ScanReader
from dsl_core.simulation.effects.catalogue import NAMES, NEEDED, USUAL
from dsl_core.simulation.effects.tolerance import ONE_DN, Tolerance
from dsl_core.simulation.sim_devices import SimCamera
from dsl_core.simulation.world import World
from tests.app.support.doubles import InlineRunner
from tests.app.support.scan_bench import FRAMES, TWIN, ScanBench, planned_bench


@pytest.fixture
def bench(tmp_path: Path) -> ScanBench:
    return planned_bench(tmp_path)


@pytest.fixture
def control(bench: ScanBench) -> EffectsController:
    return EffectsController(
        EffectsState(), bench.state, bench.rig, InlineRunner(bench.notifier), bench.notifier
    )


@pytest.fixture
def panel(qtbot: QtBot, control: EffectsController) -> Iterator[EffectsPanel]:
    made = EffectsPanel(control.state, control)
    qtbot.addWidget(made)
    apply_theme_to(made, LIGHT)
    made.resize(700, 500)
    made.show()
    yield made
    stop_following(made)


def choose(panel: EffectsPanel, key: str) -> None:
    panel.choice.setCurrentIndex(panel.choice.findData(key))


def test_every_effect_has_its_bound_cost_and_reason(control: EffectsController, bench: ScanBench) -> None:
    control.look("auto", ONE_DN)
    view = control.state.view.value
    assert view is not None
    assert [row.effect.name for row in view.plan.decisions] == list(NAMES)
    assert all(row.why.endswith(".") for row in view.plan.decisions)
    assert set(NEEDED) <= view.plan.names
    # A flat chart lights nothing else, is not glossy and not translucent.
    assert not {"interreflection", "subsurface", "specular"} & view.plan.names
    assert f"{len(view.plan.names)} of {len(NAMES)} effects are rendered" in view.summary
    assert f"s for all {FRAMES} frames" in view.saved
    assert "saves 0 %" not in view.saved
    control.look("all", ONE_DN)
    everything = control.state.view.value
    assert everything is not None
    assert everything.plan.names == set(NAMES)
    assert "saves 0 %, or 0 s" in everything.saved


def test_looking_changes_nothing_in_the_rig(control: EffectsController, bench: ScanBench) -> None:
    devices = bench.rig.state.devices.value
    assert devices is not None
    assert isinstance(devices.camera, SimCamera)
    before = devices.camera.world.request
    control.look("none", ONE_DN)
    assert devices.camera.world.request is before
    assert control.state.in_use.value == "usual"


def seen_as_it_is(world: World) -> NDArray[np.float32]:
    """The pattern that is shown, cut to 64 x 48 pixels."""
    assert world.image is not None
    return np.asarray(world.image[:48, :64].mean(-1, dtype=np.float32))


@pytest.mark.slow
def test_a_choice_is_put_in_force_by_options_that_scans_note(
    control: EffectsController, bench: ScanBench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # What the frames show does not matter here, as long as they follow the pattern.
    monkeypatch.setattr(World, "_light", lambda world, *_: 100 * seen_as_it_is(world))
    control.apply("auto", Tolerance(0.5, "sigma"))
    assert dict(bench.rig.state.choice.value.options)["tolerance"] == "0.5sigma"
    assert (control.state.in_use.value, control.state.tolerance.value) == ("auto", Tolerance(0.5, "sigma"))
    assert "--option effects=auto" in bench.scans.command_line()
    bench.scans.start()
    assert bench.state.phase.value is Phase.DONE
    notes = ScanReader(tmp_path / "first.dsl").manifest.notes
    assert json.loads(notes["effects"])["choice"] == "auto"
    control.apply("usual", ONE_DN)
    assert bench.rig.state.choice.value == TWIN


def test_while_a_scan_runs_effects_stay(control: EffectsController, bench: ScanBench) -> None:
    bench.state.phase.set(Phase.RUNNING)
    control.apply("all", ONE_DN)
    assert bench.rig.state.choice.value == TWIN
    assert "A scan is running" in bench.notifier.told[-1][1]


def test_a_choice_that_makes_no_sense_is_told(control: EffectsController, bench: ScanBench) -> None:
    control.look("magic", ONE_DN)
    assert "no effect 'magic'" in bench.notifier.told[-1][1]


def test_a_rig_that_does_not_come_offers_nothing(control: EffectsController, bench: ScanBench) -> None:
    seen = [control.state.offered.value]
    for choice in (RigChoice("twin", (*TWIN.options, ("size", "huge"))), TWIN):
        bench.rig.connect(choice)
        seen.append(control.state.offered.value)
    assert seen == [True, False, True]


def test_without_a_simulated_rig_nothing_is_offered(control: EffectsController, bench: ScanBench) -> None:
    assert control.state.offered.value
    bench.rig.disconnect()
    assert [control.state.offered.value] == [False]
    control.look_again()
    assert control.state.view.value is None


def test_the_panel_shows_the_choice_and_what_it_saves(panel: EffectsPanel) -> None:
    assert panel.table.rowCount() == len(NAMES)
    assert not panel.tolerance.isVisible()
    choose(panel, "auto")
    assert panel.tolerance.isVisible()
    assert "change no pixel" in panel._summary.text()
    assert "This saves" in panel._saved.text()


def test_the_tolerance_of_the_rig_is_shown_and_is_nothing_to_apply(
    panel: EffectsPanel, bench: ScanBench
) -> None:
    bench.rig.connect(RigChoice("twin", (*TWIN.options, ("effects", "auto"), ("tolerance", "0.005sigma"))))
    assert (panel.tolerance.value(), panel.unit.currentText()) == (0.005, "σ")
    assert not panel.apply.isEnabled()
    panel.tolerance.setValue(0.25)
    assert panel.apply.isEnabled()


def test_a_tolerance_that_makes_no_sense_is_told(control: EffectsController, bench: ScanBench) -> None:
    bench.rig.connect(RigChoice("twin", (*TWIN.options, ("effects", "auto"), ("tolerance", "1e-05"))))
    assert "must be a number of DN or of sigmas" in bench.notifier.told[-1][1]


def test_ticking_an_effect_chooses_by_name_and_apply_renders_it(
    panel: EffectsPanel, control: EffectsController, bench: ScanBench
) -> None:
    assert not panel.apply.isEnabled()
    glare = panel.table.item(NAMES.index("glare"), 0)
    assert glare is not None
    place = panel.table.visualItemRect(glare)
    panel.table.scrollToItem(glare)
    place = panel.table.visualItemRect(glare)
    place.setWidth(24)
    QTest.mouseClick(
        panel.table.viewport(), Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier, place.center()
    )
    assert panel.choice.currentData() == "chosen"
    view = control.state.view.value
    assert view is not None
    assert view.plan.names == USUAL | {"glare"}
    QTest.mouseClick(panel.apply, Qt.MouseButton.LeftButton)
    used = dict(bench.rig.state.choice.value.options)["effects"]
    assert set(used.split(",")) == USUAL | {"glare"}
    assert panel.choice.currentData() == "chosen"
    assert not panel.apply.isEnabled()


def test_what_cannot_be_left_out_cannot_be_unticked(panel: EffectsPanel) -> None:
    for name in NEEDED:
        item = panel.table.item(NAMES.index(name), 0)
        assert item is not None
        assert not item.flags() & Qt.ItemFlag.ItemIsUserCheckable
