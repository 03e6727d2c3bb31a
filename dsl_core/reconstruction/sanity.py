"""Whether frames show anything at all, and if not, what to do about it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import DecodeError
from dsl_core.model.result import DEPTH_INVALID, REASONS, Flag

#: With fewer pixels than this share a scan is taken as failed.
MIN_SHARE = 0.001
#: The gravest reason first: too much light also confuses the code.
_ADVICE = {
    Flag.SATURATED: "Lower the exposure or the drive level of the plan's settings, or dim the room.",
    Flag.NO_LIGHT: "Check that the projector is on, the lens open, the scene in the beam; or expose longer.",
    Flag.OUT_OF_RANGE: "Check that the calibration belongs to this rig, and the distance of the scene.",
    Flag.CODE_UNSURE: "Check that projector and camera run in step and nothing moved; expose longer.",
    Flag.CODES_DISAGREE: "Check focus and that nothing moved; part surfaces that light each other.",
    Flag.NON_FINITE: "Check the calibration for values that are not numbers.",
}


def require_pixels(flags: NDArray[np.uint16]) -> None:
    """Raise `DecodeError` when hardly any pixel has a depth, with the main reason and what to do."""
    good = float(np.mean((flags & int(DEPTH_INVALID)) == 0))
    if good >= MIN_SHARE:
        return
    shares = {flag: float(np.mean((flags & int(flag)) != 0)) for flag in _ADVICE}
    flag = next((f for f, share in shares.items() if share >= 0.5), max(shares, key=lambda f: shares[f]))
    raise DecodeError(
        f"Only {good:.2%} of the pixels could be decoded; for {shares[flag]:.0%} of them {REASONS[flag]}."
        f" {_ADVICE[flag]}"
    )


def require_light(
    white: NDArray[np.float32], saturated: NDArray[np.bool_], advice: str = _ADVICE[Flag.SATURATED]
) -> None:
    """Raise `DecodeError` with advice when nearly all of the white frame (rows, columns) is saturated."""
    share = float(np.mean(saturated | ~np.isfinite(white)))
    if share > 1 - MIN_SHARE:
        raise DecodeError(
            f"The white frame is saturated in {share:.0%} of its pixels at every setting, so that nothing"
            f" can be measured. {advice}"
        )
