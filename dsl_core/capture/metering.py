"""How bright white is before a scan starts, and exposures of its plan that suit the scene."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.exposure import PatternImage, RetryPolicy, ShotTaker
from dsl_core.capture.overexposure import black_level_dn, by_colour, full_scale_dn
from dsl_core.capture.proof.lasting.missing_light import NO_LIGHT, no_light
from dsl_core.capture.white_levels import doubts_of_white
from dsl_core.devices.base import DeviceRig
from dsl_core.errors import DeviceError
from dsl_core.model.conditions import COLOUR_NAMES
from dsl_core.model.plan import CapturePlan, Setting, Shot
from dsl_core.model.rig import BayerPattern, ProjectorResponse, colour_sites
from dsl_core.optics.sensor import bayer_channels, end_near_full
from dsl_core.progress import CancelToken

#: What white is to reach where exposures are shortened, as a share of full scale in its dimmest colour: lines
#: have at most .9 of its light, and what saturates in two colours is measured by the third. First orders
#: need whatever light there can be.
FILL = 1.1
#: Exposures stay as they are unless more of the picture than this share exceeds that: shorter ones cost all
#: other pixels light.
MOST, MOST_LOST = 1.3, 0.1
#: What white is to reach in its brightest colour where exposures are lengthened.
FILL_IN_DARK = 0.85
#: A scene whose white, by its brightest colour, stays below this in a plan's brightest setting is dark.
DIM = 0.4
#: Exposures that nobody chose are lengthened by this factor at most: a scan takes as much longer.
MOST_LONGER = 4.0
#: Shares of the picture that may be brighter: highlights, and small bright things in a dark scene.
_BRIGHTER, _BRIGHTER_IN_DARK = 0.05, 0.005
#: Colours are not missed in pictures whose brightest does not reach this share of full scale, as the black
#: level is not known so well.
ENOUGH = 0.1
#: A saturated picture says only that it is too bright: the next is exposed for this much less.
_SHORTEN = 8.0
#: An exposure that is shorter than a cycle by less than this share was meant to be one.
ROUNDED = 0.05
_MOST_FRAMES = 4
#: Note of a scan: what white reached before it began, and what was done to exposures.
WHITE_MEASURED = "exposures"
#: Note of a scan: what its white contradicts of the calibration, measured before the scan began.
WHITE_IN_DOUBT = "white_in_doubt"


@dataclass(frozen=True)
class Metered:
    """A plan whose exposures suit the scene, and what was measured, in a sentence or two.

    ``is_told`` says whether a person should read it: exposures have changed, or none is right, or there is a
    ``doubt``, a part of the sentences: white is not as it was when the rig was calibrated.
    """

    plan: CapturePlan
    sentence: str = ""
    is_told: bool = False
    doubt: str = ""

    @property
    def notes(self) -> dict[str, str]:
        """What a scan's manifest says of it; a doubt on its own, as its result repeats it."""
        notes = {WHITE_MEASURED: self.sentence} if self.sentence else {}
        return notes | ({WHITE_IN_DOUBT: self.doubt} if self.doubt else {})


def meter(
    rig: DeviceRig, plan: CapturePlan, pattern_image: PatternImage, token: CancelToken | None = None
) -> Metered:
    """Measure white and scale all exposures of a plan alike, so that they suit the scene.

    They become shorter where white saturates in every colour in the darkest setting, and up to `MOST_LONGER`
    times longer where it stays dark even in the brightest. All are whole cycles of the projector and within
    what the camera can do; drive levels and the ratio of the settings stay. One frame is taken, and another
    for each time that white saturates in it; of a calibrated rig black and a dimmer white as well, which have
    to agree with the calibration. A rig that plays back a scan keeps its exposures, and so does a
    plan without white.

    Raises `DeviceError` when a picture cannot be taken, `Cancelled` when the ``token`` is.
    """
    white = next((shot for shot in plan.shots() if shot.role == "white"), None)
    if white is None or rig.only_repeats:
        return Metered(plan)
    known = rig.calibration or rig.nominal
    response = ProjectorResponse() if known is None else known.projector_response
    period_ms = rig.projector.info.frame_period_ms if known is None else known.frame_period_ms
    fit = _Fit(plan, period_ms, rig.camera.info.exposure_range_ms, response)
    taker = ShotTaker(rig, plan, pattern_image, RetryPolicy(), token)
    doubt = ""
    try:
        levels = full_scale_dn(rig), black_level_dn(rig)
        seen, shot, pixels = _measure(taker, white, fit, *levels, rig.camera.info.bayer)
        if rig.calibration is not None and not seen.missing:
            doubt = doubts_of_white(taker, shot, pixels, rig.calibration)
    except DeviceError as error:
        raise DeviceError(
            f"White could not be measured before the scan: {error.__cause__ or error} Nothing is saved yet."
        ) from error
    finally:
        taker.show_black()
    found = fit.to(seen)
    doubt = seen.sentence or doubt
    if not doubt:
        return found
    return replace(found, sentence=f"{doubt} {found.sentence}", is_told=True, doubt=doubt)


@dataclass(frozen=True)
class _White:
    """White in the darkest setting of a plan, as shares of full scale above black, which may exceed 1.

    ``lost`` is the share of the picture that exceeds `MOST` even in its dimmest colour. ``is_clipped`` says
    that even the shortest exposure saturates, so that it may be brighter still. ``missing`` are the colours
    without light.
    """

    by_dimmest: float
    lost: float
    by_brightest: float
    is_clipped: bool
    missing: tuple[str, ...] = ()

    @property
    def sentence(self) -> str:
        """What to say of missing colours; empty if there are none."""
        return no_light(self.missing) if self.missing else ""


def _measure(
    taker: ShotTaker, white: Shot, fit: _Fit, full_dn: int, black_dn: float, bayer: BayerPattern
) -> tuple[_White, Shot, NDArray[np.uint16]]:
    """White, and the shot and mosaic that it was measured by."""
    darkest = fit.darkest
    exposure_ms = darkest.exposure_ms
    is_clipped = False
    for _ in range(_MOST_FRAMES):
        shot = replace(white, exposure_ms=exposure_ms, level=darkest.level)
        pixels = taker.take(shot).pixels
        colours = by_colour(pixels)
        full_dn = end_near_full(pixels, full_dn, bayer_channels(bayer, *pixels.shape))
        is_saturated = float(np.mean(colours.min(axis=0) >= full_dn)) > _BRIGHTER
        shorter_ms = fit.exposure_ms(exposure_ms / _SHORTEN)
        is_clipped = is_saturated and shorter_ms >= exposure_ms
        if is_clipped or not is_saturated:
            break
        exposure_ms = shorter_ms
    scale = darkest.exposure_ms / exposure_ms / (full_dn - black_dn)
    dimmest = _exceeded_by(_BRIGHTER, colours.min(axis=0)) - black_dn
    brightest = _exceeded_by(_BRIGHTER_IN_DARK, colours.max(axis=0)) - black_dn
    # What saturates even then may be brighter by any factor.
    most = full_dn - 1 if is_clipped else black_dn + MOST / scale
    lost = float(np.mean(colours.min(axis=0) > most))
    missing = _missing(colours, bayer, black_dn, ENOUGH * (full_dn - black_dn))
    found = _White(max(dimmest, 0.0) * scale, lost, max(brightest, 0.0) * scale, is_clipped, missing)
    return found, shot, pixels


def _missing(
    colours: NDArray[np.unsignedinteger], bayer: BayerPattern, black_dn: float, enough_dn: float
) -> tuple[str, ...]:
    """Colours without light, of the pixels of each cell (4, rows, columns) of a mosaic, DN."""
    of_site = np.array(colour_sites(bayer))
    light = {each: _exceeded_by(_BRIGHTER, colours[of_site == each]) - black_dn for each in set(of_site)}
    most = max(light.values())
    if most < enough_dn:
        return ()
    return tuple(COLOUR_NAMES[each] for each in sorted(light) if light[each] < NO_LIGHT * most)


def _exceeded_by(share: float, values: NDArray[np.unsignedinteger]) -> float:
    return float(np.quantile(values, 1.0 - share))


@dataclass(frozen=True)
class _Fit:
    """A plan on a projector of this period and response, and a camera of this range, ms."""

    plan: CapturePlan
    period_ms: float
    range_ms: tuple[float, float]
    response: ProjectorResponse

    def light(self, setting: Setting) -> float:
        """Light of white in a setting, in any unit."""
        return setting.exposure_ms * float(self.response.radiance(setting.level))

    @property
    def darkest(self) -> Setting:
        """The setting with the least light."""
        return min(self.plan.settings, key=self.light)

    @property
    def in_cycles(self) -> bool:
        """Whether exposures are whole cycles: a plan that exposes for less than one is for steady light.

        One that was typed, or rounded by a camera, or is for a projector of 60 Hz instead of 59.94, is whole.
        """
        shortest_ms = min(setting.exposure_ms for setting in self.plan.settings)
        return shortest_ms > (1 - ROUNDED) * self.period_ms

    def exposure_ms(self, wanted_ms: float, rounded: Callable[[float], int] = int) -> float:
        """The longest exposure of whole cycles within this one, or the shortest that there is.

        With ``rounded`` the number of cycles is rounded otherwise.
        """
        low_ms, high_ms = self.range_ms
        if not self.in_cycles:
            return min(max(wanted_ms, low_ms), high_ms)
        cycles = min(rounded(wanted_ms / self.period_ms + 1e-6), int(high_ms / self.period_ms + 1e-6))
        return max(cycles, int(np.ceil(low_ms / self.period_ms - 1e-6)), 1) * self.period_ms

    def to(self, white: _White) -> Metered:
        """The plan for white of this brightness."""
        most_light = max(map(self.light, self.plan.settings)) / self.light(self.darkest)
        if white.lost > MOST_LOST:
            return self._shortened(white)
        if white.by_brightest * most_light < DIM:
            return self._lengthened(white.by_brightest * most_light)
        said = f"White reaches {white.by_dimmest:.0%} of full scale in its dimmest colour"
        return Metered(self.plan, f"{said}: exposures are as planned.")

    def _shortened(self, white: _White) -> Metered:
        made = self._scaled(FILL / white.by_dimmest)
        settings = zip(made.settings, self.plan.settings, strict=True)
        shorter = tuple(min(pair, key=lambda each: each.exposure_ms) for pair in settings)
        made = made.model_copy(update={"settings": shorter})
        shortest_ms = min(made.settings, key=self.light).exposure_ms
        least = white.by_dimmest * shortest_ms / self.darkest.exposure_ms
        said = f"White reaches {white.by_dimmest:.0%} of full scale even in its dimmest colour"
        if made != self.plan:
            said += f": exposures are shortened {self._words(made)}"
        if white.is_clipped or least > MOST:
            said += (
                f". It saturates even at {shortest_ms:.4g} ms, the shortest possible: close the aperture, or"
                " lower the projector's intensity"
            )
        return Metered(made, f"{said}.", True)

    def _lengthened(self, share: float) -> Metered:
        longest_ms = max(each.exposure_ms for each in self.plan.settings)
        factor = min(FILL_IN_DARK / max(share, 1e-6), MOST_LONGER, self.range_ms[1] / longest_ms)
        made = self._scaled(max(factor, 1.0))
        longer = max(each.exposure_ms for each in made.settings) / longest_ms
        said = f"The scene is dark, white reaches {share:.1%} of full scale in the brightest setting"
        if made != self.plan:
            said += f": exposures are lengthened {self._words(made)}"
        if share * longer < DIM:
            said += f", and white reaches {share * longer:.1%}" if made != self.plan else ""
            said += ". Open the aperture, or choose longer exposures"
        return Metered(made, f"{said}.", True)

    def _scaled(self, factor: float) -> CapturePlan:
        # Others follow the darkest, so that their ratio to it stays, as far as whole cycles can.
        darkest_ms = self.darkest.exposure_ms
        factor = self.exposure_ms(darkest_ms * factor) / darkest_ms
        settings = tuple(
            Setting(exposure_ms=self.exposure_ms(each.exposure_ms * factor, round), level=each.level)
            for each in self.plan.settings
        )
        return self.plan.model_copy(update={"settings": settings})

    def _words(self, made: CapturePlan) -> str:
        """From which exposures to which."""
        return f"from {_listed(self.plan)} to {_listed(made)} ms"


def _listed(plan: CapturePlan) -> str:
    return " and ".join(f"{setting.exposure_ms:.4g}" for setting in plan.settings)
