"""Looks for the spectrum of a mark or pixel in the whole picture. No Qt."""

from __future__ import annotations

from dataclasses import replace

from dsl_app.results.state import ResultsState, Search, SearchMode
from dsl_app.shared.jobs.base import Job, JobRunner
from dsl_app.shared.notify import Notifier
from dsl_app.shared.spectrum import Floats, Spectrum
from dsl_core.errors import CalibrationError
from dsl_core.model.spectral import SpectralCurve
from dsl_core.progress import Progress


class SearchController:
    """Sets the search of a `ResultsState`."""

    def __init__(self, state: ResultsState, runner: JobRunner, notifier: Notifier) -> None:
        self.state, self._runner, self._notifier = state, runner, notifier
        #: The number of the latest search: an earlier one that takes longer is no longer wanted.
        self._latest = 0

    def start(self, mode: SearchMode) -> None:
        """Search for the spectrum of the selected mark, or of the cursor if no mark is selected."""
        opened, (name, target) = self.state.result.value, self._target()
        if opened is None or target is None or not opened.has_spectra:
            self._notifier.tell(
                "info", "Select a pin, region or reference, or point at a pixel, to search for its spectrum."
            )
            return

        self._latest = number = self._latest + 1

        def wanted() -> Floats:
            if isinstance(target, Spectrum):
                return target.mean
            try:
                return opened.at_bands(target).values
            except CalibrationError as error:
                raise CalibrationError(
                    f"{name} cannot be searched for. {error} Choose a reference of this range."
                ) from error

        def work(progress: Progress) -> Search:
            from dsl_core.evaluation.similarity import angle_noise, likeness
            from dsl_core.model.result_order import known_bands

            # A band that no pixel has would leave none a spectrum.
            known = known_bands(opened["reflectance"])
            result = opened.of_bands(known)
            std = result.known("reflectance_std")
            return Search(
                name,
                likeness(result["reflectance"], wanted()[known], result.wavelengths_nm, progress),
                mode,
                noise_rad=None if std is None else angle_noise(result["reflectance"], std),
            )

        def done(search: Search) -> None:
            if self.state.result.value is opened and number == self._latest:
                self.state.search.set(search)

        self._runner.submit(Job(f"Search for {name}", work, done, is_minor=True))

    def set_limits(self, within_rad: float, within_delta_e: float) -> None:
        """Change the limits of the search; the picture follows at once."""
        search = self.state.search.value
        if search is not None:
            self.state.search.set(replace(search, within_rad=within_rad, within_delta_e=within_delta_e))

    def set_mode(self, mode: SearchMode) -> None:
        """Search for something else with the same spectrum."""
        search = self.state.search.value
        if search is not None:
            self.state.search.set(replace(search, mode=mode))

    def clear(self) -> None:
        """Show the picture without the search."""
        self._latest += 1
        self.state.search.set(None)

    def _target(self) -> tuple[str, Spectrum | SpectralCurve | None]:
        mark, cursor = self.state.selected_mark, self.state.cursor.value
        if mark is not None:
            return mark.name, None if mark.trouble else mark.curve or mark.spectrum
        if cursor is not None:
            result = self.state.result.value
            x_px, y_px = cursor if result is None else result.in_picture(cursor)
            return f"pixel {x_px}, {y_px}", self.state.spectrum_at(cursor)
        return "", None
