"""The story on one screen: plan, scan, reconstruct, evaluate.

Data flow one way: devices -> capture -> reconstruction -> evaluation -> export. The stages do not know
each other; this module alone knows their order. `dsl_core.workflows` tells the story for scans on disk,
`dsl_core.campaign` repeats it for calibrations. Heavy libraries are imported where they are used, so that the
command line starts at once.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dsl_core.capture import metering
from dsl_core.capture.again import Again
from dsl_core.capture.preflight import fit_plan, require_possible
from dsl_core.capture.proof.report import SeenFrames
from dsl_core.capture.proof.report import prove as prove_frames
from dsl_core.capture.runner import Runner, State, Status
from dsl_core.capture.scan_watches import ScanWatches
from dsl_core.capture.sink import Watch, WatchedSink
from dsl_core.devices.base import DeviceRig
from dsl_core.errors import StoreError
from dsl_core.evaluation import summary
from dsl_core.evaluation.cost import StageTimer
from dsl_core.evaluation.report.scan_report import ReportContent, render_report
from dsl_core.evaluation.summary import Evaluation, Truth
from dsl_core.io.scan.as_exposed import as_exposed
from dsl_core.io.scan.folder import ScanReader, ScanWriter
from dsl_core.io.scan.proof_file import read_proof, save_proof
from dsl_core.io.staging import write_text
from dsl_core.model.fit import FitFinding
from dsl_core.model.frames import FrameSource
from dsl_core.model.options import Options
from dsl_core.model.plan import CapturePlan
from dsl_core.model.result_sink import MemorySink, ResultSink, SeenGeometry
from dsl_core.model.rig import Rig
from dsl_core.patterns.images import pattern_image
from dsl_core.progress import CancelToken, NoProgress, Progress
from dsl_core.reconstruction.merge import check_source
from dsl_core.solve.threads import one_kernel_thread

if TYPE_CHECKING:
    import xarray as xr


_log = logging.getLogger(__name__)
__all__ = ["Options", "evaluate", "fit_plan", "meter", "open_scan", "reconstruct", "scan", "write_report"]


def meter(rig: DeviceRig, plan: CapturePlan, token: CancelToken | None = None) -> metering.Metered:
    """The plan with exposures for this scene, as `capture.metering.meter` measures them.

    Raises `PlanError` where the plan is impossible on the rig, before anything is shown.
    """
    require_possible(rig, plan)
    return metering.meter(rig, plan, pattern_image, token)


@contextmanager
def open_scan(
    rig: DeviceRig,
    plan: CapturePlan,
    folder: Path,
    progress: Progress | None = None,
    notes: dict[str, str] | None = None,
    token: CancelToken | None = None,
    watch: Watch | None = None,
    prove: bool = True,
    waits: bool = False,
    again: Again = Again.SCAN,
) -> Iterator[Runner]:
    """A runner over a scan's folder, for callers that pause, cancel or listen; ``watch`` sees every frame.

    An interrupted scan resumes at its next missing frame. Pictures that do not show their pattern are
    captured again, unless ``prove`` is off, as for cameras that can only repeat what they gave before. When
    sentinels show that something moved, the scan pauses if it ``waits`` for a person, and ends otherwise.
    What to do after that is advised in the words of what it is captured for (``again``).
    """
    require_possible(rig, plan)
    expected = {} if rig.expect is None else rig.expect(plan)
    with ScanWriter.open(folder, plan, rig, {**(notes or {}), **expected}) as writer:
        stored = ScanReader(folder)
        watches = ScanWatches.of(rig, plan, prove, metering.WHITE_MEASURED in stored.manifest.notes)
        exposed = as_exposed(stored)
        watches.learn(writer, exposed)
        sink = watches.over(WatchedSink(writer, watch) if watch else writer)
        known = stored.calibration
        runner = Runner(
            rig, plan, sink, pattern_image, progress=progress, token=token, stored=exposed, waits=waits,
            proof=watches.proof, sentinels=watches.sentinels, exposure=watches.exposure,
            is_proven=known is not None and read_proof(stored, known) is not None, again=again,
        )  # fmt: skip
        yield runner
        if watches.seen is not None and runner.status.state is State.FINISHED:
            past = () if watches.proof is None else watches.proof.past
            _keep_proof(ScanReader(folder), watches.seen, past)


def _keep_proof(reader: ScanReader, seen: SeenFrames, past: tuple[str, ...] = ()) -> None:
    """Judge the pictures of a finished scan once and for all; without a calibration, each result does.

    ``past`` are sentences on what no frame of the scan shows, or no longer.
    """
    if reader.calibration is None or read_proof(reader, reader.calibration) is not None:
        return
    exposed, sensor = as_exposed(reader), reader.calibration.sensor
    if exposed is not reader and seen.unseen:
        # What was kept while scanning may have the light of another exposure.
        seen = SeenFrames(exposed.plan)
    seen.read_missing(exposed)
    found = prove_frames(exposed, seen, reader.calibration, sensor.bit_depth, sensor.bayer)
    if past:
        found = found.model_copy(update={"wrong": (*found.wrong, *past)})
    try:
        save_proof(reader, reader.calibration, found)
    except StoreError as error:
        _log.warning("The scan is complete; what its pictures show could not be kept with it: %s", error)


def scan(
    rig: DeviceRig,
    plan: CapturePlan,
    folder: Path,
    progress: Progress | None = None,
    notes: dict[str, str] | None = None,
    prove: bool = True,
    again: Again = Again.SCAN,
) -> Status:
    """Capture a plan into a folder; an interrupted scan resumes at its next missing frame."""
    with open_scan(rig, plan, folder, progress, notes, prove=prove, again=again) as runner:
        return runner.run()


@one_kernel_thread()
def reconstruct(
    source: FrameSource,
    rig: Rig,
    options: Options | None = None,
    progress: Progress | None = None,
    timer: StageTimer | None = None,
    sink: ResultSink | None = None,
    seen_geometry: SeenGeometry | None = None,
) -> xr.Dataset:
    """Frames -> linear radiance -> columns -> depth -> surface -> spectra -> colour -> result.

    Frames are read, and the result is made, by bands of rows, so that those of a large picture need not be
    in memory at once; the result is, unless a ``sink`` takes it. ``seen_geometry`` is given depth, points
    and normals as soon as they are known: spectra take much longer. Threads have whole pictures or tiles to
    work on, never parts of one tensor: see `one_kernel_thread`.
    """
    from dsl_core.reconstruction.geometry_steps import GeometrySteps
    from dsl_core.reconstruction.light.early_ends import EarlyEnds
    from dsl_core.reconstruction.light.mean_black import mean_black
    from dsl_core.reconstruction.light.own_sensor import own_sensor
    from dsl_core.reconstruction.rows.assembly import Assembly
    from dsl_core.reconstruction.rows.bands import bands_of
    from dsl_core.reconstruction.rows.frames import ScanFrames
    from dsl_core.reconstruction.scan_result import known_pixels, maps_without_spectra
    from dsl_core.reconstruction.spectral.solvers import check_solver, row_solver, rows_together

    options, progress, timer = options or Options(), progress or NoProgress(), timer or StageTimer()
    plan = check_source(source, rig)
    if options.spectra:
        check_solver(options.solver, rig, plan, options.correspondence)
    findings: list[FitFinding] = []
    ends = None
    if not options.as_calibrated:
        sensor, found = own_sensor(source, rig.sensor)
        rig = rig.model_copy(update={"sensor": sensor})
        findings += found
        ends = EarlyEnds(source, sensor)
    frames = ScanFrames(ends or source, rig, bands_of(plan, options.band_rows, rows_together(rig, options)))
    steps = GeometrySteps(rig, options, frames, progress)
    with timer.stage("read, merge, decode the binary code"):
        steps.decode()
    with timer.stage("read and merge the line frames"):
        steps.read_lines()
    with timer.stage("columns, depth, normals"):
        geometry = steps.measure()
    rig, findings = steps.rig, findings + steps.findings
    if seen_geometry is not None:
        seen_geometry(maps_without_spectra(rig, options, geometry))
    solver = None
    if options.spectra:
        with timer.stage("spectra"):
            solver = row_solver(rig, plan, options, frames, known_pixels(geometry), progress, findings)
        if solver.followed is not None and solver.followed.turn is not None:
            geometry = solver.followed.turn.doubted(geometry, options.surface_window_px)
    result = Assembly(rig, plan, options, geometry, frames.bands, sink or MemorySink())
    # The frames of the last band may still be in memory.
    for band in result.missing(reversed(frames.bands)):
        spectra = None
        if solver is not None:
            with timer.stage("spectra", in_parts=True):
                spectra = solver.rows(band, progress)
        with timer.stage("colour and result", in_parts=True):
            result.put(band, spectra)
    with timer.stage("colour and result", in_parts=True):
        progress.report("colour and result", 0, 0)
        findings += ends.findings if ends is not None else ()
        seen = np.isfinite(geometry.depth_mm)
        return result.finish(solver, findings, mean_black(source, rig.sensor, seen))


def evaluate(result: xr.Dataset, truth: Truth) -> Evaluation:
    """Figures of a result against what is known of the scene."""
    return summary.evaluate(result, truth)


def write_report(content: ReportContent, path: Path, overwrite: bool = False) -> Path:
    """Write the report as one HTML page; raises `StoreError`."""
    return write_text(path, lambda: render_report(content), overwrite=overwrite)
