"""The self-test's figures against their limits, each with what to do."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from dsl_core.calibration.selftest.record import PUBLISHED_MS
from dsl_core.calibration.selftest.tone import MOST_LEFT
from dsl_core.model.calibration.selftest import (
    OFF_CURVE,
    OFF_POWER_LAW,
    CameraCheck,
    CycleCheck,
    FocusCheck,
    LatencyCheck,
    Measured,
    ProjectorCheck,
    SelfTest,
)
from dsl_core.model.figure import Figure

#: Limits: percent of full scale; times the read noise; share of full scale; share of pixels.
LINEARITY_PERCENT, BLACK_NOISES, SATURATION, HOT = 0.5, 5.0, 0.9, 1e-3
#: Values of fewer bits than these, given as ones of more, round the light that black and ramps are read from.
FEWEST_BITS = 10
#: Largest change of the black level, as a share of full scale; exposures that are longer than stated, ms; and
#: noise that neighbouring pixels, and frames one after the other, have in common.
BLACK_CHANGE, EXPOSURE_MS, SHARED_BY_PIXELS, SHARED_BY_FRAMES = 1e-3, 0.1, 0.1, 0.25
#: Largest difference of gamma between colours, rms residual of a ramp, both percent; largest black.
GAMMA_SPREAD_PERCENT, RAMP_PERCENT, BLACK = 2.0, 100 * MOST_LEFT, 0.01
#: Linear projectors have a gamma of one, which noise puts on either side of it.
LEAST_GAMMA = 0.8
#: The new picture must be visible when ``show`` returns, within this; beat at the advised exposures, percent.
WAIT_MS, BEAT_PERCENT = 1.0, 0.3
#: A line of a scan is 5 px wide, and its edges are modelled by a blur of about 0.6 px; the width of a pixel
#: of the camera, which no focusing changes, comes on top.
BLUR_PX, AMBIENT = 1.5, 0.01


def selftest_figures(found: SelfTest) -> tuple[Figure, ...]:
    """All figures in the order of the test."""
    return (
        *_camera(found.camera),
        *_projector(found.projector),
        *_latency(found.latency),
        *_cycle(found.cycle),
        *_focus(found.focus),
        _figure(
            "light with the projector black, of white",
            found.ambient.share_of_white,
            "1",
            high=AMBIENT,
            advice="Switch off lamps and keep daylight out; what remains is the projector's own black.",
        ),
    )


def _figure(
    name: str,
    measured: Measured,
    unit: str,
    low: float | None = None,
    high: float | None = None,
    advice: str = "",
) -> Figure:
    return Figure(
        name=name, value=measured.value, std=measured.std, unit=unit, low=low, high=high, advice=advice
    )


def _camera(camera: CameraCheck) -> Iterator[Figure]:
    if camera.step_dn > 1:
        bits = camera.bit_depth - round(np.log2(camera.step_dn))
        yield Figure(
            name="distance of neighbouring values",
            value=float(camera.step_dn),
            unit="DN",
            high=max(2.0 ** (camera.bit_depth - FEWEST_BITS), 1.0),
            advice=f"The camera or its driver gives values of {bits} bits as ones of {camera.bit_depth}:"
            " choose a pixel format with all bits of the sensor, such as Mono12 or BayerRG12, or state"
            f" {bits} bits in the driver and pass values on as they are.",
        )
    worst = max(camera.linearity_percent, key=lambda each: each.value)
    yield _figure(
        "linearity, largest residual of full scale",
        worst,
        "%",
        high=LINEARITY_PERCENT,
        advice="Switch off the camera's gamma, white balance and automatic exposure and gain, and lamps that"
        " flicker.",
    )
    yield _figure(
        "black level",
        camera.black_level_dn,
        "DN",
        low=BLACK_NOISES * camera.read_noise_dn.value,
        advice="Noise is cut off at zero: raise the camera's black level.",
    )
    yield from _steadiness(camera)
    if camera.bends:
        yield Figure(name="values bend before they end, above", value=camera.useful_dn, unit="DN")
    yield _figure("electrons per DN", camera.electrons_per_dn, "e-/DN")
    yield _figure("read noise", camera.read_noise_dn, "DN")
    yield _figure(
        "saturation",
        camera.saturation_dn,
        "DN",
        low=SATURATION * (2**camera.bit_depth - 1),
        advice="The sensor saturates below full scale, or nothing was bright enough to clip: lower the"
        " gain's offset, open the aperture, or set the camera's full bit depth.",
    )
    yield _figure(
        "hot pixels",
        camera.hot_share,
        "1",
        high=HOT,
        advice="Let the camera cool down, or switch on its correction of defective pixels.",
    )


def _steadiness(camera: CameraCheck) -> Iterator[Figure]:
    """Whether black, exposure and noise are what a camera of raw values has, where that was measured."""
    full_scale_dn = 2**camera.bit_depth - 1
    if camera.black_change_dn is not None:
        most = BLACK_CHANGE * full_scale_dn
        yield _figure(
            "black level, change during the test",
            camera.black_change_dn,
            "DN",
            low=-most,
            high=most,
            advice="The camera's black level drifts: let the camera warm up, and switch off automatic control"
            " of its black level.",
        )
    is_line = max(each.value for each in camera.linearity_percent) <= LINEARITY_PERCENT
    # Black that is cut off is not where light without exposure would be.
    is_line &= camera.black_level_dn.value >= BLACK_NOISES * camera.read_noise_dn.value
    if camera.exposure_offset_ms is not None and is_line:
        yield _figure(
            "exposure, longer than stated by",
            camera.exposure_offset_ms,
            "ms",
            low=-EXPOSURE_MS,
            high=EXPOSURE_MS,
            advice="State exposures in the camera's driver as they are: light without exposure is not black.",
        )
    for kind, shared, most in (
        ("neighbouring pixels", camera.shared_by_pixels, SHARED_BY_PIXELS),
        ("frames one after the other", camera.shared_by_frames, SHARED_BY_FRAMES),
    ):
        if shared is not None:
            percent = Measured(value=100 * shared.value, std=100 * shared.std)
            yield _figure(
                f"noise that {kind} share",
                percent,
                "%",
                low=-100 * most,
                high=100 * most,
                advice=_SHARED,
            )


_SHARED = (
    "The camera filters its pictures, or light flickers while their rows are read, and electrons per DN are"
    " wrong with it: switch off noise reduction, sharpening, scaling and compression of the camera, and lamps"
    " that flicker."
)


def _projector(projector: ProjectorCheck) -> Iterator[Figure]:
    yield _figure(
        "gamma",
        projector.gamma,
        "1",
        low=LEAST_GAMMA,
        high=3.5,
        advice="Set the projector's picture mode to one without dynamic contrast or film mode.",
    )
    values = [ramp.gamma.value for ramp in projector.ramps]
    std = max(ramp.gamma.std for ramp in projector.ramps)
    mean = projector.gamma.value
    yield _figure(
        "gamma, difference between colours",
        Measured(value=100 * (max(values) - min(values)) / mean, std=100 * 2**0.5 * std / mean),
        "%",
        high=GAMMA_SPREAD_PERCENT,
        advice="One curve is kept for all colours: choose a picture mode without colour management, or scan"
        " with one drive level only.",
    )
    tone = projector.tone
    if tone is not None:
        level = np.linspace(tone.lowest_level, 1.0, 100)
        off = np.log(tone.light(level)) - mean * np.log(level)
        yield _figure(
            "light by drive level, farthest from a power law",
            Measured(value=100 * float(np.abs(np.expm1(off)).max()), std=100 * tone.rel_std),
            "%",
        )
    worst = max((ramp.residual_percent for ramp in projector.ramps), key=lambda each: each.value)
    yield _figure(
        OFF_POWER_LAW if tone is None else OFF_CURVE,
        worst,
        "%",
        high=RAMP_PERCENT,
        advice="The light changes with more than the drive level, or dark or bright levels look alike: switch"
        " off the projector's picture enhancements and dynamic contrast, and in the computer's display"
        " settings colour profiles and night light; and set both to the same range of levels, full (0 to 255)"
        " or limited.",
    )
    yield Figure(
        name="ramps, steps that fall",
        value=sum(ramp.falls for ramp in projector.ramps),
        unit="",
        high=0,
        advice="More drive gave less light: switch off the projector's dynamic contrast and eco mode.",
    )
    yield _figure(
        "projector black, of white",
        projector.black_fraction,
        "1",
        high=BLACK,
        advice="Switch off lamps; otherwise lower the projector's brightness offset.",
    )


def _latency(latency: LatencyCheck) -> Iterator[Figure]:
    both = Measured(
        value=latency.blocking_ms.value + latency.wait_ms.value,
        std=(latency.blocking_ms.std**2 + latency.wait_ms.std**2) ** 0.5,
    )
    yield _figure("latency from show to light", both, "ms")
    yield _figure(
        "latency not waited for",
        latency.wait_ms,
        "ms",
        high=WAIT_MS,
        advice=f"Pictures are late: raise the latency of the projector's driver from {latency.claimed_ms:g}"
        f" to at least {latency.claimed_ms + latency.wait_ms.value + latency.wait_ms.std:.0f} ms.",
    )
    yield Figure(
        name="stale frames",
        value=latency.stale_frames,
        unit="",
        high=0,
        advice="The camera delivers pictures exposed before they were requested: have its driver trigger each"
        " exposure, or empty its buffer first.",
    )


def _cycle(cycle: CycleCheck) -> Iterator[Figure]:
    if cycle.period_ms is not None:
        yield _figure("colour cycle", cycle.period_ms, "ms")
    bound = cycle.period_ms is None
    yield _figure("modulation of the light" + (", at most" if bound else ""), cycle.modulation, "1")
    yield Figure(name="shortest safe exposure", value=cycle.shortest_ms, unit="ms")
    for wanted, advised in zip(cycle.wanted_ms, cycle.advised_ms, strict=True):
        yield Figure(name=f"advised exposure for {wanted:.1f} ms", value=advised, unit="ms")
    safe = " or ".join(f"{each:.2f}" for each in cycle.advised_ms)
    for beat in cycle.beats:
        worst = max((*beat.channels_percent, beat.ratio_percent), key=lambda each: each.value)
        published = beat.exposure_ms in PUBLISHED_MS and not cycle.is_advised(beat.exposure_ms)
        yield _figure(
            f"modulation of the light at {beat.exposure_ms:.2f} ms",
            worst,
            "%",
            high=None if published else BEAT_PERCENT + 3 * beat.floor_percent,
            advice=f"Use {safe} ms, which are whole cycles."
            if published
            else "The light is not steady over whole cycles: switch off lamps, let the projector warm up, and"
            " repeat.",
        )


def _focus(focus: FocusCheck) -> Iterator[Figure]:
    yield _figure("blur of edges in the camera", focus.camera_px, "px")
    yield _figure(
        "blur of edges, worst third",
        focus.worst_px,
        "projector px",
        high=float(np.hypot(BLUR_PX, focus.pixel_px / 12**0.5)),
        advice="Focus the projector on the target first, then the camera; close the camera's aperture if only"
        " one side is soft.",
    )
