"""Imports folders of other programs: says what is missing or misnamed, then imports them. No Qt."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from dsl_app.importing.state import (
    PUBLISHED,
    SUFFIXES,
    Found,
    ImportOrder,
    ImportState,
    command_of,
    rows_of,
    summary_of,
    target_for,
    trouble_of,
)
from dsl_app.shared.jobs.base import Job, JobRunner
from dsl_app.shared.notify import Notifier, sentence_of
from dsl_core.io.calibration_library import CalibrationLibrary, load_calibration
from dsl_core.model.rig import Rig
from dsl_core.progress import Progress

#: Fields that decide whether a folder can be imported; after a change it is checked again.
_CHECKED = {"folder", "base", "camera_px"}


class ImportController:
    """Checks a folder, keeps the order to import it, and carries that out."""

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
        before = self.state.order.value
        # Folders of one rig are often imported one after the other.
        order = ImportOrder(folder, home, PUBLISHED if before is None else before.base)

        def done(found: Found) -> None:
            self.state.order.set(replace(order, target=target_for(folder, found.kind, home)))
            self._show(found)
            self.state.ready.emit(found)

        self._look(order, done)

    def change(self, **what: Any) -> None:
        """Change fields of the order; checks the folder again if that matters."""
        order, found = self.state.order.value, self.state.found.value
        if order is None or found is None:
            return
        order = replace(order, **what)
        self.state.order.set(order)
        if _CHECKED & set(what):
            self._look(order, self._show)
        else:
            self.state.trouble.set(trouble_of(found, order))

    def rename(self, name: str, home: Path) -> None:
        """Store what is imported by a name in a folder."""
        found = self.state.found.value
        if found is not None:
            suffix = SUFFIXES[found.kind]
            plain = name.strip().removesuffix(suffix).replace("/", "-")
            self.change(target=home.expanduser() / f"{plain}{suffix}")

    def _look(self, order: ImportOrder, done: Any) -> None:
        self._looks += 1
        number = self._looks
        self.state.busy.set(f"Checking {order.folder.name}")

        def work(progress: Progress) -> Found:
            progress.report("check the files", 0, 0)
            return look_at(order, self._library)

        def looked(found: Found) -> None:
            # The outcome of a check is dropped once another one has begun.
            if number == self._looks:
                self.state.busy.set("")
                done(found)

        def failed(error: Exception) -> None:
            self.state.busy.set("")
            self.state.trouble.set(sentence_of(error))
            self._tell(error)

        ended = lambda: self.state.busy.set("")  # noqa: E731
        self._runner.submit(Job(f"Check {order.folder.name}", work, looked, failed, ended, is_minor=True))

    def _show(self, found: Found) -> None:
        assert self.state.order.value is not None
        self.state.found.set(found)
        self.state.trouble.set(trouble_of(found, self.state.order.value))

    def command_line(self) -> str:
        """The command that does the same."""
        found, order = self.state.found.value, self.state.order.value
        return "" if found is None or order is None else command_of(found, order)

    def start(self) -> bool:
        """Import in a job; if that is not possible, a message says why and the answer is False."""
        found, order = self.state.found.value, self.state.order.value
        # Something of that name may exist by now.
        trouble = "Choose a folder first." if found is None or order is None else trouble_of(found, order)
        self.state.trouble.set(trouble)
        if found is None or order is None or trouble:
            self._notifier.tell("warning", trouble)
            return False
        carry_out = import_calibration if found.kind == "calibration" else import_scan
        work = lambda progress: carry_out(order, self._library, progress)  # noqa: E731
        self._runner.submit(Job(f"Import {order.folder.name}", work, self.state.done.emit, self._tell))
        return True

    def _tell(self, error: Exception) -> None:
        self._notifier.tell("error", sentence_of(error))


def look_at(order: ImportOrder, library: CalibrationLibrary) -> Found:
    """What the folder of an order contains; raises `StoreError`."""
    from dsl_core.workflows import exchange

    look = exchange.look_at(order.folder, base_of(order, library), _size(order))
    return Found(
        order.folder, look.kind, rows_of(look.table), summary_of(look.kind, look.table), look.obstacle
    )


def import_scan(order: ImportOrder, library: CalibrationLibrary, progress: Progress) -> Path:
    """Make a scan of a dataset, complete or not at all."""
    from dsl_core.io.staging import staged
    from dsl_core.workflows import exchange

    with staged([order.target]) as (draft,):
        exchange.import_scan(order.folder, draft, base_of(order, library), progress)
    return order.target


def import_calibration(order: ImportOrder, library: CalibrationLibrary, progress: Progress) -> Path:
    """Make a rig's file of a published calibration."""
    from dsl_core.io.rig_file import save_rig
    from dsl_core.workflows import exchange

    progress.report("read the calibration", 0, 0)
    rig = exchange.import_calibration(order.folder, base_of(order, library), _size(order))
    return save_rig(rig, order.target)


def base_of(order: ImportOrder, library: CalibrationLibrary) -> Rig:
    """The rig that gives film, sensor and scales; raises what `load_calibration` raises."""
    from dsl_core.simulation.published_rig import published_rig

    return published_rig() if order.base == PUBLISHED else load_calibration(order.base, library)


def _size(order: ImportOrder) -> tuple[int, int] | None:
    return order.camera_px if all(order.camera_px) else None
