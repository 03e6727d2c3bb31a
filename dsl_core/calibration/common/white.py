"""What a white target reflects."""

from __future__ import annotations

from dsl_core.model.rig import Rig
from dsl_core.model.spectral import SpectralCurve

#: Certified reflectance of a fresh Spectralon, for rigs that do not know that of their white.
SPECTRALON = 0.99


def white_target(rig: Rig, stated: float | None = None) -> SpectralCurve:
    """Reflectance (share) of a target: as ``stated``, else that of the white that the rig refers to."""
    if stated is None and rig.white_reflectance is not None:
        return rig.white_reflectance
    return SpectralCurve.of([400.0, 700.0], [SPECTRALON if stated is None else stated] * 2)
