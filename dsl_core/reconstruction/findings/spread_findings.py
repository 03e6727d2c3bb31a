"""Findings about the projector's line spread: its curve, and how its width changes over the frame."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from dsl_core.model.figure import with_std
from dsl_core.model.fit import FitFinding
from dsl_core.model.rig import ProjectorResponse
from dsl_core.optics.spread.curves import density
from dsl_core.optics.spread.field import FieldFit, Places
from dsl_core.optics.spread.fit import SpreadFit

#: A share of the light that falls elsewhere than calibrated which matters: as much as 5 % of a wider blur do.
MOST_ELSEWHERE = 0.025
#: Light farther than this from its place is told separately, px.
TAIL_PX = 2.0
#: Places at which two curves are compared, px.
FAR_PX, GRID_PX = 10.0, 0.01
#: A difference between the widths at two places that matters, and how many of its deviations it must have.
MOST_WIDER, SIGMAS = 0.05, 3.0
#: Places whose widths are compared, with words for either; from -1 to 1 across and down what was measured.
CONTRASTS: tuple[tuple[Places, str, Places, str], ...] = (
    (((-1, -1), (1, -1), (-1, 1), (1, 1)), "in the corners", ((0, 0),), "in the middle"),
    (((1, 0),), "on the right", ((-1, 0),), "on the left"),
    (((0, 1),), "at the bottom", ((0, -1),), "at the top"),
)


def spread_findings(
    calibrated: ProjectorResponse, found: SpreadFit, spot_px: float = 0.0
) -> Iterator[FitFinding]:
    """What the scan says about the line spread that it was calibrated with.

    ``spot_px`` is the rms width in columns of what a pixel of the camera sees: as far as that explains wider
    lines, they are not the projector's.
    """
    wider_px2 = found.response.blur_px**2 - calibrated.blur_px**2
    by_spot_px = min(max(wider_px2, 0.0) ** 0.5, spot_px)
    yield _curve_finding(calibrated.blurred(by_spot_px) if by_spot_px > 0 else calibrated, found)
    if found.field is not None:
        yield _field_finding(found.field)


def _field_finding(field: FieldFit) -> FitFinding:
    """The largest difference between the widths at two kinds of places."""
    compared = [(*field.contrast(here, there), a, b) for here, a, there, b in CONTRASTS]
    apart, std, here, there = max(compared, key=lambda each: abs(each[0]))
    if apart < 0:
        apart, here, there = -apart, there, here
    wider = math.expm1(apart)
    return FitFinding(
        part="profile",
        name="line spread over the field",
        value=100 * wider,
        std=100 * std * (1 + wider),
        unit="% of the width",
        limit=100 * MOST_WIDER,
        significant=wider > MOST_WIDER and apart > SIGMAS * std,
        sentence=(
            f"Lines are wider by {with_std(100 * wider, 100 * std * (1 + wider), 1)} % {here} of the measured"
            f" part of the projector's frame than {there}: its lens spreads them so, or surfaces there are"
            " translucent or out of focus. The result follows it."
        ),
        advice="If a flat matt target shows it, too, check the focus of the projector and whether its lens is"
        " tilted.",
    )


def _curve_finding(calibrated: ProjectorResponse, found: SpreadFit) -> FitFinding:
    own = found.response
    places = np.arange(-FAR_PX, FAR_PX, GRID_PX)
    curves = [density(response.line_spread, places) for response in (calibrated, own)]
    elsewhere = 0.5 * float(np.abs(curves[1] - curves[0]).sum()) * GRID_PX
    far = np.abs(places) > TAIL_PX
    tails = [float(curve[far].sum()) * GRID_PX for curve in curves]
    return FitFinding.judged(
        "profile",
        "line spread",
        100 * elsewhere,
        "% of the light of a line elsewhere than calibrated",
        100 * MOST_ELSEWHERE,
        f"Lines are spread over {with_std(own.blur_px, found.rms_std_px, 3)} px (rms), by the projector's"
        f" calibration over {calibrated.blur_px:.3f} px; {elsewhere:.1%} of it falls elsewhere, and"
        f" {tails[1]:.1%} instead of {tails[0]:.1%} farther than {TAIL_PX:g} px away. The own spread"
        " of the scan was used.",
        "If a flat matt target shows it, too, focus the projector as for its calibration, or calibrate"
        " again.",
    )
