"""How the errors of a result's bands hang together, learned from the result itself.

A result states the deviation of every band and not how bands err together. Neighbouring pixels of one
material differ by noise alone, so the differences of pairs, divided by the deviations stated for them, show
the correlation; it differs from material to material, with the smoothness that their spectra have. What
neighbours have in common (level, shading) drops out of the differences; it is treated as a brightness of its
own deviation.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dsl_core.model.result import Flag

Floats = NDArray[np.float64]
Cube = NDArray[np.float32] | NDArray[np.float64]

#: Distance of a pair, px: colours of a Bayer mosaic are interpolated from pixels two apart.
APART_PX = 2
#: Pairs that differ by more than this many deviations in root mean square are of two materials.
MOST_RMS = 1.5
#: Pairs that differ by less than this many have nearly all of their errors in common, which tells nothing.
LEAST_RMS = 0.1
#: Share of each band's variance that is taken as its own: what smoothness hides from the differences. With
#: it, the stated rate of "none of these" holds on scans of the twin with known spectra.
OWN_SHARE = 0.1
#: Fewer pairs than this many a band tell nothing.
_PAIRS_PER_BAND, _MOST_PAIRS = 4, 40_000
#: So many are enough for one correlation of all pixels, and are compared while somebody waits.
_QUICK_PAIRS = 4_000
#: The usual correlation of bands that are so many steps apart, before each has a share of its own.
_USUAL, _USUAL_STEP_NM = (1.0, 0.8, 0.45, 0.2, 0.08, 0.03), 5.0


def correlation_of(
    bands_nm: ArrayLike,
    reflectance: Cube,
    std: Cube | None,
    flags: NDArray[np.integer] | None = None,
) -> Floats:
    """The correlation (bands, bands) of the errors of a result's bands, or the usual one if too few tell it.

    Cubes (bands, rows, columns), ``flags`` (rows, columns). Scans with more noise are smoothed over more
    bands: with the usual correlation, which is that of a long scan, what sums over bands would be too sure.
    """
    found = usual_correlation(bands_nm).copy()
    if std is None:
        return found
    known = np.array([np.isfinite(band).any() for band in reflectance], bool)
    good = np.ones(reflectance[0].shape, bool)
    if flags is not None:
        good = (flags & ~np.asarray(int(Flag.BANDS_UNREACHED), flags.dtype)) == 0
    if not known.all():
        reflectance, std = reflectance[known], std[known]
    learned = band_correlation(reflectance, std, good, _QUICK_PAIRS)
    if learned is not None:
        found[np.ix_(known, known)] = learned
    return found


def band_correlation(
    reflectance: Cube, std: Cube, good: NDArray[np.bool_], most_pairs: int = _MOST_PAIRS
) -> Floats | None:
    """Correlation (bands, bands) of the errors of a result's bands; None where too few pixels tell it.

    ``reflectance`` and ``std`` are cubes (bands, rows, columns); pairs are taken of ``good`` pixels (rows,
    columns) only, about ``most_pairs`` along each axis. Positive definite, with ones on its diagonal.
    """
    bands = len(reflectance)
    pairs = np.concatenate([_pairs(reflectance, std, good, axis, most_pairs) for axis in (0, 1)], axis=1)
    if pairs.shape[1]:
        pairs = pairs[:, np.sqrt(np.mean(pairs**2, axis=0)) < MOST_RMS]
    if pairs.shape[1] < _PAIRS_PER_BAND * bands:
        return None
    found = pairs @ pairs.T / pairs.shape[1]
    level = np.sqrt(np.maximum(np.diag(found), 1e-12))
    if np.median(level) < LEAST_RMS:
        return None
    found = found / level / level[:, None]
    np.fill_diagonal(found, 1.0)
    return _with_own(found)


def _with_own(correlation: Floats) -> Floats:
    return np.asarray((1 - OWN_SHARE) * correlation + OWN_SHARE * np.eye(len(correlation)))


def _pairs(reflectance: Cube, std: Cube, good: NDArray[np.bool_], axis: int, most: int) -> Floats:
    """Differences of pairs along an axis of the picture in their deviations, (bands, pairs)."""
    first, second = [slice(None), slice(None)], [slice(None), slice(None)]
    first[axis], second[axis] = slice(None, -APART_PX), slice(APART_PX, None)
    at = np.argwhere(good[tuple(first)] & good[tuple(second)])
    at = at[:: max(len(at) // most, 1)]
    y, x = at.T
    dy, dx = (APART_PX, 0) if axis == 0 else (0, APART_PX)
    difference = reflectance[:, y, x].astype(np.float64) - reflectance[:, y + dy, x + dx]
    spread = np.hypot(std[:, y, x].astype(np.float64), std[:, y + dy, x + dx])
    with np.errstate(divide="ignore", invalid="ignore"):
        pairs = difference / spread
    return np.asarray(pairs[:, np.isfinite(pairs).all(0)])


def usual_correlation(bands_nm: ArrayLike) -> Floats:
    """The correlation (bands, bands) that results usually have, where too few pixels tell it; read only.

    It follows from how far apart bands (bands,), nm, are: those of finer steps hang together more closely.
    """
    return _usual_of(tuple(np.asarray(bands_nm, np.float64).tolist()))


@cache
def _usual_of(bands_nm: tuple[float, ...]) -> Floats:
    from scipy.interpolate import PchipInterpolator

    # Even about zero, so that a fraction of a step costs less than its share.
    lags = np.arange(-len(_USUAL) + 1, len(_USUAL)) * _USUAL_STEP_NM
    smooth = PchipInterpolator(lags, (*_USUAL[:0:-1], *_USUAL), extrapolate=False)
    nm = np.array(bands_nm)
    found = np.nan_to_num(smooth(nm - nm[:, None]))
    values, vectors = np.linalg.eigh(found)
    found = (vectors * np.maximum(values, 1e-3)) @ vectors.T
    level = np.sqrt(np.diag(found))
    usual = _with_own(found / level / level[:, None])
    usual.flags.writeable = False
    return usual
