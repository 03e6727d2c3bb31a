"""The spectral solvers by name."""

from __future__ import annotations

from dsl_core.errors import PlanError
from dsl_core.model.options import SOLVERS, Options, names
from dsl_core.model.plan import CapturePlan
from dsl_core.model.rig import Rig
from dsl_core.optics.correspondence import correspondence
from dsl_core.progress import Progress
from dsl_core.reconstruction.merge import LineStack
from dsl_core.reconstruction.spectral.nearest_line import ColourBasis, NearestLine
from dsl_core.reconstruction.spectral.published_objective import PublishedReconstruction, require_single_lines
from dsl_core.reconstruction.spectral.spectra import SpectralMaps, SpectralReconstruction
from dsl_core.reconstruction.spectral.tile_frames import Pixels

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


def solve_spectra(
    rig: Rig,
    plan: CapturePlan,
    options: Options,
    stack: LineStack,
    pixels: Pixels,
    progress: Progress | None = None,
) -> SpectralMaps:
    """Spectra of known pixels, with the solver and the model of correspondence that ``options`` name.

    Raises `PlanError` for an unknown solver or patterns that it cannot read, `CalibrationError` for a model
    that the calibration does not hold.
    """
    check_solver(options.solver, rig, plan, options.correspondence)
    if options.solver == "colour-basis":
        return ColourBasis(rig, options.grid, pixels).run(progress)
    kind = _KINDS.get(options.solver)
    model = correspondence(rig, options.correspondence)
    data = (rig, plan, options.grid, model, stack.radiance, stack.std, pixels)
    if kind is None:
        solver = SpectralReconstruction(*data, device=options.device, as_calibrated=options.as_calibrated)
        return solver.run(progress, part=options.part)
    return kind(*data, device=options.device).run(progress)
