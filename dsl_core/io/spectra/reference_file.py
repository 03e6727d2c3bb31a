"""Spectra to compare with, from any file that contains reflectance."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from dsl_core.errors import CalibrationError
from dsl_core.io.spectra.catalogue import format_of
from dsl_core.io.spectra.records import VISIBLE_NM, Floats, Spectrum
from dsl_core.io.spectra.spectrum_file import LEAST_SHARE, MOST_SHARE, as_share, is_percent, of_kind
from dsl_core.model.spectral import SpectralCurve

#: Fewer values make no spectrum.
MIN_VALUES = 2
#: Of what was deleted in the midst of a spectrum, so much is bridged by a straight line.
MOST_BRIDGED_NM = 20.0


@dataclass(frozen=True)
class Reference:
    """A spectrum with the name that it has in its file; the only one of a file may have none."""

    name: str
    curve: SpectralCurve


@dataclass(frozen=True)
class ReferenceFile:
    """The spectra of a file, and the names of those without values.

    ``as_percent`` is the largest value (%) of a file that states no unit, where that made it percent;
    ``notes`` are sentences on what else was made of the file.
    """

    references: tuple[Reference, ...]
    empty: tuple[str, ...] = ()
    as_percent: float | None = None
    notes: tuple[str, ...] = ()

    @property
    def all_notes(self) -> tuple[str, ...]:
        """A sentence on each thing that was made of the file or left out of it, percent among them."""
        percent = (
            None if self.as_percent is None else f"values up to {self.as_percent:.3g} are read as percent."
        )
        empty = f"without values and left out: {', '.join(self.empty[:5])}." if self.empty else None
        return (*self.notes, *(each for each in (percent, empty) if each is not None))


def read_references(path: Path) -> ReferenceFile:
    """All reflectances of a file, whatever range they cover; raises `CalibrationError`."""
    kind = format_of(path)
    spectra, as_percent, notes = shares_of(path, kind.read(path))
    if len(spectra) == 1 and not kind.is_named:
        spectra = [replace(spectra[0], name="")]
    return replace(as_references(path, spectra), as_percent=as_percent, notes=notes)


def shares_of(path: Path, raw: list[Spectrum]) -> tuple[list[Spectrum], float | None, tuple[str, ...]]:
    """The spectra of a file as shares, the largest value (%) if they were guessed to be percent, and notes.

    A dark spectrum in percent looks like a share; others of its file tell. Raises `CalibrationError`.
    """
    found = of_kind(path, raw, radiance=False, all_unstated=True)
    percent = [float(np.nanmax(each.values, initial=0.0)) for each in found if is_percent(each)]
    spectra, kept = [as_share(path, each, bool(percent)) for each in found], {id(each) for each in found}
    notes = []
    if beside := [each.name for each in raw if each.quantity == "unstated" and id(each) not in kept]:
        notes.append(f"left out, as values above {MOST_SHARE:g} cannot be shares: {', '.join(beside[:5])}.")
    before, after = (sum(int(np.isnan(s.values).sum()) for s in group) for group in (found, spectra))
    if deleted := after - before:
        notes.append(f"values below {LEAST_SHARE:g} are taken as deleted: {deleted}.")
    return spectra, max(percent, default=None), tuple(notes)


def read_reference(path: Path, name: str = "") -> SpectralCurve:
    """One spectrum of a file, by its name where there are several; raises `CalibrationError`."""
    found = read_references(path).references
    for reference in found:
        if name in (reference.name, "") and (name or len(found) == 1):
            return reference.curve
    raise CalibrationError(f"{path.name} contains no spectrum {name!r}. Add the reference again.")


def _without_gaps(nm: Floats, values: Floats) -> Floats:
    """A spectrum without what is beyond a gap, seen from the side that holds more of the visible range.

    What was deleted from a library is not made up by a straight line across it.
    """
    known = np.flatnonzero(np.isfinite(values))
    gaps = np.flatnonzero((np.diff(known) > 1) & (np.diff(nm[known]) > MOST_BRIDGED_NM))
    runs = np.split(known, gaps + 1)
    low, high = VISIBLE_NM
    best = max(runs, key=lambda run: (np.count_nonzero((nm[run] >= low) & (nm[run] <= high)), len(run)))
    kept = np.full_like(values, np.nan)
    kept[best] = values[best]
    return kept


def as_references(path: Path, spectra: list[Spectrum]) -> ReferenceFile:
    """Spectra of a file as curves without gaps, each name once; raises `CalibrationError` without any."""
    found: dict[str, SpectralCurve] = {}
    empty = []
    for place, spectrum in enumerate(spectra, 1):
        name = spectrum.name or ("" if len(spectra) == 1 else f"spectrum {place}")
        values = _without_gaps(spectrum.nm, spectrum.values)
        known = np.isfinite(values)
        if np.count_nonzero(known) < MIN_VALUES:
            empty.append(name)
            continue
        # Names bring a reference back with its result, so each must be one of a kind.
        own = name if name not in found else f"{name} ({place})"
        found[own] = SpectralCurve.of(spectrum.nm[known], values[known])
    if not found:
        raise CalibrationError(f"No spectrum of {path.name} contains values. Choose another file.")
    return ReferenceFile(tuple(Reference(name, curve) for name, curve in found.items()), tuple(empty))
