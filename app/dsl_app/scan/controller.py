"""Start, pause, resume and cancel a scan, and reconstruct it. No Qt."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from datetime import datetime
from pathlib import Path

from dsl_app.connection.controller import RIG, RigController
from dsl_app.connection.state import Link
from dsl_app.scan.command_line import fresh_target, named_target, rig_of_scan, scan_command
from dsl_app.scan.job import ScanJob, ScanRequest
from dsl_app.scan.plan import ScanPlanController
from dsl_app.scan.reconnect import Reconnector
from dsl_app.scan.reconstruction import Reconstructor
from dsl_app.scan.reconstruction_time import Pace
from dsl_app.scan.state import OWN_CALIBRATION, InterruptedScan, Phase, Reconnection, ScanState
from dsl_app.shared.jobs.base import Job, JobRunner, JobState
from dsl_app.shared.known_files import Kind, kind_of
from dsl_app.shared.notify import Notifier, sentence_of
from dsl_app.shared.paths import is_file, there
from dsl_app.shared.undo import UndoStack
from dsl_core.capture.runner import State, Status
from dsl_core.devices.base import DeviceRig
from dsl_core.errors import DslError
from dsl_core.io import MANIFEST_NAME
from dsl_core.io.calibration_library import CalibrationLibrary
from dsl_core.io.scan.origin import rig_notes
from dsl_core.model.plan import CapturePlan
from dsl_core.words import quoted

_PHASES = {State.RUNNING: Phase.RUNNING, State.PAUSED: Phase.PAUSED, State.CANCELLING: Phase.STOPPING}
_AWAY = " Its folder can no longer be read: connect its drive, or open the scan where it is now."
_BUSY = "A scan is running. Wait until it ends, or cancel it; frames captured so far are kept."


class ScanController:
    """Plans and runs one scan at a time; `take_news` copies what happened in the job to the state.

    ``hidden`` is a folder of the program itself, such as the demo's: scans are saved there only on request.
    """

    def __init__(
        self,
        state: ScanState,
        rig: RigController,
        runner: JobRunner,
        notifier: Notifier,
        undo: UndoStack,
        library: CalibrationLibrary | None = None,
        clock: Callable[[], datetime] = datetime.now,
        hidden: Path | None = None,
        pace: Pace | None = None,
    ) -> None:
        self.state, self._rig, self._runner, self._notifier = state, rig, runner, notifier
        self._clock, self._hidden = clock, hidden
        self._reconstructor = Reconstructor(state, runner, notifier, pace or Pace())
        #: The name that a person typed for a scan to come.
        self._name = ""
        #: Where the person saves scans.
        self._folder = state.target.value.parent
        self._stop_following = state.target.changed.connect(self._keep_folder)
        self.plans = ScanPlanController(
            state, rig.state, runner, notifier, undo, library or CalibrationLibrary()
        )
        self._reconnector = Reconnector(state, rig, notifier, self.start)
        self._scan: ScanJob | None = None
        self._job: Job[Status] | None = None
        #: The plan from before an interrupted scan, which has its own, and the file that holds it.
        self._plan_before: tuple[CapturePlan, Path | None] | None = None

    # Run -------------------------------------------------------------------------------------------

    def start(self) -> None:
        """Start the planned scan, or resume the interrupted one."""
        state, devices = self.state, self._rig.state.usable.value
        if state.phase.value.is_busy:
            self._notifier.tell("info", _BUSY)
            return
        self.plans.refresh()
        facts, session = state.facts.value, state.interrupted.value
        if facts is not None and facts.connects and session is not None:
            self._reconnector.open_rig_of(session)
            return
        if devices is None or facts is None or facts.obstacles:
            self._notifier.tell("warning", facts.obstacles[0] if facts is not None else "")
            return
        self._run(devices, state.interrupted.value)

    def _run(self, devices: DeviceRig, session: InterruptedScan | None) -> None:
        state, choice = self.state, self._rig.state.choice.value
        request = ScanRequest(
            devices,
            state.plan.value,
            state.target.value if session is None else session.folder,
            rig_notes(choice.name, dict(choice.options)),
            self.plans.calibration,
            state.override.value,
            is_resumed=session is not None,
            check_drift=state.check_drift.value,
            meters=state.is_metered,
        )
        self._scan = scan = ScanJob(request)
        self._reconnector.forget()
        for text in (state.trouble, state.note):
            text.set("")
        if session is None:
            # Frames and progress of the scan before would pass for this one's until its first frame.
            state.status.set(Status(State.IDLE))
            state.picture.set(None)
            state.graph.set(None)
        state.phase.set(Phase.STARTING)
        self._job = Job(
            f"Scan {request.folder.stem}",
            scan.work,
            self._finished,
            self._failed,
            self._cancelled,
            exclusive=RIG,
            time_left=scan.left_s,
        )
        scan.token = self._job.token
        if not self._rig.run(self._job):
            self._ended(Phase.PLANNING)

    def connect_rig(self) -> None:
        """Connect the rig that is chosen."""
        self._rig.connect(self._rig.state.choice.value)

    def resume(self) -> None:
        """Resume the interrupted scan; a lost rig is reconnected first."""
        if self.state.reconnection.value is Reconnection.NONE or self._rig.state.link.value is Link.OPEN:
            self.start()
        else:
            self._reconnector.try_now()

    def stop_reconnecting(self) -> None:
        """Stop reconnecting a lost rig automatically."""
        self._reconnector.stop()

    def pause(self, on: bool = True) -> None:
        """Wait before the next frame, or continue."""
        if self._is_under_way() and self._scan is not None:
            self._scan.pause(on)

    def cancel(self) -> None:
        """Stop before the next frame, or stop waiting for a lost rig; saved frames are kept."""
        if self.state.reconnection.value.is_trying:
            self._reconnector.stop()
        elif self._is_under_way() and self._job is not None:
            self.state.phase.set(Phase.STOPPING)
            self._job.cancel()

    def _is_under_way(self) -> bool:
        """Whether a scan can be paused or stopped; says so where there is none."""
        is_busy = self.state.phase.value.is_busy
        if not is_busy:
            self._notifier.tell("info", "No scan is running.")
        return is_busy

    def take_news(self) -> None:
        """Copy what the job reported since the last call to the state; called by a timer."""
        self._reconnector.take_news()
        self._reconstructor.take_news()
        scan = self._scan
        if scan is None:
            return
        if self._was_refused():
            self._ended(Phase.PLANNING)
        if exposed := scan.take_exposed():
            self._notifier.tell("info", exposed)
        status, picture = scan.take_news()
        if status is not None:
            before = self.state.status.value
            self.state.status.set(status)
            if status.warning and status.warning != (before.warning if before else ""):
                self._warn(status)
            if status.overexposed and not (before and before.overexposed):
                self._notifier.tell("warning", status.overexposed)
            if self.state.phase.value.is_busy and self.state.phase.value is not Phase.STOPPING:
                self.state.phase.set(_PHASES.get(status.state, self.state.phase.value))
        if picture is not None:
            self.state.picture.set(picture)
            self._draw_graph()

    def _warn(self, status: Status) -> None:
        """Say what moved, and what can be done about it."""
        more = ""
        if status.done < status.total:
            more = " The scan is paused: cancel it, or continue if the frames are to be kept all the same."
        self.state.note.set(status.warning)
        self._notifier.tell("warning", status.warning + more)

    def _was_refused(self) -> bool:
        """Whether the scan waited for what gives way, and then found the rig taken."""
        job = self._job
        if job is None or job.state is not JobState.WAITING or self._rig.waits(job):
            return False
        return job not in self._runner.active

    def point_at(self, pixel: tuple[int, int] | None) -> None:
        """Show the intensity graph of a pixel ``(x, y)``."""
        self.state.cursor.set(pixel)
        self._draw_graph()

    def _draw_graph(self) -> None:
        pixel = self.state.cursor.value
        if self._scan is not None and pixel is not None:
            self.state.graph.set(self._scan.graph(pixel))

    # End -------------------------------------------------------------------------------------------

    def _finished(self, status: Status) -> None:
        folder = self._end(Phase.DONE)
        self.state.finished.set(folder)
        assert self._scan is not None
        lacks_calibration = not self._scan.is_calibrated
        self.state.lacks_calibration.set(lacks_calibration)
        what_next = f" {self._needs_calibration}" if lacks_calibration else ""
        self.state.note.set(f"All {status.total} frames are saved in {folder}.{what_next}")
        if self.state.then_reconstruct.value and not lacks_calibration:
            self.reconstruct(folder)
        self._plan_next()

    @property
    def _needs_calibration(self) -> str:
        """What comes before a scan without calibration can be reconstructed."""
        choose = "press Reconstruct… and choose the calibration of its rig."
        if self.state.has_library:
            return f"They contain no calibration: {choose}"
        return f"They contain no calibration: first calibrate the rig on the Calibrate page, then {choose}"

    def _failed(self, error: Exception) -> None:
        folder = self._end(Phase.LOST)
        is_there = self._offer_to_resume(folder)
        session = self.state.interrupted.value
        safe = ""
        if session is not None:
            safe = f" {session.done} of {session.total} frames are saved in {folder}." if is_there else _AWAY
        story = f"The scan stopped: {sentence_of(error)}{safe}"
        self.state.trouble.set(story)
        if not self.state.is_seen.value:
            # Its page says why and what to do; nobody is told twice.
            show = {"Show the scan": lambda: self.state.wanted.emit(None)}
            self._notifier.offer(f"The scan {folder.name} was interrupted.", show)
        if self._rig.lose_by(error):
            self._reconnector.begin(story)

    def _cancelled(self) -> None:
        self._offer_to_resume(self._end(Phase.STOPPED))

    def _offer_to_resume(self, folder: Path) -> bool:
        """Offer to resume, if the scan can be read; one of which nothing was saved is planned again."""
        is_there = False
        try:
            is_there = self._remember(folder)
            if not is_there:
                self._choose_target()
        except DslError as error:
            self._notifier.tell("error", str(error))
        if not is_there:
            self._count_saved()
        self.plans.refresh()
        return is_there

    def _count_saved(self) -> None:
        """Count what was saved since a scan was resumed that can no longer be read, for when it can again."""
        session, status = self.state.interrupted.value, self.state.status.value
        if session is not None and status.total == session.total:
            self.state.interrupted.set(replace(session, done=max(session.done, status.done)))

    def _end(self, phase: Phase) -> Path:
        assert self._scan is not None
        self.take_news()
        folder = self._scan.request.folder
        self._ended(phase)
        return folder

    def _ended(self, phase: Phase) -> None:
        self._job = None
        self.state.phase.set(phase)

    def _keep_folder(self, target: Path) -> None:
        if target.parent != self._hidden:
            self._folder = target.parent

    def name_scan(self, name: str) -> None:
        """Name the next scan; that stays until there is a scan with this name. An empty one is ignored."""
        if name.strip():
            self._name = name
            self.plans.set_target(named_target(self.state.target.value.parent, name))

    def _choose_target(self) -> None:
        """Name the next scan, in the folder where the person saves scans."""
        typed = named_target(self._folder, self._name)
        is_free = bool(self._name) and not there(typed)
        self.state.target.set(typed if is_free else fresh_target(self._folder, self._clock()))

    def reconstruct(self, session: Path) -> None:
        """Reconstruct a complete scan, save the result next to it and report it."""
        self._reconstructor.start(session)

    def offer_result(self, path: Path, open_result: Callable[[Path], object]) -> None:
        """Tell a person who works on another page that a result is saved."""
        show = {"Open the result": lambda: open_result(path)}
        self._notifier.offer(f"The result {path.stem} is saved.", show)

    # Scans on disk --------------------------------------------------------------------------------------

    def open(self, path: Path) -> bool:
        """Open a plan, or offer to resume an interrupted scan; False for anything else."""
        if kind_of(path) in (Kind.PLAN, Kind.PATTERNS):
            self.plans.open_plan(path)
            return True
        if not is_file(path / MANIFEST_NAME):
            return False
        if self.state.phase.value.is_busy:
            self._notifier.tell("info", _BUSY)
            return True
        try:
            is_taken = self._remember(path)
        except DslError as error:
            self._notifier.tell("error", str(error))
            return True
        if is_taken:
            # Messages about another scan do not apply to this one.
            self._reconnector.forget()
            self.state.trouble.set("")
        return is_taken

    def _remember(self, folder: Path) -> bool:
        """Offer to resume a scan that lacks frames; False when there is nothing to resume."""
        from dsl_core.io.scan.folder import ScanReader

        if not is_file(folder / MANIFEST_NAME):
            return False
        reader = ScanReader(folder)
        missing, total = len(reader.missing()), reader.plan.shot_count
        if not missing:
            return False
        if self.state.interrupted.value is None:
            self._plan_before = self.state.plan.value, self.state.plan_file.value
        self.plans.take_plan(reader.plan)
        self.state.target.set(folder)
        own, rig = reader.calibration, rig_of_scan(reader.manifest.notes)
        name = OWN_CALIBRATION.name if own is None else own.name
        self.state.interrupted.set(InterruptedScan(folder, total - missing, total, *rig, name))
        self.plans.refresh()
        return True

    def plan_new_scan(self) -> None:
        """Plan a new scan; the interrupted one stays on disk."""
        if self.state.phase.value.is_busy:
            return
        self._reconnector.forget()
        self.state.phase.set(Phase.PLANNING)
        self.state.trouble.set("")
        self.state.note.set("")
        self._plan_next()

    def _plan_next(self) -> None:
        """Leave a scan that is complete or interrupted, whose plan makes way for the one from before it."""
        self.state.interrupted.set(None)
        self.state.check_drift.set(True)
        self._choose_target()
        before, self._plan_before = self._plan_before, None
        if before is None:
            self.plans.refresh()
            return
        self.state.plan.set(before[0])
        self.state.plan_file.set(before[1])
        # Another rig may have been connected since.
        self.plans.take_rig()

    def command_line(self) -> str:
        """The command that captures or resumes this scan."""
        state = self.state
        if state.interrupted.value is not None:
            skip = "" if state.check_drift.value else " --no-drift-check"
            return f"dsl-scan resume {quoted(state.interrupted.value.folder)}{skip}"
        rig = self._rig.state.choice.value.command
        return scan_command(
            state.target.value,
            rig,
            state.plan.value,
            state.calibration.value.key,
            state.override.value,
            state.plan_file.value,
            state.is_metered,
        )

    def close(self) -> None:
        """Disconnect from the rig's state."""
        self._stop_following()
        self._reconstructor.close()
        self._reconnector.close()
        self.plans.close()
