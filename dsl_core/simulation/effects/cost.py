"""How fast this machine is, by one quick measurement: what estimates of seconds are scaled by."""

from __future__ import annotations

import time
from functools import cache

import numpy as np

#: CPU seconds of the reference computation on the machine on which the effects' costs were measured, and its
#: time for a pixel and for a frame of the plain renderer in one colour, lit by a line.
REFERENCE_S, PLAIN_NS, PLAIN_MS = 0.0042, 65.0, 0.8
_SIZE, _REPEATS = 512, 5


@cache
def slowness() -> float:
    """CPU time of a fixed computation, relative to the machine of the costs; measured once (0.1 s).

    The computation is like that of effects: transforms and look-ups of a picture. CPU time, so that others
    who use the machine do not count; the fastest of some runs, so that a cold start does not.
    """
    rng = np.random.default_rng(0)
    picture = rng.random((_SIZE, _SIZE))
    places = rng.integers(0, picture.size, picture.size)
    seconds = []
    for _ in range(_REPEATS):
        started = time.process_time()
        spectrum = np.fft.rfft2(picture)
        smooth = np.fft.irfft2(spectrum * spectrum.conj())
        np.exp(-smooth.ravel()[places] / smooth.max()).sum()
        seconds.append(time.process_time() - started)
    return max(min(seconds), 1e-6) / REFERENCE_S
