"""Where the camera's values end and in which steps they come, as the frames of a scan show.

A camera can saturate below the largest number of its bit depth, and files can have held fewer bits than the
camera gives. Taken as calibrated, the first makes light out of what was cut off, the second noise that
nobody expects.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.fit import FitFinding
from dsl_core.model.frames import FrameSource
from dsl_core.model.plan import CapturePlan, Shot
from dsl_core.model.rig import Sensor
from dsl_core.optics.sensor import bayer_channels, end_of, step_of
from dsl_core.reconstruction.light.own_noise import own_noise
from dsl_core.reconstruction.light.setting_ratios import compared_rows

Counts = NDArray[np.int64]

#: Scan lines that are looked at, besides white and black.
LINES = 8
#: The second of the three colours has at least this share of them: noise-free light piles up in one alone.
OTHER_COLOUR = 0.1
#: Share of the range that saturation is not looked for in.
UPPER = 0.25
#: Values nearer to full scale than this share of it count as saturated anyway.
MARGIN = 0.02


def own_sensor(source: FrameSource, sensor: Sensor) -> tuple[Sensor, tuple[FitFinding, ...]]:
    """The sensor with the saturation, rounding and noise that frames show, and what was found."""
    counts = _counts(source, sensor)
    ends_dn, step_dn = saturation_dn(counts, sensor), step_of(counts.sum(0))
    findings = []
    if ends_dn is not None:
        findings.append(_ends(ends_dn, sensor))
        sensor = sensor.model_copy(update={"saturation_dn": ends_dn})
    if step_dn > sensor.step_dn:
        findings.append(_steps(step_dn, sensor))
        sensor = sensor.model_copy(update={"step_dn": step_dn})
    sensor, noisy = own_noise(source, sensor)
    return sensor, (*findings, *noisy)


def saturation_dn(counts: Counts, sensor: Sensor) -> int | None:
    """The value at which frames end, from how often each occurs (3, values); None if unseen or at full scale.

    Noise spreads light over neighbouring values, and colours differ: only where values end do many pixels of
    several colours have the same one.
    """
    total = counts.sum(0)
    low = int(sensor.black_level_dn + UPPER * (sensor.full_scale_dn - sensor.black_level_dn))
    end = end_of(total, low)
    if end is None or end >= (1 - MARGIN) * sensor.full_scale_dn:
        return None
    several = np.sort(counts[:, end])[1] >= OTHER_COLOUR * total[end] or np.count_nonzero(counts.any(1)) == 1
    return end if several else None


def _counts(source: FrameSource, sensor: Sensor) -> Counts:
    """How many pixels of each colour have each value, (3, values)."""
    most = 2**sensor.bit_depth
    counts = np.zeros((3, most), np.int64)
    for shot in _looked_at(source.plan):
        frame = source.read(shot)
        colours = bayer_channels(sensor.bayer, *frame.shape)
        rows = compared_rows(frame.shape[0])
        frame, colours = frame[rows], colours[rows]
        for colour in np.unique(colours):
            counts[colour] += np.bincount(np.minimum(frame[colours == colour], most - 1), minlength=most)
    return counts


def _looked_at(plan: CapturePlan) -> Iterator[Shot]:
    lines = set(np.linspace(0, max(plan.spectral_count - 1, 0), LINES).astype(int).tolist())
    for shot in plan.shots():
        if shot.role in ("white", "black") or (shot.role == "spectral" and shot.pattern in lines):
            yield shot


def _ends(ends_dn: int, sensor: Sensor) -> FitFinding:
    return FitFinding.judged(
        "response",
        "saturation of the camera",
        1 - ends_dn / sensor.full_scale_dn,
        "1",
        MARGIN,
        f"The camera's values end at {ends_dn} DN instead of {sensor.full_scale_dn} DN; pixels that reach it"
        " count as saturated.",
        "Check the camera's bit depth and gain, and what converts its frames; then repeat the calibration.",
    )


def _steps(step_dn: int, sensor: Sensor) -> FitFinding:
    bits = sensor.bit_depth - round(np.log2(step_dn))
    return FitFinding.judged(
        "response",
        "steps of the values",
        float(step_dn),
        "DN",
        # Rounding then adds as much as there is noise.
        max(float(np.sqrt(12)) * sensor.read_noise_dn, 1.5 * sensor.step_dn),
        f"The frames' values come in steps of {step_dn} DN, as in pictures of {bits} bits; the camera has"
        f" {sensor.bit_depth}. Deviations include that as noise; light fainter than a step is lost, and"
        " spectra of dark surfaces are off by more.",
        f"Store frames with all {sensor.bit_depth} bits of the camera, as raw files or 16-bit PNG or TIFF.",
    )
