"""Marks on disk next to a result: read before anything is changed, and never replaced unread. No Qt."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from enum import Enum
from functools import partial
from pathlib import Path

from dsl_app.results.marks.spectra import NO_SPECTRUM, fill_region, mark_of_reference
from dsl_app.results.state import Mark, ResultsState
from dsl_app.shared.jobs.base import Job, JobRunner
from dsl_app.shared.notify import Notifier
from dsl_app.shared.paths import barrier, stamp_of, there
from dsl_app.shared.replaced import was_replaced
from dsl_app.shared.spectrum import spectrum_of_pixel
from dsl_core.errors import DslError
from dsl_core.io.atomic import set_aside
from dsl_core.io.result.annotations_file import (
    Annotations,
    PinRecord,
    ReferenceRecord,
    RegionRecord,
    annotations_path,
    load_annotations,
    save_annotations,
)
from dsl_core.io.result.result_arrays import ResultArrays
from dsl_core.io.spectra.reference_file import read_reference
from dsl_core.progress import Progress


class _Reading(Enum):
    """How far the marks of the open result have been read."""

    RUNNING = "running"
    DONE = "done"
    FAILED = "failed"


@dataclass(frozen=True)
class _Unsaved:
    """Marks that could not be saved; ``stamp`` is of the file that they were to replace."""

    marks: Annotations
    stamp: tuple[int, int] | None


class MarkStorage:
    """Reads the marks of the open result and saves them at every change.

    Saving replaces the whole file. So existing marks are read first, or set aside if the user chooses to.
    Marks that cannot be saved, as on a full disk, are kept for as long as the window is open.
    """

    def __init__(self, state: ResultsState, runner: JobRunner, notifier: Notifier) -> None:
        self.state, self._runner, self._notifier = state, runner, notifier
        self._reading = _Reading.DONE
        self._reason = ""
        self._waiting: list[Callable[[], None]] = []
        #: When the file was changed last, and its size, as far as this window knows.
        self._stamp: tuple[int, int] | None = None
        #: What could not be saved, by the path of its result.
        self._unsaved: dict[Path, _Unsaved] = {}

    # Read ------------------------------------------------------------------------------------------

    def read(self) -> None:
        """Read the marks saved next to the result that was just opened."""
        self._waiting.clear()
        self.state.marks.set(())
        self.state.selected.set(0)
        self._read()

    @property
    def listed(self) -> Annotations | None:
        """The marks that are listed, saved or not; None where those of the result have not been read.

        On a full disk, or in a folder that is read only, they are not what the file holds.
        """
        return annotations_of(self.state.marks.value) if self._reading is _Reading.DONE else None

    @property
    def is_reading(self) -> bool:
        """Whether saved marks are still being read."""
        return self._reading is _Reading.RUNNING

    def when_read(self, change: Callable[[], None]) -> None:
        """Change marks once the saved ones have been read; says so if that is not now."""
        if self._reading is _Reading.DONE:
            change()
        elif self._reading is _Reading.RUNNING:
            self._waiting.append(change)
            self._notifier.tell("info", "The marks of this result are being read; the new one will follow.")
        else:
            self._offer()

    def _read(self) -> None:
        self._reading = _Reading.RUNNING
        result = self.state.result.value
        if result is None:
            self._finish()
            return
        kept = self._unsaved.get(result.path)
        try:
            saved = load_annotations(result.path) if kept is None else kept.marks
            self._stamp = stamp_of(annotations_path(result.path)) if kept is None else kept.stamp
        except DslError as error:
            self._fail(str(error))
            return
        if saved == Annotations():
            self._finish()
            return

        def done(marks: tuple[Mark, ...]) -> None:
            if self.state.result.value is result:
                self.state.marks.set(marks)
                self._tell_troubles(marks)
                self._finish()

        def failed(reason: str) -> None:
            if self.state.result.value is result:
                self._fail(reason)

        self._runner.submit(
            Job(
                "Marks",
                lambda progress: marks_of(saved, result, progress),
                done,
                lambda error: failed(str(error)),
                lambda: failed("reading them was cancelled"),
                is_minor=True,
            )
        )

    def _tell_troubles(self, marks: tuple[Mark, ...]) -> None:
        bad = [mark for mark in marks if mark.trouble]
        if not bad:
            return
        names = ", ".join(mark.name for mark in bad[:4]) + (" and more" if len(bad) > 4 else "")
        self._notifier.tell(
            "warning",
            f"No spectrum for {names}. These marks stay in the list with the reason. Open the result"
            " again once their files are back.",
            "\n".join(f"{mark.name}: {mark.trouble}" for mark in bad),
        )

    def _finish(self) -> None:
        self._reading = _Reading.DONE
        waiting, self._waiting = self._waiting, []
        for change in waiting:
            change()

    # If they cannot be read ------------------------------------------------------------------------

    def _fail(self, reason: str) -> None:
        self._reading, self._reason = _Reading.FAILED, reason
        self._offer()

    def _offer(self) -> None:
        assert self.state.result.value is not None
        path = annotations_path(self.state.result.value.path)
        self._notifier.offer(
            f"The marks in {path} could not be read: {self._reason.rstrip('.')}. The file is not changed, and"
            " no mark is added until you read it again or start with no marks.",
            {
                "Read again": partial(self._decide, path, self._read),
                "Rename the file and start with no marks": partial(self._decide, path, self._start_empty),
            },
        )

    def _decide(self, path: Path, then: Callable[[], None]) -> None:
        """Do what was chosen, unless the offer is about a result that is no longer open."""
        result = self.state.result.value
        is_open = result is not None and annotations_path(result.path) == path
        if is_open and self._reading is _Reading.FAILED:
            then()

    def _start_empty(self) -> None:
        assert self.state.result.value is not None
        path = annotations_path(self.state.result.value.path)
        where = set_aside(path)
        if there(path) or barrier(path):
            self._reason = "the file cannot be renamed; check the permissions of its folder and its drive"
            self._offer()
            return
        self._notifier.tell("info", f"Started with no marks.{where}")
        self._finish()

    # Save ------------------------------------------------------------------------------------------

    def save(self) -> None:
        """Save all marks; says why if that fails, and keeps what another window has saved meanwhile."""
        result = self.state.result.value
        if result is None:
            return
        if was_replaced(result.path, result.stamp):
            self._notifier.tell(
                "warning",
                f"The marks are not saved: {result.path} was replaced after it had been opened. Open it"
                " again, then mark it.",
            )
            return
        marks = annotations_of(self.state.marks.value)
        try:
            self._stamp = self._write(result.path, marks, self._stamp)
        except DslError as error:
            self._unsaved[result.path] = _Unsaved(marks, self._stamp)
            self._notifier.tell("warning", f"The marks could not be saved: {error}")

    def save_again(self) -> str:
        """Save what could not be saved before; says what still cannot be, and why, empty when all is."""
        lost = []
        for path, kept in tuple(self._unsaved.items()):
            try:
                stamp = self._write(path, kept.marks, kept.stamp)
            except DslError as error:
                lost.append(f"The marks of {path.stem} are not saved: {error}")
                continue
            if self.state.result.value is not None and self.state.result.value.path == path:
                self._stamp = stamp
        return " ".join(lost)

    def _write(
        self, result: Path, marks: Annotations, known: tuple[int, int] | None
    ) -> tuple[int, int] | None:
        """Save marks next to a result where the file is the one that is ``known``, or else beside that.

        Returns what the file is now; raises `StoreError`.
        """
        path = annotations_path(result)
        if stamp_of(path) not in (None, known):
            self._notifier.tell(
                "warning",
                f"Another window has changed the marks in {path}.{set_aside(path)} Those of this window are"
                " saved now. Close one of the windows.",
            )
        save_annotations(marks, result)
        self._unsaved.pop(result, None)
        return stamp_of(path)


# Records on disk -----------------------------------------------------------------------------------


def marks_of(saved: Annotations, result: ResultArrays, progress: Progress) -> tuple[Mark, ...]:
    """Saved marks with their spectra; a mark without one says why, so that it stays in the file."""
    regions = tuple(_saved_region(region, result, progress) for region in saved.regions)
    return (
        *(_saved_pin(pin, result) for pin in saved.pins),
        *regions,
        *(_saved_reference(reference) for reference in saved.references),
    )


def _saved_pin(pin: PinRecord, result: ResultArrays) -> Mark:
    spectrum = spectrum_of_pixel(result, pin.pixel)
    x_px, y_px = result.in_picture(pin.pixel)
    trouble = "" if spectrum is not None else f"Pixel {x_px}, {y_px} has no spectrum here."
    spectrum = spectrum or NO_SPECTRUM
    return Mark("pin", pin.name, pin.colour, spectrum, pin.shown, pixel=pin.pixel, trouble=trouble)


def _saved_region(region: RegionRecord, result: ResultArrays, progress: Progress) -> Mark:
    draft = Mark("region", region.name, region.colour, NO_SPECTRUM, region.shown)
    draft = replace(draft, outline_px=region.outline_px, runs=region.runs)
    filled = fill_region(draft, result, progress) if result.has_spectra else draft
    return filled if filled.used else replace(draft, trouble="No pixel of this region has a spectrum here.")


def _saved_reference(reference: ReferenceRecord) -> Mark:
    path = Path(reference.file)
    try:
        curve = read_reference(path, reference.entry)
        made = mark_of_reference(reference.name, reference.colour, path, curve, reference.entry)
    except DslError as error:
        made = Mark("reference", reference.name, reference.colour, NO_SPECTRUM, file=path, trouble=str(error))
        made = replace(made, entry=reference.entry)
    return replace(made, shown=reference.shown)


def annotations_of(marks: Iterable[Mark]) -> Annotations:
    """Marks as records to save."""
    pins, regions, references = [], [], []
    for mark in marks:
        name, colour, shown = mark.name, mark.colour, mark.shown
        if mark.kind == "pin" and mark.pixel is not None:
            pins.append(PinRecord(name=name, pixel=mark.pixel, colour=colour, shown=shown))
        elif mark.kind == "region":
            regions.append(
                RegionRecord(
                    name=name, outline_px=mark.outline_px, runs=mark.runs, colour=colour, shown=shown
                )
            )
        elif mark.file is not None:
            references.append(
                ReferenceRecord(name=name, file=str(mark.file), entry=mark.entry, colour=colour, shown=shown)
            )
    return Annotations(pins=tuple(pins), regions=tuple(regions), references=tuple(references))
