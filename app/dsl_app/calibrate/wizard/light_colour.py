"""What light of one wavelength looks like on a screen."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from dsl_core.optics.cie_tables import CIE_1931_XYZ, CIE_NM
from dsl_core.optics.colour import xyz_to_srgb

#: Luminance of the pure colours: bright enough to tell red from violet.
LEVEL = 0.55


@lru_cache(maxsize=512)
def colour_of_light(nm: float) -> str:
    """The nearest colour of a screen (``#rrggbb``) to monochromatic light of a wavelength."""
    xyz = np.array([np.interp(np.clip(nm, 400, 690), CIE_NM, row) for row in CIE_1931_XYZ])
    red, green, blue = (np.clip(xyz_to_srgb(xyz / xyz.sum() * LEVEL), 0, 1) * 255 + 0.5).astype(int).tolist()
    return f"#{red:02x}{green:02x}{blue:02x}"
