"""Names the material of every pixel, from a library or from what is marked. No Qt."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from dsl_app.results.state import Mark, Materials, ResultsState
from dsl_app.shared.jobs.base import Job, JobRunner
from dsl_app.shared.notify import Notifier, sentence_of
from dsl_app.shared.replaced import load_as_read
from dsl_core.analysis.classes import SpectralClass
from dsl_core.analysis.classify import Brightness, Limits, Measure
from dsl_core.io.result.annotations_file import Annotations
from dsl_core.io.result.result_arrays import ResultArrays
from dsl_core.progress import Progress

#: How long a report that was written is offered to be opened, s.
REPORT_STAYS_S = 30.0


@dataclass(frozen=True)
class Way:
    """How spectra are compared with classes.

    ``library_error`` is the standard deviation of the spectra of a library, as a share of them; ``grouping``
    says what of a library makes a class; ``limits`` are the usual ones of the measure for None.
    """

    measure: Measure = Measure.PROBABILITY
    brightness: Brightness = "stated"
    library_error: float = 0.0
    grouping: str = "auto"
    limits: Limits | None = None


#: Reads or makes the classes for a result, with notes.
_Classes = Callable[[ResultArrays, Progress], tuple[tuple[SpectralClass, ...], tuple[str, ...]]]


class AnswersController:
    """Sets the materials of a `ResultsState`; an older request never replaces the answer to a newer one."""

    def __init__(self, state: ResultsState, runner: JobRunner, notifier: Notifier) -> None:
        self.state, self._runner, self._notifier = state, runner, notifier
        self._request = 0
        #: The map that is being made: it is given up for the next one, or none.
        self._job: Job[Materials] | None = None

    def from_marks(self, way: Way, cancelled: Callable[[], object] = lambda: None) -> bool:
        """Look for the spectra of all ticked pins, regions and references; False if there are none.

        ``cancelled`` is called if this is, unless something else was asked for since.
        """
        marks = [mark for mark in self.state.marks.value if mark.shown and not mark.trouble]
        if not marks:
            self._notifier.tell(
                "info",
                "Pin pixels, mark regions of known materials or add references first; they are the classes.",
            )
            return False
        self._start("marks", way, lambda result, _: (classes_of_marks(result, marks), ()), cancelled)
        return True

    def from_library(self, path: Path, way: Way, cancelled: Callable[[], object] = lambda: None) -> None:
        """Look for the spectra of a file, or of a folder with all below it; ``cancelled`` as of marks."""

        def classes(
            result: ResultArrays, progress: Progress
        ) -> tuple[tuple[SpectralClass, ...], tuple[str, ...]]:
            from dsl_core.analysis.classes import classes_of_library
            from dsl_core.analysis.library import read_library

            library = read_library([path], way.grouping, progress=progress)
            nm = result.wavelengths_nm
            found, left_out = classes_of_library(library, nm, way.library_error, result.band_width_nm)
            return found, (*library.notes, *left_out)

        self._start(path.name, way, classes, cancelled)

    def _start(self, name: str, way: Way, classes: _Classes, cancelled: Callable[[], object]) -> None:
        opened = self.state.result.value
        if opened is None or not opened.has_spectra:
            self._notifier.tell("info", "Materials need a result with spectra. Open one first.")
            return
        self._request += 1
        request = self._request
        title, colours = f"Materials by {name}", {mark.name: mark.colour for mark in self.state.marks.value}

        def work(progress: Progress) -> Materials:
            from dsl_core.analysis.classes import known_classes, marked_by, without_missing
            from dsl_core.analysis.classification import Classification, PixelAreas
            from dsl_core.analysis.classify import score
            from dsl_core.model.result_order import known_bands

            known = known_bands(opened["reflectance"])
            missing, result = without_missing(opened.wavelengths_nm, known), opened.of_bands(known)
            asked, notes = classes(result, progress)
            std = result.known("reflectance_std")
            found, doubts = known_classes(marked_by(asked, colours), std)
            scores = score(
                result["reflectance"],
                std,
                result.known("data_share"),
                result["flags"],
                found,
                way.measure,
                way.brightness,
                progress,
                result.wavelengths_nm,
            )
            names = ("points_mm", "normals", "depth_std_mm")
            points_mm, normals, std_mm = (result.known(name) for name in names)
            areas = PixelAreas.of(points_mm, normals, std_mm, result.places_px)
            made = Classification.of(scores, way.limits, way.brightness, areas)
            return Materials(name, made, (*missing, *doubts, *notes))

        def done(materials: Materials) -> None:
            if self.state.result.value is opened and request == self._request:
                self.state.materials.set(materials)

        def failed(error: Exception) -> None:
            if self.state.result.value is opened and request == self._request:
                # The map of other classes would pass for the answer.
                self.state.materials.set(None)
            self._notifier.tell("error", f"There is no map by {name}. {sentence_of(error)}")

        def undone() -> None:
            if request == self._request:
                cancelled()

        def ended() -> None:
            if self._job is job:
                self._job = None

        self._give_up()
        self._job = job = Job(title, work, done, failed, undone, is_minor=True, on_ended=ended)
        self._runner.submit(job)

    def _give_up(self) -> None:
        """Stop what nobody will see: each step of a box would else compute the whole picture to its end."""
        if self._job is not None:
            self._job.cancel()

    def set_limits(self, worst: float, margin: float) -> None:
        """Change the limits; the picture and the table follow at once."""
        materials = self.state.materials.value
        limits = Limits(worst, margin)
        if materials is not None and materials.found.limits != limits:
            self.state.materials.set(replace(materials, found=materials.found.under(limits)))

    def clear(self) -> None:
        """Show the picture without materials."""
        self._request += 1
        self._give_up()
        self.state.materials.set(None)

    def write(self, result: ResultArrays, materials: Materials, path: Path, overwrite: bool = False) -> None:
        """Write a map: ENVI (.hdr), points (.ply) or table (.csv), as the ending of the path says."""

        def work(progress: Progress) -> list[Path]:
            from dsl_core.analysis.classification import write_classification

            progress.report("write the map", 0, 1)
            return write_classification(load_as_read(result), materials.found, path, overwrite=overwrite)

        def done(files: list[Path]) -> None:
            self._notifier.tell("info", f"Written: {', '.join(file.name for file in files)}.")

        self._runner.submit(Job(f"Write {path.name}", work, done))

    def write_report(
        self,
        result: ResultArrays,
        materials: Materials | None,
        path: Path,
        overwrite: bool = False,
        marks: Annotations | None = None,
    ) -> None:
        """Write a report about a result, its marks (those saved for None) and its materials: page or PDF."""

        def work(progress: Progress) -> Path:
            from dsl_core.analysis.session_report import session_content, write_report
            from dsl_core.io.result.annotations_file import load_annotations

            progress.report("write the report", 0, 1)
            content = session_content(
                result.path.stem,
                load_as_read(result),
                load_annotations(result.path) if marks is None else marks,
                None if materials is None else materials.found,
                () if materials is None else materials.of_classes,
            )
            return write_report(content, path, overwrite=overwrite)

        def done(path: Path) -> None:
            show = {"Open the report": lambda: self.state.opened.emit(path)}
            self._notifier.offer(f"The report is saved in {path.name}.", show, REPORT_STAYS_S)

        self._runner.submit(Job(f"Write {path.name}", work, done))


def classes_of_marks(result: ResultArrays, marks: list[Mark]) -> tuple[SpectralClass, ...]:
    """A class for each mark: its pixels in the result, or the curve of its file.

    Raises `DecodeError` or `CalibrationError` where one has no spectrum at the bands of the result.
    """
    import numpy as np

    from dsl_core.analysis.classes import Member, class_of_pixels
    from dsl_core.errors import CalibrationError, DecodeError
    from dsl_core.evaluation.marks import mask_of_outline, mask_of_runs

    std = result.known("reflectance_std")
    if std is None:
        raise DecodeError(
            "The result states no deviations of its spectra. Reconstruct the scan again, or name materials"
            " from a library by spectral angle."
        )
    classes = []
    for mark in marks:
        if mark.curve is not None:
            try:
                found = result.at_bands(mark.curve)
            except CalibrationError as error:
                raise CalibrationError(f"{mark.name} cannot be looked for. {error}") from error
            classes.append(SpectralClass(mark.name, (Member.of(found.values, found.std),)))
            continue
        if mark.pixel is not None:
            mask = np.zeros(result.shape, bool)
            mask[mark.pixel[1], mark.pixel[0]] = True
        elif mark.runs:
            mask = mask_of_runs(mark.runs, result.shape)
        else:
            mask = mask_of_outline(mark.outline_px, result.shape)
        cubes = (result["reflectance"], std)
        classes.append(class_of_pixels(mark.name, *cubes, mask, result["flags"]))
    return tuple(classes)
