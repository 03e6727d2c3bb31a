"""Where corrections of spectral curves have their nodes, and how smooth they may be."""

from __future__ import annotations

import numpy as np

#: Nodes of a curve's correction, nm; linear between them.
NODES_NM = np.arange(400.0, 701.0, 10.0)
#: What the evidence chooses from for a correction (`solve.smooth_functions.solve_smooth`).
SMOOTHNESS: dict[str, tuple[float, ...]] = {
    "amplitudes": (0.003, 0.01, 0.03, 0.1),
    "lengths": (20.0, 40.0, 80.0, 160.0),
    "noise_factors": (1.0, 2.0, 4.0, 8.0),
}
