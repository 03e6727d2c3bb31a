"""How much light one setting had, compared with another: the same pattern was shown to both.

Where the brighter setting saturates nearly everywhere, as white often does, few pixels are compared. What
came before these between both settings, or was taken off saturated counts, then looks like light of the whole
picture, which other pixels or other patterns contradict.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.plan import Role
from dsl_core.model.rig import Sensor
from dsl_core.optics.sensor import raw_variance
from dsl_core.reconstruction.hdr import BlackFrame
from dsl_core.solve.normal import STD_OF_MEDIAN_SIZE
from dsl_core.solve.thinned import spread_rows, thinned

#: Counts of the brighter setting that are compared, as shares of full scale.
USED = (0.01, 0.9)
#: Rows of a picture that are looked at, and pixels that a comparison needs.
ROWS, FEWEST = 145, 12

#: Pixels contradict each other where what no factor explains is so many times their noise (variance).
CONTRADICT = 4.0
#: Pixels that agree with most others are off by so many deviations and by this share of their light at most;
#: so many of all have to. A fly, a shadow or a reflection is in few pixels, and may be in the brightest ones.
AGREE_SIGMAS, AGREE_SHARE, FEWEST_AGREE = 4.0, 0.02, 0.6
#: Pixels asked whether they agree.
ASKED = 20_000
#: A pattern whose settings are further apart than those of most patterns, by so much (logarithm) and so many
#: deviations from pattern to pattern, says nothing of the light: its picture would be of wrong brightness.
STRANGE, STRANGE_SIGMAS = 0.35, 8.0
#: Patterns needed to know what most of them say.
FEWEST_PATTERNS = 8


@dataclass(frozen=True)
class Ratio:
    """Logarithm of the light at a setting over that at the last one, and its deviation."""

    log: float
    std: float


@lru_cache(maxsize=8)
def compared_rows(height: int) -> NDArray[np.intp]:
    """Rows of a picture of a height that are looked at."""
    return spread_rows(height, ROWS)


def compare_settings(
    raws: Sequence[NDArray[np.unsignedinteger]],
    blacks: Sequence[BlackFrame],
    gains_ms: Sequence[float],
    sensor: Sensor,
) -> tuple[Ratio | None, ...]:
    """The light of each mosaic of one pattern relative to the last one's; None where too little is seen."""
    # Only who merges frames needs compiled code.
    from dsl_core.reconstruction.hdr_kernels import light_sums

    rows = compared_rows(raws[0].shape[0])
    pictures = [raw[rows] for raw in raws]
    darks = [black.mean[rows] for black in blacks]
    low, high = (share * sensor.full_scale_dn for share in USED)
    floor = float(raw_variance(sensor, np.zeros(())))
    found: list[Ratio | None] = []
    for i in range(len(raws) - 1):
        # The fainter setting is fitted as a multiple of the brighter one, whose noise hardly matters.
        faint, bright = (i, -1) if gains_ms[i] <= gains_ms[-1] else (-1, i)
        scale = gains_ms[faint] / gains_ms[bright]
        count, power, product, square = light_sums(
            pictures[faint], pictures[bright], darks[faint], darks[bright],
            low, high, scale, floor, sensor.electrons_per_dn,
        )  # fmt: skip
        factor = product / power if power > 0 else 0.0
        if count < FEWEST or factor <= 0:
            found.append(None)
            continue
        misfit = (square - factor * product) / count
        ratio: Ratio | None = Ratio(float(np.log(factor / scale)), float(1 / np.sqrt(power) / factor))
        if misfit > CONTRADICT:
            one, two = ((pictures[n], darks[n]) for n in (faint, bright))
            ratio = _of_most(one, two, scale, (low, high), floor, sensor.electrons_per_dn)
        found.append(ratio if ratio is None or faint == i else Ratio(-ratio.log, ratio.std))
    return (*found, Ratio(0.0, 0.0))


def _of_most(
    faint: tuple[NDArray[np.unsignedinteger], NDArray[np.floating]],
    bright: tuple[NDArray[np.unsignedinteger], NDArray[np.floating]],
    scale: float,
    limits: tuple[float, float],
    floor: float,
    electrons: float,
) -> Ratio | None:
    """What most pixels say, where some contradict them; None where they do not agree either.

    Each setting is a mosaic and its black; the other arguments are those of `light_sums`.
    """
    other, light = (np.subtract(raw, black, dtype=np.float32) for raw, black in (faint, bright))
    used = (light > limits[0]) & (bright[0] < limits[1]) & (faint[0] < limits[1])
    some = thinned(np.flatnonzero(used), ASKED)
    x, y = (each.ravel()[some].astype(np.float64) for each in (light, other))
    shot = x / electrons
    variance = 2.0 * floor + scale * shot
    middle = float(np.median(y / x))
    agree = np.abs(y - middle * x) < AGREE_SIGMAS * np.sqrt(variance) + AGREE_SHARE * middle * x
    if middle <= 0 or int(agree.sum()) < max(FEWEST, FEWEST_AGREE * some.size):
        return None
    x, y, weight = x[agree], y[agree], 1 / variance[agree]
    power = float(weight @ (x**2 - floor - shot[agree]))
    factor = float(weight @ (x * y)) / power
    misfit = max(float(weight @ (y - factor * x) ** 2) / x.size, 1.0)
    return Ratio(float(np.log(factor / scale)), float(np.sqrt(misfit / power)) / factor)


def without_any(
    ratios: Mapping[tuple[Role, int], tuple[Ratio | None, ...]],
) -> dict[tuple[Role, int], tuple[Ratio | None, ...]]:
    """The patterns of settings that say nothing of the light."""
    return {pattern: (None,) * len(known) for pattern, known in ratios.items()}


def without_strange(
    ratios: Mapping[tuple[Role, int], tuple[Ratio | None, ...]],
) -> dict[tuple[Role, int], tuple[Ratio | None, ...]]:
    """The ``ratios`` of patterns by role and number, None where they contradict those of most others."""
    found = {key: list(of_settings) for key, of_settings in ratios.items()}
    for place in range(max(map(len, found.values()), default=0)):
        keys = [key for key, each in found.items() if place < len(each) and each[place] is not None]
        logs = np.array([ratio.log for key in keys if (ratio := found[key][place]) is not None])
        if logs.size < FEWEST_PATTERNS:
            continue
        apart = np.abs(logs - np.median(logs))
        limit = max(STRANGE, STRANGE_SIGMAS * STD_OF_MEDIAN_SIZE * float(np.median(apart)))
        for key, is_strange in zip(keys, apart > limit, strict=True):
            if is_strange:
                found[key][place] = None
    return {key: tuple(of_settings) for key, of_settings in found.items()}
