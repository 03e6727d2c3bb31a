"""The story on one screen: plan, scan, reconstruct, evaluate.

Data flow one way: devices -> capture -> reconstruction -> evaluation -> export. The stages do not know
each other; this module alone knows their order. Everything heavy is imported where it is used, so that the
command line starts at once.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from dsl_core.errors import CalibrationError, DriftError
from dsl_core.model.frames import FrameSource
from dsl_core.model.plan import CapturePlan, GrayCode
from dsl_core.model.presets import on_cycles
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.progress import CancelToken, NoProgress, Progress

if TYPE_CHECKING:
    import xarray as xr

    from dsl_core.capture.runner import Runner
    from dsl_core.capture.sink import Watch
    from dsl_core.capture.status import Status
    from dsl_core.devices.base import DeviceRig
    from dsl_core.evaluation.cost import StageTimer
    from dsl_core.evaluation.report.scan_report import ReportContent
    from dsl_core.evaluation.summary import Evaluation, Truth
    from dsl_core.model.board import Board
    from dsl_core.model.calibration.geometry import GeometryCalibration
    from dsl_core.model.calibration.pose_frames import PoseFrames
    from dsl_core.model.rig import BayerPattern


@dataclass(frozen=True)
class Options:
    """How to reconstruct: bands, correspondence (auto, grating, hybrid, grid), refinement, torch device.

    ``solver`` is ``best`` or, to compare with it, ``published`` (Adam on the published objective),
    ``nearest-line`` or ``colour-basis``. ``surface_window_px`` is the window of normals; None takes it from
    the image's width, which is wrong for a piece cut out of a larger image.
    """

    grid: WavelengthGrid = field(default_factory=WavelengthGrid)
    correspondence: str = "auto"
    refine_columns: bool = True
    spectra: bool = True
    device: str = "cpu"
    surface_window_px: int | None = None
    solver: str = "best"


def fit_plan(plan: CapturePlan, rig: DeviceRig) -> CapturePlan:
    """The plan for the image sizes of a rig's camera and projector.

    Exposures that nobody chose become whole colour cycles, as the calibration measured them or else as the
    projector claims; others are left as they are.
    """
    camera, projector = rig.camera.info, rig.projector.info
    if plan.settings == CapturePlan().settings:
        known = rig.calibration or projector
        plan = on_cycles(plan, known.frame_period_ms)
    return plan.model_copy(
        update={
            "camera_size_px": (camera.width_px, camera.height_px),
            "projector_size_px": (projector.width_px, projector.height_px),
        }
    )


@contextmanager
def open_scan(
    rig: DeviceRig,
    plan: CapturePlan,
    folder: Path,
    progress: Progress | None = None,
    notes: dict[str, str] | None = None,
    token: CancelToken | None = None,
    watch: Watch | None = None,
) -> Iterator[Runner]:
    """A runner over a session folder, for who wants to pause, cancel or listen; ``watch`` sees every frame.

    An interrupted session goes on at its next missing frame.
    """
    from dsl_core.capture.preflight import require_possible
    from dsl_core.capture.runner import Runner
    from dsl_core.capture.sink import WatchedSink
    from dsl_core.io.scan.session import SessionWriter
    from dsl_core.patterns.images import pattern_image

    require_possible(rig, plan)
    with SessionWriter.open(folder, plan, rig, notes) as writer:
        sink = WatchedSink(writer, watch) if watch else writer
        yield Runner(rig, plan, sink, pattern_image, progress=progress, token=token)


def scan(
    rig: DeviceRig,
    plan: CapturePlan,
    folder: Path,
    progress: Progress | None = None,
    notes: dict[str, str] | None = None,
) -> Status:
    """Capture a plan into a session folder; an interrupted one goes on at its next missing frame."""
    with open_scan(rig, plan, folder, progress, notes) as runner:
        return runner.run()


def resume(
    rig: DeviceRig, folder: Path, progress: Progress | None = None, check_drift: bool = True
) -> Status:
    """Go on with a session after a look at whether anything moved; raises `DriftError` if it did."""
    return scan(rig, prepare_resume(rig, folder, check_drift), folder, progress)


def prepare_resume(rig: DeviceRig, folder: Path, check_drift: bool = True) -> CapturePlan:
    """The plan of a session to go on with; raises `DriftError` if anything moved since it stopped.

    The session's own calibration counts, whatever the rig says of itself now.
    """
    from dsl_core.capture import drift
    from dsl_core.io.scan.session import SessionReader
    from dsl_core.patterns.images import pattern_image

    reader = SessionReader(folder)
    rig.calibration = reader.calibration or rig.calibration
    sound = reader.sound()  # a damaged frame is taken again, and tells nothing of the scene
    done = [shot for shot in reader.plan.shots() if shot.index in sound]
    if check_drift and 0 < len(done) < reader.plan.shot_count:
        report = drift.check_drift(rig, reader, drift.pick_reference_shots(done), pattern_image)
        if not report.is_stable:
            raise DriftError(report.message)
    return reader.plan


def reconstruct(
    source: FrameSource,
    rig: Rig,
    options: Options | None = None,
    progress: Progress | None = None,
    timer: StageTimer | None = None,
) -> xr.Dataset:
    """Frames -> linear radiance -> columns -> depth -> surface -> spectra -> colour -> result."""
    from dsl_core.evaluation.cost import StageTimer
    from dsl_core.reconstruction.geometry import reconstruct_geometry
    from dsl_core.reconstruction.merge import MergedScan, check_source, decode_columns, stack_lines
    from dsl_core.reconstruction.sanity import require_light, require_pixels
    from dsl_core.reconstruction.scan_result import assemble, known_pixels
    from dsl_core.reconstruction.spectral.solvers import check_solver, solve_spectra

    options, progress, timer = options or Options(), progress or NoProgress(), timer or StageTimer()
    plan = check_source(source, rig)
    if options.spectra:
        check_solver(options.solver, rig, plan, options.correspondence)
    with timer.stage("read, merge, decode the binary code"):
        merged = MergedScan(source, rig)
        code, white = decode_columns(merged, progress)
        require_light(white.radiance, white.saturated)
    with timer.stage("read and merge the line frames"):
        stack = stack_lines(merged, progress)
    with timer.stage("columns, depth, normals"):
        geometry = reconstruct_geometry(
            rig,
            plan,
            code,
            white,
            stack,
            refine_columns=options.refine_columns,
            surface_window_px=options.surface_window_px,
            device=options.device,
            progress=progress,
        )
        require_pixels(geometry.flags)
    spectra = None
    if options.spectra:
        with timer.stage("spectra"):
            spectra = solve_spectra(
                options.solver,
                rig,
                plan,
                options.grid,
                options.correspondence,
                stack,
                known_pixels(geometry),
                device=options.device,
                progress=progress,
            )
    with timer.stage("colour and result"):
        return assemble(rig, plan, options.grid, geometry, spectra)


def calibration_of(source: FrameSource, given: Rig | None = None) -> Rig:
    """The calibration to use: the one given, else the one stored with the scan; raises `CalibrationError`."""
    rig = given or getattr(source, "calibration", None)
    if rig is None:
        raise CalibrationError(
            "The scan holds no calibration and none was given. Name one with --calibration FILE."
        )
    return rig


def evaluate(result: xr.Dataset, truth: Truth) -> Evaluation:
    """Figures of a result against what is known of the scene."""
    from dsl_core.evaluation import summary

    return summary.evaluate(result, truth)


def write_report(content: ReportContent, path: Path, overwrite: bool = False) -> Path:
    """Write the report as one HTML page; raises `StoreError`."""
    from dsl_core.evaluation.report.scan_report import render_report
    from dsl_core.io.staging import staged

    page = render_report(content)
    with staged([path], overwrite=overwrite) as (draft,):
        draft.write_text(page, encoding="utf-8")
    return path


def calibrate_geometry(
    folder: Path,
    board: Board,
    projector_size_px: tuple[int, int],
    bayer: BayerPattern | None = None,
    camera_binning: float = 1.0,
    baseline_mm: float | None = None,
    progress: Progress | None = None,
) -> GeometryCalibration:
    """Lenses and pose of camera and projector from folders of pictures, one a board pose, film off.

    Goes on without poses whose board or code cannot be read, and says so. Raises `CalibrationError` that
    names the picture that is missing, or the poses that are wrong when too few are left.
    """
    from dsl_core.calibration.geometry.pose_series import observe_series
    from dsl_core.calibration.geometry.solve import calibrate_geometry as calibrate
    from dsl_core.io.pose_pictures import pose_folders, read_pose, require_one_size
    from dsl_core.patterns.gray_code import bit_counts

    bits, progress = bit_counts(GrayCode(), projector_size_px), progress or NoProgress()
    sizes: dict[str, tuple[int, int]] = {}
    folders = pose_folders(folder)

    def pictures() -> Iterator[PoseFrames]:
        for index, pose_folder in enumerate(folders):
            progress.report("find the board", index, len(folders))
            frames = read_pose(pose_folder, bits, bayer)
            sizes[frames.name] = (frames.white.shape[1], frames.white.shape[0])
            require_one_size(sizes)
            yield frames

    series = observe_series(pictures(), board, projector_size_px)
    return calibrate(
        series.seen,
        board,
        sizes[folders[0].name],
        projector_size_px,
        camera_binning=camera_binning,
        baseline_mm=baseline_mm,
        left_out=series.left_out,
        warnings=series.warnings,
    )
