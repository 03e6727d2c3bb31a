"""A series of results: reads them, keeps their stage positions and judges them together. No Qt."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from dsl_app.compare.refusals import CHANGED, REPLACED
from dsl_app.compare.series.state import SeriesKind, SeriesRow, SeriesState
from dsl_app.shared.jobs.base import Job, JobRunner
from dsl_app.shared.known_files import RESULT_NAME
from dsl_app.shared.notify import Notifier
from dsl_app.shared.paths import is_dir, is_file
from dsl_app.shared.replaced import Stamp, result_stamp, was_replaced
from dsl_app.shared.undo import Change, UndoStack
from dsl_core.errors import Cancelled, DecodeError, DslError
from dsl_core.evaluation.seen_target import Region
from dsl_core.evaluation.stage_test import stage_test
from dsl_core.evaluation.time_sweep import SweepFigure, require_sweep
from dsl_core.progress import Progress
from dsl_core.words import quoted

if TYPE_CHECKING:
    from dsl_core.workflows.series import ResultReference, TruthReference


#: Why a row was not read.
CANCELLED = "Not read because the job was cancelled. Remove it and add it again."


class SeriesController:
    """Fills a `SeriesState`; results are read one after the other."""

    def __init__(self, state: SeriesState, runner: JobRunner, notifier: Notifier, undo: UndoStack) -> None:
        self.state, self._runner, self._notifier, self._undo = state, runner, notifier, undo
        self._reference: TruthReference | ResultReference | None = None
        self._reference_stamp: Stamp = None

    # Rows ------------------------------------------------------------------------------------------

    def knows(self, path: Path) -> bool:
        """Whether a path is a result, or a folder that contains results."""
        return bool(results_in(path))

    def add(self, paths: Iterable[Path]) -> None:
        """Add results, or all results in folders."""
        rows = self.state.rows.value
        known = {row.path for row in rows}
        found = [result for path in paths for result in results_in(path)]
        new = [SeriesRow(path) for path in dict.fromkeys(found) if path not in known]
        if not found:
            self._notifier.tell(
                "warning", "There is no result here. Choose a folder NAME.zarr, or one that contains several."
            )
        elif not new and not any(map(_is_old, rows)):
            self._notifier.tell("info", "All of these results are already in the series.")
        else:
            self._set_rows((*rows, *new))

    def read_again(self) -> bool:
        """Read results again that were replaced after they had been read; whether there are any."""
        has_old = any(map(_is_old, self.state.rows.value)) or self._has_old_reference
        if has_old:
            self._set_rows(self.state.rows.value)
        return has_old

    def restore(
        self, rows: Sequence[tuple[Path, float | None]], against: Path | None, region: Region | None
    ) -> None:
        """Restore results with their positions and settings; warns about missing ones."""
        here = tuple(SeriesRow(path, position_mm) for path, position_mm in rows if results_in(path))
        gone = [path.name for path, _ in rows if not results_in(path)]
        if gone:
            self._notifier.tell(
                "warning",
                f"The results {', '.join(gone)} are missing. Add them again if they were moved.",
            )
        self._reference = None
        self.state.against.set(against if against is not None and results_in(against) else None)
        self.state.region.set(region)
        self._set_rows(here)

    def remove(self, path: Path) -> None:
        """Remove a result from the series."""
        rows = self.state.rows.value
        at = next((i for i, row in enumerate(rows) if row.path == path), None)
        if at is None:
            self._notifier.tell("info", "Select a row first.")
            return
        # The others may show another scene by the time it comes back.
        gone = replace(rows[at], point=None, point_trouble="")

        def others() -> tuple[SeriesRow, ...]:
            return tuple(row for row in self.state.rows.value if row.path != path)

        def put_back() -> None:
            # It may have been added again meanwhile, and has one place all the same.
            now = others()
            self._set_rows((*now[:at], gone, *now[at:]))

        self._undo.push(
            Change(f"remove {gone.name}", lambda: self._set_rows(tuple(map(_retried, others()))), put_back)
        )

    def set_position(self, path: Path, position_mm: float) -> None:
        """Set the stage position of a result."""
        row = next((row for row in self.state.rows.value if row.path == path), None)
        if row is None or row.position_mm == position_mm:
            return
        before = row.position_mm
        self._undo.push(
            Change(
                f"position of {row.name}",
                lambda: self._change(path, position_mm=position_mm),
                lambda: self._change(path, position_mm=before),
            )
        )

    def _change(self, path: Path, **fields: object) -> None:
        rows = self.state.rows.value
        self._set_rows(tuple(replace(row, **fields) if row.path == path else row for row in rows))  # type: ignore[arg-type]

    def _set_rows(self, rows: tuple[SeriesRow, ...]) -> None:
        if self._reference is not None:
            # The next results may show another scene than removed ones.
            self._reference.keep([row.path for row in rows])
        # The test was of the old rows.
        self.state.test.set(None)
        if self._has_old_reference:
            rows = self._without_points(rows)
        self.state.rows.set(_of_one_size(tuple(map(_renewed, rows))))
        self._judge()
        self._read()

    def select(self, path: Path | None) -> None:
        """Select a row."""
        self.state.selected.set(path)

    # Questions -------------------------------------------------------------------------------------

    def ask(self, kind: SeriesKind) -> None:
        """Switch between depth over positions and accuracy over time."""
        self.state.kind.set(kind)
        self._set_rows(self.state.rows.value)

    def show_figure(self, figure: SweepFigure) -> None:
        """Choose the error that the plot shows."""
        self.state.figure.set(figure)

    def compare_with(self, path: Path | None) -> None:
        """Compare the scans of a sweep with one of them, or with the ground truth."""
        if path == self.state.against.value:
            return
        self.state.against.set(path)
        self._set_rows(self._without_points(self.state.rows.value))

    @property
    def _has_old_reference(self) -> bool:
        against = self.state.against.value
        return against is not None and was_replaced(against, self._reference_stamp)

    def _without_points(self, rows: tuple[SeriesRow, ...]) -> tuple[SeriesRow, ...]:
        """The rows, to be compared with a reference that is read again."""
        self._reference, self._reference_stamp = None, None
        return tuple(replace(row, point=None, point_trouble="") for row in rows)

    def set_region(self, region: Region | None) -> None:
        """Use only a part of the picture, or all of it."""
        before = self.state.region.value
        if region != before:
            self._undo.push(Change("region", lambda: self._look_at(region), lambda: self._look_at(before)))

    def _look_at(self, region: Region | None) -> None:
        self.state.region.set(region)
        self._set_rows(tuple(replace(row, target=None, target_trouble="") for row in self.state.rows.value))

    # Read ------------------------------------------------------------------------------------------

    def _read(self) -> None:
        """Read the next result that has not been read; the others follow one by one."""
        state = self.state
        kind, asked = state.kind.value, (state.region.value, state.against.value)
        found = next((row for row in state.rows.value if not row.is_read(kind)), None)
        if found is None or state.busy.value:
            return
        row = replace(found, stamp=result_stamp(found.path))

        def work(progress: Progress) -> SeriesRow:
            if kind is SeriesKind.STAGE:
                return read_plane(row, asked[0], progress)
            return self._compare(row, progress)

        def done(read: SeriesRow) -> None:
            if asked == (state.region.value, state.against.value):
                self._take(kind, read)
            else:
                self._read()

        def failed(error: Exception) -> None:
            self._take(kind, _without(row, kind, f"{type(error).__name__}: {error}"))

        state.busy.set(f"Read {row.name}")
        cancelled, idle = lambda: self._cancelled(kind), lambda: state.busy.set("")
        self._runner.submit(Job(state.busy.value, work, done, failed, cancelled, on_ended=idle))

    def _take(self, kind: SeriesKind, read: SeriesRow) -> None:
        """Keep what was read, but prefer a position typed in the meantime; it may have been removed since."""
        known = [row.position_mm for row in self.state.rows.value if row.path == read.path]
        if not known:
            self._set_rows(self.state.rows.value)
            return
        if self.state.selected_row is None:
            self.select(read.path)
        if kind is SeriesKind.SWEEP:
            self._change(read.path, point=read.point, point_trouble=read.point_trouble, stamp=read.stamp)
            return
        self._change(
            read.path,
            position_mm=read.position_mm if known[0] is None else known[0],
            target=read.target,
            target_trouble=read.target_trouble,
            stamp=read.stamp,
        )

    def _cancelled(self, kind: SeriesKind) -> None:
        rows = self.state.rows.value
        self._set_rows(tuple(row if row.is_read(kind) else _without(row, kind, CANCELLED) for row in rows))

    def _compare(self, row: SeriesRow, progress: Progress) -> SeriesRow:
        """The row with its errors; the reference is read with the first row."""
        from dsl_core.workflows.series import ResultReference, TruthReference

        against = self.state.against.value
        if against == row.path:
            return _without(row, SeriesKind.SWEEP, "This is the reference.")
        try:
            reference = self._reference
            if reference is None:
                stamp = None if against is None else result_stamp(against)
                reference = TruthReference() if against is None else ResultReference(against, progress)
                # Another one may have been chosen while this one was read.
                if self.state.against.value == against:
                    self._reference, self._reference_stamp = reference, stamp
            return replace(row, point=reference.judge(row.path, progress))
        except Cancelled:
            raise
        except DslError as error:
            return _without(row, SeriesKind.SWEEP, str(error))

    # Judge -----------------------------------------------------------------------------------------

    def _judge(self) -> None:
        state = self.state
        counted = state.counted
        try:
            if state.kind.value is SeriesKind.STAGE:
                targets = [row.target for row in counted if row.target is not None]
                positions = [row.position_mm for row in counted if row.position_mm is not None]
                state.test.set(stage_test(positions, targets))
            else:
                require_sweep([row.point for row in counted if row.point is not None])
            state.advice.set("")
        except DecodeError as error:
            state.advice.set(str(error) if state.rows.value else "")

    # Report ----------------------------------------------------------------------------------------

    def write_report(
        self, target: Path, asked: tuple[SeriesKind, tuple[SeriesRow, ...]] | None = None
    ) -> None:
        """Write the series as an HTML page.

        Nothing is written if the series is no longer the one that was ``asked`` for (`SeriesState.reported`).
        """
        state = self.state
        (kind, counted), test = state.reported, state.test.value
        if asked is not None and asked != state.reported:
            self._notifier.tell("warning", CHANGED)
            return
        if state.advice.value or not counted or state.busy.value:
            self._notifier.tell(
                "info", state.advice.value or "Add results first, and wait until they have been read."
            )
            return
        if self.read_again():
            self._notifier.tell("warning", REPLACED)
            return
        names = [row.name for row in counted]
        targets = [row.target for row in counted if row.target is not None]
        points = [row.point for row in counted if row.point is not None]
        reference = "" if self._reference is None else self._reference.name

        def work(progress: Progress) -> Path:
            from dsl_core.evaluation.report.series_page import stage_page, sweep_page
            from dsl_core.io.staging import write_text

            progress.report("write the report", 0, 1)
            if kind is SeriesKind.STAGE and test is not None:
                return write_text(target, lambda: stage_page(names, targets, test), overwrite=True)
            return write_text(target, lambda: sweep_page(points, reference), overwrite=True)

        def done(path: Path) -> None:
            self._notifier.tell("info", f"Saved the report as {path}.")

        self._runner.submit(Job("Write the report", work, done))

    def command_line(self) -> str:
        """The command that does the same; empty while there is no answer."""
        state = self.state
        counted = state.counted
        if state.advice.value or not counted:
            return ""
        paths = " ".join(quoted(row.path) for row in counted)
        if state.kind.value is SeriesKind.SWEEP:
            against = state.against.value
            return f"dsl-scan sweep {paths}" + (f" --against {quoted(against)}" if against else "")
        positions = ",".join(f"{row.position_mm:.10g}" for row in counted)
        region = state.region.value
        part = "" if region is None else f" --region {','.join(map(str, region))}"
        return f"dsl-scan depth-test {paths} --positions {positions}{part}"


def results_in(path: Path) -> list[Path]:
    """A result itself, or all results in a folder."""
    if is_file(path / RESULT_NAME):
        return [path]
    return sorted(each.parent for each in path.glob(f"*/{RESULT_NAME}")) if is_dir(path) else []


def _is_old(row: SeriesRow) -> bool:
    return was_replaced(row.path, row.stamp)


def _renewed(row: SeriesRow) -> SeriesRow:
    """The row; one of a replaced result as if it had not been read."""
    return SeriesRow(row.path, row.position_mm) if _is_old(row) else row


def _retried(row: SeriesRow) -> SeriesRow:
    """The row; what was refused beside others is compared again."""
    return row if row.point_trouble in ("", CANCELLED) else replace(row, point_trouble="")


def _of_one_size(rows: tuple[SeriesRow, ...]) -> tuple[SeriesRow, ...]:
    """The rows; targets of another size than the first do not count."""
    first = next((row.target.shape for row in rows if row.target is not None), (0, 0))

    def judged(row: SeriesRow) -> SeriesRow:
        if row.target is None:
            return row
        sizes = [f"{width} × {height}" for height, width in (row.target.shape, first)]
        trouble = f"It has {sizes[0]} pixels, the first result {sizes[1]}." if sizes[0] != sizes[1] else ""
        return row if trouble == row.target_trouble else replace(row, target_trouble=trouble)

    return tuple(map(judged, rows))


def read_plane(row: SeriesRow, region: Region | None, progress: Progress) -> SeriesRow:
    """The row with its flat target, or with the reason there is none."""
    from dsl_core.workflows.series import read_target

    progress.report("find the plane", 0, 1)
    try:
        target, position = read_target(row.path, region)
    except DslError as error:
        return _without(row, SeriesKind.STAGE, str(error))
    return replace(row, target=target, position_mm=position)


def _without(row: SeriesRow, kind: SeriesKind, why: str) -> SeriesRow:
    """The row without a target or point, and the reason."""
    if kind is SeriesKind.STAGE:
        return replace(row, target=None, target_trouble=why)
    return replace(row, point=None, point_trouble=why)
