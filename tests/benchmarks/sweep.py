"""Many plans measured with the twin: one file a point, so that a sweep that stops resumes where it was."""

from __future__ import annotations

import csv
import hashlib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict
from io import StringIO
from pathlib import Path

import numpy as np
from pydantic import ValidationError

from dsl_core import pipeline
from dsl_core.errors import DecodeError, StoreError
from dsl_core.io.staging import staged
from dsl_core.model.base import Record
from dsl_core.model.plan import CapturePlan
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.planning import references
from dsl_core.progress import NoProgress, Progress
from tests.cases.binning import binned
from tests.cases.trial import run_trial

#: Part of every key: points measured by another method than today's are measured again.
METHOD = 5


def filters() -> references.References:
    """The nine filters of the twin's scene of that name, 450 to 650 nm every 25."""
    return references.peaks(tuple(float(nm) for nm in range(450, 651, 25)))


def unseen() -> references.References:
    """Twenty-four spectra that no design and no prior was made with: steps, bumps, wiggles, greys.

    Sigmoid edges, Gaussian bands, double bands and slow oscillations, drawn once; pigments, dyes and greys
    look so.
    """
    rng = np.random.Generator(np.random.PCG64(2024))
    rows, names = [], []
    x = references.FINE_NM
    for i in range(24):
        kind = ("edge", "band", "two bands", "wave")[i % 4]
        low, high = rng.uniform(0.03, 0.2), rng.uniform(0.4, 0.9)
        centre, width = rng.uniform(440, 650), rng.uniform(12, 45)
        if kind == "edge":
            shape = 1 / (1 + np.exp(-(x - centre) / width * rng.choice([-2, 2])))
        elif kind == "band":
            shape = np.exp(-0.5 * ((x - centre) / width) ** 2)
        elif kind == "two bands":
            other = centre + rng.choice([-1, 1]) * rng.uniform(50, 100)
            shape = np.exp(-0.5 * ((x - centre) / width) ** 2)
            shape = np.maximum(shape, rng.uniform(0.4, 1) * np.exp(-0.5 * ((x - other) / width) ** 2))
        else:
            shape = 0.5 + 0.5 * np.sin(2 * np.pi * (x - centre) / rng.uniform(60, 200))
        rows.append(low + (high - low) * shape)
        names.append(f"{kind} {i}")
    return references.References(tuple(names), np.stack(rows))


PALETTES: dict[str, Callable[[], references.References]] = {
    "chart": references.chart,
    "peaks": references.peaks,
    "filters": filters,
    "unseen": unseen,
}


class Case(Record):
    """A plan and how its scan is read: bands every ``step_nm``, pixels binned, what it looks at."""

    name: str
    plan: CapturePlan
    step_nm: float = 5.0
    binning: int = 1
    palette: str = "chart"
    solver: str = "best"

    @property
    def grid(self) -> WavelengthGrid:
        """Bands of the result."""
        return WavelengthGrid(step_nm=self.step_nm)


class Point(Record):
    """What a case reached; times in seconds, ``cpu_s`` per million pixels; None where it does not apply.

    ``failure`` says why a plan gave nothing; its figures are then None.
    """

    name: str
    frames: int
    spectral_frames: int
    seconds: float
    raw_bytes: int
    rmse: float | None = None
    pixel_rmse: float | None = None
    angle_rad: float | None = None
    pixel_angle_rad: float | None = None
    delta_e: float | None = None
    fwhm_nm: float | None = None
    depth_rmse_mm: float | None = None
    depth_coverage: float | None = None
    cpu_s_per_megapixel: float | None = None
    failure: str = ""


def measure(rig: Rig, case: Case, latency_ms: float) -> Point:
    """Scan and evaluate one case on the twin of a rig."""
    plan = case.plan
    facts = {
        "name": case.name,
        "frames": plan.shot_count,
        "spectral_frames": plan.spectral_count,
        "seconds": round(plan.duration_s(latency_ms), 3),
        "raw_bytes": plan.raw_bytes,
    }
    options = pipeline.Options(grid=case.grid, solver=case.solver)
    try:
        trial = run_trial(binned(rig, case.binning), plan, PALETTES[case.palette](), options=options)
    except DecodeError as error:
        return Point.model_validate({**facts, "failure": str(error)})
    figures = asdict(trial)
    megapixels = figures.pop("pixels") / 1e6
    del figures["cpu_s"]
    return Point.model_validate(
        {**facts, **figures, "cpu_s_per_megapixel": round(trial.cpu_s / megapixels, 3)}
    )


def run_sweep(
    rig: Rig, cases: Sequence[Case], folder: Path, latency_ms: float, progress: Progress | None = None
) -> list[Point]:
    """Measure every case that has no file yet; raises `StoreError` when a point cannot be kept."""
    progress = progress or NoProgress()
    points = []
    for done, case in enumerate(cases):
        path = folder / f"{key_of(rig, case, latency_ms)}.json"
        point = _read(path)
        if point is None:
            point = measure(rig, case, latency_ms)
            folder.mkdir(parents=True, exist_ok=True)
            with staged([path], overwrite=True) as (draft,):
                draft.write_text(point.model_dump_json(indent=1) + "\n", encoding="utf-8")
        points.append(point)
        progress.report("plans", done + 1, len(cases))
    return points


def key_of(rig: Rig, case: Case, latency_ms: float) -> str:
    """Name of a case's file: everything that its figures depend on, hashed."""
    parts = (METHOD, rig.model_dump_json(), case.model_dump_json(), latency_ms)
    return hashlib.sha256(repr(parts).encode()).hexdigest()[:20]


def stored(rig: Rig, case: Case, folder: Path, latency_ms: float) -> Point | None:
    """The point of a case that was measured before, if it can be read."""
    return _read(folder / f"{key_of(rig, case, latency_ms)}.json")


def _read(path: Path) -> Point | None:
    try:
        return Point.model_validate_json(path.read_bytes())
    except (OSError, ValidationError):
        return None


def write_csv(points: Iterable[Point], path: Path, overwrite: bool = False) -> Path:
    """A table with one row a point; raises `StoreError`."""
    rows = [point.model_dump() for point in points]
    if not rows:
        raise StoreError(f"There is no point to write into {path}. Measure a plan first.")
    text = StringIO()
    table = csv.DictWriter(text, fieldnames=list(rows[0]), lineterminator="\n")
    table.writeheader()
    table.writerows(rows)
    with staged([path], overwrite=overwrite) as (draft,):
        draft.write_text(text.getvalue(), encoding="utf-8")
    return path
