"""What goes wrong when people calibrate: how it is made in a calibrated campaign, and what is told."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from dsl_core.campaign.recipes import campaign_recipes
from dsl_core.campaign.session import CalibrationSession
from dsl_core.devices.registry import open_rig
from dsl_core.io.campaign_folder import CampaignFolder
from tests.cases.tiny_campaign import Ending, contents, give, with_options

Prepare = Callable[[Path], None]
#: Positions of the plane without filter, and steps of the filters.
PLANES = ("position-620", "position-740", "position-850")
THROUGH = tuple(f"filter-{nm}" for nm in range(450, 651, 50))
FILTERED = tuple(f"{plane}-filter-{nm}" for plane in PLANES for nm in (450, 640))


@dataclass(frozen=True)
class BadInput:
    """One mishap.

    ``command`` follows ``dsl-scan calibrate`` (its campaign put behind the first word); the twin has the
    options ``mishap``, and ``prepare`` changes the campaign before. ``told`` must be found in what the
    command says, and names the step, the picture or the file. ``code`` is how it ends. Only files below
    ``touched`` may differ afterwards. One that is not ``quick`` is left to the table.
    """

    name: str
    detected_at: str
    command: tuple[str, ...]
    told: str
    mishap: dict[str, str] = field(default_factory=dict)
    prepare: Prepare | None = None
    code: int = 2
    touched: tuple[str, ...] = ()
    quick: bool = True


@dataclass(frozen=True)
class Told:
    """How a case ended: the exit code, the line that tells, and files that changed though they must not."""

    code: int
    message: str
    changed: tuple[str, ...]


def run_case(case: BadInput, calibrated: Path, folder: Path) -> Told:
    """Let a mishap happen to a copy of a calibrated campaign."""
    # Links are enough: whatever is written replaces files, and the lock is left out.
    shutil.copytree(calibrated, folder, copy_function=os.link, ignore=shutil.ignore_patterns("lock"))
    if case.prepare is not None:
        case.prepare(folder)
    if case.mishap:
        with_options(folder, case.mishap)
    before = contents(folder)
    name, *rest = case.command
    ending = give("calibrate", name, str(folder), *rest, "--yes")
    after = contents(folder)
    changed = [path for path, content in before.items() if after.get(path) != content]
    return Told(ending.code, _message(ending), tuple(p for p in changed if not _may_change(case, p)))


def _message(ending: Ending) -> str:
    """The sentence of a failure; otherwise all that was said."""
    lines = ending.err.strip().splitlines() if ending.code else ending.out.strip().splitlines()
    return lines[-1] if ending.code and lines else "\n".join(lines)


def _may_change(case: BadInput, path: str) -> bool:
    own = ("campaign.json", "lock", "candidates", "history", *case.touched)
    return any(path == each or path.startswith(f"{each}/") for each in own)


def _redo(name: str, *steps: str) -> tuple[str, ...]:
    return (name, *(f"--redo={step}" for step in steps))


def _depth_stage(*steps: str) -> tuple[str, ...]:
    """Folders of steps that are captured anew, because only the fit can tell."""
    return tuple(f"depth-stage/{step}" for step in steps)


def _misprinted(folder: Path) -> None:
    """The squares are taken for 4 % larger than they are; the geometry alone cannot tell."""
    board = ("--board=7x5", "--square-mm=31.2")
    ending = give("calibrate", "geometry", str(folder), *board, "--yes")
    assert ending.code == 0, ending.err


def _yellowed(folder: Path) -> None:
    """The Spectralon reflects 5 % less blue than its curve says; nothing before the chart can tell."""
    file = folder / "certificate.csv"
    rows = [f"{nm};{0.99 * (1 + 0.05 * min(max((560 - nm) / 130, 0), 1)):.6g}" for nm in range(380, 781, 10)]
    file.write_text("\n".join(["nm;reflectance", *rows]), encoding="utf-8")
    campaign = CampaignFolder.open(folder)
    campaign.with_settings("spectralon", {"reflectance_file": str(file)}).save()
    ending = give("calibrate", "spectralon", str(folder), "--yes")
    assert ending.code == 0, ending.err


def _spectra(header: str, last_nm: float = 780.0) -> Prepare:
    """Files of five spectra beside the campaign, under a header and up to a wavelength."""

    def prepare(folder: Path) -> None:
        files = folder / "files"
        files.mkdir()
        for colour, centre in {"red": 630, "green": 530, "blue": 455, "white": 550, "black": 550}.items():
            nm = np.arange(400.0, last_nm + 1)
            rows = [f"{x:g};{np.exp(-0.5 * ((x - centre) / 12) ** 2):.6g}" for x in nm]
            (files / f"{colour}.csv").write_text("\n".join([header, *rows]), encoding="utf-8")
        campaign = CampaignFolder.open(folder)
        campaign.with_settings("spectralon", {"emission_folder": str(files)}).save()

    return prepare


def _pose_of_another_rig(folder: Path) -> None:
    """Pose 2 comes from the campaign of another rig."""
    other = folder.with_name("other")
    mine = CampaignFolder.open(folder).info
    campaign = CampaignFolder.begin(other, mine.rig, {**mine.options, "truth": "5"}, mine.settings)
    recipes = campaign_recipes(campaign)
    with open_rig(campaign.info.rig, campaign.info.options) as devices:
        session = CalibrationSession(recipes[1], devices, campaign, recipes)
        step = session.steps[1]
        session.place(step)
        session.capture(step)
    shutil.rmtree(folder / "geometry" / step.key)
    shutil.move(other / "geometry" / step.key, folder / "geometry" / step.key)


CASES = (
    BadInput(
        "board half out of view",
        "look at pose 2",
        _redo("geometry", "pose-02"),
        r"board of 7 x 5 inner corners was not found in the test shot of Pose 2 .* whole board is in view",
        {"board_shift_mm": "160"},
    ),
    BadInput(
        "blurred pose",
        "look at pose 2",
        _redo("geometry", "pose-02"),
        r"'Pose 2' does not look right: blur of edges \d.* Focus the camera",
        {"defocus_px": "2.5"},
    ),
    BadInput(
        "saturated pose",
        "look at pose 2",
        _redo("geometry", "pose-02"),
        r"'Pose 2' does not look right: white pictures saturated .* dim the projector",
        {"brightness": "60"},
    ),
    BadInput(
        "printed size wrong, by a quarter",
        "fit of geometry",
        ("geometry", "--board=7x5", "--square-mm=24"),
        r"Geometry was not accepted: .* the printed squares are probably \d+\.\d mm, not 24 mm",
    ),
    BadInput(
        "printed size wrong, by 4 %",
        "fit of the depth stage",
        ("depth-stage",),
        r"planes are 1\.0\d+ times as far apart .* 620, 740, 850 mm.* printed size of the board",
        prepare=_misprinted,
    ),
    BadInput(
        "pose of another rig among these",
        "geometry, before anything is captured",
        ("geometry",),
        r"Pose 2 is captured again: .* the camera's serial number was TWIN-C5 and is TWIN-C4",
        prepare=_pose_of_another_rig,
        code=0,
        touched=("geometry", "geometry.json"),
    ),
    BadInput(
        "another rig is connected",
        "depth stage, before anything is captured",
        _redo("depth-stage", "position-740"),
        r"calibration selftest was captured with other devices .* TWIN-C4 and is TWIN-C5",
        {"truth": "5"},
    ),
    BadInput(
        "spectra in counts",
        "reading the spectra",
        _redo("spectralon", "emission"),
        r"red\.csv contains counts, not a spectral radiance",
        prepare=_spectra("nm;counts"),
    ),
    BadInput(
        "spectra in micrometres",
        "reading the spectra",
        _redo("spectralon", "emission"),
        r"red\.csv: the wavelengths, 400 to 780, are not micrometres",
        prepare=_spectra("wavelength (µm);W/(sr m2 nm)"),
    ),
    BadInput(
        "spectra of another range",
        "reading the spectra",
        _redo("spectralon", "emission"),
        r"red\.csv covers 400 to 640 nm; 430 to 660 nm are needed",
        prepare=_spectra("nm;W/(sr m2 nm)", last_nm=640.0),
    ),
    BadInput(
        "Spectralon not flat",
        "figures of the Spectralon",
        _redo("spectralon", "pictures"),
        r"Spectralon was not accepted: bulge of the Spectralon over 300 mm [12]\.\d+ ± 0\.\d+ mm",
        {"bow_mm": "2"},
        touched=("spectralon/pictures",),
    ),
    BadInput(
        "Spectralon yellower than stated",
        "figures of the Color Checker",
        ("color-checker",),
        r"Color Checker was not accepted: colour of the light on the chart against the Spectralon [34]\.",
        prepare=_yellowed,
    ),
    BadInput(
        "target at the filters not flat",
        "figures of the bandpass filters",
        _redo("bandpass", "plane", *THROUGH),
        r"Bandpass filters was not accepted: .*bulge of the target over 300 mm [45]\.\d+ ± 0\.\d+ mm",
        {"bow_mm": "5"},
        touched=("bandpass/plane", *(f"bandpass/{step}" for step in THROUGH)),
        quick=False,
    ),
    BadInput(
        "checker upside down",
        "look at the Color Checker (used as it is)",
        _redo("color-checker", "chart"),
        r"Color Checker: patches found 24.*, chart upside down 180(\.0)? degrees",
        {"chart_roll_deg": "180"},
        code=0,
        touched=("color-checker", "color-checker.json"),
    ),
    BadInput(
        "checker missing",
        "look at the Color Checker",
        _redo("color-checker", "chart"),
        r"No Color Checker was found in the test shot of Color Checker",
        {"target_missing": "on"},
    ),
    BadInput(
        "wrong filter",
        "look through the filter",
        _redo("bandpass", "filter-450"),
        r"'Filter of 450 nm' does not look right: filter by its colours .* nm from the one requested",
        {"wrong_filter_nm": "600"},
    ),
    BadInput(
        "neighbouring filter",
        "fit of the depth stage",
        _redo("depth-stage", "position-740-filter-450"),
        r"Position 740 mm, filter of 450 nm: the first orders are .* about \+(9|10)\.\d nm off",
        {"wrong_filter_nm": "460"},
        touched=_depth_stage("position-740-filter-450"),
    ),
    BadInput(
        "tilted filter",
        "fit of the depth stage",
        _redo("depth-stage", "position-740-filter-640"),
        r"Position 740 mm, filter of 640 nm: .* about -\d\.\d nm off. .* not tilted",
        {"filter_tilt_deg": "12"},
        touched=_depth_stage("position-740-filter-640"),
    ),
    BadInput(
        "all filters tilted alike",
        "figures of the depth stage",
        (*_redo("depth-stage", *FILTERED), "--set=chain=true"),
        r"Depth stage was not accepted: .*filters against the LEDs' spectra, at 550 nm -[12]\.\d+ ± \d",
        {"filter_tilt_deg": "10"},
        touched=_depth_stage(*FILTERED),
        quick=False,
    ),
    BadInput(
        "all filters off alike",
        "figures of the bandpass filters",
        _redo("bandpass", *THROUGH),
        r"Bandpass filters was not accepted: .*all filters against the LEDs' spectra (5\.9|6\.\d)\d* ± 0\.",
        {"filter_off_nm": "6"},
        touched=tuple(f"bandpass/{step}" for step in THROUGH),
        quick=False,
    ),
    BadInput(
        "plane not flat at one position",
        "capture of the plane",
        _redo("depth-stage", "position-740"),
        r"position 740 mm scatter by 0\.\d+ px about a plane, those captured before by 0\.\d+ px: the target",
        {"bow_mm": "5"},
        touched=_depth_stage("position-740"),
    ),
    BadInput(
        "plane not flat at every position",
        "fit of the depth stage",
        _redo("depth-stage", *PLANES),
        r"planes contradict the geometry .* bulge towards the camera by 0\.\d+ ± 0\.\d+ mm",
        {"bow_mm": "0.5"},
        touched=_depth_stage(*PLANES),
        quick=False,
    ),
    BadInput(
        "one step of the stage is not what was asked",
        "capture of the plane",
        _redo("depth-stage", "position-850"),
        r"position \d+ mm is .* mm from where the other positions put it",
        {"stage_scale": "1.03"},
        touched=_depth_stage("position-850"),
    ),
    BadInput(
        "all steps of the stage are too long",
        "capture of the second plane",
        _redo("depth-stage", *PLANES),
        r"planes are 1\.0\d+ times as far apart as the stage's positions 620, 740 mm",
        {"stage_scale": "1.04"},
        touched=_depth_stage(*PLANES),
    ),
)
