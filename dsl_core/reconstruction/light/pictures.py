"""The frames of a scan, as far as its light is concerned."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.frames import FrameSource
from dsl_core.model.plan import CapturePlan, Role, Shot
from dsl_core.model.rig import Rig
from dsl_core.patterns.gray_code import DecodedCode
from dsl_core.progress import Progress
from dsl_core.reconstruction.hdr import MergedFrame
from dsl_core.reconstruction.light.setting_ratios import Ratio
from dsl_core.reconstruction.light.steady import SteadyLight
from dsl_core.reconstruction.merge import Exposed, PickedLines


class Pictures(Protocol):
    """The frames of a scan, as far as its light is concerned; see `dsl_core.reconstruction.rows.frames`."""

    source: FrameSource
    rig: Rig
    plan: CapturePlan
    ratios: dict[tuple[Role, int], tuple[Ratio | None, ...]]

    def shots_of(self, role: Role, pattern: int) -> list[Shot]:
        """The shots of a pattern, one for each setting it was captured with."""

    def expose(self, exposed: Exposed) -> None:
        """From now on merge frames as exposed to other light."""

    def follow(self, light: SteadyLight) -> None:
        """From now on give line frames as they would be in steady light."""

    def decode(self, progress: Progress | None = None) -> tuple[DecodedCode, MergedFrame]:
        """What the binary code says of every pixel, and white."""

    def look(self, pixels: NDArray[np.intp], progress: Progress | None = None) -> None:
        """Look at every frame once: compare settings, and keep the lines of some pixels for `pick`."""

    def pick(self, pixels: NDArray[np.intp], progress: Progress | None = None) -> PickedLines:
        """The lines of some pixels (flat indices)."""
