"""Classes that noise confuses, each as unsure as the least sure of them: which is likelier, nearness decides.

The spectrum of a class, such as the mean of a few marked pixels, has a deviation, and deviations that are
stated are rather too large than too small: errors of bands and of pixels hang together. A likelihood takes
its own width into account, over all bands. A class that is known a little better than another would then get
the pixels of both, with certainty, only because its width is smaller.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dsl_core.analysis.classes import SpectralClass

Floats = NDArray[np.float64]
#: Classes are confused whose spectra differ by less than so many deviations, in root mean square over bands.
_ALIKE_SIGMAS = 3.0


def evened(
    classes: Sequence[SpectralClass], pixel_std: NDArray[np.floating], is_free: bool
) -> tuple[SpectralClass, ...]:
    """The classes with the largest deviation (bands,) of those that each is confused with, or its own.

    ``pixel_std`` (bands,) is the usual deviation of the pixels to be named. With a free brightness, spectra
    are compared after the best scale, which scales their deviations too. A class may stay as it is.
    """
    means = np.stack([each.mean for each in classes])
    stds = np.stack([_std(each) for each in classes])
    found = []
    for each, mean, std in zip(classes, means, stds, strict=True):
        scale = _scales(mean, means) if is_free else np.ones((len(means), 1))
        others = scale * stds
        off = np.sqrt(np.mean((scale * means - mean) ** 2, axis=1))
        limit = _ALIKE_SIGMAS * np.sqrt(np.mean(others**2 + std**2 + pixel_std**2, axis=1))
        most = np.max(others, axis=0, initial=0.0, where=(off <= limit)[:, None])
        found.append(each if (most <= std).all() else _widened(each, most))
    return tuple(found)


def _std(each: SpectralClass) -> Floats:
    """The deviation (bands,) of a class's spectra."""
    return np.asarray(np.sqrt(np.mean([member.std**2 for member in each.members], axis=0)))


def _scales(mean: Floats, means: Floats) -> Floats:
    """Factors (classes, 1) that bring each of the means (classes, bands) nearest to one (bands,)."""
    power = np.maximum(np.einsum("cb,cb->c", means, means), 1e-20)
    return np.asarray(np.maximum(means @ mean / power, 0.0))[:, None]


def _widened(each: SpectralClass, std: Floats) -> SpectralClass:
    members = (replace(member, std=np.maximum(member.std, std)) for member in each.members)
    return replace(each, members=tuple(members))
