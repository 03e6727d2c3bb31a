"""What the library's panel decides: list, use, restore, export, import, report, drift check. No Qt."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path

from dsl_app.calibrate.state import CalibrateState, DriftVerdict
from dsl_app.connection.controller import RIG, RigController
from dsl_app.shared.jobs.base import Job, JobRunner
from dsl_app.shared.notify import NO_RIG, Notifier, sentence_of
from dsl_app.shared.paths import is_file
from dsl_core.io.calibration_library import CalibrationLibrary, LibraryEntry, LibraryLine
from dsl_core.progress import Progress

#: A file without this is neither a rig nor an entry of the library.
_MARK = b'"white_scale"'


@dataclass(frozen=True)
class _Differs:
    """Settings that keep a calibration from being checked, as clauses."""

    clauses: tuple[str, ...]


class LibraryController:
    """Acts on the calibrations of this computer; ``key`` is a name, or NAME@STAMP of one version."""

    def __init__(
        self,
        state: CalibrateState,
        rig: RigController,
        runner: JobRunner,
        notifier: Notifier,
        library: CalibrationLibrary,
    ) -> None:
        self._state, self._rig, self._runner, self._notifier = state, rig, runner, notifier
        self._library = library
        #: Count requests: of several that run, the last one wins, whichever ends last.
        self._reads = self._uses = 0
        #: What was said last of the calibration that scans use.
        self._used_note = ""
        state.in_use.changed.connect(lambda _: self._forget_used_note())

    def _forget_used_note(self) -> None:
        """Say no more which calibration scans use once another one was chosen, here or on the Scan page."""
        if self._used_note and self._state.note.value == self._used_note:
            self._state.note.set("")

    def load(self) -> None:
        """List every version of every calibration."""
        self._reads += 1
        read = self._reads

        def work(progress: Progress) -> tuple[LibraryLine, ...]:
            progress.report("read the library", 0, 0)
            return self._library.lines()

        def done(lines: tuple[LibraryLine, ...]) -> None:
            if read == self._reads:
                self._state.library.set(lines)

        self._runner.submit(Job("Read the library", work, done, is_minor=True))

    def use(self, key: str) -> None:
        """Scan with a calibration from now on, if the library still has it."""
        self._uses += 1
        use = self._uses

        def done(_: LibraryEntry) -> None:
            if use != self._uses:
                return
            self._state.in_use.set(key)
            self._used_note = f"Scans use the calibration {key} from now on. Plan one on the Scan page."
            self._state.note.set(self._used_note)

        def failed(error: Exception) -> None:
            self._notifier.tell("error", sentence_of(error))
            self.load()

        work = lambda progress: self._library.find(key)  # noqa: E731
        self._runner.submit(Job(f"Use {key}", work, done, failed, is_minor=True))

    def restore(self, name: str, stamp: str) -> None:
        """Make a version the current one; no version is lost."""

        def done(entry: LibraryEntry) -> None:
            self._state.note.set(f"The current version of {name} is now {entry.stamp}.")
            self.load()

        work = lambda progress: self._library.restore(name, stamp)  # noqa: E731
        self._runner.submit(Job(f"Restore {name}", work, done))

    def export(self, key: str, target: Path, form: str, overwrite: bool) -> None:
        """Export a calibration for another computer or program; ``form`` is entry, rig or published."""

        def work(progress: Progress) -> list[Path]:
            from dsl_core.campaign.products import export_entry

            return export_entry(self._library.find(key), target, form, overwrite)

        def done(files: list[Path]) -> None:
            self._notifier.tell("info", f"Exported to {', '.join(map(str, files))}.")

        self._runner.submit(Job(f"Export {key}", work, done))

    def offer(self, path: Path) -> bool:
        """Import a file if it looks like a calibration; False if it does not."""
        try:
            is_one = path.suffix.lower() == ".json" and is_file(path) and _MARK in path.read_bytes()
        except OSError:
            is_one = False
        if is_one:
            self.import_file(path)
        return is_one

    def import_file(self, path: Path) -> None:
        """Import an exported calibration, or a rig's file."""

        def work(progress: Progress) -> LibraryEntry:
            from dsl_core.campaign.products import import_entry

            return import_entry(path, self._library)

        def done(entry: LibraryEntry) -> None:
            self._state.note.set(f"{entry.name} is in the library, version {entry.stamp}.")
            self.load()

        self._runner.submit(Job(f"Import {path.name}", work, done))

    def report(self, key: str) -> None:
        """Write the report of a calibration and show it."""

        def work(progress: Progress) -> Path:
            from dsl_core.campaign.products import write_calibration_report

            entry = self._library.find(key)
            folder = Path(tempfile.mkdtemp(prefix="dsl-scan-report-"))
            return write_calibration_report(
                folder / f"{entry.name}.html", entry.rig, entry.accepted, entry.history
            )

        self._runner.submit(Job(f"Report on {key}", work, self._state.opened.emit))

    @property
    def must_be_placed(self) -> bool:
        """Whether a person has to place the target of a drift check."""
        devices = self._rig.state.usable.value
        return devices is not None and devices.place is None

    def check(self, key: str, spectralon: bool = True, override: bool = False) -> None:
        """Take one quick shot of a flat target and compare it with a calibration.

        Where camera or projector have other settings than in the calibration, the person is offered to check
        anyway (``override``).
        """
        devices = self._rig.state.usable.value
        if devices is None:
            self._notifier.tell("warning", NO_RIG)
            return

        def work(progress: Progress) -> DriftVerdict | _Differs:
            from dsl_core.campaign.drift_check import PLACEMENT, measure_drift
            from dsl_core.campaign.light_history import keep_check
            from dsl_core.devices.conditions import check_conditions, with_calibration
            from dsl_core.io.campaign_folder import now

            known = self._library.find(key).rig
            found = check_conditions(known, devices)
            if found and not override:
                return _Differs(found)
            own, _ = with_calibration(devices, known, override)
            if own.place is not None:
                own.place(PLACEMENT)
            with tempfile.TemporaryDirectory(prefix="dsl-scan-check-") as spare:
                figures = measure_drift(own, known, Path(spare) / "check.dsl", spectralon, progress)
            kept = not found and keep_check(self._library, key, figures, now())
            return DriftVerdict(key, figures, spectralon, found, kept)

        def done(said: DriftVerdict | _Differs) -> None:
            if isinstance(said, _Differs):
                self._notifier.offer(
                    f"{key} is not for these settings: {'; '.join(said.clauses)}. Set them back or calibrate"
                    " again. Checking anyway shows what the change does.",
                    {"Check anyway": lambda: self.check(key, spectralon, override=True)},
                )
                return
            self._state.note.set(said.sentence)
            self._state.drift.set(said)
            if said.kept:
                self.load()

        def failed(error: Exception) -> None:
            self._rig.lose_by(error)
            self._notifier.tell("error", sentence_of(error))

        self._rig.run(Job(f"Check {key} for drift", work, done, failed, exclusive=RIG))
