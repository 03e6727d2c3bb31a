"""Pins, regions and references of a result: made, named, shown, removed, kept beside it. No Qt."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.controllers.kept_marks import KeptMarks
from app.controllers.mark_records import NOTHING, fill_region, mark_of_reference, read_reference
from app.jobs.base import Job, JobRunner
from app.state.results import Mark, Pixel, ResultsState
from app.state.undo import Change, UndoStack
from app.views import Offerer
from dsl_core.errors import DslError
from dsl_core.evaluation.regions import runs_of

Mask = NDArray[np.bool_]
#: Colours that are told apart; further marks share them.
COLOURS = 8


class MarksController:
    """Changes the marks; each change can be taken back and is saved beside the result at once.

    New ones wait while those that are kept are read.
    """

    def __init__(self, state: ResultsState, runner: JobRunner, notifier: Offerer, undo: UndoStack) -> None:
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
        """Take a file with a spectrum to compare with; says why where it cannot be read."""
        try:
            curve = read_reference(path)
        except DslError as error:
            self._notifier.tell("error", str(error))
            return
        self._kept.when_read(lambda: self._add(mark_of_reference(path.stem, self._colour(), path, curve)))

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
