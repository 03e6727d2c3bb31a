"""The story on one screen: plan, scan, reconstruct, evaluate.

Data flow one way: devices -> capture -> reconstruction -> evaluation -> export. The stages do not know
each other; this module alone knows their order. Everything heavy is imported where it is used, so that the
command line starts at once.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from dsl_core.errors import CalibrationError
from dsl_core.model.frames import FrameSource
from dsl_core.model.plan import CapturePlan
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.progress import NoProgress, Progress

if TYPE_CHECKING:
    import xarray as xr

    from dsl_core.capture.status import Status
    from dsl_core.devices.base import DeviceRig
    from dsl_core.evaluation.cost import StageTimer
    from dsl_core.evaluation.summary import Evaluation, Truth


@dataclass(frozen=True)
class Options:
    """How to reconstruct: bands, correspondence model (auto, grating, grid), refinement, torch device."""

    grid: WavelengthGrid = field(default_factory=WavelengthGrid)
    correspondence: str = "auto"
    refine_columns: bool = True
    spectra: bool = True
    device: str = "cpu"


def fit_plan(plan: CapturePlan, rig: DeviceRig) -> CapturePlan:
    """The plan for the image sizes of a rig's camera and projector."""
    camera, projector = rig.camera.info, rig.projector.info
    return plan.model_copy(
        update={
            "camera_size_px": (camera.width_px, camera.height_px),
            "projector_size_px": (projector.width_px, projector.height_px),
        }
    )


def scan(rig: DeviceRig, plan: CapturePlan, folder: Path, progress: Progress | None = None) -> Status:
    """Capture a plan into a session folder; an interrupted one goes on at its next missing frame."""
    from dsl_core.capture.runner import Runner
    from dsl_core.io.session import SessionWriter
    from dsl_core.patterns.images import pattern_image

    with SessionWriter.open(folder, plan, rig) as sink:
        return Runner(rig, plan, sink, pattern_image, progress=progress).run()


def reconstruct(
    source: FrameSource,
    rig: Rig,
    options: Options | None = None,
    progress: Progress | None = None,
    timer: StageTimer | None = None,
) -> xr.Dataset:
    """Frames -> linear radiance -> columns -> depth -> surface -> spectra -> colour -> result."""
    from dsl_core.evaluation.cost import StageTimer
    from dsl_core.optics.correspondence import correspondence
    from dsl_core.reconstruction.geometry import reconstruct_geometry
    from dsl_core.reconstruction.merge import MergedScan, check_source, decode_columns, stack_lines
    from dsl_core.reconstruction.scan_result import assemble, known_pixels
    from dsl_core.reconstruction.spectra import SpectralReconstruction

    options, progress, timer = options or Options(), progress or NoProgress(), timer or StageTimer()
    plan = check_source(source, rig)
    with timer.stage("read, merge, decode the binary code"):
        merged = MergedScan(source, rig)
        code, white = decode_columns(merged, progress)
    with timer.stage("read and merge the line frames"):
        stack = stack_lines(merged, progress)
    with timer.stage("columns, depth, normals"):
        geometry = reconstruct_geometry(
            rig, plan, code, white, stack, refine_columns=options.refine_columns, device=options.device
        )
    spectra = None
    if options.spectra:
        with timer.stage("spectra"):
            model = correspondence(rig, options.correspondence)
            pixels = known_pixels(geometry)
            solver = SpectralReconstruction(
                rig, plan, options.grid, model, stack.radiance, stack.std, pixels, device=options.device
            )
            spectra = solver.run(progress)
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


def twin_truth(rig: DeviceRig, grid: WavelengthGrid) -> Truth | None:
    """What the twin knows of its scene; None for a real rig."""
    from dsl_core.evaluation.summary import Truth
    from dsl_core.simulation.sim_devices import SimCamera

    if not isinstance(rig.camera, SimCamera):
        return None
    truth = rig.camera.world.truth
    materials = truth.materials
    return Truth(
        truth.depth_mm, truth.lit, truth.material, materials.names, materials.at(grid.centres_nm), materials.targets
    )


def evaluate(result: xr.Dataset, truth: Truth) -> Evaluation:
    """Figures of a result against what is known of the scene."""
    from dsl_core.evaluation import summary

    return summary.evaluate(result, truth)
