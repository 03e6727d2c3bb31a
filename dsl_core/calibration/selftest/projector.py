"""Light by drive level and black of a projector from ramps of white, red, green and blue."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise, permutations

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.selftest.camera import STEADINESS, Dark, Transfer
from dsl_core.calibration.selftest.readings import Readings, RegionSizes, line_fit
from dsl_core.calibration.selftest.tone import MOST_LEFT, RampLight, design_of, fit_tone, mean_exponent
from dsl_core.errors import CalibrationError
from dsl_core.model.calibration.selftest import AmbientCheck, Colour, Measured, ProjectorCheck, RampCheck
from dsl_core.model.projector.tone_curve import ToneCurve

Floats = NDArray[np.float64]

#: Which LEDs each ramp drives.
RAMPS: dict[Colour, tuple[int, int, int]] = {
    "white": (1, 1, 1),
    "red": (1, 0, 0),
    "green": (0, 1, 0),
    "blue": (0, 0, 1),
}
LEDS: tuple[Colour, ...] = ("red", "green", "blue")
#: Signals with less than this many standard deviations say little and bend the logarithm.
_MIN_SNR = 30.0
_MIN_LEVELS = 4
#: Another order of a mosaic's colours is told if it gives more than this times as much light.
_OTHER_ORDER = 2.0


def check_projector(
    ramps: Readings, dark: Dark, transfer: Transfer, sizes: RegionSizes
) -> tuple[ProjectorCheck, AmbientCheck]:
    """Light by drive level of each ramp and of all, black, and the light while the projector is black.

    Light above black of level d is ``k_c * d ** gamma`` in camera channel c, so its logarithm is a line in
    that of d with one slope for all channels; where the light leaves that law, a curve with one form for all
    (`tone`). A channel that clips leaves the fit at that level only: a lit LED is seen, weaker, by the other
    two as well.
    """
    seen = {colour: ramp_light(ramp_of(ramps, colour), colour, dark, transfer, sizes) for colour in RAMPS}
    tone = fit_tone(list(seen.values()))
    fits = _fit_ramps(seen, tone)
    if any(check.residual_percent.value > 100 * MOST_LEFT for check, _, _ in fits.values()):
        tone = None  # light that no smooth curve describes depends on something else
        fits = _fit_ramps(seen, tone)
    values = np.array([check.gamma.value for check, _, _ in fits.values()])
    stds = np.array([check.gamma.std for check, _, _ in fits.values()])
    gamma, covariance = line_fit(np.ones((len(values), 1)), values, stds)
    _require_colours(np.stack([fits[colour][1] for colour in LEDS]))
    _, white, white_std = fits["white"]
    black, has_ambient = _black_fraction(dark, white, white_std, sizes)
    projector = ProjectorCheck(
        ramps=tuple(check for check, _, _ in fits.values()),
        gamma=Measured(value=float(gamma[0]), std=float(np.sqrt(covariance[0, 0]))),
        tone=tone,
        black_fraction=black,
        black_has_ambient=has_ambient,
    )
    return projector, _ambient(dark, white)


def _require_colours(light: Floats) -> None:
    """Raise `CalibrationError` where pixels see other LEDs than those of the colour they are said to have.

    ``light`` is that of red, green and blue (rows) in the channels, (3, 3). Gains of channels and the power
    of LEDs do not matter: each order of colours has a factor of all of them.
    """
    own = tuple(range(3))
    by_order = {order: float(np.prod(light[own, order])) for order in permutations(own)}
    best = max(by_order, key=lambda order: by_order[order])
    if light.diagonal().all() and by_order[best] > _OTHER_ORDER * by_order[own]:
        raise CalibrationError(
            "The red, green and blue LED are seen by pixels that should have other colours in the camera's"
            " mosaic. State the order of its colours in the driver as it is (such as GRBG), and switch off"
            " mirroring, turning and a region of interest that begins at an odd pixel; or the projector swaps"
            " its colours."
        )


def ramp_of(ramps: Readings, colour: Colour) -> Readings:
    """The frames in which exactly these LEDs are driven."""
    return ramps[((ramps.drive > 0) == np.array(RAMPS[colour], bool)).all(1)]


def ramp_light(
    ramp: Readings, colour: Colour, dark: Dark, transfer: Transfer, sizes: RegionSizes
) -> RampLight:
    """The usable light of one ramp; raises `CalibrationError` where there is too little."""
    exposure = ramp.exposure_ms[:, None]
    signal = ramp.mean_dn - dark.level_dn.value - dark.rate * exposure
    std = np.hypot(transfer.mean_std(signal, sizes.pixels), STEADINESS * signal)
    std = np.sqrt(std**2 + dark.level_dn.std**2 + (dark.rate_std * exposure) ** 2)
    used = ramp.unclipped & (signal > _MIN_SNR * std)
    drive = ramp.drive.max(1) / 255
    if len(np.unique(drive[used.any(1)])) < _MIN_LEVELS:
        raise CalibrationError(
            f"The {colour} ramp of the projector gives too little usable light: {used.any(1).sum()} of"
            f" {len(ramp)} frames are neither clipped nor dark. Check that the projector shows all colours,"
            " or change the camera's aperture."
        )
    return RampLight(
        colour,
        np.nonzero(used)[1],
        np.broadcast_to(drive[:, None], used.shape)[used],
        np.log((signal / exposure)[used]),
        (std / np.where(used, signal, 1))[used],
        _falls(drive, signal / exposure, std / exposure, used),
    )


def _fit_ramps(
    seen: Mapping[Colour, RampLight], tone: ToneCurve | None
) -> dict[Colour, tuple[RampCheck, Floats, Floats]]:
    terms = 1 if tone is None else len(tone.coefficients)
    return {colour: _fit_ramp(light, terms) for colour, light in seen.items()}


def _fit_ramp(light: RampLight, terms: int) -> tuple[RampCheck, Floats, Floats]:
    """The check of one colour; light at full drive above black and its standard deviation, (3,) DN per ms."""
    design, present = design_of([light], terms)
    found, covariance = line_fit(design, light.log_light, light.std)
    residual = light.log_light - design @ found
    weight = light.std**-2 / (light.std**-2).sum()
    rms = float(np.sqrt(weight @ residual**2))
    shape, scales = slice(len(present), None), slice(len(present))
    mean = mean_exponent(terms)
    check = RampCheck(
        colour=light.colour,
        gamma=Measured(
            value=float(mean @ found[shape]), std=float(np.sqrt(mean @ covariance[shape, shape] @ mean))
        ),
        coefficients=tuple(found[shape].tolist()) if terms > 1 else None,
        residual_percent=Measured(value=100 * rms, std=100 * rms / np.sqrt(2 * len(residual))),
        falls=light.falls,
    )
    full, full_std = np.zeros(3), np.zeros(3)
    channels = [channel for _, channel in present]
    full[channels] = np.exp(found[scales])
    full_std[channels] = full[channels] * np.sqrt(np.diag(covariance)[scales])
    return check, full, full_std


def _falls(drive: Floats, rate: Floats, std: Floats, used: NDArray[np.bool_]) -> int:
    """Steps of the ramp at which more drive gave clearly less light in some channel."""
    falls = set()
    for channel in range(3):
        rows = np.flatnonzero(used[:, channel])
        rows = rows[np.argsort(drive[rows], kind="stable")]
        for low, high in pairwise(rows):
            noise = 5 * np.hypot(std[low, channel], std[high, channel])
            if drive[high] > drive[low] and rate[high, channel] < rate[low, channel] - noise:
                falls.add(float(drive[high]))
    return len(falls)


def _black_fraction(
    dark: Dark, white: Floats, white_std: Floats, sizes: RegionSizes
) -> tuple[Measured, bool]:
    """Light of a dark projector as a share of white; pixels outside the picture see only ambient light.

    White above black is ``(1 - b) * w``; black without ambient light is ``b * w``.
    """
    lit = white > 0
    has_ambient = bool((sizes.beside[lit] == 0).any())
    ambient = np.zeros(3) if has_ambient else dark.beside_rate
    black = dark.rate - ambient
    std = dark.rate_std if has_ambient else np.hypot(dark.rate_std, dark.beside_std)
    share = (black / np.where(lit, white + black, 1))[lit]
    share_std = (np.hypot(std, black * white_std / np.where(lit, white, 1)) / np.where(lit, white, 1))[lit]
    found, covariance = line_fit(np.ones((len(share), 1)), share, share_std)
    value = float(np.clip(found[0], 0, 0.99))
    # All of it may be ambient light: then anything between nothing and this is equally likely.
    doubt = value / np.sqrt(3) if has_ambient else 0.0
    return Measured(value=value, std=float(np.hypot(np.sqrt(covariance[0, 0]), doubt))), has_ambient


def _ambient(dark: Dark, white: Floats) -> AmbientCheck:
    """Light with the projector black, from whatever source."""
    rates = [Measured(value=float(r), std=float(s)) for r, s in zip(dark.rate, dark.rate_std, strict=True)]
    share = dark.rate / np.where(white > 0, white, np.inf)
    worst = int(share.argmax())
    return AmbientCheck(
        rate_dn_per_ms=(rates[0], rates[1], rates[2]),
        share_of_white=Measured(value=float(share[worst]), std=float(dark.rate_std[worst] / white[worst])),
    )
