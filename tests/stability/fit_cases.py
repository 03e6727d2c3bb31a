"""Hard cases of calibration fits, which compute in double: in single their samples are rounded to it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch

from dsl_core.calibration.common.plane import fit_plane
from dsl_core.calibration.common.tiles import tile_columns
from dsl_core.calibration.film.correspondence import GridSamples, fit_grid
from dsl_core.calibration.light.zero_order import fit_zero_order
from dsl_core.calibration.orders.efficiency import RatioSample, fit_efficiency
from dsl_core.model.plan import ScanLines
from dsl_core.optics.filters import FINE_NM
from dsl_core.optics.lines.profile import zero_order_profile
from dsl_core.simulation.published_rig import published_rig
from dsl_core.solve.smooth_functions import Equations, SmoothPrior, solve_smooth
from tests.stability.case import Case, Outcome, spread
from tests.stability.double_double import Floats

Run = Callable[[torch.dtype], Outcome]
FILTERS_NM = np.array([430.0, 660.0])
DEPTHS = np.array([500.0, 600.0, 700.0, 850.0, 1000.0])
ROWS, COLUMNS = np.linspace(0, 579, 6), np.linspace(0, 889, 8)


def rounded(values: Floats, dtype: torch.dtype) -> Floats:
    """Samples as a precision holds them."""
    return np.asarray(values.astype(np.float32) if dtype == torch.float32 else values, np.float64)


def _grid(law: Callable[[Floats], Floats], depths: Floats = DEPTHS) -> Floats:
    """Columns that follow a law of depth (m) at every node of an order and two wavelengths."""
    z = depths[:, None, None] / 1000
    slope = 1 + 0.1 * ROWS[:, None] / 580 + 0.2 * COLUMNS / 890
    one = law(z) * slope + 300
    return np.stack([one, one + 5])[None]


def _fitted(values: Floats, depths: Floats = DEPTHS, limit_px: float = 0.02) -> Run:
    """The grid fitted to columns; right when it gives them back wherever it has any."""

    def run(dtype: torch.dtype) -> Outcome:
        seen = rounded(values, dtype)
        samples = GridSamples((1,), FILTERS_NM, depths, ROWS, COLUMNS, seen)
        fit = fit_grid(samples)
        if not np.isfinite(fit.grid.array).all():
            return Outcome("wrong", "a coefficient is no finite number")
        worst = float(np.nanmax(np.abs(fit.residual_px)))
        said = f"{worst:.0e} px at most, {np.isfinite(fit.residual_px).mean():.0%} used"
        return Outcome("right" if worst < limit_px else "wrong", said)

    return run


def _holed(value: float, share: float) -> Floats:
    values = _grid(lambda z: 40 / z)
    values[np.random.default_rng(2).random(values.shape) < share] = value
    return values


def _smooth(scale: float, count: int) -> Run:
    """A smooth function of any size from a number of samples, honest at all nodes."""

    def run(dtype: torch.dtype) -> Outcome:
        nodes = np.arange(400.0, 701.0, 10.0)
        rng = np.random.default_rng(1)
        at = rng.uniform(400, 700, count)
        truth = 0.05 * np.sin(nodes / 40)
        design = np.stack([np.interp(at, nodes, row) for row in np.eye(len(nodes))], 1)
        noise = np.full(count, 0.003)
        values = rounded((design @ truth + noise * rng.standard_normal(count)) * scale, dtype)
        equations = Equations.of(design, values, noise * scale)
        prior = SmoothPrior(nodes, 0.2 * scale, 0.2 * scale)
        found = solve_smooth(equations, [prior], amplitudes=tuple(scale * a for a in (0.01, 0.03, 0.1)))
        sigmas = (found.values - truth * scale) / found.std
        if not np.isfinite(sigmas).all() or np.sqrt(np.mean(sigmas**2)) > 1.5:
            return Outcome("wrong", spread(sigmas))
        return Outcome("right", f"{spread(sigmas)}, deviation {found.std.max() / scale:.2g}")

    return run


def _efficiency(ratios: tuple[float, ...]) -> Run:
    def run(dtype: torch.dtype) -> Outcome:
        light = [np.exp(-0.5 * ((FINE_NM - nm) / 4) ** 2) for nm in np.linspace(440, 650, len(ratios))]
        samples = [
            RatioSample(float(rounded(np.array(ratio), dtype)), 0.01 * 0.1, seen)
            for ratio, seen in zip(ratios, light, strict=True)
        ]
        curve = fit_efficiency(1, samples).curve
        at = np.linspace(440, 650, len(ratios))
        off = np.abs(curve.at(at) / np.array(ratios) - 1).max()
        return Outcome("right" if off < 0.03 else "wrong", f"{off:.1%} at most at the samples")

    return run


def _plane(dtype: torch.dtype) -> Outcome:
    """Pixels of one image row, which many planes contain."""
    rig = published_rig()
    rig = rig.model_copy(update={"camera": rig.camera.resized(400, 260)})
    depth, usable = np.full((260, 400), 700.0), np.zeros((260, 400), bool)
    usable[130] = True
    found = fit_plane(rig, rounded(depth, dtype), usable)
    return Outcome("wrong", f"a plane from one line of pixels, rms {found.rms_mm:.1g} mm")


def _zero_order(value: float) -> Run:
    """Peaks of which two thirds are replaced by a value, or all where it is zero."""

    def run(dtype: torch.dtype) -> Outcome:
        rig, lines = published_rig(), ScanLines(step_px=2)
        column = np.random.default_rng(0).uniform(200, 400, 400)
        centres = 2.0 + 2 * np.arange(318)[:, None]
        clean = zero_order_profile(
            torch.as_tensor(column - centres), -2.5, 2.5, rig.projector_response
        ).numpy()
        rng = np.random.default_rng(1)
        seen = clean + 0.003 * rng.standard_normal(clean.shape)
        seen[:, 133 if value else 0 :] = value
        start = rig.projector_response
        found = fit_zero_order(
            lines, np.round(column), rounded(seen, dtype), np.full(seen.shape, 0.003), start, 150.0
        )
        off = np.abs(found.response.blur_px - start.blur_px) / found.std[0]
        return Outcome("right" if off < 4 else "wrong", f"blur {off:.1f} sd off, {found.good.sum()} pixels")

    return run


def _tiles(dtype: torch.dtype) -> Outcome:
    """Columns with nothing known, one known pixel, and infinite deviations."""
    column = np.full((64, 96), np.nan)
    column[10, 10], std = 300.0, np.full((64, 96), np.inf)
    found = tile_columns(rounded(column, dtype), std)
    return Outcome("flagged" if len(found) == 0 else "wrong", f"{len(found)} tiles used")


CASES = (
    Case("power law", "columns that follow it", _fitted(_grid(lambda z: 40 / z)), "right"),
    Case(
        "three depths",
        "as many as unknowns",
        _fitted(_grid(lambda z: 40 / z, DEPTHS[::2]), DEPTHS[::2]),
        "right",
    ),
    Case(
        "two depths",
        "fewer than unknowns",
        _fitted(_grid(lambda z: 40 / z, DEPTHS[:2]), DEPTHS[:2]),
        "refused",
        "three or more different depths",
    ),
    Case(
        "depths alike",
        "five within a millimetre",
        _fitted(_grid(lambda z: 40 / z, 700 + np.arange(5) / 5), 700 + np.arange(5) / 5),
        "refused",
        "further",
    ),
    Case("columns alike", "alpha is zero, so any exponent fits", _fitted(_grid(lambda z: 0 * z)), "right"),
    Case(
        "logarithmic columns",
        "the exponent tends to zero",
        _fitted(_grid(lambda z: -40 * np.log(z)), limit_px=0.2),
        "right",
    ),
    Case("linear columns", "the exponent is one", _fitted(_grid(lambda z: 40 * z)), "right"),
    Case("samples of NaN", "every fifth", _fitted(_holed(np.nan, 0.2)), "right"),
    Case("samples of infinity", "every fifth", _fitted(_holed(np.inf, 0.2)), "right"),
    Case("lost peaks", "every fiftieth at column 1000", _fitted(_holed(1000.0, 0.02)), "right"),
    Case("no samples", "not one peak was found", _fitted(_holed(np.nan, 1.1)), "refused", "grid nodes"),
    Case("smooth function", "40 samples", _smooth(1.0, 40), "right"),
    Case("smooth function, scale 1e-6", "a millionth", _smooth(1e-6, 40), "right"),
    Case("smooth function, scale 1e6", "a million times", _smooth(1e6, 40), "right"),
    Case("smooth function of one sample", "one sample for 31 nodes", _smooth(1.0, 1), "right"),
    Case("efficiency", "eight filters", _efficiency(tuple(np.linspace(0.2, 0.08, 8))), "right"),
    Case(
        "efficiency of nothing", "ratios within their noise", _efficiency((1e-3,) * 8), "refused", "filters"
    ),
    Case("one filter", "a curve from a point", _efficiency((0.1,)), "refused", "filters"),
    Case("plane of one line", "pixels of one image row", _plane, "refused", "line"),
    Case("lost zero orders", "two thirds of the pixels dark", _zero_order(1e-9), "right"),
    Case("no zero order", "all pixels dark", _zero_order(0.0), "refused", "lines are resolved in only"),
    Case("tiles of nothing", "one known pixel of infinite deviation", _tiles, "flagged", "0 tiles"),
)
