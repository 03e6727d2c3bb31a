"""The determinant of a dense matrix, without keeping other threads from running."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def log_determinant(matrix: NDArray[np.float64]) -> float:
    """Natural logarithm of the size of the determinant of a matrix (n, n).

    numpy's holds Python's lock while it computes, which stops a window that lives in the same program.
    """
    from scipy.linalg.lapack import dgetrf

    triangles, _, _ = dgetrf(matrix)
    return float(np.log(np.abs(np.diag(triangles))).sum())
