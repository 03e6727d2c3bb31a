"""Hard cases of the spectral solvers alone, on normal equations, against the exact reference."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from dsl_core.reconstruction.scan_result import DECIDED_FROM
from dsl_core.reconstruction.spectral.solving.dense_solver import solve_dense
from dsl_core.reconstruction.spectral.solving.lane_solver import solve_spectra
from dsl_core.reconstruction.spectral.solving.prior import Prior
from dsl_core.reconstruction.spectral.solving.solution import Spectra
from tests.stability.case import HONEST_RMS, Case, Outcome
from tests.stability.double_double import Floats
from tests.stability.exact_solution import System, exact_nodes, exact_tau

BANDS, PIXELS = 53, 40
#: Errors of arithmetic allowed in each precision, in stated deviations.
ALLOWED = {torch.float32: 0.1, torch.float64: 1e-5}


@dataclass(frozen=True)
class Equations:
    """Rows of unit noise that see the bands (pixels, rows, BANDS), their values, and the truth."""

    rows: Floats
    values: Floats
    truth: Floats

    def banded(self, dtype: torch.dtype) -> tuple[Tensor, Tensor]:
        """Normal equations in the solver's banded storage, of the rows as this precision holds them."""
        rows, values = torch.as_tensor(self.rows).to(dtype), torch.as_tensor(self.values).to(dtype)
        full, right = rows.mT @ rows, torch.einsum("prj,pr->jp", rows, values)
        half = 4
        band = torch.zeros((half + 1, BANDS, len(rows)), dtype=dtype)
        for o in range(half + 1):
            band[o, : BANDS - o] = torch.diagonal(full, o, 1, 2).T
        return band, right


def lines(strength: float | Floats, spectrum: Floats | None = None, seed: int = 0) -> Equations:
    """Each row sees five bands; ``strength`` (over bands) is signal over noise at reflectance one."""
    rng = np.random.default_rng(seed)
    bands = np.arange(BANDS)
    centres = np.linspace(-1, BANDS, 3 * BANDS)
    profile = np.clip(1 - np.abs(centres[:, None] - bands) / 2.5, 0, None)
    rows = profile * rng.uniform(0.8, 1.2, (PIXELS, centres.size, 1)) * strength
    smooth = 0.45 + 0.3 * np.sin(bands / 9 + np.arange(PIXELS)[:, None])
    truth = np.broadcast_to(smooth if spectrum is None else spectrum, (PIXELS, BANDS))
    values = np.einsum("prj,pj->pr", rows, truth) + rng.standard_normal(rows.shape[:2])
    return Equations(rows, values, truth)


def judged(spectra: Spectra, truth: Floats, where: slice = slice(3, -3)) -> Outcome:
    """Right when inside the stated deviation, flagged where bands are left to the prior or at a bound."""
    for name in ("nodes", "mean", "std", "data_share", "tau"):
        if not bool(torch.isfinite(getattr(spectra, name)).all()):
            return Outcome("wrong", f"{name} holds what is no finite number")
    sigmas = ((spectra.mean.T.double().numpy() - truth) / spectra.std.T.double().numpy())[:, where]
    rms = float(np.sqrt(np.mean(sigmas**2)))
    told = f"{rms:.2f} sd rms"
    if bool(spectra.at_bound[where].any(0).all()):
        return Outcome("flagged", f"AT_BOUND; {told}")
    if bool((spectra.data_share[where] < DECIDED_FROM).any(0).all()):
        return Outcome("flagged", f"BANDS_UNREACHED; {told}")
    return Outcome("right" if rms < HONEST_RMS else "wrong", told)


def _solve(equations: Equations) -> Callable[[torch.dtype], Outcome]:
    return lambda dtype: judged(solve_spectra(*equations.banded(dtype), None, Prior()), equations.truth)


def _exactly(equations: Equations, prior: Prior | None = None) -> Callable[[torch.dtype], Outcome]:
    """The same, and no farther from the exact answer than arithmetic may be."""
    prior = prior or Prior(bounds=(-50.0, 50.0))

    def run(dtype: torch.dtype) -> Outcome:
        data, right = equations.banded(dtype)
        found = solve_spectra(data, right, None, prior)
        wide = System(data.double().numpy(), right.double().numpy(), np.zeros((BANDS, 0, PIXELS)))
        none = np.zeros((BANDS, PIXELS), bool)
        exact = exact_nodes(wide, exact_tau(wide, prior), prior, none, none.astype(float))
        off = float((np.abs(found.nodes.double().numpy() - exact) / found.std.double().numpy()).max())
        if not off < ALLOWED[dtype]:
            return Outcome("wrong", f"{off:.1g} sd from the exact answer")
        ending = judged(found, equations.truth)
        return Outcome(ending.ending, f"{ending.says}; {off:.0e} sd from the exact answer")

    return run


def _dense(rows: Floats, truth: Floats, noise: float) -> Callable[[torch.dtype], Outcome]:
    """Frames (rows, BANDS) that see any bands, the same for all pixels."""
    rng = np.random.default_rng(1)
    values = truth @ rows.T / noise + rng.standard_normal((len(truth), len(rows)))

    def run(dtype: torch.dtype) -> Outcome:
        model, seen = torch.as_tensor(rows / noise).to(dtype), torch.as_tensor(values).to(dtype)
        matrix = (model.T @ model).expand(len(truth), -1, -1)
        return judged(solve_dense(matrix, seen @ model, Prior()), truth)

    return run


def _scaled_data(scale: float) -> Callable[[torch.dtype], Outcome]:
    """A pixel that is so many times brighter with as many times the noise gives the same answer."""

    def run(dtype: torch.dtype) -> Outcome:
        plain = lines(30.0)
        signal = torch.as_tensor(plain.rows).to(dtype) * scale
        values = torch.as_tensor(plain.values).to(dtype) * scale
        weight = torch.tensor(scale, dtype=dtype) ** -2
        full, right = signal.mT @ (signal * weight), torch.einsum("prj,pr->jp", signal * weight, values)
        band = torch.zeros((5, BANDS, PIXELS), dtype=dtype)
        for o in range(5):
            band[o, : BANDS - o] = torch.diagonal(full, o, 1, 2).T
        found = solve_spectra(band, right, None, Prior())
        same = solve_spectra(*plain.banded(dtype), None, Prior())
        off = float(((found.mean - same.mean).abs() / same.std).max())
        if not off < ALLOWED[dtype]:
            return Outcome("wrong", f"{off:.1g} sd from the unscaled answer")
        return Outcome("right", f"{off:.0e} sd from the unscaled answer")

    return run


def _hostile(value: float) -> Callable[[torch.dtype], Outcome]:
    """A pixel whose equations are no numbers must not pass for an answer."""

    def run(dtype: torch.dtype) -> Outcome:
        data, right = lines(30.0).banded(dtype)
        data[0, 20, 7] = value
        try:
            return judged(solve_spectra(data, right, None, Prior()), lines(30.0).truth)
        except ValueError as error:
            return Outcome("refused", str(error))

    return run


def _smooth_truth() -> Floats:
    return np.asarray(0.45 + 0.3 * np.sin(np.arange(BANDS) / 9 + np.arange(PIXELS)[:, None]))


def _random_rows(count: int, like: int | None = None) -> Floats:
    rows = np.random.default_rng(5).uniform(0, 1, (count, BANDS)) / BANDS
    return rows if like is None else np.repeat(rows[:like], count // like, 0)


_LEFT = np.where(np.arange(BANDS) < 20, 30.0, 0.0)
_FADING = np.geomspace(1e-4, 300, BANDS)
CASES = (
    Case(
        "no data",
        "all weights are zero: only the prior speaks",
        _exactly(lines(0.0)),
        "flagged",
        "BANDS_UNREACHED",
    ),
    Case("denormal data", "equations of 1e-40", _exactly(lines(1e-20)), "flagged", "BANDS_UNREACHED"),
    Case(
        "faint data",
        "a hundredth of a standard deviation a row",
        _exactly(lines(0.01)),
        "flagged",
        "BANDS_UNREACHED",
    ),
    Case("strong data", "300 standard deviations a row", _exactly(lines(300.0)), "right"),
    Case(
        "fading data",
        "from 1e-4 to 300 standard deviations over the spectrum",
        _exactly(lines(_FADING)),
        "flagged",
        "BANDS_UNREACHED",
    ),
    Case(
        "data at one end",
        "nothing above the 20th band",
        _exactly(lines(_LEFT)),
        "flagged",
        "BANDS_UNREACHED",
    ),
    Case("scale 1e-6 of the equations", "signal and noise a millionth", _scaled_data(1e-6), "right"),
    Case("scale 1e6 of the equations", "signal and noise a million times", _scaled_data(1e6), "right"),
    Case(
        "above the bound",
        "reflectance 3 all over",
        _solve(lines(30.0, np.full(BANDS, 3.0))),
        "flagged",
        "AT_BOUND",
    ),
    Case(
        "one row",
        "one line of one band in all frames",
        _dense(np.eye(BANDS)[26:27], _smooth_truth(), 0.01),
        "flagged",
        "BANDS_UNREACHED",
    ),
    Case(
        "equal rows",
        "32 frames of one pattern: rank 1",
        _dense(_random_rows(32, 1), _smooth_truth(), 1e-3),
        "flagged",
        "BANDS_UNREACHED",
    ),
    Case(
        "collinear rows",
        "32 frames of 8 patterns",
        _dense(_random_rows(32, 8), _smooth_truth(), 1e-3),
        "right",
    ),
    Case(
        "fewer rows than bands",
        "24 patterns for 53 bands",
        _dense(_random_rows(24), _smooth_truth(), 1e-4),
        "right",
    ),
    Case("equations of NaN", "one number of one pixel", _hostile(np.nan), "refused", "not positive definite"),
    Case(
        "equations of infinity",
        "one number of one pixel",
        _hostile(np.inf),
        "refused",
        "not positive definite",
    ),
    Case("negative weights", "one number of one pixel", _hostile(-1e9), "refused", "not positive definite"),
)
