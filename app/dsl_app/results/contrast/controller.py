"""Sets which bands are shown as colours, and the contrast of each picture. No Qt."""

from __future__ import annotations

from dsl_app.results.state import ResultsState
from dsl_core.optics.levels import Levels, natural_bands

#: Levels are kept apart by at least this share of the way between them or of their size.
LEAST_SHARE = 1e-4


class ContrastController:
    """Fills the bands and levels of a `ResultsState`; both last as long as the result is open."""

    def __init__(self, state: ResultsState) -> None:
        self.state = state

    def show_three_bands(self, shown: bool) -> None:
        """Show three bands as colours, first those nearest to red, green and blue; or true colours."""
        result = self.state.result.value
        if not shown or result is None or not result.has_spectra:
            self.state.bands.set(None)
        elif self.state.bands.value is None:
            self.state.bands.set(natural_bands(result.wavelengths_nm))

    def choose_band(self, channel: int, band: int) -> None:
        """Show a band as red (0), green (1) or blue (2); a band that the result lacks is ignored."""
        result, bands = self.state.result.value, self.state.bands.value
        if result is None or bands is None or not 0 <= band < len(result.wavelengths_nm):
            return
        chosen = [*bands]
        chosen[channel] = band
        self.state.bands.set((chosen[0], chosen[1], chosen[2]))

    def set_levels(self, key: str, levels: Levels | None) -> None:
        """Keep the levels of a kind of picture, in ascending order; None for those of the picture itself."""
        kept = {known: value for known, value in self.state.levels.value.items() if known != key}
        if levels is not None:
            kept[key] = apart(levels)
        self.state.levels.set(kept)

    def clear(self) -> None:
        """Show true colours with the levels of the pictures themselves."""
        self.state.bands.set(None)
        self.state.levels.set({})


def apart(levels: Levels) -> Levels:
    """Levels in ascending order that are not equal.

    >>> apart((0.5, 0.2))
    (0.2, 0.5)
    """
    low, high = sorted(levels)
    least = LEAST_SHARE * max(abs(low), abs(high), LEAST_SHARE)
    return low, max(high, low + least)
