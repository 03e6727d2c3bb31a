"""Two results: reads them, compares them and writes their report. No Qt."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from dsl_app.compare.pair.state import Pair, PairQuantity, PairState, Side
from dsl_app.compare.refusals import CHANGED, REPLACED
from dsl_app.shared.evented import Value
from dsl_app.shared.jobs.base import Job, JobRunner
from dsl_app.shared.known_files import RESULT_NAME
from dsl_app.shared.notify import Notifier, sentence_of
from dsl_app.shared.paths import is_file
from dsl_app.shared.replaced import result_stamp, was_replaced
from dsl_app.shared.spectrum import Pixel
from dsl_core.evaluation.summary import Truth
from dsl_core.io.result.result_arrays import ResultArrays, load_arrays
from dsl_core.progress import Progress
from dsl_core.words import quoted

T = TypeVar("T")


class PairController:
    """Sets the two sides of a `PairState` and compares them."""

    def __init__(self, state: PairState, runner: JobRunner, notifier: Notifier) -> None:
        self.state, self._runner, self._notifier = state, runner, notifier
        #: Results opened while another one was being read.
        self._waiting: deque[Path] = deque()

    # Sides -----------------------------------------------------------------------------------------

    def open(self, path: Path) -> bool:
        """Open a result as A if A is free, else as B; False for anything else.

        Results opened together are read one after the other.
        """
        if not is_file(path / RESULT_NAME):
            return False
        self._waiting.append(path)
        self._open_next()
        return True

    def _open_next(self) -> None:
        if self._waiting and not self.state.busy.value:
            self.open_side(self._waiting.popleft(), second=self.state.first.value is not None)

    def open_side(self, path: Path, second: bool) -> None:
        """Read a result as A, or as B."""
        if not is_file(path / RESULT_NAME):
            self._notifier.tell("warning", f"{path.name} is not a result. Choose a folder NAME.zarr.")
            return
        side = self.state.second if second else self.state.first
        self._start(
            f"Open {path.name}",
            lambda progress: read_side(path, progress),
            lambda opened: self._take(side, opened),
        )

    def open_both(self, first: Path, second: Path) -> None:
        """Read two results as A and B."""
        self._start(
            f"Open {first.name} and {second.name}",
            lambda progress: [read_side(path, progress) for path in (first, second)],
            self._take_both,
        )

    def read_again(self) -> bool:
        """Read both sides again if a result was replaced after it had been read; whether one was."""
        sides = (self.state.first.value, self.state.second.value)
        if not any(side and was_replaced(side.arrays.path, side.stamp) for side in sides):
            return False
        # A job that runs now reads or compares: the next visit finds the same.
        if not self.state.busy.value:
            self._start(
                "Read replaced results",
                lambda progress: [side and as_on_disk(side, progress) for side in sides],
                self._take_both,
            )
        return True

    def use_truth(self) -> None:
        """Use the ground truth of A's simulated scene as B."""
        first = self.state.first.value
        if first is None:
            self._notifier.tell("info", "Open a result as A first; its ground truth then becomes B.")
            return

        self._start(
            "Read the ground truth",
            lambda progress: read_truth(first, progress),
            lambda side: self._take(self.state.second, side),
        )

    def swap(self) -> None:
        """Swap A and B; the ground truth stays B."""
        first, second = self.state.first.value, self.state.second.value
        if first is not None and second is not None and second.truth is None:
            self.state.first.set(second)
            self.state.second.set(first)
            self._compare()

    def _take(self, place: Value[Side | None], side: Side) -> None:
        second = self.state.second.value
        if place is self.state.first and second is not None and second.truth is not None:
            # The ground truth belongs to the result it was read for.
            self.state.second.set(None)
        place.set(side)
        self._compare()

    def _take_both(self, sides: Sequence[Side | None]) -> None:
        # One at a time, each would be compared with what was open before.
        self.state.first.set(sides[0])
        self.state.second.set(sides[1])
        self._compare()

    def _start(self, title: str, work: Callable[[Progress], T], done: Callable[[T], None]) -> None:
        if self.state.busy.value:
            self._notifier.tell("info", f"{self.state.busy.value} is not finished. Wait for it or cancel it.")
            return
        self.state.busy.set(title)

        def finished(result: T) -> None:
            done(result)
            self._open_next()

        idle = lambda: self.state.busy.set("")  # noqa: E731
        self._runner.submit(Job(title, work, finished, self._failed, self._cancelled, on_ended=idle))

    def _cancelled(self) -> None:
        self._waiting.clear()
        state = self.state
        is_compared = state.pair.value is not None or state.trouble.value
        if state.first.value is not None and state.second.value is not None and not is_compared:
            state.trouble.set("The comparison was cancelled. Open A or B again.")

    def _failed(self, error: Exception) -> None:
        self.state.trouble.set(sentence_of(error))
        self._notifier.tell("error", sentence_of(error))
        self._open_next()

    # Compare ---------------------------------------------------------------------------------------

    def _compare(self) -> None:
        self.state.pair.set(None)
        self.state.trouble.set("")
        first, second = self.state.first.value, self.state.second.value
        if first is not None and second is not None:
            self._start(
                f"Compare {first.name}", lambda progress: make_pair(first, second, progress), self._compared
            )

    def _compared(self, pair: Pair) -> None:
        if not pair.bands:
            self.state.shown.set(PairQuantity.DEPTH)
        self.state.band.set(len(pair.bands) // 2)
        self.state.cursor.set(None)
        self.state.pair.set(pair)

    # Look ------------------------------------------------------------------------------------------

    def show(self, shown: PairQuantity) -> None:
        """Show depth, or a band."""
        pair = self.state.pair.value
        if shown is PairQuantity.BAND and pair is not None and not pair.bands:
            self._notifier.tell("info", "The results have no band in common; only depth can be compared.")
            return
        self.state.shown.set(shown)

    def set_band(self, band: int) -> None:
        """Show one of the common bands, by index."""
        pair = self.state.pair.value
        if pair is not None and 0 <= band < len(pair.bands):
            self.state.band.set(band)

    def point_at(self, pixel: Pixel) -> None:
        """Put the cursor on a pixel in all pictures."""
        pair = self.state.pair.value
        if pair is not None and pair.first.arrays.holds(pixel):
            self.state.cursor.set(pixel)

    # Report ----------------------------------------------------------------------------------------

    def write_report(self, target: Path, asked: Pair | None = None) -> None:
        """Write the report of A against its ground truth, or against another result, as an HTML page.

        Nothing is written if the pair is no longer the one that was ``asked`` for.
        """
        pair = self.state.pair.value
        if pair is None:
            self._notifier.tell(
                "info", "A report needs two results that can be compared. Choose A and B first."
            )
            return
        if asked is not None and asked is not pair:
            self._notifier.tell("warning", CHANGED)
            return
        if self.read_again():
            self._notifier.tell("warning", REPLACED)
            return
        first, truth = pair.first, pair.second.truth

        def work(progress: Progress) -> Path:
            if truth is None:
                return _write_pair(pair, target, progress)
            from dsl_core import pipeline
            from dsl_core.evaluation.report.scan_report import report_content
            from dsl_core.io.result.result_file import load_result

            progress.report("write the report", 0, 1)
            result = load_result(first.arrays.path)
            content = report_content(first.name, result, truth, pipeline.evaluate(result, truth))
            return pipeline.write_report(content, target, overwrite=True)

        self._start(
            "Write the report",
            work,
            lambda path: self._notifier.tell("info", f"Saved the report as {path}."),
        )

    def command_line(self) -> str:
        """The command for the same comparison; empty while a side is missing."""
        pair = self.state.pair.value
        if pair is None:
            return ""
        first, second = (quoted(side.arrays.path) for side in (pair.first, pair.second))
        if pair.second.truth is not None:
            return f"dsl-scan evaluate {first}"
        return f"dsl-scan compare {first} {second}"


def read_side(path: Path, progress: Progress) -> Side:
    """A result as a side; raises `StoreError`."""
    stamp = result_stamp(path)
    return Side(path.stem, load_arrays(path, progress), stamp=stamp)


def read_truth(first: Side, progress: Progress) -> Side:
    """The ground truth of A's simulated scene as a side; raises `DecodeError` where there is none."""
    from dsl_core.io.result.result_file import load_result
    from dsl_core.workflows.truths import truth_of

    progress.report("read the ground truth", 0, 1)
    truth = truth_of(load_result(first.arrays.path))
    return Side(f"truth of {first.name}", truth_arrays(first.arrays, truth), truth, first.stamp)


def as_on_disk(side: Side, progress: Progress) -> Side:
    """The side as it is on disk now; raises `StoreError`."""
    read = read_side(side.arrays.path, progress)
    return read if side.truth is None else read_truth(read, progress)


def make_pair(first: Side, second: Side, progress: Progress) -> Pair:
    """Compare two sides; raises `DecodeError` when their sizes differ."""
    from dsl_core.evaluation.difference import (
        compare_results,
        difference_table,
        require_same_places,
        require_same_size,
        shared_bands,
    )

    a, b = first.arrays, second.arrays
    require_same_size(a["depth_mm"], b["depth_mm"])
    require_same_places(a.places_px, b.places_px)
    a, b = a.averaged_like(b), b.averaged_like(a)
    first, second = replace(first, arrays=a), replace(second, arrays=b)
    both = a.has_spectra and b.has_spectra
    bands = shared_bands(a.wavelengths_nm, b.wavelengths_nm) if both else []
    if second.truth is not None:
        from dsl_core import pipeline
        from dsl_core.evaluation.verdict import verdicts
        from dsl_core.io.result.result_file import load_result

        progress.report("compare with the ground truth", 0, 1)
        return Pair(
            first, second, tuple(bands), verdicts(pipeline.evaluate(load_result(a.path), second.truth))
        )
    cube_a, cube_b = (side["reflectance"] if both else None for side in (a, b))
    turned = [(k, i) for i, k in bands]
    # A minus B: B is the reference.
    found = compare_results(b["depth_mm"], a["depth_mm"], cube_b, cube_a, turned, progress)
    return Pair(first, second, tuple(bands), difference_table(found))


def truth_arrays(result: ResultArrays, truth: Truth) -> ResultArrays:
    """The ground truth of a scene as arrays with the bands of a result; NaN where nothing is known."""
    arrays = {}
    if truth.depth_mm is not None:
        arrays["depth_mm"] = np.asarray(truth.depth_mm, np.float32)
    else:
        arrays["depth_mm"] = np.full(result.shape, np.nan, np.float32)
    if truth.material is not None and truth.spectra is not None and result.has_spectra:
        # One extra row for pixels without a material, whose index is -1.
        spectra = np.vstack([truth.spectra, np.full((1, truth.spectra.shape[1]), np.nan)]).astype(np.float32)
        arrays["reflectance"] = np.ascontiguousarray(spectra.T)[:, truth.material]
    return replace(result, arrays=arrays, attributes={}, missing=())


def _write_pair(pair: Pair, target: Path, progress: Progress) -> Path:
    """Write a page about two results; raises `StoreError`."""
    from dsl_core.evaluation.report.pair_page import PairMap, pair_page
    from dsl_core.io.staging import write_text

    progress.report("write the report", 0, 1)
    maps = []
    depths, means = pair.images(PairQuantity.DEPTH, 0), pair.mean_reflectance()
    if depths is not None:
        maps.append(PairMap("Depth", "mm", *depths))
    if means is not None:
        maps.append(PairMap("Mean reflectance", "", *means))
    sides = pair.first, pair.second
    page = pair_page(
        (sides[0].name, sides[1].name),
        (sides[0].arrays.attributes, sides[1].arrays.attributes),
        pair.rows,
        maps,
    )
    return write_text(target, lambda: page, overwrite=True)
