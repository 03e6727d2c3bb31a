"""When a picture that was shown is really there: black and light in turn, with shrinking waits."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.selftest.readings import Readings
from dsl_core.errors import DeviceError
from dsl_core.model.calibration.selftest import LatencyCheck, Measured

#: A frame shows the new picture when its light is that of the picture to this share.
TOLERANCE = 0.03
#: ``since_show`` from which a frame certainly shows the new picture.
REFERENCE = 2
#: Light that creeps changes from each picture of one pattern to the next by at least this share of it, and
#: by this share of its largest step; what is late changes once.
LEAST_CREEP, STEADILY = 0.005, 0.5


def is_right(readings: Readings) -> NDArray[np.bool_]:
    """Whether each frame shows its own picture all the time; raises `DeviceError` if none ever changes."""
    sure = readings.since_show >= REFERENCE
    lit = readings.drive.max(1) > 0
    light = readings.mean_dn.sum(1)
    black, white = light[sure & ~lit].mean(), light[sure & lit].mean()
    if white - black < 5.0:
        raise DeviceError(
            "After a second, black and white still look the same to the camera, so the projector does not"
            " respond. Check its cable, its input and that nothing covers it."
        )
    shown = (light - black) / (white - black)
    return np.asarray(np.abs(shown - lit) < TOLERANCE)


def check_latency(readings: Readings, claimed_ms: float, has_times: bool, show_s: float) -> LatencyCheck:
    """Blocking time of ``show`` and the shortest safe wait after it.

    Rows are trials of two frames each: ``since_show`` 0 after the wait ``gap_ms``, then 1 at once. ``show_s``
    is what the clock of the computer says of ``show``, for cameras without time stamps. Raises `DeviceError`
    when even the longest wait was too short, or where light that creeps looks like it.
    """
    right = is_right(readings)
    judged, asked, stale = trials(readings, right)
    failed = asked[~right[judged]]
    longest = asked.max()
    if len(failed) and failed.max() >= longest:
        creep = _creep(readings)
        if creep:
            raise DeviceError(
                f"The light changes by {creep:+.1%} from picture to picture of one pattern, so"
                " that nobody can tell when a new one is visible. Switch off automatic exposure, gain and"
                " white balance of the camera, and let the projector warm up."
            )
        raise DeviceError(
            f"A new picture is not always visible {longest:g} ms after it was shown. Raise the"
            " latency in the projector's driver, and check that nothing else draws on its screen, and that"
            " automatic exposure and gain of the camera are off."
        )
    worst = float(failed.max()) if len(failed) else 0.0
    wait = float(asked[asked > worst].min()) if len(failed) else 0.0
    resolution = TOLERANCE * float(readings.exposure_ms.mean())
    return LatencyCheck(
        blocking_ms=_blocking(readings) if has_times else Measured(value=1000 * show_s, std=1.0),
        wait_ms=Measured(value=wait, std=float(np.hypot((wait - worst) / np.sqrt(12), resolution))),
        claimed_ms=claimed_ms,
        stale_frames=stale,
        checked=int((readings.since_show == 0).sum()),
    )


def _creep(readings: Readings) -> float:
    """Change of light from one picture of the reference to the next, as a share; 0 if it is not steady."""
    lit = readings.drive.max(1) > 0
    sure = int(np.flatnonzero((readings.since_show >= REFERENCE) & lit).max())
    light = readings.mean_dn.sum(1)
    black = light[(readings.since_show >= REFERENCE) & ~lit].mean()
    steps = np.diff(light[sure - REFERENCE : sure + 1]) / (light[sure] - black)
    least, most = np.abs(steps).min(), np.abs(steps).max()
    is_steady = least > max(LEAST_CREEP, STEADILY * most) and (steps[0] > 0) == (steps[-1] > 0)
    return float(steps.mean()) if is_steady else 0.0


def first_failing(readings: Readings, right: NDArray[np.bool_]) -> float | None:
    """The longest wait that was too short at least once, ms; None when none was."""
    judged, asked, _ = trials(readings, right)
    failed = asked[~right[judged]]
    return float(failed.max()) if len(failed) else None


def trials(
    readings: Readings, right: NDArray[np.bool_]
) -> tuple[NDArray[np.int64], NDArray[np.float64], int]:
    """Rows that are judged, the wait before each, and how many stale frames there were.

    A frame is stale when it shows the picture before even after the longest wait and the next does not; that
    says nothing of the wait, so it is not judged.
    """
    # The reference pictures come first and are not trials.
    trial = np.arange(len(readings)) > np.flatnonzero(readings.since_show >= REFERENCE).max()
    first = np.flatnonzero(trial & (readings.since_show == 0))
    is_long = readings.gap_ms[first] == readings.gap_ms[first].max()
    is_stale = is_long & ~right[first] & right[first + 1]
    # When all are late at the longest wait, it is the wait.
    is_stale &= not is_stale[is_long].all()
    return first[~is_stale], readings.gap_ms[first[~is_stale]], int(is_stale.sum())


def _blocking(readings: Readings) -> Measured:
    """Time between frames across a ``show``, less exposure, wait, and what the camera itself takes."""
    step_ms = np.diff(readings.timestamp_s) * 1000 - readings.exposure_ms[1:] - readings.gap_ms[1:]
    second = readings.since_show[1:] == 1
    across = readings.since_show[1:] == 0
    across[: np.flatnonzero(readings.since_show >= REFERENCE).max()] = False
    own = np.median(step_ms[second])
    values = step_ms[across] - own
    return Measured(value=max(float(np.median(values)), 0.0), std=float(values.std() / np.sqrt(len(values))))
