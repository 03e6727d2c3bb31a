"""Reconstructs the frames of a scan again with other parameters. No Qt."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from dsl_app.results.reconstruct_again.state import (
    OWN,
    Reconstructed,
    ReconstructionRequest,
    ReconstructionSource,
    ReconstructionState,
    bands_of,
    command_of,
    cost_of,
    fresh_name,
    target_of,
    trouble_of,
)
from dsl_app.shared.jobs.base import Job, JobRunner
from dsl_app.shared.known_files import Kind, kind_of
from dsl_app.shared.notify import Notifier
from dsl_core.errors import StoreError
from dsl_core.evaluation.cost import costs_of
from dsl_core.io.calibration_library import CalibrationLibrary
from dsl_core.io.neighbours import result_beside
from dsl_core.progress import Progress


class ReconstructionController:
    """Reads a scan, keeps the request for it, and runs it."""

    def __init__(
        self,
        state: ReconstructionState,
        runner: JobRunner,
        notifier: Notifier,
        library: CalibrationLibrary | None = None,
    ) -> None:
        self.state, self._runner, self._notifier = state, runner, notifier
        self._library = library or CalibrationLibrary()

    def prepare(self, path: Path) -> None:
        """Read a scan, or the scan of a result; ``ready`` fires when that is done."""

        def work(progress: Progress) -> ReconstructionSource:
            progress.report("read the scan", 0, 0)
            return read_source(path, self._library.names())

        def done(source: ReconstructionSource) -> None:
            self.state.source.set(source)
            self.state.request.set(
                ReconstructionRequest(fresh_name(source.session), spectra=source.has_spectra)
            )
            self._judge()
            self.state.ready.emit(source)

        self._runner.submit(Job(f"Read {path.name}", work, done, is_minor=True))

    def change(self, **what: Any) -> None:
        """Change fields of the request."""
        self.state.request.set(replace(self.state.request.value, **what))
        self._judge()

    def _judge(self) -> None:
        request, source = self.state.request.value, self.state.source.value
        if source is not None:
            self.state.trouble.set(trouble_of(request, source))
            self.state.cost.set(cost_of(request, source))

    def command_line(self) -> str:
        """The command that does the same."""
        source = self.state.source.value
        return "" if source is None else command_of(self.state.request.value, source)

    def start(self) -> bool:
        """Run the request in a job; False if that is not possible, which is then explained."""
        request, source = self.state.request.value, self.state.source.value
        # A folder of that name may have been created in the meantime.
        self._judge()
        if source is None or self.state.trouble.value:
            self._notifier.tell("warning", self.state.trouble.value or "Choose a scan first.")
            return False
        target = target_of(request, source)

        def done(result: Path) -> None:
            before = source.before if source.before != result else None
            self.state.done.emit(Reconstructed(result, before))

        title = f"Reconstruct {target.stem}"
        work = lambda progress: reconstruct(request, source, target, self._library, progress)  # noqa: E731
        self._runner.submit(Job(title, work, done))
        return True


def reconstruct(
    request: ReconstructionRequest,
    source: ReconstructionSource,
    target: Path,
    library: CalibrationLibrary,
    progress: Progress,
) -> Path:
    """Run a request; raises what the engine raises, and then writes nothing."""
    from dsl_core.io.calibration_library import load_calibration
    from dsl_core.io.result.result_file import RESULT_FOLDER
    from dsl_core.io.staging import check_targets
    from dsl_core.pipeline import Options
    from dsl_core.solve.torch_device import torch_device
    from dsl_core.workflows.scans import reconstruct_to

    check_targets([target], overwrite=request.replace, kind=RESULT_FOLDER)
    rig = None if request.calibration == OWN else load_calibration(request.calibration, library)
    options = Options(
        # Without spectra, the bands of the request may be invalid.
        grid=bands_of(request if request.spectra else ReconstructionRequest("")),
        correspondence=request.model,
        refine_columns=request.refine,
        spectra=request.spectra,
        device=torch_device(request.device),
        solver=request.solver,
    )
    return reconstruct_to(
        target,
        source.session,
        rig,
        options,
        progress,
        override_calibration=request.override,
        overwrite=request.replace,
    )


def read_source(path: Path, library: tuple[str, ...]) -> ReconstructionSource:
    """Read what the choices depend on, from a scan or the scan of a result; raises `StoreError`."""
    from dsl_core.io.kinds import what_is_at
    from dsl_core.io.result.result_file import load_result
    from dsl_core.io.scan.check import require_complete
    from dsl_core.io.scan.folder import ScanReader
    from dsl_core.model.plan import NoSpectral
    from dsl_core.solve.torch_device import has_cuda
    from dsl_core.workflows.inspection import scan_of

    match kind_of(path):
        case Kind.RESULT:
            before: Path | None = path
            scan = scan_of(path, load_result(path).attrs)
        case Kind.SCAN:
            before, scan = result_beside(path), path
        case _:
            raise StoreError(
                f"{path.name} is not a scan: {what_is_at(path)}. Choose a folder NAME.dsl with all of its"
                " frames, or open its result first."
            )
    reader = ScanReader(scan)
    require_complete(reader)
    if before is None or kind_of(before) is not Kind.RESULT:
        before = None
    return ReconstructionSource(
        scan,
        reader.plan.camera_size_px,
        reader.calibration.name if reader.calibration is not None else "",
        library,
        has_cuda(),
        before,
        0.0 if before is None else took_s(load_result(before).attrs),
        not isinstance(reader.plan.spectral, NoSpectral),
    )


def took_s(attributes: Mapping[Any, Any]) -> float:
    """How long a result took, s; 0 if it does not say."""
    return sum(stage.seconds for stage in costs_of(attributes))
