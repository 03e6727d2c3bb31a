"""What the Calibrate page decides: the campaign, its rows, one wizard at a time, or everything. No Qt."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

from dsl_app.calibrate.calibrate_all import CANNOT_PLACE, CalibrateAll, products_text
from dsl_app.calibrate.campaign_status import Kinds
from dsl_app.calibrate.library import LibraryController
from dsl_app.calibrate.state import ABOUT, CalibrateState, CampaignFacts, Row
from dsl_app.calibrate.wizard.controller import WizardController
from dsl_app.calibrate.wizard.state import WizardState
from dsl_app.connection.controller import RIG, RigController
from dsl_app.connection.state import RigChoice
from dsl_app.shared.evented import Event
from dsl_app.shared.jobs.base import Job, JobRunner
from dsl_app.shared.notify import NO_RIG, Notifier, sentence_of
from dsl_app.shared.paths import is_file
from dsl_app.shared.widget_state import LabelState
from dsl_core.campaign.guide import calibrated_rig
from dsl_core.campaign.products import Products, write_products
from dsl_core.devices.conditions import current_conditions
from dsl_core.errors import CalibrationError, DecodeError, DslError
from dsl_core.io import CAMPAIGN_NAME
from dsl_core.io.calibration_library import CalibrationLibrary, name_from
from dsl_core.io.campaign_folder import CampaignFolder, take_campaign
from dsl_core.progress import Progress
from dsl_core.words import quoted

NO_CAMPAIGN = "No campaign is open. Begin a new one, or open an existing one."


class CalibrateController:
    """Opens campaigns and runs their calibrations; ``wizard_ready`` fires with each wizard to show."""

    def __init__(
        self,
        state: CalibrateState,
        rig: RigController,
        runner: JobRunner,
        notifier: Notifier,
        library: CalibrationLibrary | None = None,
        kinds: Kinds | None = None,
    ) -> None:
        self.state, self._rig, self._runner, self._notifier = state, rig, runner, notifier
        self._kinds = kinds or Kinds()
        self._store = library or CalibrationLibrary()
        self.library = LibraryController(state, rig, runner, notifier, self._store)
        self.wizard_ready: Event[tuple[WizardState, WizardController]] = Event()
        self._wizard: WizardController | None = None
        #: Counts readings of the campaign: what the last one read is shown, whichever ends last.
        self._reads = 0
        #: Holds the lock of the campaign that is written; a second release does nothing.
        self._lock = ExitStack()
        self._stops = [
            rig.state.usable.changed.connect(lambda _: self.refresh()),
            rig.state.choice.changed.connect(lambda _: self.refresh()),
        ]
        self._everything = CalibrateAll(
            state, rig, self._kinds, self._store, self._ended, begins=self.refresh
        )

    # Campaign --------------------------------------------------------------------------------------

    def open(self, path: Path) -> bool:
        """Open a campaign by its folder or a file in it, or import a calibration's file into the library.

        False for anything else.
        """
        folder = path.parent if path.name == CAMPAIGN_NAME else path
        if is_file(folder / CAMPAIGN_NAME):
            self.open_campaign(folder)
            return True
        return self.library.offer(path)

    def open_campaign(self, folder: Path) -> None:
        """Open an existing campaign; a folder that is not one is named."""
        if not self._is_busy():
            self._take(lambda: CampaignFolder.open(folder))

    def begin_campaign(self, folder: Path) -> None:
        """Start a campaign for the chosen rig in a new folder."""
        choice = self._rig.state.choice.value
        if not self._is_busy():
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
        self.state.outcome.set(LabelState())
        self.state.refused.set("")
        self.state.campaign.set(CampaignFacts(campaign.path.absolute(), rig))
        self.refresh()

    def refresh(self) -> None:
        """Read the state of every calibration again."""
        facts, devices = self.state.campaign.value, self._rig.state.usable.value
        self.state.foreign.set(facts is not None and devices is not None and not self._fits(facts))
        self.state.trouble.set(self._obstacle())
        if facts is None:
            return
        conditions = current_conditions(devices) if devices is not None and self._fits(facts) else None
        self._reads += 1
        read = self._reads

        def work(progress: Progress) -> tuple[Row, ...]:
            progress.report("read the campaign", 0, 0)
            return self._kinds.rows(facts.path, conditions)

        def done(rows: tuple[Row, ...]) -> None:
            if read == self._reads:
                self.state.rows.set(rows)

        def failed(error: Exception) -> None:
            if read == self._reads:
                self.state.trouble.set(sentence_of(error))

        self._runner.submit(Job("Read the campaign", work, done, failed, is_minor=True))

    def _fits(self, facts: CampaignFacts) -> bool:
        choice = self._rig.state.choice.value
        return (choice.name, dict(choice.options)) == (facts.rig.name, dict(facts.rig.options))

    def connect_rig(self) -> None:
        """Connect the rig that the campaign was begun with."""
        facts = self.state.campaign.value
        if facts is not None and not self._is_busy():
            self._rig.connect(facts.rig)

    # One calibration -------------------------------------------------------------------------------

    def run(self, name: str) -> None:
        """Open the wizard of a calibration, which continues where you left it."""
        facts = self._ready()
        if facts is None or not self._take_lock(facts.path):
            return
        title = ABOUT[name].title if name in ABOUT else name
        state = WizardState(name, title)
        state.following = following_of(self.state.rows.value, name)
        state.following_title = ABOUT[state.following].title if state.following in ABOUT else state.following
        wizard = WizardController(
            state,
            facts.path,
            self._rig,
            self._runner,
            self._kinds.recipes,
            lambda: (self._name_when_complete(facts.path), self._store),
        )
        self._wizard = wizard
        self.state.opening.set(title)
        # It has been read by now, and the wizard says it again.
        self.state.outcome.set(LabelState())
        state.closed.connect(lambda _: self._left(state))

        def failed(error: Exception) -> None:
            self._closed()
            self._notifier.tell("error", sentence_of(error))

        wizard.open(lambda: self._opened(state, wizard), failed)

    def _opened(self, state: WizardState, wizard: WizardController) -> None:
        self.wizard_ready.emit((state, wizard))
        # Last: the row says that its wizard opens until that is there.
        self.state.opening.set("")

    def _left(self, state: WizardState) -> None:
        self._closed()
        if state.goes_on:
            self.run(state.following)

    def _closed(self) -> None:
        self._wizard = None
        self.state.opening.set("")
        self._lock.close()
        self.refresh()
        self.library.load()

    def _name_when_complete(self, path: Path) -> str | None:
        """The library's name of the campaign once all its calibrations are accepted; read from disk."""
        return library_name(path) if all(r.state.is_accepted for r in self._kinds.rows(path)) else None

    # Everything ------------------------------------------------------------------------------------

    def run_everything(self) -> None:
        """Run all calibrations in order where the rig places its targets; continues where it stopped."""
        facts, devices = self._ready(), self._rig.state.usable.value
        if facts is None or devices is None:
            return
        if devices.place is None:
            self._notifier.tell("info", CANNOT_PLACE)
            return
        if not self._take_lock(facts.path):
            return
        self._everything.run(facts.path, devices, library_name(facts.path))

    def cancel_everything(self) -> None:
        """Stop at the next safe point; everything captured is kept."""
        self._everything.cancel()

    def take_news(self) -> None:
        """Update how far it is; called by the window's timer."""
        self._everything.take_news()

    def _ended(self, note: str, error: Exception | None, name: str) -> None:
        self._lock.close()
        outcome = LabelState(note, "muted")
        if error is not None:
            self._rig.lose_by(error)
            title, reason = ABOUT[name].title if name in ABOUT else name, sentence_of(error)
            at = f" at {title}" if name and not reason.startswith(title) else ""
            outcome = LabelState(f"Calibrating everything stopped{at}: {reason}", "bad")
            self._notifier.tell("error", outcome.text)
        self.state.outcome.set(outcome)
        # A lost device or a full disk is no matter of the calibration, which goes on afterwards.
        self.state.refused.set(name if isinstance(error, CalibrationError | DecodeError) else "")
        self.refresh()
        self.library.load()

    # The rig so far --------------------------------------------------------------------------------

    def keep(self) -> None:
        """Assemble the rig of everything accepted so far and keep it in the library."""
        facts, devices = self._ready(), self._rig.state.usable.value
        if facts is None or devices is None:
            return

        def work(progress: Progress) -> Products:
            progress.report("assemble the rig", 0, 0)
            campaign = CampaignFolder.open(facts.path)
            recipes = self._kinds.recipes(campaign)
            name = library_name(facts.path)
            rig = calibrated_rig(campaign, devices, name, recipes)
            return write_products(campaign, rig, name, recipes=recipes, library=self._store)

        def done(made: Products) -> None:
            self.state.note.set(products_text(made))
            self.library.load()

        self._runner.submit(Job("Keep the rig", work, done))

    # Obstacles --------------------------------------------------------------------------------------

    def _ready(self) -> CampaignFacts | None:
        """The campaign, when a calibration may run now; otherwise the person is told why not."""
        facts = self.state.campaign.value
        if self._is_busy():
            return None
        trouble = NO_CAMPAIGN if facts is None else self._obstacle()
        if trouble:
            self._notifier.tell("warning", trouble)
            return None
        return facts

    def _obstacle(self) -> str:
        """Why nothing can be calibrated now, empty if it can."""
        facts, devices = self.state.campaign.value, self._rig.state.usable.value
        if facts is None:
            return ""
        if devices is not None and not self._fits(facts):
            mine, known = self._rig.state.choice.value.words, facts.rig.words
            return (
                f"This campaign was begun with the rig {known}, but {mine} is connected. Connect the"
                " campaign's rig, or open another campaign."
            )
        return NO_RIG if devices is None else ""

    def _is_busy(self) -> bool:
        """Whether a calibration runs; then the person is told which."""
        running = "" if self._wizard is None else self._wizard.state.title
        if self._everything.is_running:
            running = "Calibrating everything"
        if running:
            self._notifier.tell("warning", f"{running} is still running. Finish or leave it first.")
        return bool(running)

    def _take_lock(self, path: Path) -> bool:
        user = next((job for job in self._runner.active if job.exclusive == RIG), None)
        if user is not None and not self._rig.gives_way(user):
            self._notifier.tell(
                "warning", f"{user.title} is using the rig. Wait until it ends, or cancel it."
            )
            return False
        try:
            CampaignFolder.open(path)
            self._lock.callback(take_campaign(path).release)
        except DslError as error:
            self._notifier.tell("error", str(error))
            return False
        return True

    def command_line(self, name: str = "") -> str:
        """The command that runs one calibration, or all of them for an empty name.

        A campaign that was begun knows its rig; a new one is told.
        """
        facts = self.state.campaign.value
        verb = name if name == "selftest" else f"calibrate {name or 'all'}"
        folder = "CAMPAIGN" if facts is None else quoted(facts.path)
        rig = self._rig.state.choice.value if facts is None else facts.rig
        return f"dsl-scan {verb} {folder} {rig.command}".rstrip()

    def close(self) -> None:
        """Stop what runs, and following the rig."""
        for stop in self._stops:
            stop()
        if self._wizard is not None:
            self._wizard.leave()
        self.cancel_everything()
        self._lock.close()


def following_of(rows: tuple[Row, ...], name: str) -> str:
    """The calibration after ``name`` that is not accepted yet; empty when there is none."""
    names = [row.name for row in rows]
    later = rows[names.index(name) + 1 :] if name in names else ()
    return next((row.name for row in later if not row.state.is_accepted), "")


def library_name(folder: Path) -> str:
    """The name a campaign's rig gets in the library.

    >>> library_name(Path("a/room 12 & 13"))
    'room 12 - 13'
    """
    return name_from(folder.name) or "campaign"
