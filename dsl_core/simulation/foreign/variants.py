"""What the twin can do that its own solver does not assume: names, and a choice of them from text."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from dsl_core.errors import DeviceError

#: Every variant and what it does; strengths are constants of the modules that render them.
VARIANTS: Mapping[str, str] = MappingProxyType(
    {
        "plain": "nothing else wrong: the usual light, sampled numerically instead of by the twin's formulas",
        "blur": "projector blurred 1.08 times as much as the calibration says",
        "spread-square": "line spread like an aperture: a softened box of the usual variance",
        "spread-tails": "line spread with tails: an eighth of the light three times as wide",
        "spread-skew": "asymmetric line spread of the usual mean and variance",
        "spread-corners": "line spread up to 40 % wider towards the corners of the projector's frame",
        "response-curve": "LEDs whose light leaves the power law of the drive level by up to 2 %",
        "tone-s": "light that follows the drive level in an S, as of a liquid crystal, and no power law",
        "tone-srgb": "light that follows the drive level as sRGB says, straight at its foot",
        "prnu": "pixel gains that differ by 1 %, and hot pixels",
        "light-drift": "light of the projector that falls by 3 % in five minutes and comes back",
        "lateral-colour": "red and blue apart by half a full-size pixel at the side, in both lenses",
        "vignetting": "gain of the camera that falls by 8 % to the corner",
        "second-order": "second orders brighter than the calibration says by 4 % of the first",
        "curves": "smooth deviations of up to 5 % of all curves of camera and LEDs",
        "red-edge": "a camera whose red begins at 575 nm, within 16 nm; its data sheet rounds that off",
        "filter-angle": "bandpass filters tilted by 3 degrees and seen at an angle",
        "bend-s": "film bent in an S",
        "bend-twist": "twisted film",
        "film-dent": "film with a dent, which no record of its shape can say",
        "flicker": "lamps of the room whose light differs from frame to frame",
    }
)
#: What is not among ``all``: a projector has one curve, and nobody scans before the self-test measured it; a
#: camera has its own edges or the usual ones.
_ALONE = frozenset({"tone-s", "tone-srgb", "red-edge"})


@dataclass(frozen=True)
class Foreign:
    """Some variants, and the seed that draws what is random about them; it belongs to the rig."""

    names: frozenset[str]
    seed: int = 0

    @classmethod
    def of(cls, text: str, seed: int = 0) -> Foreign | None:
        """Variants from names with commas between, or ``all`` but those that stand alone; None for no text.

        Raises `DeviceError` for other names.

        >>> sorted(Foreign.of("prnu, blur").names)
        ['blur', 'prnu']
        """
        if not text.strip():
            return None
        names = [name.strip() for name in text.split(",")]
        if names == ["all"]:
            return cls(frozenset(VARIANTS) - _ALONE, seed)
        unknown = [name for name in names if name not in VARIANTS]
        if unknown:
            raise DeviceError(
                f"The twin has no foreign variant {', '.join(map(repr, unknown))}."
                f" Choose all, or some of {', '.join(VARIANTS)}."
            )
        return cls(frozenset(names), seed)

    def has(self, name: str) -> bool:
        """Whether a variant is among them."""
        assert name in VARIANTS
        return name in self.names
