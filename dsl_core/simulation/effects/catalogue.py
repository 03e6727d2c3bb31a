"""All effects of the twin, and how some of them are chosen by a text."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from dsl_core.errors import DeviceError
from dsl_core.simulation.effects.base import Effect, ExtraEffect, LightPath
from dsl_core.simulation.effects.depth_of_field import DepthOfField
from dsl_core.simulation.effects.film import FilmBend, FilmPeriod, FilmTilt, Orders, SecondOrders
from dsl_core.simulation.effects.interreflection import Interreflection
from dsl_core.simulation.effects.lens import Distortion, Glare, Vignetting
from dsl_core.simulation.effects.projector_light import BlackLevel, Blur, Gamma, Halo, LedCycle
from dsl_core.simulation.effects.sensor import (
    Ambient,
    Defocus,
    Quantisation,
    ReadNoise,
    Saturation,
    ShotNoise,
)
from dsl_core.simulation.effects.specular import Specular
from dsl_core.simulation.effects.subsurface import Subsurface
from dsl_core.simulation.effects.surfaces_light import Shading, Shadow

#: Beyond the plain renderer, in the order in which light meets them.
EXTRAS: tuple[ExtraEffect, ...] = (Interreflection(), Subsurface(), Specular(), Glare(), DepthOfField())
#: Every effect, from the projector to the numbers.
EFFECTS: tuple[Effect, ...] = (
    Orders(), SecondOrders(), FilmBend(), FilmTilt(), FilmPeriod(), Distortion(), Blur(), Halo(),
    BlackLevel(), Gamma(), LedCycle(), Shading(), Shadow(), *EXTRAS, Vignetting(), Ambient(), Defocus(),
    ShotNoise(), ReadNoise(), Saturation(), Quantisation(),
)  # fmt: skip
NAMES = tuple(effect.name for effect in EFFECTS)
NEEDED = frozenset(effect.name for effect in EFFECTS if effect.needed)
#: What the twin renders when nothing is asked: all that the plain renderer has.
USUAL = frozenset(NAMES) - {extra.name for extra in EXTRAS}


@dataclass(frozen=True)
class Choice:
    """Which effects to render: names, or (None) those that a scene calls for within a tolerance.

    ``text`` is how it was asked for.
    """

    text: str
    names: frozenset[str] | None

    @classmethod
    def of(cls, text: str) -> Choice:
        """A choice from ``auto``, ``all``, ``none``, ``usual`` or names; raises `DeviceError`.

        >>> sorted(Choice.of("halo,blur").names - NEEDED)
        ['blur', 'halo']
        """
        fixed = {"auto": None, "all": frozenset(NAMES), "none": NEEDED, "usual": USUAL}
        if text in fixed:
            return cls(text, fixed[text])
        names = [name.strip() for name in text.split(",")]
        unknown = [name for name in names if name not in NAMES]
        if unknown:
            raise DeviceError(
                f"The twin has no effect {', '.join(map(repr, unknown))}."
                f" Choose auto, all, none, usual, or some of {', '.join(NAMES)}."
            )
        return cls(text, NEEDED | frozenset(names))


USUAL_CHOICE = Choice("usual", USUAL)


def with_effects(path: LightPath, names: Collection[str]) -> LightPath:
    """The path of a world where everything happens, without all but some effects.

    In the order of `EFFECTS`: distortion before shadow, as the scene is rendered again for a lens without it.
    """
    for effect in EFFECTS:
        if effect.name not in names:
            path = effect.leave_out(path)
    return path
