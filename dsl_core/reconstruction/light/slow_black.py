"""Black that changes slowly during a scan: light of the room that fades, or a camera that warms up.

Black pictures taken again say by how much; between them black is taken to change evenly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dsl_core.reconstruction.light.neighbour_steps import Scan
from dsl_core.reconstruction.light.sudden import LEAST_DN, SIGMAS, Again, SuddenChanges
from dsl_core.reconstruction.merge import Exposed

Floats = NDArray[np.float64]

#: A share of black counts from so many of its deviations on.
SHARE_SIGMAS = 4.0
#: Deviation from an even change, relative to the change from one picture to the next: half of it at most.
UNEVEN = 0.29


@dataclass(frozen=True)
class SlowBlack:
    """What black has gained at each shot since its first picture: ``dn``, and a ``share``; both (shots,).

    ``std_dn`` is what a shot may be off by, where black changed otherwise than evenly.
    """

    dn: Floats
    share: Floats
    std_dn: float

    def exposed(self, scan: Scan, before: Exposed) -> Exposed:
        """In what light shots were taken, besides what was known of it before."""
        blacks = {shot.setting: shot.index for shot in scan.shots_of("black", 0)}
        # Its black frame was taken in the middle of the change as well.
        own = [blacks[shot.setting] for shot in scan.plan.shots()]
        share = (self.share - self.share[own]) / (1 + self.share[own])
        return replace(
            before,
            black_dn=before.black_dn + self.dn - self.dn[own],
            black_share=before.black_share + share,
            black_std_dn=self.std_dn,
        )


def slow_black(scan: Scan, blacks: Sequence[Again], sudden: SuddenChanges | None) -> SlowBlack | None:
    """What ``blacks`` say besides ``sudden`` changes; None if that is nothing that matters."""
    first = scan.plan.references().get("black")
    if first is None or not blacks or (sudden is not None and sudden.explains_black):
        return None
    known = Exposed.as_planned(scan.plan.shot_count) if sudden is None else sudden.exposed(scan)
    dark = float(scan.source.read(first).astype(np.float64).mean()) - scan.rig.sensor.black_level_dn
    knots, dn, share = [first.index], [0.0], [0.0]
    matters = False
    for each in blacks:
        left = each.more - known.black_dn[each.shot] - known.black_share[each.shot] * dark
        matters |= abs(left) > max(LEAST_DN, SIGMAS * each.std)
        more, std = each.share
        is_share = abs(more) > SHARE_SIGMAS * std
        of_dark = more - known.black_share[each.shot] if is_share else 0.0
        knots.append(each.shot)
        dn.append(left - of_dark * dark)
        share.append(of_dark)
    if not matters:
        return None
    shots = np.arange(scan.plan.shot_count)
    steps = np.diff(np.array(dn) + np.array(share) * dark)
    return SlowBlack(
        np.interp(shots, knots, dn), np.interp(shots, knots, share), UNEVEN * float(np.abs(steps).max())
    )
