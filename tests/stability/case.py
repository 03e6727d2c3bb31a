"""What a hard case is, how it may end, and how a result is judged."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
import torch
from numpy.typing import NDArray

from dsl_core.errors import DslError
from dsl_core.model.result import SPECTRUM_INVALID, VARIABLES, Flag

if TYPE_CHECKING:
    import xarray as xr

#: ``right`` within the stated deviation, ``flagged`` with the reason, ``refused`` by a message that says why,
#: or, which no case may be, ``wrong``.
Ending = Literal["right", "flagged", "refused", "wrong"]
PRECISIONS: dict[str, torch.dtype] = {"single": torch.float32, "double": torch.float64}

#: Flags after which a value is given but does not claim its deviation.
UNRELIABLE = Flag.AT_BOUND | Flag.POOR_FIT | Flag.DEPTH_EDGE
#: Errors in stated deviations: their rms, and the share beyond three of them, that honest ones may have.
HONEST_RMS, HONEST_BEYOND_3 = 1.35, 0.02
#: Share of the pixels in question that must bear a flag, or be right.
MOST = 0.7


@dataclass(frozen=True)
class Outcome:
    """How a case ended, and in words what the figures or reasons were."""

    ending: Ending
    says: str


@dataclass(frozen=True)
class Case:
    """One hard case: what is hard, a run in a precision, and the ending wanted with what it must say."""

    name: str
    hard: str
    run: Callable[[torch.dtype], Outcome]
    ends: Ending
    says: str = ""

    def outcome(self, dtype: torch.dtype) -> Outcome:
        """Run it; a message to the user is an ending like any other, any other error is none."""
        try:
            return self.run(dtype)
        except DslError as error:
            return Outcome("refused", str(error))


def silent_values(result: xr.Dataset) -> list[str]:
    """Variables with a value that is no finite number at a pixel whose flags are zero."""
    silent = []
    for name in VARIABLES:
        if name in result and np.issubdtype(result[name].dtype, np.floating):
            bad = ~np.isfinite(result[name].values)
            bad = bad.any(0) if bad.ndim == 3 else bad
            if (bad & (result["flags"].values == 0)).any():
                silent.append(name)
    return silent


def judge_scan(
    result: xr.Dataset,
    truth: NDArray[np.float64],
    depth_mm: NDArray[np.float64],
    where: NDArray[np.bool_] | None = None,
    limits: Flag | None = None,
) -> Outcome:
    """How the pixels ``where`` (rows, columns) of a result ended.

    They are flagged when most bear one of ``limits``, by default of `UNRELIABLE`, of the flags that
    invalidate a pixel, or of `Flag.BANDS_UNREACHED`. Every value given must be as good as it says, flagged or
    not, but for those that `UNRELIABLE` excuses.
    """
    silent = silent_values(result)
    if silent:
        return Outcome("wrong", f"no finite number and no flag: {', '.join(silent)}")
    flags = result["flags"].values
    where = np.ones(flags.shape, bool) if where is None else where
    claims = where & (flags & int(UNRELIABLE | SPECTRUM_INVALID) == 0)
    error = (result["reflectance"].values - truth)[:, claims]
    sigmas = error / result["reflectance_std"].values[:, claims]
    depth = ((result["depth_mm"].values - depth_mm) / result["depth_std_mm"].values)[claims]
    honest = all(is_honest(values) for values in (sigmas, depth))
    limits = limits or UNRELIABLE | SPECTRUM_INVALID | Flag.BANDS_UNREACHED
    flagged = where & (flags & int(limits) != 0)
    figures = f"spectra {spread(sigmas)}, depth {spread(depth)}"
    if not honest:
        return Outcome("wrong", figures)
    if flagged.sum() >= MOST * where.sum():
        names = [
            str(flag.name) for flag in Flag if ((flags & int(flag) != 0) & where).mean() > 0.1 * where.mean()
        ]
        return Outcome("flagged", " ".join(names) + (f"; {figures}" if claims.any() else ""))
    if claims.sum() < MOST * where.sum():
        return Outcome("wrong", f"only {claims.sum() / where.sum():.0%} of the pixels have an answer")
    return Outcome("right", f"{figures}, rms error {np.sqrt(np.mean(error**2)):.2g}")


def is_honest(sigmas: NDArray[np.floating]) -> bool:
    """Whether errors in stated deviations are as large as these say."""
    if not sigmas.size:
        return True
    rms = float(np.sqrt(np.mean(sigmas**2)))
    return rms < HONEST_RMS and float((np.abs(sigmas) > 3).mean()) <= HONEST_BEYOND_3


def spread(sigmas: NDArray[np.floating]) -> str:
    """Errors in stated deviations in words."""
    if not sigmas.size:
        return "not given"
    return f"{np.sqrt(np.mean(sigmas**2)):.2f} sd rms, {np.abs(sigmas).max():.1f} at most"
