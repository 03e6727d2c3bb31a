"""Imports folders of other programs: says what is missing or misnamed, then imports them. No Qt."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from dsl_app.importing.captures.state import checks_of
from dsl_app.importing.state import (
    PUBLISHED,
    SUFFIXES,
    Found,
    ImportRequest,
    ImportState,
    command_of,
    rows_of,
    summary_of,
    target_for,
    trouble_of,
)
from dsl_app.shared.jobs.base import Job, JobRunner
from dsl_app.shared.notify import Notifier, sentence_of
from dsl_app.shared.paths import barrier, expanded
from dsl_core.errors import StoreError
from dsl_core.io.calibration_library import CalibrationLibrary, load_calibration, name_from
from dsl_core.model.rig import Rig
from dsl_core.progress import Progress

#: Fields that decide whether a folder can be imported; after a change it is checked again.
_CHECKED = {"folder", "base", "camera_px", "unit_mm"}


class ImportController:
    """Checks a folder, keeps the request to import it, and carries that out."""

    def __init__(
        self,
        state: ImportState,
        runner: JobRunner,
        notifier: Notifier,
        library: CalibrationLibrary | None = None,
    ) -> None:
        self.state, self._runner, self._notifier = state, runner, notifier
        self._library = library or CalibrationLibrary()
        self._looks = 0

    def look(self, folder: Path, home: Path) -> None:
        """Check a folder; the proposed target is in the folder ``home``."""
        self.state.library.set(self._library.names())
        before = self.state.request.value
        # Folders of one rig are often imported one after the other.
        request = ImportRequest(folder, home, PUBLISHED if before is None else before.base)

        def done(found: Found) -> None:
            self.state.request.set(replace(request, target=target_for(folder, found.kind, home)))
            self._show(found)
            self.state.ready.emit(found)

        self._look(request, done)

    def change(self, **what: Any) -> None:
        """Change fields of the request; checks the folder again if that matters."""
        request, found = self.state.request.value, self.state.found.value
        if request is None or found is None:
            return
        request = replace(request, **what)
        self.state.request.set(request)
        if _CHECKED & set(what):
            self._look(request, self._show)
        else:
            self.state.trouble.set(trouble_of(found, request))

    def rename(self, name: str, home: Path) -> None:
        """Store what is imported by a name in a folder."""
        found = self.state.found.value
        if found is not None:
            suffix = SUFFIXES[found.kind]
            plain = name.strip().removesuffix(suffix).replace("/", "-")
            self.change(target=expanded(home) / f"{plain}{suffix}")

    def _look(self, request: ImportRequest, done: Any) -> None:
        self._looks += 1
        number = self._looks
        self.state.busy.set(f"Checking {request.folder.name}")

        def work(progress: Progress) -> Found:
            progress.report("check the files", 0, 0)
            return look_at(request, self._library)

        def looked(found: Found) -> None:
            # The outcome of a check is dropped once another one has begun.
            if number == self._looks:
                done(found)

        def failed(error: Exception) -> None:
            if number == self._looks:
                self.state.trouble.set(sentence_of(error))
                self._notifier.tell("error", sentence_of(error))

        def ended() -> None:
            if number == self._looks:
                self.state.busy.set("")

        title = f"Check {request.folder.name}"
        self._runner.submit(Job(title, work, looked, failed, is_minor=True, on_ended=ended))

    def _show(self, found: Found) -> None:
        assert self.state.request.value is not None
        self.state.found.set(found)
        self.state.trouble.set(trouble_of(found, self.state.request.value))

    def command_line(self) -> str:
        """The command that does the same."""
        found, request = self.state.found.value, self.state.request.value
        return "" if found is None or request is None else command_of(found, request)

    def start(self) -> bool:
        """Import in a job; if that is not possible, a message says why and the answer is False."""
        found, request = self.state.found.value, self.state.request.value
        # Something of that name may exist by now.
        trouble = "Choose a folder first." if found is None or request is None else trouble_of(found, request)
        self.state.trouble.set(trouble)
        if found is None or request is None or trouble:
            self._notifier.tell("warning", trouble)
            return False
        carry_out = import_calibration if found.kind == "calibration" else import_scan
        work = lambda progress: carry_out(request, self._library, progress)  # noqa: E731
        self._runner.submit(Job(f"Import {request.folder.name}", work, self.state.done.emit))
        return True


def look_at(request: ImportRequest, library: CalibrationLibrary) -> Found:
    """What the folder of an request contains; raises `StoreError`."""
    from dsl_core.workflows import exchange

    if reason := barrier(request.folder):
        raise StoreError(f"{request.folder} cannot be read ({reason}). Choose another folder.")
    look = exchange.look_at(request.folder, base_of(request, library), _size(request), request.unit_mm)
    return Found(
        request.folder,
        look.kind,
        rows_of(look.table),
        summary_of(look.kind, look.table),
        look.obstacle,
        " ".join(checks_of(look.doubts)),
    )


def import_scan(request: ImportRequest, library: CalibrationLibrary, progress: Progress) -> Path:
    """Make a scan of a dataset, complete or not at all."""
    from dsl_core.io.staging import staged
    from dsl_core.workflows import exchange

    with staged([request.target]) as (draft,):
        exchange.import_scan(request.folder, draft, base_of(request, library), progress)
    return request.target


def import_calibration(request: ImportRequest, library: CalibrationLibrary, progress: Progress) -> Path:
    """Make a rig's file of a published calibration."""
    from dsl_core.io.rig_file import save_rig
    from dsl_core.workflows import exchange

    progress.report("read the calibration", 0, 0)
    # Doubts were told when the folder was looked at.
    rig, _ = exchange.import_calibration(
        request.folder, base_of(request, library), _size(request), unit_mm=request.unit_mm
    )
    # The library takes it by this name: rigs of several folders are not versions of one calibration.
    name = name_from(request.target.stem) or rig.name
    return save_rig(rig.model_copy(update={"name": name}), request.target)


def base_of(request: ImportRequest, library: CalibrationLibrary) -> Rig:
    """The rig that gives film, sensor and scales; raises what `load_calibration` raises."""
    from dsl_core.simulation.published_rig import published_rig

    return published_rig() if request.base == PUBLISHED else load_calibration(request.base, library)


def _size(request: ImportRequest) -> tuple[int, int] | None:
    return request.camera_px if all(request.camera_px) else None
