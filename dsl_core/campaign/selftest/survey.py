"""The first look of a self-test: is there light, how much, where; and can camera and projector be driven."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.selftest.readings import RegionSizes
from dsl_core.campaign.selftest.recorder import BLACK, Recorder, Region, grey
from dsl_core.errors import CalibrationError, DeviceError
from dsl_core.model.rig import BayerPattern
from dsl_core.optics.sensor import bayer_channels

#: White is exposed until it reaches this share of the scale, or this long.
_AIM, _LONGEST_MS = 0.4, 200.0
#: So many times that exposure, at most so long, shows where signals end.
_BRIGHTER, _LONG_MS = 40.0, 2000.0
#: Frames that catch every LED of a colour cycle at least once, and their random waits.
_GLANCES, _MAP_FRAMES, _MAX_GAP_MS = 6, 16, 40.0
#: A camera saturates if more than this share of all pixels has just the largest number.
_SATURATED = 0.1
#: A difference between white and black that is too small to be light.
_NO_LIGHT_DN = 10.0
#: The region: pixels brighter than this share of the brightest ones of their channel.
_LIT = 0.6
#: Pixels next to the picture get less than this share, and keep this distance from brighter ones, px.
_BESIDE, _DISTANCE_PX = 0.01, 6
_FEWEST_PIXELS, _FEWEST_BESIDE = 200, 60


@dataclass(frozen=True)
class Survey:
    """What the first look found: a short exposure of white, the black level (DN), region and sizes.

    ``ambient_share`` is the light of a black picture as a share of white, for a target as bright as most,
    and ``ambient_std`` its standard deviation; ``lit_share`` is the region's share of all pixels.
    """

    white_ms: float
    black_dn: float
    region: Region
    sizes: RegionSizes
    lit_share: float
    ambient_share: float
    ambient_std: float


def survey(recorder: Recorder, rng: np.random.Generator) -> Survey:
    """Find exposure and region under white.

    Raises `CalibrationError` when there is no light, too much of it, or too little of the picture in view,
    and `DeviceError` when the projector does not follow or the camera ignores its exposure.
    """
    from scipy.ndimage import uniform_filter

    info = recorder.devices.camera.info
    shortest = info.exposure_range_ms[0]
    recorder.show(BLACK)
    black_dn = float(np.median(recorder.snap(shortest).pixels))
    if black_dn > 0.9 * recorder.full_scale_dn:
        raise CalibrationError(
            f"The picture is saturated at the shortest exposure ({shortest:g} ms) although the projector"
            " shows black. Darken the room, and check the camera's black level and gain."
        )
    recorder.show(grey(1.0))
    white_ms = _expose(recorder, black_dn, rng)
    _require_obedience(recorder, white_ms, black_dn, rng)
    recorder.ceiling_dn = _ceiling(recorder, white_ms)
    _require_fresh_frames(recorder, white_ms)
    recorder.show(grey(1.0))
    white = _mean(recorder, white_ms, rng)
    recorder.show(BLACK)
    dark = _mean(recorder, white_ms, rng)
    # Means over neighbours, so that the noise of bright ambient light is not taken for the projector's light.
    if float(np.percentile(uniform_filter(white - dark, 9), 99)) < _NO_LIGHT_DN:
        raise _no_light(float(np.percentile(dark, 99)) - black_dn, white_ms)
    region, lit_share = _find_region(white, dark, _channels(info.bayer, white.shape))
    if min(len(each) for each in region.lit) < _FEWEST_PIXELS:
        raise _too_few_pixels(info.bayer)
    sizes = RegionSizes(
        np.array([len(each) for each in region.lit]),
        np.array([len(each) for each in region.beside]),
        info.bit_depth,
        is_monochrome=info.bayer == "MONO",
    )
    lit = np.concatenate(region.lit)
    light = float((white - dark).ravel()[lit].mean())
    # The black level is a median of whole numbers, so half a number off.
    return Survey(
        white_ms,
        black_dn,
        region,
        sizes,
        lit_share,
        ambient_share=(float(dark.ravel()[lit].mean()) - black_dn) / light,
        ambient_std=0.5 / light,
    )


def _expose(recorder: Recorder, black_dn: float, rng: np.random.Generator) -> float:
    """The exposure at which the brightest moment of white reaches the aim, ms."""
    shortest, longest = recorder.devices.camera.info.exposure_range_ms
    exposure = shortest
    while True:
        bright = float(np.percentile(_glance(recorder, exposure, rng), 99))
        if exposure == shortest and bright > 0.9 * recorder.full_scale_dn:
            raise CalibrationError(
                f"White is saturated at the shortest exposure ({shortest:g} ms). Close the camera's aperture,"
                " use a grey filter or lower the gain; if the camera chooses its own exposure, switch off"
                " its automatic exposure."
            )
        if bright - black_dn > _AIM * recorder.full_scale_dn or 2 * exposure > min(longest, _LONGEST_MS):
            return exposure
        exposure *= 2


def _require_obedience(
    recorder: Recorder, white_ms: float, black_dn: float, rng: np.random.Generator
) -> None:
    """Raise `DeviceError` when a quarter or four times the exposure gives the same light."""
    low, high = recorder.devices.camera.info.exposure_range_ms
    other_ms = white_ms / 4 if white_ms / 4 >= low else min(4 * white_ms, high)
    pairs = sorted((white_ms, other_ms))
    pictures = [_mean(recorder, ms, rng) for ms in pairs]
    faint, bright = (float(each.mean()) - black_dn for each in pictures)
    if bright > _NO_LIGHT_DN and bright < 1.5 * faint:
        _require_scale(recorder, *pictures)
        raise DeviceError(
            f"The camera gives {faint:.0f} DN at {pairs[0]:.3g} ms and {bright:.0f} DN at {pairs[1]:.3g} ms"
            " above black, so it ignores the requested exposure. Switch off its automatic exposure and gain."
        )


def _require_scale(recorder: Recorder, faint: NDArray[np.float64], bright: NDArray[np.float64]) -> None:
    """Raise `DeviceError` when two pictures, (rows, columns), end at the same number below full scale."""
    most = float(bright.max())
    if (faint == most).mean() > _SATURATED:
        raise DeviceError(
            f"The camera saturates at {most:.0f} DN, and not at {recorder.full_scale_dn:.0f} DN as its"
            f" {recorder.devices.camera.info.bit_depth} bits say. State its bits in the driver as they are,"
            " or lower the gain's offset."
        )


def _ceiling(recorder: Recorder, white_ms: float) -> float:
    """Where signals end, DN: twice the light gives no more; infinite where the scale ends first."""
    longest = min(recorder.devices.camera.info.exposure_range_ms[1], _LONG_MS)
    exposure_ms = min(_BRIGHTER * white_ms, longest / 2)
    once, twice = (float(np.median(recorder.snap(k * exposure_ms).pixels)) for k in (1, 2))
    return twice if twice < 1.1 * once and exposure_ms > 2 * white_ms else float("inf")


def _require_fresh_frames(recorder: Recorder, white_ms: float) -> None:
    """Raise `DeviceError` when the frame after a change of the picture still shows the picture before."""
    for _ in range(2):
        recorder.show(grey(1.0))
        bright = max(float(recorder.snap(white_ms).pixels.mean()) for _ in range(_GLANCES))
        recorder.show(BLACK)
        first, second = (float(recorder.snap(white_ms).pixels.mean()) for _ in range(2))
        if first - second < 0.2 * (bright - second) or bright - second < 0.1 * _NO_LIGHT_DN:
            return
    raise DeviceError(
        "The camera delivers stale frames: after a new picture its first frame shows the previous one, the"
        " next one does not. Have its driver expose on request, or empty its buffer before each frame."
    )


def _glance(recorder: Recorder, exposure_ms: float, rng: np.random.Generator) -> NDArray[np.float64]:
    """The brightest value of each pixel over a few frames at random times."""
    brightest = recorder.snap(exposure_ms).pixels
    for _ in range(_GLANCES - 1):
        recorder.wait(rng.uniform(0, _MAX_GAP_MS))
        brightest = np.maximum(brightest, recorder.snap(exposure_ms).pixels)
    return np.asarray(brightest, float)


def _mean(recorder: Recorder, exposure_ms: float, rng: np.random.Generator) -> NDArray[np.float64]:
    """The mean of frames at random times."""
    total = np.zeros(())
    for _ in range(_MAP_FRAMES):
        recorder.wait(rng.uniform(0, _MAX_GAP_MS))
        total = total + recorder.snap(exposure_ms).pixels
    return np.asarray(total / _MAP_FRAMES)


def _no_light(ambient_dn: float, exposure_ms: float) -> CalibrationError | DeviceError:
    if ambient_dn > _NO_LIGHT_DN:
        return DeviceError(
            f"The camera receives light ({ambient_dn:.0f} DN at {exposure_ms:.3g} ms), but white and black of"
            " the projector look the same. Check that the projector is on, connected, and shines on the"
            " target."
        )
    return CalibrationError(
        f"The camera's picture is dark, even at {exposure_ms:.3g} ms with the projector white. Take off the"
        " lens cap, open the aperture, switch the projector on and put a white target in view."
    )


def _channels(bayer: BayerPattern, shape: tuple[int, ...]) -> NDArray[np.int64]:
    """Channel (0 to 2) of every pixel: its colour, or of a monochrome camera that of its row, every third.

    Whole rows, so that the next pixel of a channel is a neighbour on the sensor.
    """
    if bayer == "MONO":
        return np.broadcast_to(np.arange(shape[0])[:, None] % 3, shape)
    return bayer_channels(bayer, *shape)


def _too_few_pixels(bayer: BayerPattern) -> CalibrationError:
    colours = "" if bayer == "MONO" else " in red, green and blue"
    return CalibrationError(
        f"The projected picture is bright enough{colours} on too few pixels. Put a white target in view that"
        " fills the picture, and check that all three LEDs of the projector light."
    )


def _find_region(
    bright: NDArray[np.float64], black: NDArray[np.float64], channels: NDArray[np.int64]
) -> tuple[Region, float]:
    """Lit pixels and pixels next to the picture of each channel, without hot ones; the share of lit ones."""
    from scipy.ndimage import maximum_filter

    white = bright - black
    sound = np.abs(black - np.median(black)) < max(_NO_LIGHT_DN, 0.1 * float(np.percentile(white, 99)))
    lit, beside = [], []
    noise = np.median(np.abs(np.diff(white[::2], axis=0))) + 0.1
    brightest = np.array([np.percentile(white[channels == c], 99) for c in range(3)])
    share = white / np.maximum(brightest, _NO_LIGHT_DN)[channels]
    # The brightest neighbour decides, so that the soft edge of the picture belongs to neither.
    near = maximum_filter(share, 2 * _DISTANCE_PX + 1)
    dark = (near < _BESIDE + 6 * noise / np.maximum(brightest.min(), _NO_LIGHT_DN)) & (share < _BESIDE * 2)
    for c in range(3):
        own = (channels == c) & sound
        lit.append(np.flatnonzero(own & (share > _LIT)))
        beside.append(np.flatnonzero(own & dark))
    if min(len(each) for each in beside) < _FEWEST_BESIDE:
        beside = [np.empty(0, np.int64)] * 3
    total = sum(len(each) for each in lit) / white.size
    return Region((lit[0], lit[1], lit[2]), (beside[0], beside[1], beside[2])), total
