"""Doing a plan: one small state machine around one loop.

Shots are captured in order and pushed to a sink. Pausing and cancelling act between shots. Whatever
happens, the projector is dark at the end and every saved frame is kept.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum

from dsl_core.capture.again import Again
from dsl_core.capture.diagnosis import Diagnosis
from dsl_core.capture.exposure import PatternImage, RetryPolicy, ShotTaker
from dsl_core.capture.overexposure import ExposureWatch
from dsl_core.capture.preflight import require_possible
from dsl_core.capture.proof.verifier import FrameProof
from dsl_core.capture.proven.shots import ProvenShots
from dsl_core.capture.put_back import ADVICE, PutBack
from dsl_core.capture.sentinels import SensorWatch, SentinelWatch
from dsl_core.devices.base import DeviceRig
from dsl_core.errors import Cancelled, DriftError, DslError, StoreError
from dsl_core.model.frames import FrameSink, FrameSource
from dsl_core.model.plan import CapturePlan, Shot, describe_shot
from dsl_core.progress import CancelToken, NoProgress, Progress


class State(StrEnum):
    """The state of a scan; the last three are final."""

    IDLE = "idle"
    CHECKING = "checking"
    RUNNING = "running"
    PAUSED = "paused"
    CANCELLING = "cancelling"
    FINISHED = "finished"
    CANCELLED = "cancelled"
    FAILED = "failed"

    @property
    def is_final(self) -> bool:
        """Whether nothing more will happen."""
        return self in (State.FINISHED, State.CANCELLED, State.FAILED)


@dataclass(frozen=True)
class Status:
    """A moment of a scan; ``done`` counts saved frames, the ``earlier`` ones of runs before included.

    ``elapsed_s`` is the time this run has spent, pauses left out; ``remaining_s`` is estimated from it.
    ``corrected`` counts shots that were taken again because a picture did not show their pattern,
    ``warning`` says what moved meanwhile, and ``overexposed`` how much is.
    """

    state: State
    shot: Shot | None = None
    done: int = 0
    total: int = 0
    elapsed_s: float = 0.0
    remaining_s: float = 0.0
    message: str = ""
    corrected: int = 0
    warning: str = ""
    overexposed: str = ""
    earlier: int = 0


Listener = Callable[[Status], None]
_log = logging.getLogger(__name__)
#: So often a scan is completed after it was read back; a disk that loses frames again does not keep any.
_COMPLETIONS = 2
#: So often in a run, what moved may be put back; a rig that never keeps still does not scan for ever.
_PUT_BACKS = 5


class Runner:
    """Runs a plan once; everything but `run` may be called from other threads.

    The runner owns neither the rig nor the sink: whoever opened them closes them.
    """

    def __init__(
        self,
        rig: DeviceRig,
        plan: CapturePlan,
        sink: FrameSink,
        pattern_image: PatternImage,
        *,
        policy: RetryPolicy | None = None,
        proof: FrameProof | None = None,
        stored: FrameSource | None = None,
        progress: Progress | None = None,
        token: CancelToken | None = None,
        clock: Callable[[], float] = time.monotonic,
        sentinels: SentinelWatch | None = None,
        exposure: ExposureWatch | None = None,
        waits: bool = False,
        is_proven: bool = False,
        again: Again = Again.SCAN,
    ) -> None:
        """Keep the parts; ``clock`` gives seconds and only serves the estimate of the remaining time.

        With ``proof`` every picture is judged, and taken again if it does not show its pattern; ``stored``
        has the frames of earlier runs, from which it learns. When ``sentinels``, which see the frames of the
        sink, find that something moved, the scan pauses if it ``waits``, and ends otherwise. ``exposure``
        sees them, too; what it finds is only told. What is stored ``is_proven`` when a run before this one
        has kept what all of its frames show. Errors advise ``again``.
        """
        self._rig = rig
        self._plan = plan
        self._sink = sink
        self._token = token or CancelToken()
        self._taker = ShotTaker(rig, plan, pattern_image, policy or RetryPolicy(), self._token, again=again)
        camera, sensor = rig.camera.info, rig.calibration.sensor if rig.calibration else None
        diagnosis = Diagnosis(plan, SensorWatch(plan, sensor, camera.bit_depth, camera.bayer))
        self._shots = ProvenShots(self._taker, proof, diagnosis, sink, self._token, rig.only_repeats, again)
        self._stored = stored
        if stored is not None:
            missing = {shot.index for shot in sink.missing()}
            for shot in stored.plan.shots():
                if shot.index not in missing:
                    self._taker.assume(shot)
        self._progress = progress or NoProgress()
        self._pace = _Pace(clock, rig.projector.info.latency_ms)
        self._exposure, self._waits, self._is_proven = exposure, waits, is_proven
        self._place = PutBack(plan, sentinels, lambda shot: self._taker.take(shot).seen, sink)
        self._status = Status(State.IDLE, total=plan.shot_count)
        self._listeners: list[Listener] = []
        self._condition = threading.Condition()
        self._pause_requested = False
        self._put_backs = 0
        self._again = again

    @property
    def status(self) -> Status:
        """The latest status."""
        return self._status

    def listen(self, listener: Listener) -> None:
        """Call ``listener`` with every new status, on the thread of `run`; what it raises is only logged."""
        self._listeners.append(listener)

    def pause(self) -> None:
        """Stop before the next shot until `resume` or `cancel`."""
        with self._condition:
            self._pause_requested = True

    def resume(self) -> None:
        """Continue after `pause`."""
        with self._condition:
            self._pause_requested = False
            self._condition.notify_all()

    def cancel(self) -> None:
        """End before the next shot; saved frames are kept."""
        self._token.cancel()
        with self._condition:
            self._condition.notify_all()

    def run(self) -> Status:
        """Take every missing shot, read all of them back, and return the final status.

        Raises `PlanError` when the plan is impossible on the rig, `DeviceError` when a shot cannot be taken,
        `StoreError` when it cannot be saved, `Cancelled` when someone requested the end.
        """
        if self._status.state is not State.IDLE:
            raise RuntimeError("a runner runs once; make a new one to continue with the same sink")
        try:
            self._set(State.CHECKING)
            require_possible(self._rig, self._plan)
            self._require_place(list(self._sink.missing()))
            missing = list(self._sink.missing())
            earlier = self._plan.shot_count - len(missing)
            self._status = replace(self._status, done=earlier, earlier=earlier)
            is_proven = self._is_proven and not missing
            if self._stored is not None:
                self._shots.learn(self._stored, self._plan, {shot.index for shot in missing})
            self._take_all(missing)
            # Later pictures may have cast doubt on earlier ones.
            self._take_all(list(self._sink.missing()))
            self._shots.conclude(is_proven)
            self._complete()
        except (Cancelled, KeyboardInterrupt) as error:
            self._end(
                State.CANCELLED,
                str(error) or f"Interrupted; saved frames are kept. {self._again.sentence}",
            )
            raise
        except DslError as error:
            self._end(State.FAILED, str(error))
            raise
        except BaseException as error:
            self._end(State.FAILED, f"{type(error).__name__}: {error}")
            raise
        self._end(
            State.FINISHED, f"All {self._plan.shot_count} frames are saved.{self._shots.note}{self._note}"
        )
        return self._status

    @property
    def _note(self) -> str:
        return f" {self._status.warning}" if self._status.warning else ""

    def _take_all(self, missing: list[Shot]) -> None:
        done = self._plan.shot_count - len(missing)
        self._pace.start(missing)
        last = max((shot.index for shot in missing if shot.role != "sentinel"), default=-1)
        for shot in missing:
            if self._between_shots(shot, done) and self._is_back():
                return self._take_all(list(self._sink.missing()))
            self._set(State.RUNNING, shot=shot, done=done)
            self._shots.take(shot)
            self._pace.passed(shot)
            done += 1
            self._set(State.RUNNING, shot=shot, done=done, corrected=self._shots.corrected)
            self._report(done)
            self._heed(only_sentinels_left=shot.index >= last)

    def _heed(self, only_sentinels_left: bool) -> None:
        """Pause or end when something has moved; a scan that has all it needs ends as usual."""
        if self._exposure is not None and self._exposure.found and not self._status.overexposed:
            _log.warning("%s", self._exposure.found)
            self._set(State.RUNNING, overexposed=self._exposure.found)
        moved = self._place.moved
        if moved is None or self._status.warning:
            return
        if only_sentinels_left:
            self._set(State.RUNNING, warning=f"{moved.sentence} {moved.advice}")
            return
        if not self._waits:
            raise DriftError(f"{moved.sentence} {self._put_it_back}")
        self._set(State.RUNNING, warning=f"{moved.sentence} {ADVICE} {self._again.then}")
        self.pause()

    def _require_place(self, missing: list[Shot]) -> None:
        """See that what moved in an earlier run is back; raises `DriftError` if not while frames lack."""
        moved, away = self._place.moved, self._place.still_away()
        if moved is None:
            return
        if away is None:
            _log.warning(
                "%s It is back in its place; what was captured since is captured again.", moved.sentence
            )
        elif missing:
            raise DriftError(
                f"{moved.sentence} Not all is back in its place: {away.sentence} {self._put_it_back}"
            )
        else:
            self._set(State.CHECKING, warning=f"{moved.sentence} {moved.advice}")

    @property
    def _put_it_back(self) -> str:
        """What to do about a motion that ended a run."""
        again = f"{self._again.then} What was captured since then is captured again."
        return f"{ADVICE} {again} {self._again.unchecked}".rstrip()

    def _is_back(self) -> bool:
        """Whether what moved was put back during a pause, so that all since then is captured again."""
        moved = self._place.moved
        if moved is None:
            return False
        is_back = self._put_backs < _PUT_BACKS and self._place.still_away() is None
        self._put_backs += is_back
        self._set(State.RUNNING, warning="" if is_back else f"{moved.sentence} {moved.advice}")
        return is_back

    def _complete(self) -> None:
        """Read everything back and take again what is not there, so that a finished scan is a whole one."""
        for _ in range(_COMPLETIONS):
            lost = self._sink.read_back()
            if not lost:
                return
            _log.warning(
                "%d of %d frames were lost or damaged on the disk after they were saved; they are taken"
                " again. The first is %s.",
                len(lost),
                self._plan.shot_count,
                describe_shot(lost[0]),
            )
            self._take_all(lost)
        if lost := self._sink.read_back():
            raise StoreError(
                f"{len(lost)} of {self._plan.shot_count} frames are lost or damaged whenever they are read"
                f" back, the first is {describe_shot(lost[0])}. Check the drive, and that no other program"
                f" changes the folder. {self._again.then}"
            )

    def _between_shots(self, shot: Shot, done: int) -> bool:
        """Wait while paused, and say whether that was so; raise `Cancelled` once that was requested."""
        was_paused = self._must_wait()
        if was_paused:
            self._pace.hold()
            self._set(State.PAUSED, shot=shot, done=done)
            with self._condition:
                # A token may be cancelled elsewhere without notifying, hence the time-out.
                while self._must_wait():
                    self._condition.wait(0.1)
            self._pace.restart()
        if self._token.is_cancelled:
            self._set(State.CANCELLING, shot=shot, done=done)
            raise Cancelled(
                f"Cancelled after {done} of {self._plan.shot_count} frames; they are saved."
                f" {self._again.sentence}"
            )
        return was_paused

    def _must_wait(self) -> bool:
        return self._pause_requested and not self._token.is_cancelled

    def _report(self, done: int) -> None:
        try:
            self._progress.report("scan", done, self._plan.shot_count)
        except Cancelled:
            self._token.cancel()  # a finished scan ends as finished; otherwise the next boundary ends it
        except Exception:
            _log.exception("the progress display failed; the scan continues")

    def _set(self, state: State, **changes: object) -> None:
        elapsed_s, remaining_s = self._pace.times()
        self._status = replace(
            self._status,
            state=state,
            elapsed_s=elapsed_s,
            remaining_s=remaining_s,
            **changes,  # type: ignore[arg-type]
        )
        for listener in tuple(self._listeners):
            try:
                listener(self._status)
            except Exception:
                _log.exception("a listener failed; the scan continues")

    def _end(self, state: State, message: str) -> None:
        """Leave the projector dark and say how it ended; a failing projector does not hide the reason."""
        try:
            self._taker.show_black()
        except Exception as error:
            _log.warning("the projector could not be turned dark: %s", error)
            message += f" The projector could not be turned dark ({error})"
        finally:  # also when a second Ctrl-C comes just now
            self._set(state, message=message)


class _Pace:
    """Time spent running, and an estimate of what is left, weighted by exposure."""

    def __init__(self, clock: Callable[[], float], latency_ms: float) -> None:
        self._clock = clock
        self._latency_ms = latency_ms
        self._spent_s = 0.0
        self._since_s: float | None = None
        self._cost_done_s = 0.0
        self._cost_left_s = 0.0

    def start(self, missing: list[Shot]) -> None:
        self._cost_left_s = sum(map(self._cost_s, missing))
        self._spent_s = self.times()[0]
        self._since_s = self._clock()

    def passed(self, shot: Shot) -> None:
        self._cost_done_s += self._cost_s(shot)
        self._cost_left_s -= self._cost_s(shot)

    def hold(self) -> None:
        self._spent_s = self.times()[0]
        self._since_s = None

    def restart(self) -> None:
        self._since_s = self._clock()

    def times(self) -> tuple[float, float]:
        """Seconds spent running, and seconds left at the pace so far."""
        running_s = 0.0 if self._since_s is None else self._clock() - self._since_s
        elapsed_s = self._spent_s + running_s
        pace = elapsed_s / self._cost_done_s if self._cost_done_s > 0 else 1.0
        return elapsed_s, round(pace * max(self._cost_left_s, 0.0), 3)

    def _cost_s(self, shot: Shot) -> float:
        return (shot.exposure_ms + self._latency_ms) / 1000.0
