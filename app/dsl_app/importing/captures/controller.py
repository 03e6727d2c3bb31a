"""Guesses what a folder of pictures is, keeps the mapping as it is corrected, and imports by it. No Qt."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsl_app.importing.captures import fields, look
from dsl_app.importing.captures.carry_out import carry_out
from dsl_app.importing.captures.command_line import command_of
from dsl_app.importing.captures.state import (
    SUFFIX,
    CapturesState,
    Decoded,
    Imported,
    Listing,
    Place,
    Size,
    Stated,
    captures_view,
)
from dsl_app.shared.jobs.base import Job, JobRunner
from dsl_app.shared.known_files import first_free
from dsl_app.shared.notify import sentence_of
from dsl_app.shared.paths import expanded
from dsl_core.errors import DslError
from dsl_core.io.calibration_library import CalibrationLibrary
from dsl_core.io.pictures.mapping import Mapping
from dsl_core.progress import Progress


class CapturesController:
    """Fills a `CapturesState`; whatever reads pictures runs in a worker, and only its last outcome counts."""

    def __init__(
        self, state: CapturesState, runner: JobRunner, library: CalibrationLibrary | None = None
    ) -> None:
        self.state, self._runner = state, runner
        self._library = library or CalibrationLibrary()
        self._jobs: list[Job[Any]] = []
        self._round = 0
        state.library.set(self._library.names())

    # Folder ----------------------------------------------------------------------------------------

    def open(self, folder: Path) -> None:
        """Guess what the pictures of a folder are; the request keeps calibration and where to save.

        As all that follows from the request, it waits for the end of an import, which it would stop.
        """
        if self.state.is_importing.value:
            return
        request = self.state.request.value
        target = first_free(request.target.parent, folder.name, SUFFIX)
        self.state.request.set(replace(request, folder=folder, target=target, chosen="", projector_px=(0, 0)))
        self.state.sets.set(())
        self.guess()

    def guess(self) -> None:
        """Guess, with the size of the projector and the set that were chosen."""
        request = self.state.request.value
        if request.folder is None or self.state.is_importing.value:
            return
        self._forget(Listing())
        self.state.stated.set(None)

        def done(found: look.Guessed) -> None:
            # A guess of one set names the others only while none is chosen.
            if not request.chosen:
                self.state.sets.set(found.sets)
            self._say(Place.FOLDER, found.trouble)
            self.state.stated.set(found.stated)
            self._check()

        def failed(error: Exception) -> None:
            self._say(Place.FOLDER, sentence_of(error))

        self._submit("Look at the pictures", lambda progress: look.guess(request, progress), done, failed)

    def choose_set(self, name: str) -> None:
        """Take one of several captures in the folder."""
        self._request(chosen=name)
        self.guess()

    def set_projector(self, size_px: Size) -> None:
        """Set the size of the projector, 0 for not known; a mapping as guessed is guessed again for it.

        Any other mapping has a size, and keeps that where none is given.
        """
        stated = self.state.stated.value
        self._request(projector_px=size_px)
        if stated is None:
            return
        if stated.is_guessed:
            self.guess()
        elif all(size_px):
            self._change(lambda mapping: fields.with_projector(mapping, size_px))

    # Mapping ---------------------------------------------------------------------------------------

    def change_part(self, place: int, key: str, value: Any) -> None:
        """Change a field of a part."""
        self._change(lambda mapping: fields.with_part_field(mapping, place, key, value))

    def change_pictures(self, key: str, value: Any) -> None:
        """Change how files are found and read."""
        self._change(lambda mapping: fields.with_field(mapping, key, value))

    def add_part(self, place: int, kind: str) -> None:
        """Add a part before the one at a place."""
        self._change(lambda mapping: fields.with_part(mapping, place, kind))

    def remove_part(self, place: int) -> None:
        """Remove a part."""
        self._change(lambda mapping: fields.without_part(mapping, place))

    def move_part(self, place: int, steps: int) -> None:
        """Move a part down, or up for negative steps."""
        self._change(lambda mapping: fields.moved_part(mapping, place, steps))

    def load_mapping(self, path: Path) -> None:
        """Use the mapping of a file for the folder."""
        from dsl_core.workflows.captures import load_mapping

        try:
            mapping = load_mapping(path)
        except DslError as error:
            self._say(Place.MAPPING, sentence_of(error))
            return
        self._state_mapping(Stated(mapping, file=path))

    def save_mapping(self, path: Path) -> None:
        """Write the mapping to a file, which the file dialog has asked to replace if it exists."""
        from dsl_core.io.records import write_record

        stated = self.state.stated.value
        if stated is None:
            return
        try:
            write_record(path, stated.mapping, overwrite=True, sealed=False)
        except DslError as error:
            self._say(Place.MAPPING, sentence_of(error))
            return
        self._say(Place.MAPPING, "")
        self.state.stated.set(replace(stated, file=path))

    def _change(self, change: Callable[[Mapping], Mapping]) -> None:
        stated = self.state.stated.value
        if stated is None:
            return
        try:
            mapping = change(stated.mapping)
        except DslError as error:
            self._say(Place.MAPPING, sentence_of(error))
            # The widgets show the mapping that still holds.
            self.state.stated.set(replace(stated))
            return
        if mapping != stated.mapping:
            self._state_mapping(Stated(mapping))

    def _state_mapping(self, stated: Stated) -> None:
        self.state.trouble.set(())
        self.state.stated.set(stated)
        self._check()

    # Calibration and target ------------------------------------------------------------------------

    def choose_calibration(self, key: str) -> None:
        """Choose a calibration by its key, or the path of a file."""
        self._request(calibration=key)
        self._check(only_files=True)

    def set_unit(self, unit_mm: float) -> None:
        """Set the unit of lengths in another program's calibration, mm."""
        self._request(unit_mm=unit_mm)
        self._check(only_files=True)

    def set_direction(self, from_projector: bool) -> None:
        """Set whether the pose of another program's calibration leads from the projector to the camera."""
        self._request(from_projector=from_projector)
        self._check(only_files=True)

    def set_curves(self, device: str, path: Path | None) -> None:
        """Set the table of curves of the ``camera`` or the ``LEDs``, None for none."""
        self._request(**{"camera_curves" if device == "camera" else "led_curves": path})
        self._check(only_files=True)

    def rename(self, name: str, home: Path) -> None:
        """Save under a name in a folder."""
        plain = name.strip().removesuffix(SUFFIX).replace("/", "-")
        self._request(target=expanded(home) / f"{plain}{SUFFIX}")

    def _request(self, **what: Any) -> None:
        if self.state.is_importing.value:
            return
        self._say(Place.TARGET, "")
        self.state.request.set(replace(self.state.request.value, **what))

    # Check -----------------------------------------------------------------------------------------

    def _check(self, only_files: bool = False) -> None:
        """List the files by the mapping, then decode them; what was decoded stays if the mapping did."""
        request, stated = self.state.request.value, self.state.stated.value
        if request.folder is None or stated is None or self.state.is_importing.value:
            return
        folder, mapping = request.folder, stated.mapping
        if not only_files:
            self._forget(self.state.listing.value)

        def listed(found: Listing) -> None:
            self.state.listing.set(found)
            if self.state.decoded.value is None:
                self._look(folder, mapping, found)

        work = lambda _: look.list_files(request, mapping, self._library)  # noqa: E731
        self._submit("Compare the files with the mapping", work, listed, self._failed)

    def _look(self, folder: Path, mapping: Mapping, listing: Listing) -> None:
        fits = Place.MAPPING not in dict(listing.troubles)

        def work(progress: Progress) -> tuple[dict[str, NDArray[np.uint8]], Decoded | None]:
            small = look.small_pictures(folder, mapping, listing.table)
            return small, look.decode(folder, mapping, progress) if fits else None

        def done(found: tuple[dict[str, NDArray[np.uint8]], Decoded | None]) -> None:
            small, decoded = found
            self.state.small.set(small)
            self.state.decoded.set(decoded)

        self._submit("Decode the pictures", work, done, self._failed)

    def _failed(self, error: Exception) -> None:
        self._say(Place.MAPPING, sentence_of(error))

    def _forget(self, listing: Listing) -> None:
        self.state.listing.set(listing)
        self.state.decoded.set(None)

    def _submit(
        self,
        title: str,
        work: Callable[[Progress], Any],
        done: Callable[[Any], object],
        failed: Callable[[Exception], object],
    ) -> None:
        """Run the only job that still counts; the others are stopped and their outcomes dropped."""
        self.stop()
        self._round += 1
        number = self._round
        self.state.busy.set(title)

        def ended() -> None:
            if number == self._round:
                self.state.busy.set("")

        job = Job(
            title,
            work,
            lambda found: done(found) if number == self._round else None,
            lambda error: failed(error) if number == self._round else None,
            is_minor=True,
            on_ended=ended,
        )
        self._jobs = [job]
        self._runner.submit(job)

    def _say(self, place: Place, text: str) -> None:
        """Set or remove the sentence about a part of the dialog."""
        others = {at: said for at, said in self.state.trouble.value if at is not place}
        self.state.trouble.set(tuple({**others, place: text}.items() if text else others.items()))

    # Import ----------------------------------------------------------------------------------------

    def command_line(self) -> str:
        """The commands that do the same."""
        state = self.state
        return command_of(state.request.value, state.stated.value, state.listing.value.camera_px)

    def start(self) -> bool:
        """Import in a job, if nothing prevents that; the dialog stays until ``done`` fires or it fails.

        Always False: a dialog that would close now could not say what goes wrong.
        """
        state, request, stated = self.state, self.state.request.value, self.state.stated.value
        if stated is None or not captures_view(state).can_import:
            return False
        mapping = stated.mapping
        state.busy.set("Importing")
        state.is_importing.set(True)

        def ended() -> None:
            state.busy.set("")
            state.is_importing.set(False)

        job: Job[Imported] = Job(
            f"Import {stated.mapping.name or request.target.stem}",
            lambda progress: carry_out(request, mapping, self._library, progress),
            state.done.emit,
            lambda error: self._say(Place.TARGET, sentence_of(error)),
            on_ended=ended,
        )
        self._jobs = [job]
        self._runner.submit(job)
        return False

    def stop(self) -> None:
        """Stop whatever runs for the dialog; an import leaves nothing behind."""
        for job in self._jobs:
            if not job.state.is_final:
                job.cancel()
