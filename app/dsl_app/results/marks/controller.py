"""Pins, regions and references of a result: made, named, shown, removed, kept beside it. No Qt."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dsl_app.results.marks.kept import KeptMarks
from dsl_app.results.marks.records import NOTHING, fill_region, mark_of_reference
from dsl_app.results.marks.spectra import spectra_of
from dsl_app.results.state import Library, Mark, ResultsState
from dsl_app.shared.jobs.base import Job, JobRunner
from dsl_app.shared.notify import Notifier
from dsl_app.shared.spectrum import Pixel
from dsl_app.shared.undo import Change, UndoStack
from dsl_core.evaluation.marks import runs_of
from dsl_core.io.spectra.reference_file import Reference, ReferenceFile, read_references
from dsl_core.progress import Progress

Mask = NDArray[np.bool_]
#: Colours that are told apart; further marks share them.
COLOURS = 8


class MarksController:
    """Changes the marks; each change can be taken back and is saved beside the result at once.

    New ones wait while those that are kept are read.
    """

    def __init__(self, state: ResultsState, runner: JobRunner, notifier: Notifier, undo: UndoStack) -> None:
        self.state, self._runner, self._notifier, self._undo = state, runner, notifier, undo
        self._kept = KeptMarks(state, runner, notifier)

    # Make ------------------------------------------------------------------------------------------

    def pin(self, pixel: Pixel) -> None:
        """Keep the spectrum of a pixel; says why where there is none."""
        self._kept.when_read(lambda: self._pin(pixel))

    def _pin(self, pixel: Pixel) -> None:
        spectrum = self.state.spectrum_at(pixel)
        if spectrum is None:
            self._notifier.tell("info", f"Pixel {pixel[0]}, {pixel[1]} has no spectrum to pin.")
            return
        self._add(Mark("pin", self._name("pin"), self._colour(), spectrum, pixel=pixel))

    def add_outline(self, outline_px: Iterable[tuple[float, float]]) -> None:
        """Make a region of the pixels in an outline of (x, y) corners."""
        outline = tuple((float(x), float(y)) for x, y in outline_px)
        self._add_region(Mark("region", "", 0, NOTHING, outline_px=outline))

    def add_pixels(self, mask: Mask) -> None:
        """Make a region of the pixels of a mask (rows, columns), as a lasso in 3D does."""
        self._add_region(Mark("region", "", 0, NOTHING, runs=runs_of(mask)))

    def add_reference(self, path: Path) -> None:
        """Take a file with a spectrum to compare with, or let somebody choose where it holds several.

        Says why where it cannot be read.
        """
        result = self.state.result.value

        def done(content: ReferenceFile) -> None:
            if self.state.result.value is not result:
                return
            if len(content.references) == 1:
                self.take_references(path, content.references)
            else:
                self.state.library.set(Library(path, content))

        self._runner.submit(
            Job(f"Read {path.name}", lambda progress: read_references(path), done, self._tell, is_minor=True)
        )

    def take_references(self, path: Path, chosen: Iterable[Reference]) -> None:
        """Take spectra of a file to compare with; a library is not asked about any more."""
        self.state.library.set(None)
        for each in chosen:
            self._kept.when_read(lambda each=each: self._add(self._reference(path, each)))  # type: ignore[misc]

    def _reference(self, path: Path, chosen: Reference) -> Mark:
        name = chosen.name or path.stem
        return mark_of_reference(name, self._colour(), path, chosen.curve, chosen.name)

    def _add_region(self, draft: Mark) -> None:
        result = self.state.result.value
        if result is None or not result.has_spectra:
            self._notifier.tell("info", "This result holds depth only; a region needs spectra.")
            return

        def done(region: Mark) -> None:
            if self.state.result.value is not result:
                return
            if region.used == 0:
                self._notifier.tell("info", "No pixel in this outline has a spectrum. Draw a larger one.")
                return
            self._kept.when_read(
                lambda: self._add(replace(region, name=self._name("region"), colour=self._colour()))
            )

        self._runner.submit(
            Job(
                "Mean of a region",
                lambda progress: fill_region(draft, result, progress),
                done,
                self._tell,
                is_minor=True,
            )
        )

    def _add(self, mark: Mark) -> None:
        self._change(f"adding {mark.name}", (*self.state.marks.value, mark))
        self.state.selected.set(mark.key)

    # Change ----------------------------------------------------------------------------------------

    def remove(self, key: int) -> None:
        """Take a mark away."""
        mark = self._find(key)
        if mark is not None:
            self._change(f"removing {mark.name}", tuple(m for m in self.state.marks.value if m.key != key))

    def rename(self, key: int, name: str) -> None:
        """Name a mark; an empty name changes nothing."""
        mark = self._find(key)
        if mark is not None and name.strip() and name.strip() != mark.name:
            self._replace(f"naming {name.strip()}", replace(mark, name=name.strip()))

    def show(self, key: int, shown: bool) -> None:
        """Show or hide a mark in pictures and plot."""
        mark = self._find(key)
        if mark is not None and mark.shown != shown:
            self._replace(f"{'showing' if shown else 'hiding'} {mark.name}", replace(mark, shown=shown))

    def _replace(self, text: str, mark: Mark) -> None:
        self._change(text, tuple(mark if m.key == mark.key else m for m in self.state.marks.value))

    def _find(self, key: int) -> Mark | None:
        return next((mark for mark in self.state.marks.value if mark.key == key), None)

    def _change(self, text: str, after: tuple[Mark, ...]) -> None:
        before = self.state.marks.value
        self._undo.push(Change(text, self._setter(after), self._setter(before)))

    def _setter(self, marks: tuple[Mark, ...]) -> Callable[[], None]:
        def set_marks() -> None:
            self.state.marks.set(marks)
            self._kept.save()

        return set_marks

    def _name(self, kind: str) -> str:
        taken = {mark.name for mark in self.state.marks.value}
        return next(name for i in range(1, len(taken) + 2) if (name := f"{kind} {i}") not in taken)

    def _colour(self) -> int:
        """The colour that the fewest marks have."""
        used = [mark.colour for mark in self.state.marks.value]
        return min(range(COLOURS), key=used.count)

    # Hand on ---------------------------------------------------------------------------------------

    def has_shown(self) -> bool:
        """Whether a spectrum is shown that could be copied or exported; says what to do where none is."""
        found = bool(spectra_of(self.state.marks.value))
        if not found:
            self._notifier.tell("info", "No spectrum is ticked. Pin a pixel, draw a region, or tick one.")
        return found

    def copy_spectra(self, put: Callable[[str], object]) -> None:
        """Hand the spectra that are shown to ``put``, as a table with tabs."""
        from dsl_core.io.export.spectra import spectra_as_text

        if self.has_shown():
            spectra = spectra_of(self.state.marks.value)
            put(spectra_as_text(spectra))
            self._notifier.tell("info", f"Copied {_counted(len(spectra))}. Paste them into a spreadsheet.")

    def export_spectra(self, path: Path, overwrite: bool) -> None:
        """Write the spectra that are shown as CSV."""
        result = self.state.result.value
        if result is None or not self.has_shown():
            return
        spectra = spectra_of(self.state.marks.value)

        def work(progress: Progress) -> Path:
            from dsl_core.io.export.spectra import export_spectra

            progress.report("write spectra", 0, 1)
            return export_spectra(spectra, path, result.attributes, overwrite=overwrite)

        def done(written: Path) -> None:
            self._notifier.tell("info", f"Wrote {_counted(len(spectra))} to {written}.")

        self._runner.submit(Job("Export spectra", work, done, self._tell))

    # Keep ------------------------------------------------------------------------------------------

    def load(self) -> None:
        """Take the marks that are kept beside the result that was opened; forgets what could be undone."""
        self._undo.clear()
        self._kept.read()

    @property
    def is_reading(self) -> bool:
        """Whether kept marks are still being read."""
        return self._kept.is_reading

    def _tell(self, error: Exception) -> None:
        self._notifier.tell("error", str(error))


def _counted(spectra: int) -> str:
    return "1 spectrum" if spectra == 1 else f"{spectra} spectra"
