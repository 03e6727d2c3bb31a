"""The projector's line spread as a scan itself shows it, where that is not what the calibration says.

Focus changes from day to day, and with the distance of what is scanned. A spread that is off by a tenth moves
columns by as much as it moves them between two lines, so that surfaces get waves.
"""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray

from dsl_core.model.fit import FitFinding
from dsl_core.model.rig import ProjectorResponse, Rig
from dsl_core.optics.line_set import LineSet
from dsl_core.optics.spread.curves import density
from dsl_core.optics.spread.fit import REACH_PX, Peaks, SpreadFit, fit_spread
from dsl_core.patterns.gray_code import DecodedCode
from dsl_core.reconstruction.hdr import MergedFrame
from dsl_core.reconstruction.merge import LineStack
from dsl_core.solve.threads import one_kernel_thread

#: Pixels that are looked at, spread evenly over bright ones, and neighbours of a row in a run.
PIXELS, RUN = 4000, 10
#: Pixels darker than this share of all lit ones are left out.
DARKER = 0.3
#: Pixels whose decoded column is so many times the usual step from a neighbour's are at an edge.
EDGE_STEPS = 4.0
#: A share of the light that falls elsewhere than calibrated which matters: as much as 5 % of a wider blur do.
MOST_ELSEWHERE = 0.025
#: Light farther than this from its place is told separately, px.
TAIL_PX = 2.0
#: Places at which two curves are compared, px.
FAR_PX, GRID_PX = 10.0, 0.01


def own_spread(
    rig: Rig, lines: LineSet | None, code: DecodedCode, white: MergedFrame, stack: LineStack
) -> SpreadFit | None:
    """The line spread that single scan lines show; None for other patterns and where too few are seen."""
    if lines is None or not lines.single or lines.step_px > lines.width_px:
        return None
    pixels = _sample(code, white)
    if pixels.size == 0:
        return None
    column = torch.as_tensor(code.likely_column.ravel()[pixels].astype(np.float64))
    with one_kernel_thread():
        return fit_spread(_peaks(stack, lines, pixels, column), column, rig.projector_response)


def with_own_spread(rig: Rig, found: SpreadFit | None) -> Rig:
    """The rig with the line spread that its scan calls for, if it calls for another one."""
    if found is None or not found.changed:
        return rig
    return rig.model_copy(update={"projector_response": found.response})


def spread_finding(calibrated: ProjectorResponse, found: SpreadFit) -> FitFinding:
    """What the scan says about the line spread that it was calibrated with."""
    own = found.response
    places = np.arange(-FAR_PX, FAR_PX, GRID_PX)
    curves = [density(response.line_spread, places) for response in (calibrated, own)]
    elsewhere = 0.5 * float(np.abs(curves[1] - curves[0]).sum()) * GRID_PX
    far = np.abs(places) > TAIL_PX
    tails = [float(curve[far].sum()) * GRID_PX for curve in curves]
    return FitFinding(
        part="profile",
        name="line spread",
        value=100 * elsewhere,
        unit="% of the light of a line elsewhere than calibrated",
        limit=100 * MOST_ELSEWHERE,
        significant=elsewhere > MOST_ELSEWHERE,
        sentence=(
            f"The projector spreads light over {own.blur_px:.3f} ± {found.rms_std_px:.3f} px (rms), by its"
            f" calibration over {calibrated.blur_px:.3f} px; {elsewhere:.1%} of it falls elsewhere, and"
            f" {tails[1]:.1%} instead of {tails[0]:.1%} farther than {TAIL_PX:g} px away. The own spread"
            " of the scan was used."
        ),
        advice="Focus the projector as for its calibration, or calibrate again.",
    )


def _sample(code: DecodedCode, white: MergedFrame) -> NDArray[np.intp]:
    """Flat indices of bright pixels, in runs of neighbours on smooth surfaces, evenly thinned."""
    light = white.radiance
    good = ~code.undecided & ~white.saturated & np.isfinite(light) & (light > 0)
    if not good.any():
        return np.empty(0, np.intp)
    good &= light >= np.quantile(light[good], DARKER)
    steps = np.abs(np.diff(code.likely_column.astype(np.float64), axis=1))
    smooth = steps <= EDGE_STEPS * max(float(np.median(steps)), 1.0)
    columns = light.shape[1]
    starts = np.arange(0, columns - RUN + 1, RUN)
    inside = starts[:, None] + np.arange(RUN)
    whole = good[:, inside].all(-1) & smooth[:, inside[:, :-1]].all(-1)
    row, run = np.nonzero(whole)
    first = row * columns + starts[run]
    first = first[:: max(first.size * RUN // PIXELS, 1)]
    return np.asarray((first[:, None] + np.arange(RUN)).ravel())


def _peaks(stack: LineStack, lines: LineSet, pixels: NDArray[np.intp], column: torch.Tensor) -> Peaks:
    """The lines around the columns of some pixels."""
    half = int((lines.width_px / 2 + REACH_PX) / lines.step_px)
    line = lines.nearest(column) + torch.arange(-half, half + 1)[:, None]
    frame = lines.frame(line).numpy()
    y, std = (
        torch.as_tensor(frames.reshape(len(frames), -1)[frame, pixels].astype(np.float64))
        for frames in (stack.radiance, stack.std)
    )
    used = lines.exists(line) & torch.isfinite(y) & torch.isfinite(std)
    return Peaks(
        torch.where(used, y, 0.0),
        torch.where(used, std**2, torch.inf),
        lines.centre_px(line).to(torch.float64),
        lines.width_px,
        lines.step_px,
        RUN,
    )
