"""Black level, linearity, photon transfer and saturation of a camera (after EMVA 1288)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.selftest.readings import ROUNDING_DN2, Readings, RegionSizes, line_fit
from dsl_core.errors import CalibrationError
from dsl_core.model.calibration.selftest import CameraCheck, Measured
from dsl_core.model.conditions import COLOUR_NAMES

Floats = NDArray[np.float64]

#: Light and exposure are taken as this steady from frame to frame, as a share of the signal.
STEADINESS = 1e-4
#: Exposures that a line needs.
_MIN_EXPOSURES = 5
#: Where dark frames have less noise than this, rounding makes most of it.
_LEAST_NOISE_DN2 = 2 * ROUNDING_DN2
#: Many sensors bend before they saturate: looked for above this share of the scale, where values lie below
#: the line of the others by this share of it and by so many deviations.
BENDS_ABOVE, BENT, BENT_SIGMAS = 0.85, 2e-3, 5.0


@dataclass(frozen=True)
class Dark:
    """Black level (DN), light of a dark projector (DN per ms), and light outside its picture (DN per ms)."""

    level_dn: Measured
    rate: Floats  # (3,)
    rate_std: Floats  # (3,)
    beside_rate: Floats  # (3,)
    beside_std: Floats  # (3,)


@dataclass(frozen=True)
class Transfer:
    """Electrons per DN and read noise, from the variances of pairs of frames."""

    electrons_per_dn: Measured
    read_noise_dn: Measured

    def mean_std(self, signal_dn: Floats, pixels: NDArray[np.int64]) -> Floats:
        """Standard deviation of the mean over so many pixels of a signal above black, DN."""
        floor = self.read_noise_dn.value**2 + ROUNDING_DN2
        variance = floor + np.maximum(signal_dn, 0) / self.electrons_per_dn.value
        return np.asarray(np.sqrt(variance / pixels))


def fit_dark(dark: Readings, sizes: RegionSizes) -> Dark:
    """Black level and rates from frames with the projector black, at a short and a long exposure."""
    short = dark.exposure_ms == dark.exposure_ms.min()
    step_ms = dark.exposure_ms[~short].mean() - dark.exposure_ms.min()
    noise = float(np.sqrt(dark.pair_variance_dn2[dark.is_pair].mean(0) @ sizes.pixels / sizes.pixels.sum()))
    rates = []
    for values, pixels in ((dark.mean_dn, sizes.pixels), (dark.beside_dn, sizes.beside)):
        rate = (values[~short].mean(0) - values[short].mean(0)) / step_ms
        frames = 1 / (~short).sum() + 1 / short.sum()
        rates.append((rate, noise * np.sqrt(frames / np.maximum(pixels, 1)) / step_ms))
    (rate, rate_std), (beside, beside_std) = rates
    level = dark.mean_dn[short].mean(0) - rate * dark.exposure_ms.min()
    weight = sizes.pixels / sizes.pixels.sum()
    statistical = noise / np.sqrt(sizes.pixels.sum() * short.sum())
    # Channels that differ have no one black level; their spread says how far it can be trusted.
    spread = np.sqrt(weight @ (level - weight @ level) ** 2 / 2)
    black = Measured(value=float(weight @ level), std=float(np.hypot(statistical, spread)))
    return Dark(black, rate, rate_std, beside, beside_std)


def fit_transfer(pairs: Readings, black_dn: float, sizes: RegionSizes) -> Transfer:
    """Variance against signal is a line: slope 1 / electrons per DN, intercept read noise and rounding.

    Raises `CalibrationError` when variance does not grow with signal.
    """
    used = pairs.is_pair[:, None] & pairs.unclipped
    variance, signal = pairs.pair_variance_dn2[used], (pairs.mean_dn - black_dn)[used]
    freedom = np.broadcast_to(sizes.pixels, used.shape)[used]
    design = np.stack([np.ones_like(signal), signal], 1)
    model = np.maximum(variance, ROUNDING_DN2)
    for _ in range(3):
        found, covariance = line_fit(design, variance, model * np.sqrt(2 / freedom))
        model = np.maximum(design @ found, ROUNDING_DN2)
    if found[1] <= 3 * np.sqrt(covariance[1, 1]):
        raise CalibrationError(
            "The noise of the camera does not grow with light, so its values are not raw photon counts."
            " Switch off its denoising, compression and gamma, or choose a brighter target."
        )
    gain = Measured(value=float(1 / found[1]), std=float(np.sqrt(covariance[1, 1]) / found[1] ** 2))
    read = float(np.sqrt(max(found[0] - ROUNDING_DN2, 0.0)))
    # Below the step of rounding the square root is flat; its error is then that of the variance itself.
    std = np.sqrt(covariance[0, 0])
    return Transfer(gain, Measured(value=read, std=float(min(std / max(2 * read, 1e-9), np.sqrt(std)))))


def noise_of_pixels(dark: Readings, lit: Readings, sizes: RegionSizes) -> Measured | None:
    """Share of the noise of light that neighbouring pixels of a colour have in common; None if not known.

    Filters of a camera spread it over neighbours, and light that flickers by rows adds some to whole rows.
    What dark frames have is left out: noise of whole rows is many a sensor's own, and does no harm.
    """
    used = lit.is_pair[:, None] & lit.unclipped
    own, own_shared = (
        np.broadcast_to(each[dark.is_pair].mean(0), used.shape)[used]
        for each in (dark.pair_variance_dn2, dark.pair_covariance_dn2)
    )
    variance, shared = lit.pair_variance_dn2[used], lit.pair_covariance_dn2[used]
    total = float((variance - own).sum())
    if total <= 0 or not shared.any():
        return None
    pixels = np.broadcast_to(sizes.pixels, used.shape)[used]
    return Measured(
        value=float((shared - own_shared).sum()) / total,
        std=float(np.sqrt((variance**2 / pixels).sum())) / total,
    )


def noise_of_frames(dark: Readings, sizes: RegionSizes) -> Measured | None:
    """Share of the noise that a dark frame has from the one before; None where rounding hides noise.

    Of noise that fades from frame to frame, those next to each other differ by less than those further apart.
    """
    used = (dark.second_variance_dn2 > 0).all(1)
    next_dn2, second_dn2 = (
        float((variance[used] @ sizes.pixels).sum())
        for variance in (dark.pair_variance_dn2, dark.second_variance_dn2)
    )
    count = int(used.sum()) * float(sizes.pixels.sum())
    if count == 0 or next_dn2 < _LEAST_NOISE_DN2 * count:
        return None
    ratio = second_dn2 / next_dn2
    return Measured(value=ratio - 1, std=float(ratio * np.sqrt(4 / count)))


def check_camera(
    dark: Dark,
    transfer: Transfer,
    series: Readings,
    saturated: Readings,
    hot: tuple[int, int],
    sizes: RegionSizes,
) -> CameraCheck:
    """Line of signal against exposure for each channel, and the figures that follow from it.

    ``series`` may bend at its end. ``hot`` are hot pixels and all pixels. Raises `CalibrationError` when a
    channel has too few unclipped exposures.
    """
    unclipped = series.unclipped
    series = straight_part(series, dark, transfer, sizes)
    useful_dn = float(series.mean_dn[series.unclipped].max())
    lines = [exposure_line(series, channel, dark, transfer, sizes) for channel in range(3)]
    intercepts, stds = np.array([(line.intercept.value, line.intercept.std) for line in lines]).T
    red, green, blue = (line.largest_percent(sizes.full_scale_dn) for line in lines)
    weight = stds**-2 / (stds**-2).sum()
    rates = np.array([line.rate_dn_per_ms for line in lines])
    offsets, offset_stds = (
        (intercepts - dark.level_dn.value) / rates,
        np.hypot(stds, dark.level_dn.std) / rates,
    )
    count, total = hot
    return CameraCheck(
        bit_depth=sizes.bit_depth,
        step_dn=sizes.step_dn,
        ends_dn=sizes.ends_dn,
        is_monochrome=sizes.is_monochrome,
        black_level_dn=dark.level_dn,
        intercept_dn=Measured(value=float(weight @ intercepts), std=float((stds**-2).sum() ** -0.5)),
        linearity_percent=(red, green, blue),
        useful_dn=useful_dn,
        bends=bool((unclipped & ~series.unclipped).any()),
        saturation_dn=_saturation(saturated),
        electrons_per_dn=transfer.electrons_per_dn,
        read_noise_dn=transfer.read_noise_dn,
        hot_share=Measured(value=count / total, std=float(np.sqrt(max(count, 1)) / total)),
        exposure_offset_ms=Measured(
            value=float(np.average(offsets, weights=offset_stds**-2)),
            std=float((offset_stds**-2).sum() ** -0.5),
        ),
    )


def black_change(dark: Dark, again: Readings, transfer: Transfer, sizes: RegionSizes) -> Measured:
    """What black of the shortest exposure has gained since the level was measured, DN."""
    weight = sizes.pixels / sizes.pixels.sum()
    level = float((again.mean_dn - dark.rate * again.exposure_ms[:, None]).mean(0) @ weight)
    noise = float(transfer.mean_std(np.zeros(1), np.array([sizes.pixels.sum() * len(again)]))[0])
    return Measured(value=level - dark.level_dn.value, std=float(np.hypot(noise, dark.level_dn.std)))


def count_hot_pixels(first: NDArray[np.uint16], second: NDArray[np.uint16], noise_dn: float) -> int:
    """Pixels of two dark frames that both times stand out from their neighbours of the same colour."""
    from scipy.ndimage import maximum_filter

    around = np.ones((3, 3), bool)
    around[1, 1] = False
    frame = np.minimum(first, second).astype(np.float32)
    count = 0
    for row in (0, 1):
        for column in (0, 1):
            plane = frame[row::2, column::2]
            # Beyond every neighbour, so that the edge of a faint picture is not a hot pixel.
            excess = plane - maximum_filter(plane, footprint=around, mode="mirror")
            # Far beyond what noise does; dim pixels that merely glow belong to the noise figures.
            count += int((excess > max(6 * noise_dn, 5.0)).sum())
    return count


@dataclass(frozen=True)
class ExposureLine:
    """Signal of one channel against exposure, (n,), and the straight line through it.

    ``residual_dn`` are distances from the line, ``std_dn`` their deviations; ``intercept`` is where the line
    meets an exposure of zero.
    """

    exposure_ms: Floats
    value_dn: Floats
    residual_dn: Floats
    std_dn: Floats
    intercept: Measured

    @property
    def rate_dn_per_ms(self) -> float:
        """The slope of the line."""
        on_line = self.value_dn[-1] - self.residual_dn[-1]
        return float((on_line - self.intercept.value) / self.exposure_ms[-1])

    def largest_percent(self, full_scale_dn: float) -> Measured:
        """The largest distance from the line in percent of full scale."""
        worst = int(np.abs(self.residual_dn).argmax())
        percent = 100 / full_scale_dn
        return Measured(
            value=float(abs(self.residual_dn[worst]) * percent), std=float(self.std_dn[worst] * percent)
        )


def straight_part(series: Readings, dark: Dark, transfer: Transfer, sizes: RegionSizes) -> Readings:
    """The same readings, of which those count as clipped that lie where values bend before they end."""
    from_dn = BENDS_ABOVE * sizes.full_scale_dn
    low = replace(series, clipped=np.where(series.mean_dn > from_dn, 1.0, series.clipped))
    ends_dn = np.inf
    for channel in range(3):
        high = series.unclipped[:, channel] & ~low.unclipped[:, channel]
        if not high.any() or len(np.unique(series.exposure_ms[low.unclipped[:, channel]])) < _MIN_EXPOSURES:
            continue
        line = exposure_line(low, channel, dark, transfer, sizes)
        value = series.mean_dn[high, channel]
        found = np.polyfit(line.exposure_ms, line.value_dn - line.residual_dn, 1)
        below = np.polyval(found, series.exposure_ms[high]) - value
        signal = value - dark.level_dn.value
        std = np.hypot(transfer.mean_std(signal, sizes.pixels[channel]), STEADINESS * signal)
        bent = (below > BENT * sizes.full_scale_dn) & (below > BENT_SIGMAS * std)
        ends_dn = min(ends_dn, value[bent].min(initial=np.inf))
    return replace(series, clipped=np.where(series.mean_dn >= ends_dn, 1.0, series.clipped))


def exposure_line(
    series: Readings, channel: int, dark: Dark, transfer: Transfer, sizes: RegionSizes
) -> ExposureLine:
    """The line of a channel through its unclipped readings; raises `CalibrationError` for too few of them."""
    used = series.unclipped[:, channel]
    exposure, value = series.exposure_ms[used], series.mean_dn[used, channel]
    if len(np.unique(exposure)) < _MIN_EXPOSURES:
        name = "picture" if sizes.is_monochrome else f"{COLOUR_NAMES[channel]} channel"
        raise CalibrationError(
            f"The {name} clips at all but {len(np.unique(exposure))}"
            " exposures, too few to fit a line. Close the aperture of the camera or dim the light."
        )
    signal = value - dark.level_dn.value
    std = np.hypot(transfer.mean_std(signal, sizes.pixels[channel]), STEADINESS * signal)
    found, covariance = line_fit(np.stack([np.ones_like(exposure), exposure], 1), value, std)
    intercept = Measured(value=float(found[0]), std=float(np.sqrt(covariance[0, 0])))
    return ExposureLine(exposure, value, value - found[0] - found[1] * exposure, std, intercept)


def _saturation(saturated: Readings) -> Measured:
    """Where the scale ends: the mean of clipped regions; at least the largest signal if nothing clipped."""
    full = saturated.clipped > 0.98
    values = saturated.mean_dn[full] if full.any() else saturated.mean_dn.max(keepdims=True)
    return Measured(value=float(values.mean()), std=float(values.std()))
