"""What the zero order says of the lines' profile: blur and tails that differ from those of the rig.

The zero order of a line is many times brighter than its spectrum, and every pixel sees it at another fraction
of a column. Amplitude, column and a level are eliminated pixel by pixel.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dsl_core.model.rig import ProjectorResponse
from dsl_core.optics.lines.line_set import LineSet
from dsl_core.optics.lines.profile import LineTable
from dsl_core.reconstruction.spectral.probing.picked_cube import PickedCube
from dsl_core.reconstruction.spectral.solving.tile_frames import Pixels, weighted

Floats = NDArray[np.float64]

#: The parameters: blur of a line relative to its own, and the share of its light in a tail.
PROFILE = ("blur", "tail")
#: What each may be off before any scan is seen.
PRIOR_STD = (1.0, 0.5)
#: Pixels whose chi-square exceeds the usual one by this factor are next to an edge.
MIXED_FROM = 3.0
#: Lines this far from a pixel's column tell of the profile, px.
REACH_PX = 14.0
#: Steps of the derivatives: column (px) and blur (share); and blur of the tail relative to the line's own.
STEP_PX, BLUR_STEP, TAIL_BLUR = 0.05, 0.05, 4.0


def sound_pixels(score: Floats, normal: Floats, chi_square: Floats, mixed_from: float) -> NDArray[np.bool_]:
    """Pixels (n,) with finite equations and a chi-square below ``mixed_from`` times the usual one."""
    finite = np.isfinite(score).all(1) & np.isfinite(normal).all((1, 2))
    usual = max(float(np.median(chi_square[finite])), 1.0) if finite.any() else 1.0
    return np.asarray(finite & (chi_square < mixed_from * usual))


@dataclass(frozen=True)
class LineProbe:
    """Equations of `PROFILE` for pixels (n,): ``normal`` (n, 2, 2), ``score`` (n, 2), ``chi_square`` (n,)."""

    normal: Floats
    score: Floats
    chi_square: Floats

    @property
    def sound(self) -> NDArray[np.bool_]:
        """Pixels (n,) whose numbers are finite, and whose lines fit about as well as those of most."""
        return sound_pixels(self.score, self.normal, self.chi_square, MIXED_FROM)

    @property
    def values(self) -> Floats:
        """The parameters over all pixels, (2,)."""
        return self._solution[0]

    @property
    def std(self) -> Floats:
        """Their deviations by the scatter of what single pixels ask for, (2,)."""
        return self._solution[1]

    @property
    def _solution(self) -> tuple[Floats, Floats]:
        here = self.sound
        information = self.normal[here].sum(0) + np.diag(np.square(1 / np.array(PRIOR_STD)))
        inverse = np.linalg.inv(information)
        values = inverse @ self.score[here].sum(0)
        each = self.score[here] - self.normal[here] @ values
        return values, np.sqrt(np.diag(inverse @ (each.T @ each) @ inverse))


def probe_lines(
    lines: LineSet,
    response: ProjectorResponse,
    pixels: Pixels,
    radiance: NDArray[np.float32] | PickedCube,
    std: NDArray[np.floating] | PickedCube,
    targets: NDArray[np.intp],
    widths: Tensor | None = None,
) -> LineProbe:
    """Probe the lines near the columns of pixels (flat indices).

    ``radiance`` and ``std`` are (frames, rows, columns), ``widths`` (n,) those of the line spread relative to
    the response's.
    """
    column, offset = (
        torch.as_tensor(values.ravel()[targets], dtype=torch.float64)
        for values in (pixels.column_px, pixels.offset)
    )
    near = int(np.ceil(REACH_PX / lines.step_px))
    index = lines.nearest(column)[:, None] + torch.arange(-near, near + 1)
    rows, columns = (at[:, None] for at in np.divmod(targets, pixels.valid.shape[1]))
    frame = lines.frame(index).numpy()
    y, spread = (torch.as_tensor(cube[frame, rows, columns]).double() for cube in (radiance, std))
    values, weight = weighted(y - offset[:, None], spread**2)
    weight = weight * lines.exists(index)
    distance = column[:, None] - lines.centre_px(index)

    reach_px = float(distance.abs().max()) + 2 * STEP_PX
    own = torch.ones_like(column) if widths is None else widths

    def light(blur: float = 1.0, shift_px: float = 0.0) -> Tensor:
        table = LineTable(lines.width_px, response, reach_px, column, own * blur)
        return table.at(distance.T + shift_px)[0].T

    base = light()
    slope = (light(shift_px=STEP_PX) - light(shift_px=-STEP_PX)) / (2 * STEP_PX)
    known = torch.stack([base, slope, torch.ones_like(base)], -1)
    change = torch.stack([(light(1 + BLUR_STEP) - base) / BLUR_STEP, light(TAIL_BLUR) - base], -1)
    heavy = (known * weight[..., None]).mT
    matrix = heavy @ known
    matrix = matrix + torch.diag_embed(1e-9 * torch.diagonal(matrix, dim1=1, dim2=2) + 1e-12)
    found = torch.linalg.solve(matrix, heavy @ values[..., None])[..., 0]
    residual = values - (known @ found[..., None])[..., 0]
    change = change * found[:, :1, None]
    left = torch.linalg.solve(matrix, heavy @ change)
    heavy_change = (change * weight[..., None]).mT
    normal = heavy_change @ change - (heavy @ change).mT @ left
    score = (heavy_change @ residual[..., None])[..., 0]
    freedom = ((weight > 0).sum(1) - known.shape[-1]).clip(min=1)
    return LineProbe(normal.numpy(), score.numpy(), ((weight * residual**2).sum(1) / freedom).numpy())
