"""What a class of a class map is: spectra at the bands of a result, and how they vary."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dsl_core.analysis.library import SpectralLibrary
from dsl_core.errors import CalibrationError, DecodeError
from dsl_core.evaluation.marks import left_of_variance
from dsl_core.model.result import SPECTRUM_INVALID, Flag
from dsl_core.model.spectral import at_bands
from dsl_core.words import as_given

Floats = NDArray[np.float64]
Cube = NDArray[np.float32] | NDArray[np.float64]

#: Fewer bands than this have no shape to compare.
FEWEST_BANDS = 3
#: A class of more spectra than this is summed up: a mean, and components of how its spectra vary.
MOST_MEMBERS = 8
MOST_COMPONENTS = 3
#: The share of a class's variance that its components have to explain.
_EXPLAINED = 0.99
#: The part of a library's error that bands do not have in common.
BAND_SHARE = 0.25
#: A class that varies by more than this share of its reflectance is doubted.
WIDE = 0.2
#: A class whose spectrum is known to no better than both, a share of it and a reflectance, is left out.
UNKNOWN_SHARE, UNKNOWN = 0.5, 0.05
#: So is one beyond both of these, if it is so many times less certain than the pixels that it would name.
VAGUE_SHARE, VAGUE, VAGUE_RATIO = 0.1, 0.03, 3.0
#: Pixels with one of these flags get no class, nor those with all of the others: their spectrum is absent or
#: that of two materials, or the peak of their lines is cut off. Of others, only a frame is left out.
_NOT_JUDGED, _CUT_OFF = SPECTRUM_INVALID | Flag.POOR_FIT, Flag.SATURATED | Flag.NOT_REFINED


def is_judged(flags: NDArray[np.integer]) -> NDArray[np.bool_]:
    """Whether pixels with these flags get a class, in the shape of ``flags``."""
    is_cut_off = (flags & int(_CUT_OFF)) == int(_CUT_OFF)
    return np.asarray(((flags & int(_NOT_JUDGED)) == 0) & ~is_cut_off)


@dataclass(frozen=True)
class Member:
    """One spectrum (bands,) of a class with the deviation of its bands, and how the class varies around it.

    ``components`` (components, bands) are deviations in reflectance, each of one standard deviation.
    """

    mean: Floats
    std: Floats
    components: Floats

    @classmethod
    def of(cls, mean: Floats, std: Floats | None = None) -> Member:
        """A spectrum that does not vary."""
        return cls(mean, np.zeros_like(mean) if std is None else std, np.empty((0, len(mean))))


@dataclass(frozen=True)
class SpectralClass:
    """A class by its name: one or several spectra, any of which a pixel may have.

    ``colour`` is the index in `mark_colours` of the mark that it comes from; None for one without a mark.
    """

    name: str
    members: tuple[Member, ...]
    colour: int | None = None

    @property
    def mean(self) -> Floats:
        """The mean of its spectra, (bands,)."""
        return np.asarray(np.mean([member.mean for member in self.members], axis=0))


def summed_up(name: str, members: Sequence[Member]) -> SpectralClass:
    """A class of these spectra; of many, their mean and how they vary around it."""
    if len(members) <= MOST_MEMBERS:
        return SpectralClass(name, tuple(members))
    means = np.stack([member.mean for member in members])
    own = np.mean([member.std**2 + (member.components**2).sum(0) for member in members], axis=0)
    components, rest = components_of(np.cov(means, rowvar=False))
    return SpectralClass(name, (Member(means.mean(0), np.sqrt(own + rest), components),))


def components_of(covariance: Floats) -> tuple[Floats, Floats]:
    """Leading components (components, bands) of a covariance, and the variance (bands,) left beside them."""
    values, vectors = np.linalg.eigh(covariance)
    values, vectors = np.maximum(values[::-1], 0), vectors[:, ::-1]
    if values[0] <= 0:
        return np.empty((0, len(values))), np.zeros(len(values))
    needed = int(np.searchsorted(np.cumsum(values) / values.sum(), _EXPLAINED)) + 1
    kept = min(needed, MOST_COMPONENTS)
    components = (vectors[:, :kept] * np.sqrt(values[:kept])).T
    return components, np.maximum(np.diag(covariance) - (components**2).sum(0), 0)


def classes_of_library(
    library: SpectralLibrary, bands_nm: Floats, relative_error: float = 0.0, width_nm: float | None = None
) -> tuple[tuple[SpectralClass, ...], tuple[str, ...]]:
    """The groups of a library as classes at bands (nm), and notes on entries that are left out.

    ``relative_error`` is the standard deviation, as a share of reflectance, that its spectra have because
    another instrument measured them: of the level of each, and a quarter of it of single bands.
    ``width_nm`` is how wide the bands are, as `at_bands` needs it. Raises `CalibrationError` when no entry
    covers the bands, or for an error that is none.
    """
    if not isinstance(relative_error, int | float | np.number) or not 0 <= relative_error < 1:
        raise CalibrationError(
            f"The error of a library is a share from 0 to 1, not {as_given(relative_error)}."
            " Give 0.02 for 2 %."
        )
    members: dict[str, list[Member]] = {group: [] for group in library.groups}
    notes = []
    for entry in library.entries:
        try:
            found = at_bands(entry.curve, bands_nm, width_nm)
        except CalibrationError as error:
            notes.append(f"{entry.name} ({entry.file.name}) is left out. {error}")
        else:
            std = np.hypot(found.std, BAND_SHARE * relative_error * found.values)
            level = found.values[None] * relative_error if relative_error else np.empty((0, len(bands_nm)))
            members[entry.group].append(Member(found.values, std, level))
    kept = tuple(summed_up(name, found) for name, found in members.items() if found)
    if not kept:
        raise CalibrationError(
            f"No spectrum of the library covers {bands_nm[0]:g} to {bands_nm[-1]:g} nm. {notes[0]}"
            " Choose a library that covers them, or give the command line the range that both have."
        )
    return kept, tuple(notes)


def without_missing(bands_nm: Floats, known: NDArray[np.bool_]) -> tuple[str, ...]:
    """A note on the bands (bands,), nm, that are not known and left out; nothing where all are."""
    missing = ", ".join(f"{nm:g}" for nm in bands_nm[~known])
    return (f"{missing} nm: left out, as no pixel has a reflectance there.",) if missing else ()


def class_of_pixels(
    name: str,
    reflectance: Cube,
    std: Cube,
    mask: NDArray[np.bool_],
    flags: NDArray[np.integer] | None = None,
) -> SpectralClass:
    """The class of marked pixels: their mean, and how they vary more than their deviations say.

    Cubes (bands, rows, columns), mask and ``flags`` (rows, columns): pixels that get no class define none,
    unless there are no others. Raises `DecodeError` where no pixel has a spectrum with deviations.
    """
    if flags is not None and (judged := mask & is_judged(flags)).any():
        mask = judged
    y, x = np.nonzero(mask)
    values, spread = reflectance[:, y, x].astype(np.float64), std[:, y, x].astype(np.float64)
    has_spectrum = np.isfinite(values).all(0)
    known = has_spectrum & np.isfinite(spread).all(0)
    values, spread = values[:, known], spread[:, known]
    count = values.shape[1]
    if count == 0 and has_spectrum.any():
        raise DecodeError(
            f"{name}: none of its {len(y)} pixels has deviations of its spectrum. Mark another place, or name"
            " materials from a library by spectral angle."
        )
    if count == 0:
        if np.isfinite(reflectance[:, y, x]).any():
            raise DecodeError(
                f"{name}: none of its {len(y)} pixels has all {len(reflectance)} bands. Leave out the bands"
                " that they lack, do not mask single ones, or mark another place."
            )
        raise DecodeError(f"{name}: none of its {len(y)} pixels has a spectrum. Mark another place.")
    noise = np.mean(spread**2, axis=1)
    member = Member.of(values.mean(1), np.sqrt(noise * left_of_variance(count)))
    if count > 4 * len(values):
        components, rest = _more_than_noise(np.atleast_2d(np.cov(values)), noise)
        member = replace(member, std=np.sqrt(member.std**2 + rest), components=components)
    return SpectralClass(name, (member,))


def _more_than_noise(covariance: Floats, noise: Floats) -> tuple[Floats, Floats]:
    """As `components_of`, of what exceeds the stated noise; nothing where it explains all."""
    components, rest = components_of(covariance)
    level = np.sqrt(noise)
    strength = ((components / level) ** 2).mean(1) if len(components) else np.empty(0)
    kept = components[strength > 1]
    return kept, np.maximum(rest - noise, 0) if len(kept) else np.zeros_like(rest)


def doubt_of(each: SpectralClass) -> str:
    """A sentence where a class varies so much that it explains nearly anything; else empty."""
    for member in each.members:
        varied = float(np.sqrt((member.components**2).sum(0)).mean() / max(member.mean.mean(), 1e-9))
        if varied > WIDE:
            return (
                f"{each.name} varies by {varied:.0%} of its reflectance and explains much: it may hold two"
                " materials. Mark a smaller region, or group the library otherwise."
            )
    return ""


def known_classes(
    classes: Sequence[SpectralClass], pixel_std: ArrayLike | None = None
) -> tuple[tuple[SpectralClass, ...], tuple[str, ...]]:
    """Classes whose spectra are known, and notes on those left out and on those in doubt.

    A pin on the edge of a patch may have a deviation of several times its reflectance: it would be as likely
    as any other name everywhere. One that is far less certain than the pixels, whose deviations
    ``pixel_std`` (bands, rows, columns) are, takes whole patches of other materials that no class describes.
    Raises `DecodeError` where no class is left.
    """
    usual = 0.0 if pixel_std is None else _usual(np.asarray(pixel_std))
    kept: list[SpectralClass] = []
    notes: list[str] = []
    for each in classes:
        std = min(float(member.std.mean()) for member in each.members)
        level = float(each.mean.mean())
        is_unknown = std > UNKNOWN and std > UNKNOWN_SHARE * level
        is_vague = std > max(VAGUE, VAGUE_RATIO * usual) and std > VAGUE_SHARE * level
        if is_unknown or is_vague:
            notes.append(
                f"{each.name} is left out: its reflectance of {level:.2f} is known to ±{std:.2f} only"
                " and would explain other materials as well. Mark another place."
            )
        else:
            kept.append(each)
    if classes and not kept:
        raise DecodeError(" ".join(notes))
    return tuple(kept), (*notes, *(doubt for each in kept if (doubt := doubt_of(each))))


def _usual(pixel_std: Cube) -> float:
    """The deviation that pixels usually have; every fourth row and column tells it."""
    some = pixel_std[:, ::4, ::4]
    known = some[np.isfinite(some)]
    return float(np.median(known)) if known.size else 0.0


def shared_names(classes: Sequence[SpectralClass]) -> tuple[SpectralClass, ...]:
    """Classes of which those of one name are one."""
    by_name: dict[str, list[Member]] = {}
    colours: dict[str, int | None] = {}
    for each in classes:
        by_name.setdefault(each.name, []).extend(each.members)
        if colours.get(each.name) is None:
            colours[each.name] = each.colour
    return tuple(SpectralClass(name, tuple(members), colours[name]) for name, members in by_name.items())


def marked_by(classes: Sequence[SpectralClass], marks: Mapping[str, int]) -> tuple[SpectralClass, ...]:
    """Classes with the colours of ``marks`` (indices by name), and others with colours that no mark has."""
    known = {index for each in classes if (index := marks.get(each.name, each.colour)) is not None}
    free = (index for index in itertools.count() if index not in known | set(marks.values()))
    colours = (marks.get(each.name, each.colour) for each in classes)
    return tuple(
        replace(each, colour=next(free) if colour is None else colour)
        for each, colour in zip(classes, colours, strict=True)
    )
