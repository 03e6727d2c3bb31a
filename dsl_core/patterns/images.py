"""What the projector shows for each shot of a plan."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import PlanError
from dsl_core.model.captured_code import CapturedCode
from dsl_core.model.plan import CapturePlan, NoCode, Shot
from dsl_core.patterns.binary_code import binary_image
from dsl_core.patterns.captured_code import captured_levels
from dsl_core.patterns.multiplexed import profile, profiles


def pattern_image(plan: CapturePlan, shot: Shot) -> NDArray[np.uint8]:
    """Drive levels of a shot, ``round(255 * level * pattern)``, shape (height, width, 3).

    Raises `PlanError` when the shot or its pattern set does not fit the plan's projector.
    """
    width, height = plan.projector_size_px
    image = np.empty((height, width, 3), np.uint8)
    match shot.role:
        case "code":
            if isinstance(plan.code, NoCode):
                raise PlanError(
                    f"The plan {plan.name!r} has no binary code, so no code frame {shot.pattern}."
                )
            if isinstance(plan.code, CapturedCode):
                levels = captured_levels(plan.code, plan.projector_size_px, shot.pattern)
                image[:] = np.round(255 * shot.level * levels).astype(np.uint8)[..., None]
                return image
            drive = np.uint8(np.round(255 * shot.level))
            image[:] = (binary_image(plan.code, plan.projector_size_px, shot.pattern) & drive)[..., None]
        case "white":
            image[:] = np.uint8(np.round(255 * shot.level))
        case "black":
            image[:] = 0
        case "spectral":
            image[:] = drive_levels(profile(plan.spectral, width, shot.pattern), shot.level)
        case "sentinel":
            return pattern_image(plan, plan.original(shot))
    return image


def drive_levels(profile: NDArray[np.float32], level: float) -> NDArray[np.uint8]:
    """8 bit drive levels of a pattern (any shape, 0..1) shown at a setting's level (0..1)."""
    return np.round(255 * level * profile.astype(np.float64)).astype(np.uint8)


def spectral_profiles(plan: CapturePlan) -> NDArray[np.float32]:
    """Column profiles of the plan's spectral set, shape (frames, width, 3), 0..1; raises `PlanError`."""
    return profiles(plan.spectral, plan.projector_size_px[0])
