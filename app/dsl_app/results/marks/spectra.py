"""Marks as spectra for other programs. No Qt."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from dsl_app.results.state import Mark

if TYPE_CHECKING:
    from dsl_core.io.export.spectra import NamedSpectrum


def spectra_of(marks: Iterable[Mark]) -> list[NamedSpectrum]:
    """The spectra of the marks that are shown and have one."""
    return [_spectrum_of(mark) for mark in marks if mark.shown and not mark.trouble]


def _spectrum_of(mark: Mark) -> NamedSpectrum:
    from dsl_core.io.export.spectra import NamedSpectrum

    nm, mean, std = mark.spectrum.nm, mark.spectrum.mean, mark.spectrum.std
    match mark.kind:
        case "pin":
            return NamedSpectrum(mark.name, nm, mean, uncertainty=std, pixels=1)
        case "region":
            return NamedSpectrum(mark.name, nm, mean, std, mark.pixel_std, mark.used)
        case "reference":
            return NamedSpectrum(mark.name, nm, mean)
