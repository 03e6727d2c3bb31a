"""What the Results page decides about a whole result: open, reconstruct, light, search, export. No Qt."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dsl_app.results.files import expected_files, is_complete, picture_of
from dsl_app.results.marks.controller import MarksController
from dsl_app.results.state import Limits, ResultsState, Search, Seek, View
from dsl_app.shared.evented import Event
from dsl_app.shared.jobs.base import Job, JobRunner
from dsl_app.shared.known_files import RESULT_NAME, Kind, kind_of
from dsl_app.shared.notify import Notifier
from dsl_app.shared.spectrum import Pixel, Spectrum
from dsl_app.shared.undo import Change, UndoStack
from dsl_core.io.result.result_arrays import ResultArrays, load_arrays
from dsl_core.progress import Progress
from dsl_core.workflows.inspection import FrameBlock, IntensityGraph, intensity_graph, read_block


class ResultsController:
    """Opens results and answers what the page asks of the whole image; ``marks`` has pins and regions."""

    def __init__(self, state: ResultsState, runner: JobRunner, notifier: Notifier, undo: UndoStack) -> None:
        self.state, self._runner, self._notifier = state, runner, notifier
        self.marks = MarksController(state, runner, notifier, undo)
        self._undo = undo
        #: Tells when a result is there with all its views, so that one may look at it in another way.
        self.opened: Event[ResultArrays] = Event()
        self._block: FrameBlock | None = None
        self._turn, self._lit = 0, ("D65", True)
        self._loading: Job[tuple[ResultArrays, NDArray[np.uint8] | None]] | None = None

    # Open ------------------------------------------------------------------------------------------

    def open(self, path: Path) -> bool:
        """Open a result, offer to reconstruct a scan, or take a reference; False for anything else."""
        match kind_of(path):
            case Kind.RESULT:
                self._load(path)
            case Kind.SCAN if is_complete(path):
                self.offer(path)
            case Kind.REFERENCE if self.state.result.value is not None:
                self.marks.add_reference(path)
            case _:
                return False
        return True

    @property
    def is_reading(self) -> bool:
        """Whether a result or its marks are still being read; a reconstruction is no reading."""
        is_loading = self._loading is not None and not self._loading.state.is_final
        return is_loading or self.marks.is_reading

    def offer(self, session: Path) -> None:
        """Open the result beside a scan, or offer to make it."""
        target = session.with_suffix(".zarr")
        if (target / RESULT_NAME).is_file():
            self._load(target)
        else:
            self.state.offer.set(session)

    def reconstruct(self) -> None:
        """Make the result of the scan that is offered, save it beside the scan and open it."""
        session = self.state.offer.value
        if session is None:
            return
        target = session.with_suffix(".zarr")

        def work(progress: Progress) -> ResultArrays:
            from dsl_core.io.result.result_file import save_result
            from dsl_core.workflows.scans import reconstruct_scan

            save_result(reconstruct_scan(session, progress=progress), target)
            return load_arrays(target, progress)

        self._start(f"Reconstruct {session.name}", work)

    def _load(self, path: Path) -> None:
        self._start(f"Open {path.name}", lambda progress: load_arrays(path, progress), is_minor=True)

    def _start(self, title: str, work: Callable[[Progress], ResultArrays], is_minor: bool = False) -> None:
        if self.state.busy.value:
            self._notifier.tell(
                "info", f"{self.state.busy.value} is not finished yet. Wait for it or cancel."
            )
            return
        self.state.busy.set(title)

        def both(progress: Progress) -> tuple[ResultArrays, NDArray[np.uint8] | None]:
            from dsl_core.optics.colour import observer_weights

            arrays = work(progress)
            if arrays.has_spectra:
                # Imports what the first comparison of colours would else stop the window for.
                observer_weights(arrays.wavelengths_nm)
            return arrays, picture_of(arrays["rgb"]) if "rgb" in arrays.arrays else None

        job = Job(
            title,
            both,
            self._opened,
            self._failed,
            lambda: self.state.busy.set(""),
            exclusive="opening",
            is_minor=is_minor,
        )
        self._loading = job if is_minor else None
        self._runner.submit(job)

    def _opened(self, opened: tuple[ResultArrays, NDArray[np.uint8] | None]) -> None:
        arrays, picture = opened
        state = self.state
        state.busy.set("")
        state.offer.set(None)
        state.search.set(None)
        state.graph.set(None)
        self._block = None
        state.cursor.set(None)
        self._turn += 1
        state.light.set("D65")
        self._lit = "D65", state.adapted.value
        state.depth_limits.set(None)
        state.picture.set(picture)
        # Every result has this band; that of another one it may not have.
        state.band.set(0)
        state.result.set(arrays)
        state.band.set(len(arrays.wavelengths_nm) // 2)
        if not arrays.has_spectra and state.view.value in (View.COLOUR, View.BAND):
            state.view.set(View.DEPTH)
        self.marks.load()
        self.opened.emit(arrays)

    def _failed(self, error: Exception) -> None:
        self.state.busy.set("")
        self._notifier.tell("error", str(error))

    def command_line(self) -> str:
        """The command that makes or exports what is open."""
        if self.state.offer.value is not None:
            return f"dsl-scan reconstruct {shlex.quote(str(self.state.offer.value))}"
        result = self.state.result.value
        if result is None:
            return ""
        path, points = (shlex.quote(str(each)) for each in (result.path, result.path.with_suffix(".ply")))
        return f"dsl-scan export {path} ply {points}"

    # Look ------------------------------------------------------------------------------------------

    def show(self, view: View) -> None:
        """Look at the result in another way; says why where the result has nothing to show."""
        result = self.state.result.value
        if result is not None and not result.has_spectra and view in (View.COLOUR, View.BAND):
            self._notifier.tell(
                "info", "This result holds depth only. Reconstruct the scan with spectra to see colours."
            )
            return
        self.state.view.set(view)

    def step_band(self, steps: int) -> None:
        """Go some bands up or down."""
        result = self.state.result.value
        if result is not None and result.has_spectra:
            last = len(result.wavelengths_nm) - 1
            self.state.band.set(min(max(self.state.band.value + steps, 0), last))

    def move_cursor(self, dx: int, dy: int) -> None:
        """Move the cursor by pixels, from the middle where there is none."""
        result = self.state.result.value
        if result is None:
            return
        height, width = result.shape
        x, y = self.state.cursor.value or (width // 2, height // 2)
        self.point_at((min(max(x + dx, 0), width - 1), min(max(y + dy, 0), height - 1)))

    def point_at(self, pixel: Pixel | None) -> None:
        """Put the cursor on a pixel; outside the image it stays where it was."""
        result = self.state.result.value
        if pixel is None or (result is not None and result.holds(pixel)):
            self.state.cursor.set(pixel)

    def limit_depth(self, limits: Limits | None) -> None:
        """Show only what lies between two depths (mm), or all of it; says why where that is nothing."""
        value, before = self.state.depth_limits, self.state.depth_limits.value
        if limits == before:
            return
        if limits is not None and not limits[0] < limits[1]:
            self._notifier.tell(
                "info",
                f"Nothing lies between {limits[0]:g} and {limits[1]:g} mm. Make the second limit the larger"
                " one.",
            )
            return
        text = "showing all depths" if limits is None else "limiting depth"
        self._undo.push(Change(text, partial(value.set, limits), partial(value.set, before)))

    # Light -----------------------------------------------------------------------------------------

    def relight(self, light: str, adapted: bool) -> None:
        """Show the colours under another light; of quick choices the last."""
        result = self.state.result.value
        if result is None or not result.has_spectra:
            return
        self._turn += 1
        turn = self._turn

        def work(progress: Progress) -> NDArray[np.uint8]:
            from dsl_core.optics.relighting import relight

            progress.report("relight", 0, 1)
            return picture_of(relight(result["reflectance"], result.wavelengths_nm, light, adapted))

        def done(picture: NDArray[np.uint8]) -> None:
            if turn == self._turn:
                self._lit = light, adapted
                self.state.picture.set(picture)

        def undone() -> None:
            if turn == self._turn:
                self._choose_light(*self._lit)

        def failed(error: Exception) -> None:
            undone()
            self._tell(error)

        self._choose_light(light, adapted)
        self._runner.submit(Job(f"Light {light}", work, done, failed, undone, is_minor=True))

    def _choose_light(self, light: str, adapted: bool) -> None:
        self.state.light.set(light)
        self.state.adapted.set(adapted)

    # Search ----------------------------------------------------------------------------------------

    def search(self, seek: Seek) -> None:
        """Look for the spectrum of the selected mark, or of the cursor where none is selected."""
        result, (name, wanted) = self.state.result.value, self._target()
        if result is None or wanted is None or not result.has_spectra:
            self._notifier.tell(
                "info", "Select a pin, region or reference, or point at a pixel, to look for it."
            )
            return

        def work(progress: Progress) -> Search:
            from dsl_core.evaluation.similarity import likeness, spectrum_at

            nm = result.wavelengths_nm
            return Search(
                name,
                likeness(result["reflectance"], spectrum_at(nm, wanted.nm, wanted.mean), nm, progress),
                seek,
            )

        def done(search: Search) -> None:
            if self.state.result.value is result:
                self.state.search.set(search)

        self._runner.submit(Job(f"Look for {name}", work, done, self._tell, is_minor=True))

    def limit_search(self, within_rad: float, within_delta_e: float) -> None:
        """Change the limits of the search; the image follows at once."""
        search = self.state.search.value
        if search is not None:
            self.state.search.set(replace(search, within_rad=within_rad, within_delta_e=within_delta_e))

    def seek(self, what: Seek) -> None:
        """Look for the other thing with the same spectrum."""
        search = self.state.search.value
        if search is not None:
            self.state.search.set(replace(search, seek=what))

    def end_search(self) -> None:
        """Show the image without the search."""
        self.state.search.set(None)

    def _target(self) -> tuple[str, Spectrum | None]:
        mark, cursor = self.state.selected_mark, self.state.cursor.value
        if mark is not None:
            return mark.name, None if mark.trouble else mark.spectrum
        if cursor is not None:
            return f"pixel {cursor[0]}, {cursor[1]}", self.state.spectrum_at(cursor)
        return "", None

    def _tell(self, error: Exception) -> None:
        self._notifier.tell("error", str(error))

    # Inspect ---------------------------------------------------------------------------------------

    def inspect(self) -> None:
        """Show what the pixel under the cursor saw line by line, if the scan lies beside the result."""
        result, pixel, block = self.state.result.value, self.state.cursor.value, self._block
        if result is None or pixel is None:
            self._notifier.tell("info", "Point at a pixel to see its intensity graph.")
            return

        def work(progress: Progress) -> tuple[FrameBlock, IntensityGraph]:
            near = block if block is not None and block.holds(pixel) else None
            near = near or read_block(result, pixel, progress)
            return near, intensity_graph(near, result, pixel)

        def done(found: tuple[FrameBlock, IntensityGraph]) -> None:
            if self.state.result.value is result:
                self._block, graph = found
                self.state.graph.set(graph)

        self._runner.submit(Job("Intensity graph", work, done, self._tell, is_minor=True))

    # Export ----------------------------------------------------------------------------------------

    def export(self, targets: dict[str, Path], overwrite: bool) -> None:
        """Write the result in formats by name, to a path each; tells what was written.

        Tables hold the pins, and pictures the band and the light that are shown.
        """
        result = self.state.result.value
        if result is None or not targets:
            return
        pixels = [mark.pixel for mark in self.state.marks.value if mark.pixel and not mark.trouble]
        band_nm = float(result.wavelengths_nm[self.state.band.value]) if result.has_spectra else None
        light, adapted = self._lit

        def work(progress: Progress) -> list[Path]:
            from dsl_core.io.export import Exporter, export_csv, export_png, formats
            from dsl_core.io.result.result_file import load_result

            exporters: dict[str, Exporter] = {
                **formats(),
                "csv": partial(export_csv, pixels=pixels),
                "png": partial(export_png, band_nm=band_nm, light=light, adapted=adapted),
            }
            data, written = load_result(result.path), []
            for done, (form, path) in enumerate(targets.items()):
                check = partial(progress.report, f"write {form}", done, len(targets))
                check()
                written += exporters[form](data, path, overwrite=overwrite, check=check)
            return written

        self._runner.submit(Job(f"Export {result.path.stem}", work, self._exported, self._tell))

    def _exported(self, written: Sequence[Path]) -> None:
        megabytes = sum(path.stat().st_size for path in written if path.is_file()) / 1e6
        files = "file" if len(written) == 1 else "files"
        details = "\n".join(str(path) for path in written)
        self._notifier.tell(
            "info",
            f"Wrote {len(written)} {files}, {megabytes:.1f} MB, to {written[0].parent}.",
            details,
        )

    def taken(self, targets: dict[str, Path]) -> list[Path]:
        """Files that an export would replace."""
        result = self.state.result.value
        return [] if result is None else [path for path in expected_files(targets, result) if path.exists()]
