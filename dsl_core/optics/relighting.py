"""How a scene would look under another light."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.optics.colour import observer_weights, reflectance_to_xyz, xyz_to_srgb

#: Names of CIE illuminants and what they are, in the words of a person.
LIGHTS: dict[str, str] = {
    "D65": "D65 – average daylight, 6504 K",
    "D50": "D50 – horizon daylight, 5003 K",
    "A": "A – tungsten lamp, 2856 K",
    "FL2": "F2 – cool white fluorescent lamp, 4230 K",
    "FL7": "F7 – broad-band daylight fluorescent lamp, 6500 K",
    "FL11": "F11 – narrow-band white fluorescent lamp, 4000 K",
}
#: Cone responses of the Bradford transform (ICC.1:2022, annex E).
_BRADFORD = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])


def relight(
    cube: NDArray[np.float32], wavelengths_nm: NDArray[np.float64], light: str, adapted: bool = True
) -> NDArray[np.float32]:
    """Colour in sRGB, shape (3, rows, columns), of a band-first cube under an illuminant of `LIGHTS`.

    ``adapted`` shows it as to eyes that are used to the light, so that white stays white (Bradford); without,
    as next to daylight. Raises ``ValueError`` for an unknown illuminant.
    """
    xyz = reflectance_to_xyz(cube, wavelengths_nm, light)
    if adapted and light != "D65":
        matrix = adaptation(
            observer_weights(wavelengths_nm, light).sum(1), observer_weights(wavelengths_nm).sum(1)
        )
        xyz = np.tensordot(matrix.astype(xyz.dtype), xyz, axes=1)
    return xyz_to_srgb(xyz)


def adaptation(white_xyz: NDArray[np.float64], to_white_xyz: NDArray[np.float64]) -> NDArray[np.float64]:
    """Matrix (3, 3) that takes XYZ seen with one white to XYZ seen alike with another (Bradford)."""
    gain = (_BRADFORD @ to_white_xyz) / (_BRADFORD @ white_xyz)
    return np.asarray(np.linalg.solve(_BRADFORD, gain[:, None] * _BRADFORD))
