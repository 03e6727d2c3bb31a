"""The spectral solvers by name."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from dsl_core.errors import PlanError
from dsl_core.model.fit import FitFinding
from dsl_core.model.options import SOLVERS, Options, names
from dsl_core.model.plan import CapturePlan
from dsl_core.model.rig import Rig
from dsl_core.optics.correspondence import correspondence
from dsl_core.optics.lines.line_set import LineSet
from dsl_core.optics.spectra import Bands
from dsl_core.progress import Progress
from dsl_core.reconstruction.code_agreement import rows_apart_px
from dsl_core.reconstruction.light.told import colour_changed
from dsl_core.reconstruction.merge import PickedLines
from dsl_core.reconstruction.rows.bands import Band
from dsl_core.reconstruction.rows.frames import ScanFrames
from dsl_core.reconstruction.spectral.colour_sites import colour_sites_finding
from dsl_core.reconstruction.spectral.first_order_light import FirstOrderLight
from dsl_core.reconstruction.spectral.model_error import ModelError
from dsl_core.reconstruction.spectral.nearest_line import ColourBasis, NearestLine
from dsl_core.reconstruction.spectral.order_balance import order_balance_finding
from dsl_core.reconstruction.spectral.probing.frame_levels import frame_levels
from dsl_core.reconstruction.spectral.probing.picked_cube import PickedCube
from dsl_core.reconstruction.spectral.probing.probe import probed_pixels
from dsl_core.reconstruction.spectral.published_objective import PublishedReconstruction, require_single_lines
from dsl_core.reconstruction.spectral.self_correction import Followed
from dsl_core.reconstruction.spectral.solving.tile_frames import Pixels
from dsl_core.reconstruction.spectral.spectra import SpectralReconstruction, tile_shape
from dsl_core.reconstruction.spectral.spectral_maps import SpectralMaps

_KINDS = {"published": PublishedReconstruction, "nearest-line": NearestLine}


def check_solver(solver: str, rig: Rig, plan: CapturePlan, model: str) -> None:
    """Raise what `solve_spectra` would, before frames are read for it."""
    if solver not in names(SOLVERS):
        raise PlanError(f"There is no spectral solver {solver!r}; choose {', '.join(names(SOLVERS))}.")
    if solver == "colour-basis":
        return
    correspondence(rig, model)
    if solver in _KINDS:
        require_single_lines(plan)


@dataclass(frozen=True)
class RowSolver:
    """Spectra of a scan by rows; with what it says about its model, and what is left of that, if anything."""

    rows: Callable[[Band, Progress | None], SpectralMaps]
    followed: Followed | None = None
    error: ModelError | None = None
    findings: tuple[FitFinding, ...] = ()


def rows_together(rig: Rig, options: Options) -> int | None:
    """Rows of a picture that are solved together; None where all are, by solvers to compare with."""
    if not options.spectra:
        return 2
    return tile_shape(Bands.of(rig, options.grid).count)[0] if options.solver == "best" else None


def row_solver(
    rig: Rig,
    plan: CapturePlan,
    options: Options,
    frames: ScanFrames,
    pixels: Pixels,
    progress: Progress | None = None,
    told: Sequence[FitFinding] = (),
) -> RowSolver:
    """Spectra of known pixels, with the solver and the model of correspondence that ``options`` name.

    ``told`` is what light and geometry have said: what they explain is not put down to the film.
    Raises `PlanError` for an unknown solver or patterns that it cannot read, `CalibrationError` for a model
    that the calibration does not hold.
    """
    check_solver(options.solver, rig, plan, options.correspondence)
    if options.solver == "colour-basis":
        return RowSolver(lambda _, progress: ColourBasis(rig, options.grid, pixels).run(progress))
    model = correspondence(rig, options.correspondence)
    if options.solver in _KINDS:
        stack = frames.lines(frames.bands[0], progress)
        kind = _KINDS[options.solver](
            rig, plan, options.grid, model, stack.radiance, stack.std, pixels, device=options.device
        )
        return RowSolver(lambda _, progress: kind.run(progress))
    lines, asked = LineSet.of(plan), probed_pixels(pixels.valid, rig.sensor.bayer)
    picked = frames.pick(asked, progress)
    findings: list[FitFinding] = []
    if lines is not None and lines.single and asked.size:
        seen = FirstOrderLight.of(lines, model, picked, pixels)
        of_orders = colour_sites_finding(rig, seen), order_balance_finding(rig, seen)
        findings = [each for each in of_orders if each is not None]

    def cubes(picked: PickedLines) -> tuple[PickedCube, PickedCube]:
        width = pixels.valid.shape[1]
        return PickedCube(picked.radiance, asked, width), PickedCube(picked.std, asked, width)

    best = SpectralReconstruction(
        rig, plan, options.grid, model, *cubes(picked), pixels,
        device=options.device, rows_px=rows_apart_px(told), colour_changed=colour_changed(told),
        as_calibrated=options.as_calibrated or not options.refine_columns,
    )  # fmt: skip
    if frames.light is not None and frames.light.flickers:
        found = frame_levels(best.probed, frames.light.std)
        if found is not None:
            frames.follow(frames.light.refined(found.log, found.std))
            best.take(*cubes(frames.pick(asked, progress)), 0)
    best.learn()

    def solve(band: Band, progress: Progress | None) -> SpectralMaps:
        stack = frames.lines(band, progress)
        best.take(stack.radiance, stack.std, band.near.start)
        return best.solve(band.rows, progress, part=options.part)

    return RowSolver(solve, best.followed, best.error, tuple(findings))
