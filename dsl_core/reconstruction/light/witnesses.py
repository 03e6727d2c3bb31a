"""What the frames of a scan say of its light: settings, white and black taken again, and lines."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.plan import Shot
from dsl_core.optics.sensor import bayer_channels, raw_variance
from dsl_core.reconstruction.light.heard import Witness
from dsl_core.reconstruction.light.line_levels import LineLevels
from dsl_core.reconstruction.light.pictures import Pictures
from dsl_core.reconstruction.light.sudden import Again, share_of_black
from dsl_core.reconstruction.merge import Exposed
from dsl_core.solve.normal import MEDIAN_OVER_MEAN_STD
from dsl_core.solve.robust import robust_std

#: What levels of frames may be wrong by beyond their own deviations: the sum of light is not exact.
LEVEL_ERROR = 0.004
#: Pixels of a colour that tell how much light of it there is.
FEWEST = 60


def blacks_again(scan: Pictures) -> list[Again]:
    """By how much black pictures that a scan took again differ from the first ones, DN."""
    plan, changes = scan.plan, []
    whites = {shot.setting: shot for shot in plan.shots() if shot.role == "white"}
    for shot in plan.shots():
        old = plan.original(shot)
        if shot.role == "sentinel" and old.role == "black":
            black = scan.source.read(old).astype(np.float32)
            more, share = scan.source.read(shot) - black, (0.0, float("inf"))
            if old.setting in whites:
                share = share_of_black(more, black, scan.source.read(whites[old.setting]))
            std = float(more.std()) / np.sqrt(more.size)
            changes.append(Again(shot.index, float(more.mean()), max(std, 1e-3), share))
    return changes


def without_steps(witness: Witness, exposed: Exposed | None) -> Witness:
    """What a witness says of the light beyond its changes at once."""
    if exposed is None or witness.against is None:
        return witness
    known = np.log(exposed.levels[witness.shot] / exposed.levels[witness.against])
    return replace(witness, log=witness.log - float(known))


def of_settings(scan: Pictures) -> Iterator[Witness]:
    """Settings of the same pattern against its last one, exposures and levels considered."""
    sensor = scan.rig.sensor
    if sensor.rounds_light:
        return  # black is rounded too, and that is much of what a faint setting shows
    for (role, pattern), ratios in sorted(scan.ratios.items()):
        shots = scan.shots_of(role, pattern)
        for place, (shot, ratio) in enumerate(zip(shots[:-1], ratios, strict=False)):
            if ratio is not None:
                yield Witness(shot.index, shots[-1].index, ratio.log, ratio.std, setting=place)


@dataclass(frozen=True)
class ColoursAgain:
    """Logarithms of the light of white, taken again, in red, green and blue, over that of the first.

    ``apart`` is how far the farthest of them is from that of all light together, and ``std`` its deviation.
    """

    log: tuple[float, float, float]
    apart: float
    std: float


def of_whites(scan: Pictures) -> Iterator[Witness]:
    """White taken again, over white as it was taken first, each less the black next to it."""
    for shot, old, first, now in _whites_again(scan):
        yield _compared(scan, shot, old, first, now)


def colours_of_whites(scan: Pictures) -> Iterator[ColoursAgain]:
    """The same in each colour, of a camera that sees colours; none where one is nowhere bright enough."""
    bayer, limit = scan.rig.sensor.bayer, 0.9 * scan.rig.sensor.full_scale_dn
    for _, _, first, now in _whites_again(scan):
        channels = bayer_channels(bayer, *first.shape)
        # A monochrome camera lacks two colours, and a picture of one row or column lacks one.
        if np.bincount(channels.ravel(), minlength=3).min() < FEWEST:
            return
        bright, both = np.zeros(first.shape, bool), (first + now) / 2
        for colour in range(3):
            own = channels == colour
            bright |= own & (both > 0.25 * np.percentile(both[own], 95))
        used = bright & (first < limit) & (now < limit) & (first > 0) & (now > 0)
        each = [used & (channels == colour) for colour in range(3)]
        if min(int(own.sum()) for own in each) < FEWEST:
            continue
        more = np.log(np.where(used, now, 1.0) / np.where(used, first, 1.0))
        # Something before a part of the picture changes the light of that part alone.
        middle, logs = float(np.median(more[used])), [float(np.median(more[own])) for own in each]
        worst = int(np.abs(np.array(logs) - middle).argmax())
        own = more[each[worst]]
        std = MEDIAN_OVER_MEAN_STD * float(robust_std(own - logs[worst])) / np.sqrt(own.size)
        yield ColoursAgain((logs[0], logs[1], logs[2]), abs(logs[worst] - middle), std)


def _whites_again(
    scan: Pictures,
) -> Iterator[tuple[Shot, Shot, NDArray[np.floating], NDArray[np.floating]]]:
    """Each white taken again, what it repeats, and the light of both: that of the first one first."""
    plan = scan.plan
    again = {shot: plan.original(shot) for shot in plan.shots() if shot.role == "sentinel"}
    blacks = [shot for shot, old in again.items() if old.role == "black"]
    for shot, old in again.items():
        near = [black for black in blacks if abs(black.index - shot.index) < 4]
        if old.role != "white" or not near:
            continue
        black = scan.shots_of("black", 0)[old.setting]
        first = scan.source.read(old).astype(np.float32) - scan.source.read(black)
        yield shot, old, first, scan.source.read(shot).astype(np.float32) - scan.source.read(near[0])


def _compared(
    scan: Pictures, shot: Shot, old: Shot, first: NDArray[np.floating], now: NDArray[np.floating]
) -> Witness:
    limit = 0.9 * scan.rig.sensor.full_scale_dn
    # Chosen by one of them, noise would make that one brighter.
    both = (first + now) / 2
    used = (both > 0.25 * np.percentile(both, 95)) & (first < limit) & (now < limit)
    sums = [max(float(each[used].sum(dtype=np.float64)), 1.0) for each in (now, first)]
    noise = [float(raw_variance(scan.rig.sensor, each[used]).sum(dtype=np.float64)) for each in (now, first)]
    std = np.sqrt(noise[0] / sums[0] ** 2 + noise[1] / sums[1] ** 2)
    return Witness(shot.index, old.index, float(np.log(sums[0] / sums[1])), float(std))


def of_lines(scan: Pictures, lines: LineLevels | None) -> Iterator[Witness]:
    """Lines against white, whose light they share out."""
    if lines is None:
        return
    for pattern, (log, std) in enumerate(zip(lines.log, lines.std, strict=True)):
        shot = scan.shots_of("spectral", pattern)[-1]
        slope = 2 * (pattern + 0.5) / len(lines.log) - 1
        yield Witness(shot.index, None, float(log), float(np.hypot(std, LEVEL_ERROR)), slope)
