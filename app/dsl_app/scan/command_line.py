"""The command line that does the same as the page, and the names of new scans. No Qt."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime
from pathlib import Path

from dsl_app.connection.state import RigChoice
from dsl_app.shared.known_files import first_free
from dsl_core.io.scan.folder import SUFFIX
from dsl_core.io.scan.origin import rig_of_notes
from dsl_core.model.plan import CapturePlan, LineComb, ScanLines, Sentinels
from dsl_core.model.presets import name_of
from dsl_core.words import quoted


def plan_words(plan: CapturePlan) -> list[str]:
    """Options of ``dsl-scan scan`` that make a plan."""
    code = name_of(plan.code)
    words = [] if code is None else [f"--code {code}"]
    match plan.spectral:
        case ScanLines(width_px=width, step_px=step):
            words.append(f"--lines {width}x{step}")
        case LineComb(width_px=width, step_px=step, period_px=period):
            words.append(f"--comb {width}x{step}x{period}")
    if plan.sentinels is None:
        words.append("--no-sentinels")
    # Enough digits to keep an exposure a whole number of LED cycles.
    words += [f"--setting {setting.exposure_ms:.12g}@{setting.level:g}" for setting in plan.settings]
    return words


def needs_file(plan: CapturePlan) -> bool:
    """Whether a plan cannot be expressed by options of the command line."""
    is_line_set = isinstance(plan.spectral, ScanLines) and not plan.spectral.sparse
    is_comb = isinstance(plan.spectral, LineComb) and not any(plan.spectral.shifts_px)
    usual = plan.sentinels in (None, Sentinels())
    return not (usual and (is_line_set or is_comb)) or plan.code_settings != tuple(range(len(plan.settings)))


def scan_command(
    target: Path,
    rig: str,
    plan: CapturePlan,
    calibration: str,
    override: bool,
    file: Path | None = None,
    meters: bool = False,
) -> str:
    """The command that captures this scan; ``rig`` as in `RigChoice.command`, ``file`` holds the plan.

    ``meters`` says whether the scene is measured first.
    """
    words, first = ["dsl-scan scan", quoted(target), rig], ""
    if file is None and needs_file(plan):
        file, first = (
            Path("plan.json"),
            "# First save the plan as plan.json ('Save plan…').\n",
        )
    words += plan_words(plan) if file is None else [f"--plan {quoted(file)}"]
    if calibration:
        words.append(f"--calibration {quoted(calibration)}")
    if override:
        words.append("--override-calibration")
    if meters:
        words.append("--match-exposure")
    return first + " ".join(words)


def rig_of_scan(notes: Mapping[str, object]) -> tuple[RigChoice | None, bool]:
    """The rig of a scan, None when the scan does not name it, and whether it may be opened unasked."""
    from dsl_core.devices.registry import is_built_in
    from dsl_core.io.scan.origin import is_of_this_computer

    origin = rig_of_notes(notes)
    if origin is None:
        return None, False
    choice = RigChoice(origin[0], tuple(sorted(origin[1].items())))
    return choice, is_built_in(choice.name) or is_of_this_computer(notes)


def named_target(folder: Path, name: str) -> Path:
    """The scan folder with a name that a person typed, with or without its ending."""
    return folder / f"{name.strip().replace('/', '-').removesuffix(SUFFIX)}{SUFFIX}"


def fresh_target(folder: Path, now: datetime) -> Path:
    """A scan folder that does not exist yet, named by date and minute."""
    return first_free(folder, f"scan-{now:%Y%m%d-%H%M}", SUFFIX)
