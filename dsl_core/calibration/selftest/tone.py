"""The form of a projector's light by drive level: a power law, or a curve where ramps leave it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.selftest.readings import line_fit
from dsl_core.model.calibration.selftest import Colour
from dsl_core.model.projector.tone_curve import MOST_TERMS, ToneCurve, rises

Floats = NDArray[np.float64]

#: A form that leaves no more than this relative rms needs no further term.
ENOUGH = 1e-3
#: What a form may leave of a colour's light, relative rms, and still be what the light follows.
MOST_LEFT = 0.01
#: How much a further term must lower chi-square beyond what the form with most of them leaves to each value.
_GAIN = 9.0
#: Drive levels of a scan's settings, between which colours are compared.
SCAN_LEVELS = (0.2, 0.8)


@dataclass(frozen=True)
class RampLight:
    """Usable values of one ramp, all (n,): camera channel, level 0..1, logarithm of the light, its deviation.

    ``falls`` counts the steps at which more drive gave clearly less light.
    """

    colour: Colour
    channel: NDArray[np.int64]
    level: Floats
    log_light: Floats
    std: Floats
    falls: int


def fit_tone(ramps: Sequence[RampLight]) -> ToneCurve | None:
    """The one curve of all ramps; None where a power law says the same.

    Terms are added while they say what those before them do not. The deviation holds what the curve leaves,
    differences between the colours among it.
    """
    level = np.concatenate([ramp.level for ramp in ramps])
    value = np.concatenate([ramp.log_light for ramp in ramps])
    std = np.concatenate([ramp.std for ramp in ramps])
    weight = std**-2 / (std**-2).sum()
    lowest = float(level.min())
    forms: list[tuple[Floats, Floats]] = []
    for terms in range(1, min(MOST_TERMS, len(np.unique(level)) // 2) + 1):
        design, present = design_of(ramps, terms)
        found, _ = line_fit(design, value, std)
        if rises(found[len(present) :], lowest):
            forms.append((found[len(present) :], value - design @ found))
    if not forms:
        return None
    sizes = np.array([len(shape) for shape, _ in forms])
    chi2 = np.array([((left / std) ** 2).sum() for _, left in forms])
    rms = np.array([np.sqrt(weight @ left**2) for _, left in forms])
    scatter = max(1.0, chi2[-1] / max(len(value) - sizes[-1], 1))
    enough = (rms < ENOUGH) | (chi2 <= chi2[-1] + _GAIN * (sizes[-1] - sizes) * scatter)
    best = int(enough.argmax())
    if sizes[best] == 1:
        return None
    return ToneCurve(
        coefficients=tuple(forms[best][0].tolist()), lowest_level=lowest, rel_std=float(rms[best])
    )


def design_of(ramps: Sequence[RampLight], terms: int) -> tuple[Floats, list[tuple[int, int]]]:
    """Equations of the logarithms of all ramps: a scale for each channel of each, then the common terms.

    Also which (ramp, channel) the scales belong to.
    """
    ramp = np.concatenate([np.full(len(each.level), number) for number, each in enumerate(ramps)])
    channel = np.concatenate([each.channel for each in ramps])
    present = sorted(set(zip(ramp.tolist(), channel.tolist(), strict=True)))
    scales = np.stack([(ramp == r) & (channel == c) for r, c in present], 1).astype(float)
    logs = np.log(np.concatenate([each.level for each in ramps]))
    return np.concatenate([scales, logs[:, None] ** np.arange(1, terms + 1)], 1), present


def mean_exponent(terms: int) -> Floats:
    """What each coefficient of a curve adds to its mean exponent between the levels of a scan, (terms,)."""
    low, high = np.log(SCAN_LEVELS)
    powers = np.arange(1, terms + 1)
    return np.asarray((high**powers - low**powers) / (high - low))
