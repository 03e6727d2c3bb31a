"""Opens results, and sets how a result is looked at. No Qt."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dsl_app.results.answers.controller import AnswersController
from dsl_app.results.contrast.controller import ContrastController
from dsl_app.results.export.controller import ExportController
from dsl_app.results.marks.controller import MarksController
from dsl_app.results.search.controller import SearchController
from dsl_app.results.state import DAYLIGHT, NEED_SPECTRA, Limits, ResultsState, ResultView, within
from dsl_app.shared.evented import Event
from dsl_app.shared.jobs.base import Job, JobRunner, JobState
from dsl_app.shared.known_files import RESULT_NAME, Kind, kind_of
from dsl_app.shared.notify import Notifier, sentence_of
from dsl_app.shared.paths import is_file
from dsl_app.shared.replaced import read_stamped, was_replaced
from dsl_app.shared.spectrum import Pixel
from dsl_app.shared.undo import Change, UndoStack
from dsl_core.errors import DslError
from dsl_core.io.neighbours import beside_result, result_beside
from dsl_core.io.result.completed import completed
from dsl_core.io.result.result_arrays import ResultArrays
from dsl_core.model.result_sink import Maps
from dsl_core.optics.levels import rgba_of_colours
from dsl_core.progress import Progress
from dsl_core.words import quoted

if TYPE_CHECKING:
    from dsl_core.workflows.inspection import FrameBlock, IntensityGraph


class ResultsController:
    """Fills a `ResultsState`.

    ``marks`` has the pins, regions and references, ``search`` looks for spectra, ``answers``
    names materials, ``contrast`` sets bands and levels of pictures.
    ``opened`` fires when a result is open and its views are set, so that listeners can change them.
    """

    def __init__(self, state: ResultsState, runner: JobRunner, notifier: Notifier, undo: UndoStack) -> None:
        self.state, self._runner, self._notifier = state, runner, notifier
        self.marks = MarksController(state, runner, notifier, undo)
        self.search = SearchController(state, runner, notifier)
        self.answers = AnswersController(state, runner, notifier)
        self.contrast = ContrastController(state)
        self._undo = undo
        self.opened: Event[ResultArrays] = Event()
        self._block: FrameBlock | None = None
        #: Counts requests for a light, so that only the last one is shown.
        self._light_request = 0
        self._loading: Job[tuple[ResultArrays, NDArray[np.uint8] | None]] | None = None
        #: What a reconstruction has found before its spectra, from its thread; news until it is in the state.
        self._found_first: ResultArrays | None = None
        #: What was open before that was shown: its picture, and the light of that.
        self._before: tuple[ResultArrays, NDArray[np.uint8] | None, tuple[str, bool]] | None = None
        #: What coloured the cloud before a result with depth only.
        self._cloud_by_chosen: ResultView | None = None

    # Open ------------------------------------------------------------------------------------------

    def open(self, path: Path) -> bool:
        """Open a result, offer to reconstruct a scan, or add a reference; False for anything else."""
        match kind_of(path):
            case Kind.RESULT:
                self._load(path)
            case Kind.SCAN if is_complete(path):
                self._offer(path)
            case Kind.REFERENCE if self.state.result.value is not None:
                self.marks.add_reference(path)
            case _:
                return False
        return True

    @property
    def is_reading(self) -> bool:
        """Whether a result or its marks are still being read; a reconstruction does not count."""
        is_loading = self._loading is not None and not self._loading.state.is_final
        return is_loading or self.marks.is_reading

    def _offer(self, session: Path) -> None:
        """Open the result next to a scan, or offer to reconstruct it; says why if it cannot be read."""
        target = result_beside(session)
        if is_file(target / RESULT_NAME):
            self._load(target)
        elif reason := _unreadable(session):
            self._notifier.tell("error", reason)
        else:
            self.state.offer.set(session)

    def reconstruct(self) -> None:
        """Reconstruct the offered scan, save the result next to it and open it; depth is shown at once."""
        session = self.state.offer.value
        if session is None:
            return
        target = result_beside(session)

        def work(progress: Progress) -> ResultArrays:
            from dsl_core.io.scan.folder import ScanReader
            from dsl_core.pipeline import Options
            from dsl_core.workflows.captures import is_import
            from dsl_core.workflows.scans import reconstruct_to

            # Pictures of other programs have no frames of spectral patterns.
            options = Options(spectra=not is_import(ScanReader(session)))
            made = reconstruct_to(target, session, None, options, progress, seen_geometry=see)
            return read_stamped(made, progress)

        def see(maps: Maps) -> None:
            self._found_first = completed(ResultArrays(target, np.empty(0), maps))

        self._start(f"Reconstruct {session.name}", work)

    def decline(self) -> None:
        """Show what was open before a scan was offered."""
        self.state.offer.set(None)

    def _load(self, path: Path) -> None:
        self._start(f"Open {path.name}", lambda progress: read_stamped(path, progress), is_minor=True)

    def _start(self, title: str, work: Callable[[Progress], ResultArrays], is_minor: bool = False) -> None:
        if self.state.busy.value:
            self._notifier.tell(
                "info", f"{self.state.busy.value} is not finished yet. Wait for it or cancel it."
            )
            return
        self.state.busy.set(title)

        def both(progress: Progress) -> tuple[ResultArrays, NDArray[np.uint8] | None]:
            arrays = completed(work(progress))
            return arrays, rgba_of_colours(arrays["rgb"]) if "rgb" in arrays.arrays else None

        def ended() -> None:
            self._found_first = None
            if job.state is not JobState.DONE:
                self._withdraw_first()
            self._before = None
            self.state.busy.set("")

        job = Job(title, both, self._opened, exclusive="opening", is_minor=is_minor, on_ended=ended)
        self._loading = job if is_minor else None
        self._runner.submit(job)

    def take_news(self) -> None:
        """Show depth and points that a reconstruction has found by now; called by a timer."""
        first, self._found_first = self._found_first, None
        if first is None:
            return
        state = self.state
        if state.result.value is not None:
            self._before = state.result.value, state.picture.value, state.picture_light.value
        state.is_begun.set(True)
        self._show_result(first, None)

    def _withdraw_first(self) -> None:
        """Close what a reconstruction showed that has come to nothing, for what was open before it."""
        if not self.state.is_begun.value:
            return
        self.state.is_begun.set(False)
        if self._before is None:
            self.state.cursor.set(None)
            self.state.result.set(None)
            self.marks.load()
        else:
            arrays, picture, light = self._before
            self._show_result(arrays, picture)
            self._choose_light(*light)
            self.state.picture_light.set(light)

    def _opened(self, opened: tuple[ResultArrays, NDArray[np.uint8] | None]) -> None:
        arrays, picture = opened
        self.state.offer.set(None)
        is_the_rest = self.state.is_begun.value
        self.state.is_begun.set(False)
        self._show_result(arrays, picture, is_the_rest)
        if is_the_rest and picture is not None:
            self._notifier.tell("info", f"The spectra of {arrays.path.stem} are there. Key 1 shows colours.")
        self.opened.emit(arrays)

    def _show_result(
        self, arrays: ResultArrays, picture: NDArray[np.uint8] | None, is_the_rest: bool = False
    ) -> None:
        """Show a result; cursor and depth limits are kept if it ``is_the_rest`` of the one that is open."""
        state = self.state
        state.search.set(None)
        self.answers.clear()
        state.graph.set(None)
        self._block = None
        self._light_request += 1
        state.light.set(DAYLIGHT)
        state.picture_light.set((DAYLIGHT, state.adapted.value))
        if not is_the_rest:
            state.cursor.set(None)
            state.depth_limits.set(None)
            self.contrast.clear()
        state.picture.set(picture)
        # Band 0 exists in both results, while the band shown last may not.
        state.band.set(0)
        state.result.set(arrays)
        state.band.set(len(arrays.wavelengths_nm) // 2)
        if not arrays.has_spectra and state.view.value in NEED_SPECTRA:
            state.view.set(ResultView.DEPTH)
        self._colour_cloud(arrays)
        self.marks.load()

    def _colour_cloud(self, arrays: ResultArrays) -> None:
        """Colour the cloud by what the result has, and again as a person chose once there are spectra."""
        by, chosen = self.state.cloud_by, self._cloud_by_chosen
        if not arrays.has_spectra and not self.state.is_begun.value:
            if by.value in NEED_SPECTRA:
                self._cloud_by_chosen = by.value
                by.set(ResultView.DEPTH)
        elif arrays.has_spectra and chosen is not None:
            self._cloud_by_chosen = None
            if by.value is ResultView.DEPTH:
                by.set(chosen)

    def export(self) -> ExportController | None:
        """What writes files of the result as it is looked at now; None where no saved one is shown."""
        result = self.shown_result()
        if result is None:
            return None
        return ExportController(result, self.state, self._runner, self._notifier)

    def shown_result(self) -> ResultArrays | None:
        """The result that something is to be done with; says so where that is hidden or replaced."""
        if why := self.state.hidden:
            self._notifier.tell("info", why)
        return None if why or self.read_again() else self.state.saved_result

    def read_again(self) -> bool:
        """Read the open result again where another one took its place on disk; whether one did."""
        result = self.state.saved_result
        if result is None or not was_replaced(result.path, result.stamp):
            return False
        # What runs now opens or makes a result: the next visit finds the same.
        if not self.state.busy.value:
            self._notifier.tell(
                "warning",
                f"{result.path.name} was replaced after it had been opened, and is read again. Look at"
                " it first.",
            )
            self._load(result.path)
        return True

    def command_line(self) -> str:
        """The command that reconstructs the offered scan or exports the open result."""
        if self.state.offer.value is not None:
            return f"dsl-scan reconstruct {quoted(self.state.offer.value)}"
        result = self.state.result.value
        if result is None:
            return ""
        path, points = (quoted(each) for each in (result.path, beside_result(result.path, ".ply")))
        return f"dsl-scan export {path} ply {points}"

    # Look ------------------------------------------------------------------------------------------

    def show(self, view: ResultView) -> None:
        """Switch the view; says why where the result has nothing to show."""
        result = self.state.result.value
        if result is not None and not result.has_spectra and view in NEED_SPECTRA:
            what = (
                "The spectra are still being computed. Colours can be seen then."
                if self.state.is_begun.value
                else "This result has depth only. Reconstruct the scan with spectra to see colours."
            )
            self._notifier.tell("info", what)
            return
        self.state.view.set(view)

    def step_band(self, steps: int) -> None:
        """Move some bands up or down."""
        result = self.state.result.value
        if result is not None and result.has_spectra:
            last = len(result.wavelengths_nm) - 1
            self.state.band.set(min(max(self.state.band.value + steps, 0), last))

    def move_cursor(self, dx: int, dy: int) -> None:
        """Move the cursor by pixels, from the centre if there is none."""
        result = self.state.result.value
        if result is None:
            return
        height, width = result.shape
        x, y = self.state.cursor.value or (width // 2, height // 2)
        self.point_at((min(max(x + dx, 0), width - 1), min(max(y + dy, 0), height - 1)))

    def point_at(self, pixel: Pixel | None) -> None:
        """Put the cursor on a pixel; a pixel outside the image is ignored."""
        result = self.state.result.value
        if pixel is None or (result is not None and result.holds(pixel)):
            self.state.cursor.set(pixel)

    def limit_depth(self, limits: Limits | None) -> None:
        """Show only depths between two limits (mm), or all; refuses limits that leave nothing."""
        value, before = self.state.depth_limits, self.state.depth_limits.value
        if limits == before:
            return
        if limits is not None and (why := self._leaves_nothing(limits)):
            gone = f"There are no depths between {limits[0]:g} and {limits[1]:g} mm."
            self._notifier.tell("info", f"{gone} {why}")
            return
        text = "showing all depths" if limits is None else "limiting depth"
        change = Change(text, partial(value.set, limits), partial(value.set, before), owner=self.state)
        self._undo.push(change)

    def _leaves_nothing(self, limits: Limits) -> str:
        """What to do about limits that leave no depth; empty where they leave one."""
        if not limits[0] < limits[1]:
            return "Make the second limit the larger one."
        result = self.state.result.value
        if result is None or within(result["depth_mm"], limits).any():
            return ""
        known = result["depth_mm"][within(result["depth_mm"], None)]
        if not known.size:
            return "The result has none at all."
        return f"Those of the result go from {known.min():.5g} to {known.max():.5g} mm."

    def relight(self, light: str, adapted: bool) -> None:
        """Show the colours under another light; after several quick requests, under the last."""
        state, result = self.state, self.state.result.value
        if result is None or not result.has_spectra:
            return
        self._light_request += 1
        request = self._light_request

        def work(progress: Progress) -> NDArray[np.uint8]:
            from dsl_core.optics.relighting import relight

            progress.report("relight", 0, 1)
            known = result.without_missing_bands()
            return rgba_of_colours(relight(known["reflectance"], known.wavelengths_nm, light, adapted))

        def done(picture: NDArray[np.uint8]) -> None:
            if request == self._light_request:
                state.picture_light.set((light, adapted))
                state.picture.set(picture)

        def undone() -> None:
            if request == self._light_request:
                self._choose_light(*state.picture_light.value)

        def failed(error: Exception) -> None:
            undone()
            self._notifier.tell("error", sentence_of(error))

        self._choose_light(light, adapted)
        self._runner.submit(Job(f"Light {light}", work, done, failed, undone, is_minor=True))

    def _choose_light(self, light: str, adapted: bool) -> None:
        self.state.light.set(light)
        self.state.adapted.set(adapted)

    # Inspect ---------------------------------------------------------------------------------------

    def inspect(self) -> None:
        """Show what the pixel under the cursor received in each frame; needs the scan next to the result."""
        result, pixel, block = self.shown_result(), self.state.cursor.value, self._block
        if result is None and self.state.saved_result is not None:
            return
        if result is None or pixel is None:
            self._notifier.tell("info", "Point at a pixel to see its intensity graph.")
            return

        def work(progress: Progress) -> tuple[FrameBlock, IntensityGraph]:
            from dsl_core.workflows.inspection import intensity_graph, read_block

            near = block if block is not None and block.holds(result.in_picture(pixel)) else None
            near = near or read_block(result, pixel, progress)
            return near, intensity_graph(near, result, pixel)

        def done(found: tuple[FrameBlock, IntensityGraph]) -> None:
            if self.state.result.value is result:
                self._block, graph = found
                self.state.graph.set(graph)

        def failed(error: Exception) -> None:
            self._notifier.tell("warning", sentence_of(error))

        self._runner.submit(Job("Intensity graph", work, done, failed, is_minor=True))


def _unreadable(session: Path) -> str:
    """Why a scan cannot be read, such as a part that is missing; empty if it can."""
    from dsl_core.io.scan.folder import ScanReader

    try:
        ScanReader(session)
    except DslError as error:
        return sentence_of(error)
    return ""


def is_complete(session: Path) -> bool:
    """Whether a scan has all its frames; True for one that cannot be read, as no resuming cures it."""
    from dsl_core.io.scan.folder import ScanReader

    try:
        return not ScanReader(session).missing()
    except DslError:
        return True
