"""CIE 1931 2 degree colour matching functions and illuminant D65 at 5 nm, 380 to 780 nm.

Kept among the resources because the import of colour-science, which has them too, takes seconds.
"""

import numpy as np
from numpy.typing import NDArray

from dsl_core.resources import resource_path

_TABLE: NDArray[np.float64] = np.loadtxt(resource_path("colour/cie_1931_d65.csv"), delimiter=",", unpack=True)

#: Shape (81,), nm.
CIE_NM: NDArray[np.float64] = _TABLE[0]
#: Shape (3, 81).
CIE_1931_XYZ: NDArray[np.float64] = _TABLE[1:4]
#: Shape (81,).
CIE_D65: NDArray[np.float64] = _TABLE[4]
