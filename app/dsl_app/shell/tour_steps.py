"""What the guided tour says, in its order."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Step:
    """One call-out: the page it stands on, the object name of what it points at, and its words."""

    page: str
    target: str
    title: str
    text: str


STEPS: tuple[Step, ...] = (
    Step(
        "rig",
        "rail",
        "Five pages, in the order of the work",
        "Rig, Calibrate, Scan, Results, Compare. Ctrl+1 to Ctrl+5 open them. Nothing has to be connected: a"
        " simulated rig is there when no hardware is.",
    ),
    Step(
        "rig",
        "live-view",
        "What the camera sees",
        "Start the live view to see raw frames with their histogram. Red cells are saturated; the focus score"
        " rises as edges sharpen. What is shown here never changes what is saved.",
    ),
    Step(
        "scan",
        "scan-plan",
        "What is scanned",
        "Choose a preset, or patterns and exposures of your own. The curve beside it shows what accuracy"
        " costs in time on this rig.",
    ),
    Step(
        "scan",
        "scan-run",
        "Start, pause, go on",
        "Frames, time and disk are known before the start, and what keeps it from starting stands here. Every"
        " frame is safe on disk before the next is taken, so that a scan can be resumed after anything.",
    ),
    Step(
        "results",
        "spectra",
        "Spectra with their uncertainty",
        "The spectrum under the cursor, with its 95 % band; dashed where no light reached and only smoothness"
        " decides. Click the picture to pin one; drop a file of a spectroradiometer to compare.",
    ),
    Step(
        "results",
        "result-pictures",
        "Five views, one cursor",
        "Keys 1 to 5: colours, one band, depth, quality, and the points in space. The cursor is the same in"
        " all of them, and I shows what its pixel saw line by line.",
    ),
    Step(
        "results",
        "menu-bar",
        "Help is where you are",
        "F1 explains what has the focus. File, Show command line gives the command that does the same. Help,"
        " Guided tour shows this again; Help, Demo opens a finished scan.",
    ),
)
