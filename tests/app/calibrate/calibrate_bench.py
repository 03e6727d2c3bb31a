"""A connected twin with a controller of two small calibrations, for tests of the Calibrate page."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from dsl_app.calibrate.campaign_status import Kinds
from dsl_app.calibrate.controller import CalibrateController
from dsl_app.calibrate.state import CalibrateState, Row, RowState
from dsl_app.calibrate.wizard.controller import WizardController
from dsl_app.calibrate.wizard.state import Fit, WizardState
from dsl_app.connection.controller import RigController
from dsl_app.connection.state import RigChoice, RigState
from dsl_app.shared.evented import Value
from dsl_app.shared.jobs.base import JobRunner

from dsl_core.campaign.common.recipe import AnyRecipe
from dsl_core.campaign.recipes import _build
from dsl_core.devices.base import DeviceRig
from dsl_core.io.calibration_library import CalibrationLibrary
from dsl_core.io.campaign_folder import CampaignFolder
from dsl_core.model.rig import Rig
from tests.app.support.doubles import InlineRunner, RecordingNotifier
from tests.cases.fake_recipe import FakeGeometry, FakeSelfTest

SMALL = RigChoice("twin", (("scene", "plane"), ("size", "32x24")))
KINDS: dict[str, Any] = {"selftest": FakeSelfTest, "geometry": FakeGeometry}


@dataclass
class CalibrateBench:
    """Everything a test of calibrations touches; ``wrong`` are attributes that recipes get when made."""

    folder: Path
    rig: RigController
    state: CalibrateState
    notifier: RecordingNotifier
    library: CalibrationLibrary
    control: CalibrateController = field(init=False)
    wizards: list[tuple[WizardState, WizardController]] = field(default_factory=list)
    wrong: dict[str, Any] = field(default_factory=dict)
    later: timedelta = timedelta(0)

    @property
    def campaign(self) -> Path:
        return self.folder / "campaign"

    @property
    def told(self) -> str:
        return self.notifier.told[-1][1] if self.notifier.told else ""

    @property
    def calibrated(self) -> tuple[DeviceRig, Rig]:
        """The devices that are connected, and their calibration."""
        devices = self.rig.state.devices.value
        assert devices is not None
        assert devices.calibration is not None
        return devices, devices.calibration

    def row(self, name: str) -> Row:
        return next(row for row in self.state.rows.value if row.name == name)

    def recipes(self, campaign: CampaignFolder) -> tuple[AnyRecipe, ...]:
        made = []
        for name, kind in KINDS.items():
            recipe = _build(kind, name, campaign.info.settings.get(name, {}))
            for key, value in self.wrong.items():
                setattr(recipe, key, value)
            made.append(recipe)
        return tuple(made)

    def wizard(self, name: str) -> tuple[WizardState, WizardController]:
        """Open the wizard of a calibration; it must open."""
        count = len(self.wizards)
        self.control.run(name)
        assert len(self.wizards) == count + 1, self.told
        return self.wizards[-1]


def make_bench(
    folder: Path,
    runner: JobRunner | None = None,
    kinds: Callable[[CalibrateBench], Kinds] | None = None,
    choice: RigChoice = SMALL,
) -> CalibrateBench:
    """A bench whose rig is not yet connected; its calibrations are ``kinds``, two small ones by default."""
    notifier = RecordingNotifier()
    runner = runner or InlineRunner(notifier)
    rig = RigController(RigState(choice), runner, notifier)
    bench = CalibrateBench(folder, rig, CalibrateState(), notifier, CalibrationLibrary(folder / "library"))
    made = (kinds or _small)(bench)
    bench.control = CalibrateController(bench.state, rig, runner, notifier, bench.library, made)
    bench.control.wizard_ready.connect(bench.wizards.append)
    return bench


def _small(bench: CalibrateBench) -> Kinds:
    return Kinds(tuple(KINDS), bench.recipes, clock=lambda: datetime.now(UTC) + bench.later)


def with_a_campaign(bench: CalibrateBench) -> CalibrateBench:
    """The bench with its rig connected and a fresh campaign; a person places targets."""
    bench.rig.connect(bench.rig.state.choice.value)
    devices = bench.rig.state.devices.value
    assert devices is not None
    devices.place = None
    bench.control.begin_campaign(bench.campaign)
    return bench


def calibrate(bench: CalibrateBench, name: str) -> None:
    """Go through a whole wizard as a person does."""
    state, control = bench.wizard(name)
    while state.lacking:
        control.go_to(state.lacking[0])
        control.capture()
        assert not state.trouble.value
    control.fit()
    control.accept()
    control.leave()


def fit_of(state: WizardState) -> Fit | None:
    return state.fit.value


def is_on(value: Value[bool]) -> bool:
    return value.value


def page(state: WizardState) -> int:
    return state.at.value


def states(bench: CalibrateBench) -> list[RowState]:
    return [row.state for row in bench.state.rows.value]
