"""What materials do with light beside reflecting it where it arrives: gloss and translucency."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Finish:
    """Gloss and translucency of a material; the defaults are matte and opaque.

    ``gloss`` is the reflectance of its surface at normal incidence (0.04 for a refractive index of 1.5),
    ``roughness`` the width of the highlight, 0..1, whose square is the alpha of the GGX distribution.
    ``spread_mm`` says how far red, green and blue light wander inside before they leave: the length d of
    Burley's diffusion profile, whose mean distance is 2.5 d.
    """

    gloss: float = 0.0
    roughness: float = 0.3
    spread_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)


#: Skin: diffuse mean free paths of 3.67, 1.37 and 0.68 mm (H. W. Jensen, J. Buhler, SIGGRAPH 2002, "skin 1")
#: by 3.5 (P. H. Christensen, B. Burley, Approximate Reflectance Profiles, 2015); oily sheen of index 1.4.
SKIN = Finish(gloss=0.028, roughness=0.5, spread_mm=(1.05, 0.39, 0.19))
#: Paraffin wax, index 1.43; its spread is an assumption between skin and marble.
WAX = Finish(gloss=0.031, roughness=0.45, spread_mm=(2.0, 1.6, 1.2))
