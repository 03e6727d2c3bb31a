"""What single frames of a line scan show more of than their neighbours, away from their line.

Two views of the same: all pixels that are away from a frame's line, beside the neighbouring frames, which
share the slowly changing light of first orders; and the few pixels that no order of that line reaches, where
nothing but black and the halo of the line is expected.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from dsl_core.model.plan import ScanLines
from dsl_core.model.rig import ProjectorResponse
from dsl_core.optics.lines.profile import halo_of_line
from dsl_core.reconstruction.light.line_levels import AROUND
from dsl_core.solve.robust import robust_std

Floats = NDArray[np.float64]

#: Pixels away from a line that are needed to tell anything.
FEWEST = 60
#: What an interpolated frame may be off by, relative to the light of so many frames on either side.
INTERPOLATED, NEAR = 0.2, 4
#: Differences count up to so many deviations, and how often that is asked.
CLIP, ROUNDS = 4.0, 3
#: How far the light of a projector may be off that of neighbouring frames, relative to it.
PROJECTOR_STD = 0.3
#: What the halo may be off by, relative to it.
HALO_ERROR = 0.5


@dataclass(frozen=True)
class Places:
    """Columns of some pixels (P,), rising, and how far from a line they are away from it, px."""

    lines: ScanLines
    column: Floats
    zone_px: float
    unlit_px: tuple[float, float]

    def away(self, pattern: int) -> NDArray[np.intp]:
        """Pixels that are away from the line of a pattern."""
        middle = self._middle_px(pattern)
        first, last = np.searchsorted(self.column, (middle - self.zone_px, middle + self.zone_px))
        return np.concatenate([np.arange(first), np.arange(last, len(self.column))])

    def unlit(self, pattern: int) -> tuple[NDArray[np.intp], Floats]:
        """Pixels that no order of a pattern reaches, and how far from its line these are, px."""
        middle, (near, far) = self._middle_px(pattern), self.unlit_px
        ends = np.searchsorted(self.column, (middle - far, middle - near, middle + near, middle + far))
        pixels = np.r_[ends[0] : ends[1], ends[2] : ends[3]] if far > near else np.empty(0, np.intp)
        return pixels, np.abs(self.column[pixels] - middle)

    def _middle_px(self, pattern: int) -> float:
        return pattern * self.lines.step_px + self.lines.width_px / 2


@dataclass(frozen=True)
class Halo:
    """The halo of lines whose zero order has an amplitude (P,) in each pixel."""

    amplitude: Floats
    response: ProjectorResponse

    def at(self, pixels: NDArray[np.intp], distance_px: Floats, width_px: float) -> Floats:
        """What reaches some pixels at a distance from a line, (n,)."""
        share = halo_of_line(torch.as_tensor(distance_px), width_px, self.response).numpy()
        return np.asarray(self.amplitude[pixels] * share)


@dataclass(frozen=True)
class Pictures:
    """Frames of some pixels less black, and their variances, (frames, P), DN.

    ``of_black`` (P,) is the variance of the black picture that was taken off all frames: it is in all of
    them, and in the last of the shapes that are looked for.
    """

    frames: Floats
    variance: Floats
    of_black: Floats

    def beside_neighbours(self, places: Places, shapes: Floats) -> tuple[NDArray[np.intp], Floats, Floats]:
        """What frames have more of ``shapes`` (n, P) than their neighbours have.

        Returns which frames can tell (k,), how much more (k, n) and deviations (k, n).
        """
        kept, own, std = [], [], []
        for k in range(2, len(self.frames) - 2):
            pixels = places.away(k)
            if len(pixels) < FEWEST:
                continue
            around = np.sum([share * self.frames[k + by, pixels] for by, share in AROUND.items()], axis=0)
            of_around = np.sum(
                [share**2 * self.variance[k + by, pixels] for by, share in AROUND.items()], axis=0
            )
            # Bands narrower than a few steps of the lines do not change slowly: unlit pixels count most.
            light = self.frames[max(k - NEAR, 0) : k + NEAR + 1, pixels].mean(0)
            sure = 1 / (self.variance[k, pixels] + of_around + (INTERPOLATED * light) ** 2)
            design, of_black, last = (
                np.stack([around, *shapes[:, pixels]]),
                self.of_black[pixels],
                len(shapes),
            )
            # The square of the light keeps its noise: light below the noise tells nothing of the projector.
            noise = {(0, last): -of_black, (last, last): of_black}
            found, found_std, usual = _robust_fit(
                design, self.frames[k, pixels] - around, sure, noise, {0: -of_around}, {0: PROJECTOR_STD}
            )
            kept.append(k)
            own.append(found[1:])
            std.append(usual * found_std[1:])
        shape = (len(kept), len(shapes))
        return np.array(kept, np.intp), np.reshape(own, shape), np.reshape(std, shape)

    def where_unlit(self, places: Places, shapes: Floats, halo: Halo) -> Floats:
        """What frames have of ``shapes`` (n, P) where no order of their line arrives, with deviations.

        Shape (2, frames, n); NaN for frames that leave too few pixels unlit.
        """
        found = np.full((2, len(self.frames), len(shapes)), np.nan)
        for k in range(len(self.frames)):
            pixels, distance_px = places.unlit(k)
            if len(pixels) < FEWEST:
                continue
            faint = halo.at(pixels, distance_px, places.lines.width_px)
            sure = 1 / (self.variance[k, pixels] + (HALO_ERROR * faint) ** 2)
            of_black, last = self.of_black[pixels], len(shapes) - 1
            more, std, _ = _robust_fit(
                shapes[:, pixels],
                self.frames[k, pixels] - faint,
                sure,
                {(last, last): of_black},
                {last: -of_black},
                scaled=False,
            )
            found[:, k] = more, std
        return found


def _robust_fit(
    design: Floats,
    values: Floats,
    sure: Floats,
    shared: Mapping[tuple[int, int], Floats],
    shared_with_values: Mapping[int, Floats],
    prior_std: Mapping[int, float] | None = None,
    *,
    scaled: bool = True,
) -> tuple[Floats, Floats, float]:
    """Multiples (n,) of the rows of ``design`` (n, P) in ``values`` (P,), their deviations, and the scatter.

    ``sure`` (P,) is one over the variance of a value. Noise that two rows, or a row and the values, have in
    common leaves products (P,) in the sums, which light does not: these are taken off. The scatter, in
    deviations, is what outliers are judged by if ``scaled``; it is at least 1.
    """
    weight, usual = sure, 1.0
    for _ in range(ROUNDS):
        normal, right = (design * weight) @ design.T, (design * weight) @ values
        for row, std in (prior_std or {}).items():
            normal[row, row] += std**-2
        for (row, other), product in shared.items():
            normal[row, other] -= weight @ product
            normal[other, row] = normal[row, other]
        for row, product in shared_with_values.items():
            right[row] -= weight @ product
        inverse = np.linalg.pinv(normal, hermitian=True)
        found = inverse @ right
        left = np.abs(values - found @ design) * np.sqrt(sure)
        if scaled:
            usual = max(float(robust_std(left)), 1.0)
        weight = sure * np.minimum(1, CLIP * usual / np.maximum(left, 1e-9))
    return found, np.sqrt(np.diag(inverse).clip(1e-30)), usual
