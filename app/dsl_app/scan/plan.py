"""The next scan: its plan, target and calibration, what it costs and what prevents it. No Qt."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from dsl_app.connection.state import RigChoice, RigState
from dsl_app.scan.facts import find_facts
from dsl_app.scan.state import (
    OWN_CALIBRATION,
    CalibrationChoice,
    InterruptedScan,
    Phase,
    ScanState,
    same_plan,
)
from dsl_app.shared.jobs.base import Job, JobRunner
from dsl_app.shared.known_files import Kind, kind_of
from dsl_app.shared.notify import Notifier, sentence_of
from dsl_app.shared.undo import Change, UndoStack
from dsl_core.devices.base import DeviceRig
from dsl_core.devices.conditions import check_conditions
from dsl_core.errors import DslError, PlanError
from dsl_core.io.calibration_library import CalibrationLibrary, LibraryEntry
from dsl_core.io.plan_file import save_plan
from dsl_core.io.scan.folder import SUFFIX
from dsl_core.io.scan.origin import rig_notes, rig_of_notes
from dsl_core.model.plan import CapturePlan, GrayCode
from dsl_core.model.presets import PRESETS, on_cycles
from dsl_core.model.rig import Rig
from dsl_core.progress import Progress

KEEPS_ITS_PLAN = (
    "The current scan keeps its plan. Complete it, or click 'Plan a new scan', to change, undo or redo the"
    " plan."
)


class ScanPlanController:
    """Keeps plan, target and calibration of the next scan, and works out what they cost."""

    def __init__(
        self,
        state: ScanState,
        rig: RigState,
        runner: JobRunner,
        notifier: Notifier,
        undo: UndoStack,
        library: CalibrationLibrary,
    ) -> None:
        self.state, self._rig, self._runner, self._notifier = state, rig, runner, notifier
        self._undo, self._library = undo, library
        self._chosen: Rig | None = None
        #: Counts choices of a calibration: when several are being read, the last one wins.
        self._turn = 0
        #: What was chosen during a scan, which keeps its own calibration.
        self._next: CalibrationChoice | None = None
        #: What a person has overridden: a calibration by its key, and how the settings differ from it.
        self._overridden: tuple[str, frozenset[str]] = "", frozenset()
        self._stops = [
            rig.usable.follow(lambda _: self.take_rig()),
            state.phase.changed.connect(self._phase_changed),
            state.then_reconstruct.changed.connect(lambda _: self._what_follows_changed()),
        ]

    # Plan ------------------------------------------------------------------------------------------

    def choose_preset(self, key: str) -> None:
        """Use the plan of a preset."""
        plan = next(preset.plan for preset in PRESETS if preset.key == key)
        self.change_plan(on_cycles(plan, self.state.period_ms.value))

    def change_plan(self, plan: CapturePlan) -> None:
        """Use a plan, adapted to the sizes of the rig; can be undone."""
        old, new, period_ms = self.state.plan.value, self._fitted(plan), self.state.period_ms.value
        if new != old and not self._is_locked():
            self._undo.push(
                Change(
                    "change of plan",
                    lambda: self._set_plan(new, period_ms),
                    lambda: self._set_plan(old, period_ms),
                    lambda: KEEPS_ITS_PLAN if self._is_locked() else "",
                )
            )

    def _set_plan(self, plan: CapturePlan, period_ms: float) -> None:
        """Use a plan made for an LED cycle; another rig may have been connected since."""
        now_ms = self.state.period_ms.value
        fitted = self._fitted(plan)
        self.take_plan(fitted if period_ms == now_ms else on_cycles(fitted, now_ms))
        self.refresh()

    def take_plan(self, plan: CapturePlan) -> None:
        """Make this the current plan; a file that held another plan is forgotten."""
        if not same_plan(plan, self.state.plan.value):
            self.state.plan_file.set(None)
        self.state.plan.set(plan)

    def open_plan(self, path: Path) -> None:
        """Open a plan or a pattern set from a file; undo restores the previous plan."""
        if self._is_locked():
            self._notifier.tell(
                "info", f"The current scan keeps its plan. Open {path.name} when it has finished."
            )
            return
        now = self.state.plan.value

        def done(plan: CapturePlan) -> None:
            self.change_plan(plan)
            # The file stands for the plan only if it is one and nothing had to be adapted to the rig.
            is_same = kind_of(path) is Kind.PLAN and self.state.plan.value == plan
            self.state.plan_file.set(path if is_same else None)

        work = lambda progress: read_plan(path, now)  # noqa: E731
        self._runner.submit(Job(f"Open {path.name}", work, done, is_minor=True))

    def save_plan(self, path: Path) -> None:
        """Save the plan to a file; the file dialog has asked before replacing one."""
        plan = self.state.plan.value

        def done(written: Path) -> None:
            if self.state.plan.value == plan:
                self.state.plan_file.set(written)
            self._notifier.tell("info", f"The plan is saved in {written}.")

        work = lambda progress: save_plan(plan, path, overwrite=True)  # noqa: E731
        self._runner.submit(Job(f"Save {path.name}", work, done, is_minor=True))

    def _is_locked(self) -> bool:
        """Whether a scan has begun, whose plan must not change."""
        return self.state.phase.value.is_busy or self.state.interrupted.value is not None

    def set_target(self, target: Path) -> None:
        """Save the scan there."""
        if not self._is_locked():
            self.state.target.set(
                target if target.suffix == SUFFIX else target.with_name(target.name + SUFFIX)
            )
            self.refresh()

    def refresh(self) -> None:
        """Work out again what the plan costs and what prevents it from starting."""
        state = self.state
        session = state.interrupted.value
        self._withdraw_override()
        facts = find_facts(
            self._devices, state.plan.value, state.target.value, self.calibration, state.override.value,
            state.then_reconstruct.value,
        )  # fmt: skip
        if session is not None:
            is_there = self._devices is not None and was_taken_with(session, self._rig.choice.value)
            connects = not is_there and session.rig_to_open is not None
            needs = () if self._devices or connects else (connect_first(session),)
            facts = replace(facts, obstacles=needs, remarks=(), connects=connects, is_calibrated=True)
        state.facts.set(facts)

    def _what_follows_changed(self) -> None:
        # The name of a scan that runs is its own, and not taken.
        if not self.state.phase.value.is_busy:
            self.refresh()

    def _fitted(self, plan: CapturePlan) -> CapturePlan:
        from dsl_core.pipeline import fit_plan

        return plan if self._devices is None else fit_plan(plan, self._devices)

    @property
    def _devices(self) -> DeviceRig | None:
        return self._rig.usable.value

    def take_rig(self) -> None:
        """Adapt plan and calibration to the connected rig."""
        state, devices = self.state, self._devices
        if devices is not None:
            info = devices.projector.info
            state.period_ms.set(info.frame_period_ms)
            state.longest_ms.set(devices.camera.info.exposure_range_ms[1])
            state.latency_ms.set(info.latency_ms)
            if not self._is_locked():
                self.take_plan(on_cycles(self._fitted(state.plan.value), info.frame_period_ms))
        own = None if devices is None else devices.calibration
        choice = OWN_CALIBRATION if own is None else CalibrationChoice("", own.name, own.provenance.created)
        rest = tuple(each for each in state.calibrations.value if each.key)
        state.calibrations.set((choice, *rest))
        if not state.calibration.value.key:
            state.calibration.set(choice)
        self.refresh()

    # Calibration -----------------------------------------------------------------------------------

    @property
    def calibration(self) -> Rig | None:
        """The calibration to scan with, or None."""
        if self.state.calibration.value.key:
            return self._chosen
        return None if self._devices is None else self._devices.calibration

    def load_library(self) -> None:
        """List the calibrations of the library."""

        def work(progress: Progress) -> tuple[dict[str, LibraryEntry], list[str]]:
            found: dict[str, LibraryEntry] = {}
            troubles: list[str] = []
            for name in self._library.names():
                progress.report("read the library", len(found), 0)
                try:
                    found[name] = self._library.find(name)
                except DslError as error:
                    troubles.append(str(error))
            return found, troubles

        def done(read: tuple[dict[str, LibraryEntry], list[str]]) -> None:
            found, troubles = read
            listed = {name: CalibrationChoice(name, name, entry.stored) for name, entry in found.items()}
            used = self.state.calibration.value
            newer = listed.get(used.key, used)
            if newer != used and not self.state.phase.value.is_busy:
                # Another window, or the command line, has stored it again.
                self._use(newer, found[newer.key].rig)
            elif used.key:
                # What scans use stays in the list: an older version, and one that is gone from the library.
                listed[used.key] = used
            self.state.calibrations.set((self.state.calibrations.value[0], *listed.values()))
            for trouble in troubles:
                self._notifier.tell("warning", trouble)

        self._runner.submit(Job("Read the calibrations", work, done, is_minor=True))

    def choose_calibration(self, choice: CalibrationChoice) -> None:
        """Scan with another calibration; a running scan keeps its own."""
        if self.state.phase.value.is_busy:
            self._choose_later(choice)
            return
        self._turn += 1
        turn = self._turn
        if not choice.key:
            self._chosen = None
            self.state.calibration.set(choice)
            self.refresh()
            return

        def done(entry: LibraryEntry) -> None:
            if turn != self._turn:
                return
            if self.state.phase.value.is_busy:
                self._choose_later(choice)
                return
            used = replace(choice, date=entry.stored)
            listed = {each.key: each for each in self.state.calibrations.value} | {used.key: used}
            self.state.calibrations.set(tuple(listed.values()))
            self._use(used, entry.rig)

        def failed(error: Exception) -> None:
            used = self.state.calibration.value.in_use
            self._notifier.tell("error", f"{sentence_of(error)} {used}")
            if turn == self._turn:
                self.state.refused.emit(choice)

        work = lambda progress: self._library.find(choice.key)  # noqa: E731
        title = f"Open the calibration {choice.key}"
        self._runner.submit(Job(title, work, done, failed, is_minor=True))

    def _use(self, choice: CalibrationChoice, rig: Rig) -> None:
        self._chosen = rig
        self.state.calibration.set(choice)
        self.refresh()

    def _choose_later(self, choice: CalibrationChoice) -> None:
        is_news = choice != self._next and choice.key != self.state.calibration.value.key
        self._next = choice
        if is_news:
            self._notifier.tell(
                "info", f"The running scan keeps its calibration. Later scans use {choice.name}."
            )

    def _phase_changed(self, phase: Phase) -> None:
        if not phase.is_busy and self._next is not None:
            choice, self._next = self._next, None
            self.choose_calibration(choice)

    def set_override(self, on: bool) -> None:
        """Use the calibration although settings differ from it; another one, or others, are not meant."""
        self._overridden = self._differing
        self.state.override.set(on)
        self.refresh()

    @property
    def _differing(self) -> tuple[str, frozenset[str]]:
        """The calibration in use by its key, and how the settings of the devices differ from it."""
        known, devices = self.calibration, self._devices
        clauses = () if known is None or devices is None else check_conditions(known, devices)
        return self.state.calibration.value.key, frozenset(clauses)

    def _withdraw_override(self) -> None:
        """Override nothing that a person has not seen: another rig, other settings or calibration."""
        if not self.state.override.value or self.state.phase.value.is_busy:
            return
        (key, differ), (seen_key, seen) = self._differing, self._overridden
        if differ and (key != seen_key or not differ <= seen):
            self.state.override.set(False)

    def close(self) -> None:
        """Disconnect from the rig's state."""
        for stop in self._stops:
            stop()


def was_taken_with(session: InterruptedScan, choice: RigChoice) -> bool:
    """Whether a scan was captured with this rig and its options; taken for so where the scan names none."""
    if session.rig is None:
        return True
    named = rig_of_notes(rig_notes(choice.name, dict(choice.options)))
    return named == (session.rig.name, dict(session.rig.options))


def connect_first(session: InterruptedScan) -> str:
    """Which rig an interrupted scan needs."""
    which = f" It was captured with {session.rig.words}." if session.rig is not None else ""
    return f"Connect the rig of this scan on the Rig page.{which}"


def read_plan(path: Path, now: CapturePlan) -> CapturePlan:
    """The plan in a file; a pattern set takes the settings of the current plan.

    Raises `PlanError` or `StoreError` that says what is wrong with the file.
    """
    from dsl_core.io.plan_file import load_plan

    if kind_of(path) is not Kind.PATTERNS:
        return load_plan(path)
    from dsl_core.planning.designed import columns_of, load_design

    made = load_design(path)
    width_px = now.projector_size_px[0]
    if made.width_px != width_px:
        raise PlanError(
            f"The patterns of {path.name} are {made.width_px} columns wide, but the projector has {width_px}."
            " Open a pattern set that was designed for this rig."
        )
    return now.model_copy(
        update={
            "name": made.name,
            "code": GrayCode(rows=False),
            "spectral": columns_of(made.array),
            "code_settings": tuple(range(len(now.settings))),
        }
    )
