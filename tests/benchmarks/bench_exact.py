"""The spectral solver against 106-bit arithmetic: 100000 random pixels in single and double precision.

``python -m tests.benchmarks.bench_exact [--quick] [--json FILE]``. Places, depths, spectra, brightness and
noise are drawn (`tests.stability.random_pixels`). Errors of nodes are relative to the largest of their pixel,
under the smoothness that the solver chose; in stated deviations they count the choice of smoothness too.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch

from tests.benchmarks.common import options, print_table, write_json
from tests.stability.case import PRECISIONS
from tests.stability.exactness import Exactness, exactness

BATCH = 2000
SHARES = (0.5, 0.99, 0.9999, 1.0)


def main() -> int:
    """Print the quantiles of the errors, each kind for free pixels and for those at a bound."""
    given = options(__doc__).parse_args()
    pixels = 4 * BATCH if given.quick else 100_000
    torch.set_num_threads(1)
    rows: list[list[object]] = []
    figures: dict[str, Any] = {"pixels": pixels}
    for name, dtype in PRECISIONS.items():
        found = Exactness.joined([exactness(BATCH, seed, dtype) for seed in range(pixels // BATCH)])
        for kind, chosen in (("free", ~found.at_bound), ("at a bound", found.at_bound)):
            for figure, errors in (("relative", found.relative), ("stated deviations", found.sigmas)):
                values = np.quantile(errors[chosen], SHARES).tolist()
                rows.append([f"{name}, {kind}", figure, int(chosen.sum()), *(f"{v:.1e}" for v in values)])
                figures[f"{name}, {kind}, {figure}"] = values
    print_table(["pixels", "error", "number", "median", "99 %", "99.99 %", "worst"], rows)
    write_json(given.json, figures)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
