"""Time of merging two settings, and of demosaicing, for one 890 x 580 frame.

Run ``python tests/benchmarks/bench_hdr.py``.
"""

from __future__ import annotations

import timeit

import numpy as np

from dsl_core.model.rig import Sensor
from dsl_core.optics.demosaic import demosaic, demosaic_variance
from dsl_core.optics.sensor import digitise
from dsl_core.reconstruction.hdr import HdrMerger, black_frame

SHAPE = (580, 890)
GAINS_MS = (5.0, 200.0)


def main() -> None:
    """Print milliseconds a frame, best of ten."""
    sensor = Sensor()
    rng = np.random.default_rng(0)
    radiance = rng.exponential(2.0, SHAPE).astype(np.float32)
    raws = [digitise(sensor, np.float32(gain) * radiance, rng) for gain in GAINS_MS]
    black = black_frame([digitise(sensor, np.zeros(SHAPE, np.float32), rng)], sensor)
    merger = HdrMerger(GAINS_MS, [black, black], sensor)
    out = merger.merge(raws)
    for name, work in (
        ("merge into given arrays", lambda: merger.merge(raws, out)),
        ("merge into new arrays", lambda: merger.merge(raws)),
        ("demosaic", lambda: demosaic(out.radiance, sensor.bayer)),
        ("demosaic variance", lambda: demosaic_variance(out.variance, sensor.bayer)),
    ):
        print(f"{name}: {1e3 * min(timeit.repeat(work, number=5, repeat=10)) / 5:.2f} ms")


if __name__ == "__main__":
    main()
