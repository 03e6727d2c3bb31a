"""How scans and measurements end on rigs whose devices fail in every way we could think of.

    python -m tests.benchmarks.bench_faults [--quick] [--seeds 20] [--size 64x48] [--kinds late] [--part 2/8]

The rig is a package of its own, installed into a temporary folder, around the twin. Every scan is held
against the clean one of the same scene, plan and seed: its frames, and where some look different, its result,
against that of the same frames with those of the clean scan in their place.
Told are scans whose result is other than it should be and names a change of light, black level or place.
A scan that stopped is resumed with sound devices and judged again, so that wrong frames kept before show.
Where a fault begins follows from its name and the seed, so that a part of the kinds gives the same rows.
White is metered before a scan as `dsl-scan scan` does, on a rig that fails from the beginning or not at all.
In band are results that differ by no more than they say of themselves. Unseen are scans that another scene
on a sound rig would have given, frame by frame. Both are told apart from scans that finished wrong.
"""

from __future__ import annotations

import json
import logging
import re
import shutil
import sys
import tempfile
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from hashlib import blake2b
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from dsl_core import pipeline
from dsl_core.campaign.common.recipe import Bench, Step
from dsl_core.campaign.spectralon.emission_readings import load_readings, read_emission
from dsl_core.devices.base import DeviceRig
from dsl_core.devices.registry import open_rig
from dsl_core.errors import DslError
from dsl_core.io.scan.folder import ScanReader
from dsl_core.model.attributes import DOUBTS
from dsl_core.model.fit import Fit
from dsl_core.model.placement import Placement
from dsl_core.model.plan import CapturePlan, GrayCode, ScanLines, Sentinels, Setting, Shot
from dsl_core.progress import NoProgress
from dsl_core.simulation.scenes.catalogue import scene_catalogue
from dsl_core.workflows.scans import reconstruct_scan
from tests.benchmarks.common import options, print_table, write_json
from tests.cases.faulty_lab import CAMERA, OTHER, PROJECTOR, SHIFTS, SPECTRUM, STAGE, installed
from tests.cases.lab_everyday import CAMERA_EVERYDAY, PROJECTOR_EVERYDAY
from tests.cases.lab_links import CAMERA_LINKS, PROJECTOR_LINKS
from tests.cases.lab_mishaps import CAMERA_MISHAPS, PROJECTOR_MISHAPS
from tests.cases.lab_oddities import CAMERA_ODDITIES, PROJECTOR_ODDITIES
from tests.cases.lab_surprises import CAMERA_SURPRISES, PROJECTOR_SURPRISES
from tests.cases.lab_whims import CAMERA_WHIMS, PROJECTOR_WHIMS
from tests.cases.pattern_faults import LASTING, SINGLE
from tests.cases.rig_habits import ALWAYS, CAMERA_HABITS, PROJECTOR_HABITS
from tests.cases.spoiled_pictures import SPOILED

#: Pixels that differ from the clean frame by so many deviations, and how many of them make a frame different.
DIFFERENT_SIGMAS, DIFFERENT_PIXELS = 6.0, 12
#: A result is wrong if depth is lost or moved, or reflectance differs, by more than this: mm, share, -. Noise
#: has no part in it: the other result is of the same frames, but for those that look different.
DEPTH_MM, DEPTH_SHARE, REFLECTANCE = 0.5, 0.01, 0.01
#: What a sentence of a stopped scan has to say, by kind; other kinds are judged by the pictures.
REASONS = {
    "cannot be opened": "No such device",
    "bit depth changes": "bit_depth from 12 to 8",
    "exposure rounded by a third": "instead of",
    "camera hangs": "camera .* has not returned",
    "projector hangs": "projector .* has not returned",
    "camera hangs when closed": "close, but has not returned",
    "camera fails to close": "could not close",
    "driver raises for good": "Input/output error",
    "driver ends the program": "SystemExit",
    "left-aligned": "is the largest",
    "cut off from": "rows empty",
    "another size": "px instead of",
    "another type": "uint8",
    "exposure told": "instead of",
    "projector raises for good": "context lost",
    "projector changes its size": "width_px from",
    "stage sticks": "was sent to",
    "stage sticks and denies it": "was sent to",
    "stage overshoots": "was sent to",
    "stage says NaN": "nan",
    "two bits high": "is the largest",
    "bytes swapped": "is the largest",
}
#: A result that differs is in its band if no more than this share of its values is further off than so many
#: deviations, its own and those of the result wanted together.
BEYOND, BAND_SIGMAS = 0.05, 2.0
#: Kinds whose frames are those of another scene, and of which: nothing in them can contradict anything.
OTHER_SCENES = {
    "light rises in the code always": "every surface reflects 1.1 times as much",
    "light falls in the code always": "every surface reflects 0.9 times as much",
    "night mode always": "surfaces reflect less in the bands of the green and of the blue LED",
    "target slips always": "the surfaces in the middle stand elsewhere",
}
#: Changes that only old shots taken again tell from a scene: in scans of these, sentinels are taken.
HABITS = (
    *(*CAMERA_HABITS, *PROJECTOR_HABITS, *CAMERA_MISHAPS, *PROJECTOR_MISHAPS),
    *(*CAMERA_SURPRISES, *PROJECTOR_SURPRISES, *CAMERA_ODDITIES, *PROJECTOR_ODDITIES),
    *(*CAMERA_WHIMS, *PROJECTOR_WHIMS, *CAMERA_LINKS, *PROJECTOR_LINKS),
    *(*CAMERA_EVERYDAY, *PROJECTOR_EVERYDAY),
)
CHANGES = (*SPOILED, *SHIFTS, "projector squares its picture", *HABITS)
#: Faults of the beginning of a scan, and between the last picture of the code and the first line.
EARLY, AT_LINES = ("counter wraps", "lamp warms up"), ("swapped at the lines",)
#: What a result says of such a change; other sentences on its fit do not count, nor do any of other faults.
TOLD = (
    r"[Ll]ines together have|inverses? (together|both)|first pictures of the code had"
    r"|In parts of the picture, lines|Lines between frame|White, captured again"
    r"|Black pictures changed|The light (drifted|flickered|has changed)"
    r"|(scene|Something|pattern) moved by"
)
BAD = ("reason?", "not resumed", "WRONG")
_PICTURES = r"does not show its pattern|delivered the picture of the previous|captured once more"
_SPECTRUM = "spectrum|measure"
#: Sentences that differ by numbers alone say the same.
_NUMBER = re.compile(r"[-+±]?\d[\d.]*")


@dataclass(frozen=True)
class Case:
    """What is scanned: the twin's options and a plan, kept in a file."""

    scene: str
    size: str
    seed: int
    plan_kind: int
    has_sentinels: bool = False

    @property
    def options(self) -> dict[str, str]:
        return {"scene": self.scene, "size": self.size, "seed": str(self.seed)}

    def plan(self) -> CapturePlan:
        bright, dim = Setting(exposure_ms=333.3, level=0.8), Setting(exposure_ms=166.7, level=0.2)
        settings = (dim, bright) if self.plan_kind == 1 else (Setting(exposure_ms=166.7, level=0.2),)
        return CapturePlan(
            code=GrayCode(rows=self.plan_kind == 2),
            spectral=ScanLines(step_px=5),
            settings=settings,
            code_settings=tuple(range(len(settings))),
            sentinels=Sentinels() if self.has_sentinels else None,
        )


@dataclass
class Work:
    """Where scans of this run are, and what the clean ones gave."""

    folder: Path
    count: int = 0
    clean: dict[Case, Path] = field(default_factory=dict)
    results: dict[Case, xr.Dataset] = field(default_factory=dict)

    def new(self) -> Path:
        self.count += 1
        return self.folder / f"{self.count}.dsl"

    def clean_result(self, case: Case) -> xr.Dataset:
        if case not in self.results:
            self.results[case] = reconstruct_scan(self.clean[case])
        return self.results[case]


@dataclass(frozen=True)
class Mended:
    """The frames of a scan, with those that are ``wrong`` from the clean one."""

    scan: ScanReader
    clean: ScanReader
    wrong: frozenset[int]

    @property
    def plan(self) -> CapturePlan:
        return self.scan.plan

    def read(self, shot: Shot) -> NDArray[np.uint16]:
        return (self.clean if shot.index in self.wrong else self.scan).read(shot)

    def read_rows(self, shot: Shot, rows: slice) -> NDArray[np.uint16]:
        return (self.clean if shot.index in self.wrong else self.scan).read_rows(shot, rows)


def open_lab(case: Case, kind: str = "", at: int = 0, tear: float = 0.5, plan_file: str = "") -> DeviceRig:
    """The rig of the package, its pictures of sound patterns remembered from scan to scan."""
    fault = {"fault": kind, "at": str(at), "tear": f"{tear:.3f}", "plan": plan_file}
    rig = open_rig("faulty-lab", case.options | fault)
    _remember_pictures(rig, case)
    return rig


@cache
def _pictures(case: Case) -> dict[bytes, NDArray[np.float32]]:
    return {}


def _remember_pictures(rig: DeviceRig, case: Case) -> None:
    camera: Any = rig.camera
    while not hasattr(camera, "world"):
        camera = getattr(camera, "_camera", None) or camera.camera
    world, known = camera.world, _pictures(replace(case, has_sentinels=False))
    render = world.rate

    def rate() -> NDArray[np.float32]:
        key = b"" if world.image is None else blake2b(world.image).digest()
        if key not in known:
            known[key] = render()
        return known[key]

    world.rate = rate


def judge_scan(work: Work, case: Case, kind: str, at: int, tear: float) -> tuple[str, str]:
    """How a scan with a fault ended, and what it said."""
    folder, plan = work.new(), ScanReader(work.clean[case]).plan
    plan_file = work.folder / f"plan{case.plan_kind}{case.has_sentinels}.json"
    plan_file.write_text(plan.model_dump_json())
    said, corrected = "", 0
    try:
        notes = meter_white(case, kind, plan) if kind.endswith(ALWAYS) else {}
        with (
            open_lab(case, kind, at, tear, str(plan_file)) as rig,
            pipeline.open_scan(rig, plan, folder, notes=notes) as runner,
        ):
            corrected = runner.run().corrected
    except DslError as error:
        said = str(error)
    except Exception as error:
        return "WRONG", f"not a sentence: {type(error).__name__}: {error}"
    end = "corrected" if corrected else "right"
    if said:
        changes = kind.removesuffix(ALWAYS) in CHANGES
        wanted = REASONS.get(kind.removesuffix(ALWAYS), f"{_PICTURES}|{TOLD}" if changes else _PICTURES)
        end = "stopped" if re.search(wanted, said) else "reason?"
        if kind == "cannot be opened":
            return end, said
        if kind.endswith(ALWAYS) and end == "stopped":
            return end, said  # what was captured was never right: nothing is resumed
        try:
            with open_lab(case) as sound, pipeline.open_scan(sound, plan, folder) as runner:
                runner.run()
        except DslError as error:
            return "not resumed", f"{said} || {error}"
    wrong, told, is_in_band = _wrong(work, case, folder)
    shutil.rmtree(folder)
    if not wrong:
        return end, said
    is_told = bool(told) if kind.endswith(ALWAYS) else bool(re.search(TOLD, told))
    if kind.removesuffix(ALWAYS) in CHANGES and is_told:
        end = "told"
    elif kind in OTHER_SCENES:
        end, told = "unseen", f"{told} The frames are those of a scene where {OTHER_SCENES[kind]}."
    else:
        end = "in band" if is_in_band else "WRONG"
    return end, f"{wrong} {told} {said}"


def meter_white(case: Case, kind: str, plan: CapturePlan) -> dict[str, str]:
    """What is noted of white before a scan on a rig that fails from the beginning; exposures stay."""
    with open_lab(case, kind) as rig:
        notes = pipeline.meter(rig, plan).notes
    return {name: text for name, text in notes.items() if name != "exposures"}


def _wrong(work: Work, case: Case, folder: Path) -> tuple[str, str, bool]:
    """What differs from the clean scan's result, what the result says, and whether it is within its band.

    Nothing differs where that is no matter.
    """
    ours, theirs = ScanReader(folder), ScanReader(work.clean[case])
    calibration = theirs.calibration
    assert calibration is not None
    different = []
    for shot in theirs.plan.shots():
        one, other = (reader.read(shot).astype(np.float64) for reader in (ours, theirs))
        light = np.maximum(other - calibration.sensor.black_level_dn, 0)
        sensor = calibration.sensor
        sigma = np.sqrt(2 * (light / sensor.electrons_per_dn + sensor.read_noise_dn**2))
        if int((np.abs(one - other) > DIFFERENT_SIGMAS * (sigma + 0.3)).sum()) >= DIFFERENT_PIXELS:
            different.append(shot.index)
    if not different:
        return "", "", True
    names = f"{len(different)} frames differ, {different[:6]}"
    wanted = work.clean_result(case)
    try:
        result = reconstruct_scan(folder)
    except DslError as error:
        return f"{names}; no result", str(error), False
    usual = {_NUMBER.sub("#", sentence) for sentence in _sentences(wanted)}
    new = (each for each in _sentences(result) if _NUMBER.sub("#", each) not in usual)
    # What is measured and corrected names no fault that is left.
    told = " ".join(sorted(each for each in new if not each.rstrip().endswith("corrected for it.")))
    mended = pipeline.reconstruct(Mended(ours, theirs, frozenset(different)), calibration)
    bad, spectra, beyond = _apart(result, mended)
    if bad > DEPTH_SHARE or spectra > REFLECTANCE:
        harm = f"depth of {bad:.1%} wrong, reflectance off by {spectra:.3f}, {beyond:.1%} beyond the band"
        return f"{names}; {harm}.", told, beyond <= BEYOND
    return "", told, True


def _apart(result: xr.Dataset, wanted: xr.Dataset) -> tuple[float, float, float]:
    """Share of depths that are lost or moved, rms of reflectance's difference, and the share out of band.

    The last is that of depths or of reflectances, whichever is larger; of depths, those lost count as well.
    """
    known = np.isfinite(wanted["depth_mm"].values)
    depth = np.abs(result["depth_mm"].values - wanted["depth_mm"].values)[known]
    std_mm = np.hypot(result["depth_std_mm"].values, wanted["depth_std_mm"].values)[known]
    apart = np.abs(result["reflectance"].values - wanted["reflectance"].values)
    std = np.hypot(result["reflectance_std"].values, wanted["reflectance_std"].values)
    both = np.isfinite(apart)
    beyond = (
        float((~(depth < BAND_SIGMAS * std_mm)).mean()),
        float((apart[both] > BAND_SIGMAS * std[both]).mean()),
    )
    return float((~(depth < DEPTH_MM)).mean()), float(np.sqrt(np.nanmean(apart**2))), max(beyond)


def _sentences(result: xr.Dataset) -> set[str]:
    """What a result says of its pictures and of the fit of its model."""
    fit = Fit.read(result.attrs)
    found = () if fit is None else tuple(finding.sentence for finding in fit.significant)
    return {*found, *json.loads(result.attrs.get(DOUBTS, "[]"))}


def judge_stage(case: Case, kind: str) -> tuple[str, str]:
    """Whether the stage is where it says after three moves."""
    with open_lab(case, kind) as rig:
        assert rig.stage is not None
        stage = rig.stage
        inner = stage._stage.stage  # type: ignore[attr-defined]
        try:
            for wanted in (620.0, 740.0, 850.0):
                reached = stage.move_to(wanted)
                if not abs(reached - inner.position_mm) < stage.tolerance_mm:
                    return "WRONG", f"says {reached}, is at {inner.position_mm}"
        except DslError as error:
            return ("stopped" if re.search(REASONS.get(kind, " "), str(error)) else "reason?"), str(error)
    return "corrected", ""


def judge_spectrum(case: Case, kind: str, folder: Path) -> tuple[str, str]:
    """Whether readings of the emission that are kept are those of a sound instrument."""
    with open_lab(case, kind) as rig:
        assert rig.calibration is not None
        bench = Bench(rig, folder, rig.calibration)
        step = Step("light", "Light", "Nothing.", Placement(target="spectralon"))
        bench.step_folder(step).mkdir(parents=True)
        try:
            read_emission(bench, step, 1, None, NoProgress())
        except DslError as error:
            return ("stopped" if re.search(_SPECTRUM, str(error)) else "reason?"), str(error)
        readings = load_readings(bench, step).readings
    peaks = [max(readings[colour][0].values) for colour in ("red", "green", "blue", "white")]
    return ("corrected", "") if min(peaks) > 0 and len(set(peaks)) == 4 else ("WRONG", f"peaks {peaks}")


def run(
    chosen_kinds: Sequence[str], cases: Sequence[Case], work: Work, prints_all: bool = False
) -> dict[str, Counter[str]]:
    """All kinds over all cases."""
    table: dict[str, Counter[str]] = defaultdict(Counter)
    for plain in cases:
        for kind in chosen_kinds:
            case = replace(plain, has_sentinels=kind.removesuffix(ALWAYS) in CHANGES)
            rng = np.random.default_rng((case.seed, crc32(kind.encode())))
            shots = list(ScanReader(work.clean[case]).plan.shots())
            at = int(rng.integers(2, len(shots) - 2))
            if kind in EARLY:
                at = 2
            elif kind.endswith("in the code"):
                at = int(rng.integers(2, 2 * ScanReader(work.clean[case]).plan.code_bits[0]))
            elif kind.endswith("in the last lines"):
                last = [shot for shot in shots if shot.setting == shots[-1].setting]
                at = int(rng.choice([s.index for s in last if s.role == "spectral"][:-8]))
            elif kind in AT_LINES:
                at = next(shot.index for shot in shots if shot.role == "spectral") - 1
            if kind in STAGE:
                end, said = judge_stage(case, kind)
            elif kind in SPECTRUM:
                end, said = judge_spectrum(case, kind, work.new())
            else:
                end, said = judge_scan(work, case, kind, at, float(rng.uniform(0.1, 0.9)))
            table[kind][end] += 1
            is_shown = end in BAD or prints_all
            more = f" (frame {at} of {len(shots)}) {said[:420]}" if is_shown else ""
            print(f"{case.scene}, seed {case.seed}, {kind}: {end}{more}", flush=True)
    return table


def scan_clean(cases: Sequence[Case], work: Work) -> int:
    """Scan every case without a fault; how many of them raised an alarm."""
    alarms = 0
    for case in cases:
        folder = work.new()
        with open_lab(case) as rig:
            plan = pipeline.fit_plan(case.plan(), rig)
            try:
                with pipeline.open_scan(rig, plan, folder) as runner:
                    corrected = runner.run().corrected
            except DslError as error:
                corrected = -1
                print(f"  false alarm: {case}: {error}", flush=True)
                alarms += 1
        if corrected > 0:
            alarms += 1
            print(f"  false alarm: {case}: {corrected} taken again", flush=True)
        work.clean[case] = folder
    return alarms


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the tables."""
    parser = options(__doc__)
    parser.add_argument("--size", default="64x48")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--kinds", default="")
    parser.add_argument("--part", default="1/1", help="every so manieth of the kinds, such as 2/8")
    parser.add_argument("--all", action="store_true", help="print how every scan ended")
    parser.add_argument("--clean", type=int, default=0, help="further clean scans, to count false alarms")
    chosen = parser.parse_args(arguments)
    logging.disable(logging.CRITICAL)
    habits = [kind + ALWAYS for kind in HABITS]
    every = (*SINGLE, *AT_LINES, *LASTING, *CAMERA, *PROJECTOR, *OTHER, *STAGE, *SPECTRUM, *habits)
    kinds = chosen.kinds.split(",") if chosen.kinds else every[::7] if chosen.quick else every
    part, parts = map(int, chosen.part.split("/"))
    kinds = kinds[part - 1 :: parts]
    scenes = [entry.name for entry in scene_catalogue()]
    with tempfile.TemporaryDirectory() as spare:
        sys.path.insert(0, str(installed(Path(spare) / "site")))
        work = Work(Path(spare))
        cases = [
            Case(scenes[seed % len(scenes)], chosen.size, seed, seed % 3)
            for seed in range(chosen.first, chosen.first + chosen.seeds)
        ]
        both = [replace(case, has_sentinels=has) for case in cases for has in (False, True)]
        alarms = scan_clean(both, work)
        print(f"{len(both)} clean scans: {alarms} false alarms", flush=True)
        table: dict[str, Counter[str]] = defaultdict(Counter)
        for case in cases:
            for kind, ends in run(kinds, [case], work, chosen.all).items():
                table[kind] += ends
            _pictures.cache_clear()
            work.results.clear()
        columns = ("right", "corrected", "stopped", "told", "in band", "unseen", *BAD)
        rows = [(kind, *(row[end] for end in columns)) for kind, row in table.items()]
        print_table(("fault", *columns), rows)
        total = sum(table.values(), Counter())
        print_table(("all", *columns), [(f"{total.total()} scans", *(total[end] for end in columns))])
        if chosen.clean:
            more = [
                Case(scenes[seed % len(scenes)], size, 5000 + seed, seed % 3)
                for seed in range(chosen.clean)
                for size in (("64x48", "112x72")[seed % 2],)
            ]
            print(f"{len(more)} more clean scans: {scan_clean(more, work)} false alarms")
        write_json(chosen.json, {"faults": {kind: dict(row) for kind, row in table.items()}, "clean": alarms})


if __name__ == "__main__":
    main()
