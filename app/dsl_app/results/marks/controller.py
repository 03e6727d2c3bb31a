"""Pins, regions and references of a result: adds, names, shows, removes and saves them. No Qt."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dsl_app.results.marks.spectra import NO_SPECTRUM, fill_region, mark_of_reference, shown_spectra
from dsl_app.results.marks.storage import MarkStorage
from dsl_app.results.state import Library, Mark, ResultsState
from dsl_app.shared.jobs.base import Job, JobRunner
from dsl_app.shared.notify import Notifier
from dsl_app.shared.spectrum import Pixel
from dsl_app.shared.undo import Change, UndoStack
from dsl_core.evaluation.marks import runs_of
from dsl_core.io.result.annotations_file import Annotations
from dsl_core.io.result.result_arrays import ResultArrays
from dsl_core.io.spectra.reference_file import Reference, ReferenceFile, read_references
from dsl_core.progress import Progress
from dsl_core.words import counted

if TYPE_CHECKING:
    from dsl_core.io.export.spectra import NamedSpectrum

Mask = NDArray[np.bool_]


class MarksController:
    """Changes the marks; each change can be undone and is saved next to the result at once.

    Changes wait while saved marks are being read.
    """

    def __init__(self, state: ResultsState, runner: JobRunner, notifier: Notifier, undo: UndoStack) -> None:
        self.state, self._runner, self._notifier, self._undo = state, runner, notifier, undo
        self._storage = MarkStorage(state, runner, notifier)

    # Add -------------------------------------------------------------------------------------------

    def pin(self, pixel: Pixel) -> None:
        """Pin the spectrum of a pixel; says so if it has none."""
        self._storage.when_read(lambda: self._pin(pixel))

    def _pin(self, pixel: Pixel) -> None:
        spectrum = self.state.spectrum_at(pixel)
        if spectrum is None:
            result = self.state.result.value
            x_px, y_px = pixel if result is None else result.in_picture(pixel)
            self._notifier.tell("info", f"Pixel {x_px}, {y_px} has no spectrum to pin.")
            return
        self._add(Mark("pin", self._name("pin"), self._colour(), spectrum, pixel=pixel))

    def add_outline(self, outline_px: Iterable[tuple[float, float]]) -> None:
        """Add a region: the pixels inside an outline of (x, y) corners."""
        outline = tuple((float(x), float(y)) for x, y in outline_px)
        self._add_region(Mark("region", "", 0, NO_SPECTRUM, outline_px=outline))

    def add_pixels(self, mask: Mask) -> None:
        """Add a region: the pixels of a mask (rows, columns), as a lasso in 3D gives them."""
        self._add_region(Mark("region", "", 0, NO_SPECTRUM, runs=runs_of(mask)))

    def add_reference(self, path: Path) -> None:
        """Add the reference spectrum in a file; if it holds several, the user is asked which.

        Says why if the file cannot be read.
        """
        result = self.state.result.value

        def done(content: ReferenceFile) -> None:
            if self.state.result.value is not result:
                return
            for note in content.notes:
                self._notifier.tell("info", f"{path.name}: {note}")
            if content.as_percent is not None:
                most = content.as_percent
                self._notifier.tell(
                    "info",
                    f"{path.name} states no unit: values up to {most:.3g} are read as percent, {most:.3g} as"
                    f" a reflectance of {most / 100:.3g}. If that is wrong, divide them by those of a white"
                    " standard.",
                )
            if len(content.references) == 1:
                self.add_references(path, content.references)
            else:
                self.state.library.set(Library(path, content))

        work = lambda progress: read_references(path)  # noqa: E731
        self._runner.submit(Job(f"Read {path.name}", work, done, is_minor=True))

    def add_references(self, path: Path, chosen: Iterable[Reference]) -> None:
        """Add reference spectra of a file; ends the choice from a library.

        One that is listed already is selected instead. Says why one that has no wavelength in common with
        the result is neither drawn nor compared.
        """
        self.state.library.set(None)
        for each in chosen:
            self._tell_if_beside(each.name or path.stem, each.curve.wavelengths_nm)
            self._storage.when_read(lambda each=each: self._add_reference(path, each))  # type: ignore[misc]

    def _tell_if_beside(self, name: str, nm: Sequence[float]) -> None:
        result = self.state.result.value
        if result is None or not result.has_spectra:
            return
        low, high = result.wavelengths_nm[0], result.wavelengths_nm[-1]
        if nm[-1] < low or nm[0] > high:
            self._notifier.tell(
                "warning",
                f"{name} covers {nm[0]:.0f} to {nm[-1]:.0f} nm and the result {low:.0f} to {high:.0f} nm:"
                " it is listed, but neither drawn nor compared. If that is not so, correct its wavelengths.",
            )

    def _add_reference(self, path: Path, chosen: Reference) -> None:
        origin = (path, chosen.name, chosen.curve)
        for mark in self.state.marks.value:
            if (mark.file, mark.entry, mark.curve) == origin:
                self._notifier.tell("info", f"{mark.name} of {path.name} is listed already.")
                self.state.selected.set(mark.key)
                return
        name = chosen.name or path.stem
        self._add(mark_of_reference(name, self._colour(), path, chosen.curve, chosen.name))

    def _add_region(self, draft: Mark) -> None:
        result = self.state.result.value
        if result is None or not result.has_spectra:
            self._notifier.tell("info", "This result has depth only; a region needs spectra.")
            return

        def done(region: Mark) -> None:
            if self.state.result.value is not result:
                return
            if region.used == 0:
                self._notifier.tell("info", "No pixel in this outline has a spectrum. Draw a larger one.")
                return
            self._storage.when_read(
                lambda: self._add(replace(region, name=self._name("region"), colour=self._colour()))
            )

        work = lambda progress: fill_region(draft, result, progress)  # noqa: E731
        self._runner.submit(Job("Mean of a region", work, done, is_minor=True))

    def _add(self, mark: Mark) -> None:
        self._change(f"adding {mark.name}", (*self.state.marks.value, mark))
        self.state.selected.set(mark.key)

    # Change ----------------------------------------------------------------------------------------

    def remove(self, *keys: int) -> None:
        """Remove marks at once; if the selected one goes, the one in its place is selected."""
        marks = self.state.marks.value
        gone = [mark for mark in marks if mark.key in keys]
        if not gone:
            return
        rest = tuple(mark for mark in marks if mark not in gone)
        what = gone[0].name if len(gone) == 1 else f"{len(gone)} marks"
        self._change(f"removing {what}", rest)
        if self.state.selected.value in keys:
            place = marks.index(gone[0])
            self.state.selected.set(rest[min(place, len(rest) - 1)].key if rest else 0)

    def rename(self, key: int, name: str) -> None:
        """Rename a mark; an empty name is ignored."""
        mark = self._find(key)
        if mark is not None and name.strip() and name.strip() != mark.name:
            self._replace(f"renaming to {name.strip()}", replace(mark, name=name.strip()))

    def show(self, shown: bool, *keys: int) -> None:
        """Show or hide marks in the pictures and the plot."""
        marks = self.state.marks.value
        other = [mark for mark in marks if mark.key in keys and mark.shown != shown]
        if other:
            what = other[0].name if len(other) == 1 else f"{len(other)} marks"
            after = tuple(replace(mark, shown=shown) if mark in other else mark for mark in marks)
            self._change(f"{'showing' if shown else 'hiding'} {what}", after)

    def _replace(self, text: str, mark: Mark) -> None:
        self._change(text, tuple(mark if m.key == mark.key else m for m in self.state.marks.value))

    def _find(self, key: int) -> Mark | None:
        return next((mark for mark in self.state.marks.value if mark.key == key), None)

    def _change(self, text: str, after: tuple[Mark, ...]) -> None:
        before = self.state.marks.value
        self._undo.push(Change(text, self._setter(after), self._setter(before), owner=self.state))

    def _setter(self, marks: tuple[Mark, ...]) -> Callable[[], None]:
        def set_marks() -> None:
            self.state.marks.set(marks)
            self._storage.save()

        return set_marks

    def _name(self, kind: str) -> str:
        taken = {mark.name for mark in self.state.marks.value}
        return next(name for i in range(1, len(taken) + 2) if (name := f"{kind} {i}") not in taken)

    def _colour(self) -> int:
        """The first colour that no mark has."""
        used = {mark.colour for mark in self.state.marks.value}
        return next(index for index in itertools.count() if index not in used)

    # Copy and export -------------------------------------------------------------------------------

    def shown(self) -> list[NamedSpectrum]:
        """The spectra that can be copied or exported; if there are none, says what to do."""
        why = self.state.hidden
        found = [] if why else shown_spectra(self.state.marks.value, self.state.result.value)
        if not found:
            none_ticked = "No spectrum is ticked. Pin a pixel, draw a region, or tick one."
            self._notifier.tell("info", why or none_ticked)
        return found

    def copy_spectra(self, put: Callable[[str], object]) -> None:
        """Pass the spectra shown to ``put``, as a tab-separated table."""
        from dsl_core.io.export.spectra import spectra_as_text

        if spectra := self.shown():
            put(spectra_as_text(spectra))
            self._notifier.tell(
                "info",
                f"Copied {counted(len(spectra), 'spectrum', 'spectra')}. Paste them into a spreadsheet.",
            )

    def export_spectra(
        self, result: ResultArrays, spectra: list[NamedSpectrum], path: Path, overwrite: bool
    ) -> None:
        """Write spectra of a result as CSV."""

        def work(progress: Progress) -> Path:
            from dsl_core.io.export.spectra import export_spectra

            progress.report("write spectra", 0, 1)
            return export_spectra(spectra, path, result.attributes, overwrite=overwrite)

        def done(written: Path) -> None:
            self._notifier.tell("info", f"Wrote {counted(len(spectra), 'spectrum', 'spectra')} to {written}.")

        self._runner.submit(Job("Export spectra", work, done))

    # Read ------------------------------------------------------------------------------------------

    def load(self) -> None:
        """Read the marks of the result that was just opened; forgets the changes to those of another."""
        self._undo.forget(self.state)
        self._storage.read()

    @property
    def listed(self) -> Annotations | None:
        """The marks that are listed, saved or not; None where those of the result have not been read."""
        return self._storage.listed

    def save_again(self) -> str:
        """Save what could not be saved before; says what still cannot be, and why, empty when all is."""
        return self._storage.save_again()

    @property
    def is_reading(self) -> bool:
        """Whether saved marks are still being read."""
        return self._storage.is_reading
