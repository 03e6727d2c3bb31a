"""The longest exposure that saturates nothing that matters, found from live frames one after the other."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from dsl_core.solve.thinned import thinned

#: Share of full scale that the brightest pixels may reach, and the share from which that is near enough.
FILL, NEAR = 0.9, 0.8
#: Share of pixels that may be brighter than the brightness that is judged: glints and hot pixels.
BRIGHTEST_SHARE = 0.005
#: A saturated frame says only that it is too long, a dark one little of how much too short.
SHORTEN, LENGTHEN = 4.0, 16.0
#: At the longest exposure, less than this share of full scale is too dark to measure anything.
TOO_DARK = 0.1
MOST_FRAMES = 12
#: No more pixels than these are judged, evenly spread: enough for a quantile, quick enough for a live view.
_PIXELS = 200_000


class ExposureSearch:
    """Judges frames and says how long to expose the next one, until it is `found` or there is `trouble`.

    Exposures are whole cycles of ``cycle_ms``, so that each holds all colours of a projector that flashes
    them one after the other; None leaves them free, and so does a range that holds no whole cycle.
    """

    def __init__(
        self,
        range_ms: tuple[float, float],
        full_scale_dn: int,
        cycle_ms: float | None,
        black_level_dn: float = 0.0,
    ) -> None:
        """``range_ms`` is what the camera can do, and what a person would wait for."""
        self._cycle_ms: float | None = None
        self._low, self._high = range_ms
        if cycle_ms:
            # A hair of rounding does not cost a cycle.
            first = max(math.ceil(self._low / cycle_ms - 1e-6), 1)
            last = math.floor(self._high / cycle_ms + 1e-6)
            if first <= last:
                self._cycle_ms = cycle_ms
                # Beyond its range the camera would not follow, by a hair either.
                self._low, self._high = max(first * cycle_ms, self._low), min(last * cycle_ms, self._high)
        self._full, self._black = full_scale_dn, black_level_dn
        self._judged = 0
        self.found = False
        self.trouble = ""
        #: Whether the trouble is too much light for any exposure, or too little.
        self.is_too_bright = self.is_too_dark = False
        #: What the brightest pixels of the frame judged last reached, as a share of full scale.
        self.share = 0.0

    @property
    def is_over(self) -> bool:
        """Whether no further frame is needed."""
        return self.found or bool(self.trouble)

    def start_from(self, exposure_ms: float) -> float:
        """The first exposure to try: the current one, within the range and on whole cycles."""
        return min(max(self._whole(exposure_ms), self._low), self._high)

    def judge(self, pixels: NDArray[np.uint16], exposure_ms: float) -> float:
        """How long to expose the next frame after one of raw ``pixels``; the same once it `is_over`."""
        self._judged += 1
        self.share = share = self._brightness(pixels)
        if share >= 1.0:
            if exposure_ms <= self._low:
                self.is_too_bright = True
                self.trouble = (
                    f"Even the shortest exposure, {exposure_ms:.4g} ms, saturates. Close the"
                    " aperture, or lower the projector's intensity."
                )
                return exposure_ms
            following = exposure_ms / SHORTEN
        else:
            following = exposure_ms * min(FILL / max(share, 1e-6), LENGTHEN)
        following = min(max(self._whole(following), self._low), self._high)
        if NEAR <= share <= FILL or following == exposure_ms:
            self._end(share, exposure_ms)
            return exposure_ms
        if self._judged >= MOST_FRAMES:
            self.trouble = (
                "The light changes while it is being measured. Hold everything still and try again."
            )
        return following

    def _end(self, share: float, exposure_ms: float) -> None:
        if share < TOO_DARK:
            self.is_too_dark = True
            self.trouble = (
                f"The scene is too dark: even {exposure_ms / 1000:.3g} s of exposure reach only"
                f" {100 * share:.0f} % of full scale. Open the aperture, or raise the projector's intensity."
            )
        else:
            self.found = True

    def _brightness(self, pixels: NDArray[np.uint16]) -> float:
        """The brightest pixels that count, as a share of the range above black; 1 if saturated."""
        judged = thinned(pixels.ravel(), _PIXELS)
        place = int(judged.size * (1.0 - BRIGHTEST_SHARE))
        level = float(np.partition(judged, place)[place])
        if level >= self._full:
            return 1.0
        return max(level - self._black, 0.0) / (self._full - self._black)

    def _whole(self, exposure_ms: float) -> float:
        """The longest whole number of cycles within an exposure."""
        if not self._cycle_ms:
            return exposure_ms
        # A hair of rounding does not cost a cycle.
        return math.floor(exposure_ms / self._cycle_ms + 1e-6) * self._cycle_ms
