"""What the frames of a scan say of its light: settings, white and black taken again, and lines."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.plan import Shot
from dsl_core.optics.sensor import raw_variance
from dsl_core.reconstruction.light.course import Witness
from dsl_core.reconstruction.light.line_levels import LineLevels
from dsl_core.reconstruction.light.pictures import Pictures
from dsl_core.reconstruction.light.sudden import Again, share_of_black
from dsl_core.reconstruction.merge import Exposed

#: What levels of frames may be wrong by beyond their own deviations: the sum of light is not exact.
LEVEL_ERROR = 0.004


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


def of_whites(scan: Pictures) -> Iterator[Witness]:
    """White taken again, over white as it was taken first, each less the black next to it."""
    plan = scan.plan
    again = {shot: plan.original(shot) for shot in plan.shots() if shot.role == "sentinel"}
    blacks = [shot for shot, old in again.items() if old.role == "black"]
    for shot, old in again.items():
        near = [black for black in blacks if abs(black.index - shot.index) < 4]
        if old.role != "white" or not near:
            continue
        black = scan.shots_of("black", 0)[old.setting]
        first = scan.source.read(old).astype(np.float32) - scan.source.read(black)
        now = scan.source.read(shot).astype(np.float32) - scan.source.read(near[0])
        yield _compared(scan, shot, old, first, now)


def _compared(
    scan: Pictures, shot: Shot, old: Shot, first: NDArray[np.floating], now: NDArray[np.floating]
) -> Witness:
    limit = 0.9 * scan.rig.sensor.full_scale_dn
    used = (first > 0.25 * np.percentile(first, 95)) & (first < limit) & (now < limit)
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
