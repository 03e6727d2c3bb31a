"""Whether the values of a scan are linear in light, asked of the stripes of its code."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from math import isfinite
from typing import Literal

from dsl_core.model.figure import with_std
from dsl_core.model.frames import FrameSource
from dsl_core.optics.additivity import Additivity, Telling, additivity, mixed_light, stripe_light
from dsl_core.patterns.inverse_pairs import inverse_pairs, lone_stripes

#: The finest stripes mix most light: so many digits of each set are read.
DIGITS_OF_A_SET = 3
#: Exponents are not better known than this, whatever pairs agree on: projectors sharpen stripes.
LEAST_STD = 0.1
#: The words by which sentences about this are known.
LINEAR_WORDS = "linear in light"
_UNKNOWN = f"whether values are {LINEAR_WORDS} is unknown"
Verdict = Literal["linear", "srgb", "encoded", "darker", "unknown"]


@dataclass(frozen=True)
class Linearity:
    """A verdict, the figures it comes from (None if unknown), and both as a sentence without its point.

    ``srgb`` means values as in pictures for screens, ``encoded`` another curve of the camera, ``darker`` sums
    that no camera's curve explains but a curve that was undone, or a projector that scales its patterns.
    """

    verdict: Verdict
    figures: Additivity | None
    sentence: str

    @property
    def is_wrong(self) -> bool:
        """Whether the values are known not to be linear."""
        return self.verdict not in ("linear", "unknown")


def linearity_of(
    source: FrameSource, full_scale_dn: float, black_level_dn: float, absent: Collection[int] = ()
) -> Linearity:
    """Read white, black and the finest stripes of a scan, and say what their sums tell.

    ``full_scale_dn`` is the value of a saturated pixel; ``absent`` are indices of shots that cannot be read.
    Raises what reading the others raises.
    """
    plan = source.plan
    setting = min(plan.code_settings)
    shots = {
        (shot.role, shot.pattern): shot
        for shot in plan.shots()
        if shot.setting == setting and shot.index not in absent
    }
    sets: tuple[tuple[tuple[int, ...], ...], ...] = inverse_pairs(plan.code, plan.projector_size_px)
    sets = sets or tuple(tuple((each,) for each in lone) for lone in lone_stripes(plan.code))
    if not sets:
        return Linearity("unknown", None, f"the code has no stripes, so {_UNKNOWN}")
    digits = [digit for each in sets for digit in each[-DIGITS_OF_A_SET:]]
    digits = [digit for digit in digits if all(("code", number) in shots for number in digit)]
    if not digits or ("white", 0) not in shots or ("black", 0) not in shots:
        return Linearity("unknown", None, f"frames are missing, so {_UNKNOWN}")
    ends = source.read(shots["white", 0]), source.read(shots["black", 0])

    def seen(digit: tuple[int, ...]) -> Telling | None:
        frames = [source.read(shots["code", number]) for number in digit]
        if len(frames) == 2:
            return mixed_light((frames[0], frames[1]), *ends, full_scale_dn, black_level_dn)
        return stripe_light(frames[0], *ends, full_scale_dn, black_level_dn)

    return _judged(additivity(map(seen, digits)))


def _judged(found: Additivity | None) -> Linearity:
    if found is None:
        words = f"too few pixels see bright and dark stripes at once above the noise, so {_UNKNOWN}"
        return Linearity("unknown", None, words)
    figure = found.figure
    if isfinite(found.exponent) and not found.is_linear:
        std = max(found.exponent_std, LEAST_STD)
        figure += f"; light goes with the value to the power {with_std(found.exponent, std, 1)}"
    if found.is_linear:
        return Linearity("linear", found, f"{LINEAR_WORDS}: {figure}")
    if found.is_srgb:
        words = f"not {LINEAR_WORDS} but encoded, as sRGB for screens is: {figure}"
        return Linearity("srgb", found, words)
    if found.excess > 0:
        return Linearity("encoded", found, f"not {LINEAR_WORDS}, nor sRGB: {figure}")
    return Linearity("darker", found, f"not {LINEAR_WORDS}: {figure}")
