"""Which campaign is open, where its calibrations stand, and whether it belongs to this rig. No Qt."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from dsl_app.calibrate.campaign_status import Kinds
from dsl_app.calibrate.state import CalibrateState, CampaignFacts, Row
from dsl_app.connection.controller import RigController
from dsl_app.connection.state import RigChoice
from dsl_app.shared.jobs.base import Job, JobRunner
from dsl_app.shared.notify import NO_RIG, Notifier, sentence_of
from dsl_core.devices.conditions import current_conditions
from dsl_core.errors import DslError
from dsl_core.io.atomic import store_error
from dsl_core.io.campaign_folder import CampaignFolder
from dsl_core.io.scan.lock import FolderLock
from dsl_core.progress import Progress


class CampaignController:
    """Opens campaigns and keeps the rows of the open one up to date."""

    def __init__(
        self, state: CalibrateState, rig: RigController, runner: JobRunner, notifier: Notifier, kinds: Kinds
    ) -> None:
        self.state, self._rig, self._runner, self._notifier = state, rig, runner, notifier
        self._kinds = kinds
        self._stops = [
            rig.state.devices.changed.connect(lambda _: self.refresh()),
            rig.state.choice.changed.connect(lambda _: self.refresh()),
        ]

    def open(self, folder: Path) -> None:
        """Open a campaign that was begun before; a wrong folder is named."""
        self._take(lambda: CampaignFolder.open(folder))

    def begin(self, folder: Path) -> None:
        """Begin a campaign of the chosen rig in a new folder."""
        choice = self._rig.state.choice.value
        self._take(lambda: CampaignFolder.begin(folder, choice.name, dict(choice.options)))

    def _take(self, make: Callable[[], CampaignFolder]) -> None:
        try:
            campaign = make()
        except DslError as error:
            self._notifier.tell("error", str(error))
            return
        info = campaign.info
        rig = RigChoice(info.rig, tuple(info.options.items()))
        self.state.note.set("")
        self.state.campaign.set(CampaignFacts(campaign.path.absolute(), rig))
        self.refresh()

    def refresh(self) -> None:
        """Read again where every calibration stands."""
        facts, devices = self.state.campaign.value, self._rig.state.devices.value
        self.state.foreign.set(facts is not None and devices is not None and not self._fits(facts))
        self.state.trouble.set(self.obstacle())
        if facts is None:
            return
        conditions = current_conditions(devices) if devices is not None and self._fits(facts) else None

        def work(progress: Progress) -> tuple[Row, ...]:
            progress.report("read the campaign", 0, 0)
            return self._kinds.rows(facts.path, conditions)

        def done(rows: tuple[Row, ...]) -> None:
            if self.state.campaign.value == facts:
                self.state.rows.set(rows)

        def failed(error: Exception) -> None:
            self._notifier.tell("error", sentence_of(error))

        self._runner.submit(Job("Read the campaign", work, done, failed, is_minor=True))

    def _fits(self, facts: CampaignFacts) -> bool:
        choice = self._rig.state.choice.value
        return (choice.name, dict(choice.options)) == (facts.rig.name, dict(facts.rig.options))

    def obstacle(self) -> str:
        """Why nothing can be calibrated now, empty if it can."""
        facts, devices = self.state.campaign.value, self._rig.state.devices.value
        if facts is None:
            return ""
        if devices is not None and not self._fits(facts):
            mine, known = self._rig.state.choice.value.words, facts.rig.words
            return (
                f"This campaign was begun with the rig {known}, but {mine} is connected. Connect the"
                " campaign's rig, or open another campaign."
            )
        return NO_RIG if devices is None else ""

    def close(self) -> None:
        """Stop following the rig."""
        for stop in self._stops:
            stop()


class CampaignLock:
    """One writer for each campaign, among all windows and commands of this computer."""

    def __init__(self) -> None:
        self._lock: FolderLock | None = None

    def take(self, folder: Path) -> None:
        """Lock it; raises `StoreError` when another process writes it, or the folder is read-only."""
        try:
            self._lock = FolderLock(folder / "lock")
        except OSError as error:
            raise store_error(folder / "lock", error) from error

    def release(self) -> None:
        """Unlock it; a second call does nothing."""
        if self._lock is not None:
            self._lock.release()
            self._lock = None
