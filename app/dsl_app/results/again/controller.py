"""Reconstructs a scan again with other parameters, without scanning it again. No Qt."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from dsl_app.results.again.state import OWN, AgainDone, AgainOrder, AgainSource, AgainState
from dsl_app.results.again.words import RESULT_SUFFIX, bands_of, command_of, cost_of, fresh_name, target_of
from dsl_app.results.again.words import trouble_of as trouble_of_order
from dsl_app.shared.jobs.base import Job, JobRunner
from dsl_app.shared.known_files import Kind, kind_of
from dsl_app.shared.notify import Notifier, sentence_of
from dsl_core.errors import StoreError
from dsl_core.io.calibration_library import CalibrationLibrary
from dsl_core.progress import Progress


class AgainController:
    """Looks at a scan, keeps the order for it, and carries it out."""

    def __init__(
        self,
        state: AgainState,
        runner: JobRunner,
        notifier: Notifier,
        library: CalibrationLibrary | None = None,
    ) -> None:
        self.state, self._runner, self._notifier = state, runner, notifier
        self._library = library or CalibrationLibrary()

    def prepare(self, path: Path) -> None:
        """Look at a scan, or at the scan of a result; ``ready`` tells when that is done."""

        def work(progress: Progress) -> AgainSource:
            progress.report("look at the scan", 0, 0)
            return read_source(path, self._library.names())

        def done(source: AgainSource) -> None:
            self.state.source.set(source)
            self.state.order.set(AgainOrder(fresh_name(source.session)))
            self._judge()
            self.state.ready.emit(source)

        self._runner.submit(Job(f"Look at {path.name}", work, done, self._tell, is_minor=True))

    def change(self, **what: Any) -> None:
        """Change fields of the order."""
        self.state.order.set(replace(self.state.order.value, **what))
        self._judge()

    def _judge(self) -> None:
        order, source = self.state.order.value, self.state.source.value
        if source is not None:
            self.state.trouble.set(trouble_of_order(order, source))
            self.state.cost.set(cost_of(order, source))

    def command_line(self) -> str:
        """The command that does the same."""
        source = self.state.source.value
        return "" if source is None else command_of(self.state.order.value, source)

    def start(self) -> bool:
        """Carry the order out in a job; False where it cannot be, and why is told."""
        order, source = self.state.order.value, self.state.source.value
        # A folder of that name may have come meanwhile.
        self._judge()
        if source is None or self.state.trouble.value:
            self._notifier.tell("warning", self.state.trouble.value or "Choose a scan first.")
            return False
        target = target_of(order, source)

        def done(result: Path) -> None:
            before = source.before if source.before != result else None
            self.state.done.emit(AgainDone(result, before))

        title = f"Reconstruct {target.stem}"
        work = lambda progress: reconstruct(order, source, target, self._library, progress)  # noqa: E731
        self._runner.submit(Job(title, work, done, self._tell))
        return True

    def _tell(self, error: Exception) -> None:
        self._notifier.tell("error", sentence_of(error))


def reconstruct(
    order: AgainOrder, source: AgainSource, target: Path, library: CalibrationLibrary, progress: Progress
) -> Path:
    """Carry an order out; raises what the engine raises, and then writes nothing."""
    from dsl_core.io.calibration_library import load_calibration
    from dsl_core.io.result.result_file import RESULT_FOLDER, save_result
    from dsl_core.io.staging import check_targets
    from dsl_core.pipeline import Options
    from dsl_core.reconstruction.torch_device import torch_device
    from dsl_core.workflows.scans import reconstruct_scan

    check_targets([target], overwrite=order.replace, kind=RESULT_FOLDER)
    rig = None if order.calibration == OWN else load_calibration(order.calibration, library)
    options = Options(
        # Depth has no bands; those of the order need not make sense then.
        grid=bands_of(order if order.spectra else AgainOrder("")),
        correspondence=order.model,
        refine_columns=order.refine,
        spectra=order.spectra,
        device=torch_device(order.device),
        solver=order.solver,
    )
    result = reconstruct_scan(source.session, rig, options, progress, override_calibration=order.override)
    progress.report("save the result", 0, 0)
    return save_result(result, target, overwrite=order.replace)


def read_source(path: Path, library: tuple[str, ...]) -> AgainSource:
    """What the choices depend on, of a scan or of the scan of a result; raises `StoreError`."""
    from dsl_core.io.result.result_file import load_result
    from dsl_core.io.scan.check import require_complete
    from dsl_core.io.scan.folder import ScanReader
    from dsl_core.reconstruction.torch_device import has_cuda
    from dsl_core.workflows.inspection import session_of

    match kind_of(path):
        case Kind.RESULT:
            before: Path | None = path
            session = session_of(path, load_result(path).attrs)
        case Kind.SCAN:
            before, session = path.with_suffix(RESULT_SUFFIX), path
        case _:
            raise StoreError(
                f"{path.name} is no scan. Choose a folder NAME.dsl with all of its frames,"
                " or open its result first."
            )
    reader = ScanReader(session)
    require_complete(reader)
    if before is None or kind_of(before) is not Kind.RESULT:
        before = None
    return AgainSource(
        session,
        reader.plan.camera_size_px,
        reader.calibration.name if reader.calibration is not None else "",
        library,
        has_cuda(),
        before,
        0.0 if before is None else took_s(load_result(before).attrs),
    )


def took_s(attributes: Mapping[Any, Any]) -> float:
    """Seconds that a result took to make; 0 where it does not say."""
    try:
        return sum(float(stage["seconds"]) for stage in json.loads(attributes.get("stage_costs", "[]")))
    except (ValueError, TypeError, KeyError):
        return 0.0
