"""Factors of the spectral chain that make a diffuser of known reflectance come out flat.

``chain_correction(rig, scans) -> ChainCorrection`` takes scans of a Spectralon plane under white lines,
without a filter, and a rig whose geometry, film, response, emission and efficiency are known about;
`dsl_core.model.calibration.chain.apply_chain` puts the factors into the rig.

Each curve has its error: of response, emission and efficiency only the product counts, and the line scan
shows it at every wavelength. With smooth relative corrections ``e_m`` of the orders' efficiency, ``r_c`` of
the response and ``w`` of the white scale, the signal of a pixel of colour c in frame k is, to first order::

    y_k = s sum_m sum_j moment_mcj G(q_m(j) - x_k) H (1 + e_m(j) + r_c(j) + w)

over bands j, with G the line's profile over a band, and the zero order likewise. The shading s of each pixel
is taken from its zero order, so that uneven light or target do not matter. The equations are linear and are
solved twice, since products of corrections count when these are large.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from operator import add

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.common.spectral_nodes import NODES_NM, SMOOTHNESS
from dsl_core.calibration.common.white import white_target
from dsl_core.calibration.light.chain_deviation import LeftOut, Part
from dsl_core.calibration.light.chain_equations import (
    ZERO_ORDER_ERROR,
    LineScan,
    Unknowns,
    colours_of,
    first_order_equations,
    stretched,
    without_outliers,
    zero_order_equations,
    zero_order_ratios,
)
from dsl_core.errors import CalibrationError
from dsl_core.model.calibration.chain import ChainCorrection, apply_chain
from dsl_core.model.conditions import mosaic_colours
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.correspondence import Correspondence, correspondence
from dsl_core.optics.spectra import ORDERS, chain_response
from dsl_core.solve.smooth_functions import Equations, SmoothPrior, SmoothSolution, solve_given, solve_smooth

__all__ = ["LineScan", "chain_correction"]

Floats = NDArray[np.float64]

UNKNOWNS = Unknowns(NODES_NM)
#: Prior deviations of a correction's level and of its rise over all nodes.
LEVEL_STD, RISE_STD = 0.05, 0.1
ROUNDS = 2
#: What is known beforehand of the scale of wavelengths.
SCALE_STD = 0.02
#: A smaller one moves the emission by less than its flanks are wide.
LINEAR_SCALE, SCALE_ROUNDS = 3e-4, 4
#: Parts of the image (down, across) between which the scatter is taken.
PARTS = (3, 4)
MIN_PIXELS = 50
#: Wavelengths with less than this share of the brightest one's light say little of a correction.
BRIGHT_SHARE = 0.05
#: What geometry, film and bands of finite width leave, relative: the rms error of drawn rigs of the twin that
#: were calibrated from what their camera sees alone was 0.2 to 0.3 % (0.05 to 0.12 % with the true geometry).
MODEL_STD = 2.5e-3


@dataclass(frozen=True)
class _Solved:
    """A round: the solution, its misfit, and the chain's relative deviation at the nodes of each order.

    ``scale`` is that of the wavelengths, with its deviation.
    """

    solution: SmoothSolution
    chi_square: float
    chain_std: dict[int, Floats]
    ratio_std: float
    pixels: int
    scale: tuple[float, float]


def chain_correction(
    rig: Rig, scans: Sequence[LineScan], *, reflectance: float | None = None
) -> ChainCorrection:
    """Smooth factors from one or more scans of a diffuser; raises `CalibrationError` without good pixels.

    ``reflectance`` (share) is that of the diffuser, of the rig's white if not given.
    """
    # Where the light goes depends on film and lenses alone, so that the model outlives the rig's curves.
    model, target = correspondence(rig), white_target(rig, reflectance)
    factors, corrected = np.ones(UNKNOWNS.count), rig
    scale = 0.0, 0.0
    for round_ in range(ROUNDS):
        solved = _solve(
            corrected, [without_outliers(corrected, scan, target) for scan in scans], model, target
        )
        factors = factors * (1 + solved.solution.values)
        if round_ == 0:
            # Later rounds have put into the curves what a wrong scale does.
            scale = _refined_scale(rig, scans, model, target, solved.scale)
        record = _record(factors, solved, scale)
        corrected = apply_chain(record, rig)
    return record.model_copy(update={"largest_correction": largest_correction(rig, corrected)})


def largest_correction(before: Rig, after: Rig) -> float:
    """Largest relative change of the chain, orders apart, at wavelengths that are bright enough to matter.

    Of response, efficiency and white scale only the product counts, and where a colour is dark its factor
    absorbs stray light and can grow without limit.
    """
    largest, seen = 0.0, list(mosaic_colours(before.sensor.bayer))
    for order in ORDERS:
        old, new = (chain_response(rig, order, UNKNOWNS.nodes_nm).sum(1)[seen] for rig in (before, after))
        light = old.sum(0)
        bright = light > BRIGHT_SHARE * light.max()
        weight = old**2
        change = (weight * (new / old.clip(min=1e-30) - 1)).sum(0) / weight.sum(0).clip(min=1e-30)
        largest = max(largest, float(np.abs(change[bright]).max()))
    return largest


def _solve(rig: Rig, scans: list[LineScan], model: Correspondence, target: SpectralCurve) -> _Solved:
    pixels = sum(len(scan.pixels) for scan in scans)
    if pixels < MIN_PIXELS:
        raise CalibrationError(
            f"The line scan of the diffuser has {pixels} usable pixels; {MIN_PIXELS} are needed. Check that"
            " it fills the picture, is lit and not saturated, and capture the step again."
        )
    ratio, ratio_std = _mean_ratios(rig, scans, target)
    placed = [
        (number, place, first_order_equations(rig, part, ratio, model, target, UNKNOWNS))
        for number, scan in enumerate(scans)
        for place, part in _parts(rig, scan).items()
    ]
    parts = [equations for _, _, equations in placed]
    zero = zero_order_equations(rig, ratio, ratio_std, target, UNKNOWNS)
    with_scale = reduce(add, parts) + zero
    total = _corrections(with_scale)
    solution = solve_smooth(
        total,
        [SmoothPrior(UNKNOWNS.nodes_nm, LEVEL_STD, RISE_STD)] * (len(ORDERS) + 3),
        [LEVEL_STD],
        **SMOOTHNESS,
    )
    used = [part for part in parts if part.count]
    seen = list(mosaic_colours(rig.sensor.bayer))
    left_out = LeftOut(
        solution,
        total,
        [Part(number, *place, _corrections(part)) for number, place, part in placed if part.count],
    )
    x, first = solution.values, _corrections(with_scale - zero)
    misfit = first.square - 2 * x @ first.right + x @ first.normal @ x
    chain_std = {order: _chain_std(rig, order, solution, left_out) for order in ORDERS}
    return _Solved(
        solution,
        float(misfit / max(first.count, 1)),
        chain_std,
        float(np.linalg.norm(ratio_std[seen]) / len(seen)),
        pixels,
        _scale(solution, with_scale, used),
    )


def _corrections(equations: Equations) -> Equations:
    """The equations of the corrections alone, wavelengths taken as they are."""
    n = UNKNOWNS.count
    return Equations(equations.normal[:n, :n], equations.right[:n], equations.square, equations.count)


def _scale(solution: SmoothSolution, equations: Equations, parts: list[Equations]) -> tuple[float, float]:
    """The wavelengths' scale, with corrections as smooth as without it; deviation by leaving out parts."""
    prior = np.zeros((UNKNOWNS.count + 1,) * 2)
    prior[:-1, :-1], prior[-1, -1] = solution.prior, SCALE_STD**2
    found = solve_given(equations, prior, solution.noise_factor)
    without = [solve_given(equations - part, prior, solution.noise_factor).values[-1] for part in parts]
    return float(found.values[-1]), float(np.hypot(found.std[-1], np.std(without) * np.sqrt(len(parts) - 1)))


def _refined_scale(
    rig: Rig,
    scans: Sequence[LineScan],
    model: Correspondence,
    target: SpectralCurve,
    found: tuple[float, float],
) -> tuple[float, float]:
    """The scale of wavelengths, solved again with the emission moved where it is too large to be linear."""
    scale, std = found
    for _ in range(SCALE_ROUNDS):
        if abs(scale) < LINEAR_SCALE:
            break
        moved = stretched(rig, 1 / (1 + scale))
        more, std = _solve(
            moved, [without_outliers(moved, scan, target) for scan in scans], model, target
        ).scale
        scale += more
        if abs(more) < LINEAR_SCALE:
            break
    return scale, std


def _parts(rig: Rig, scan: LineScan) -> dict[tuple[int, int], LineScan]:
    """The scan in parts of the image, by their row and column."""
    rows, columns = np.divmod(scan.pixels, rig.camera.width_px)
    down, across = rows * PARTS[0] // rig.camera.height_px, columns * PARTS[1] // rig.camera.width_px
    places = sorted(set(zip(down.tolist(), across.tolist(), strict=True)))
    return {(y, x): scan.at((down == y) & (across == x)) for y, x in places}


def _mean_ratios(rig: Rig, scans: list[LineScan], target: SpectralCurve) -> tuple[Floats, Floats]:
    """Measured over expected zero order of each colour, (3,), and its deviation from parts of the image."""
    found: list[list[float]] = [[], [], []]
    for scan in scans:
        for part in _parts(rig, scan).values():
            ratio, colours = zero_order_ratios(rig, part, target), colours_of(rig, part)
            for colour in range(3):
                if (colours == colour).any():
                    found[colour].append(float(np.median(ratio[colours == colour])))
    mean = np.array([np.mean(values) if values else 1.0 for values in found])
    std = np.array([np.std(values) / np.sqrt(len(values)) if values else 1.0 for values in found])
    return mean, np.hypot(std, ZERO_ORDER_ERROR)


def _chain_std(rig: Rig, order: int, solution: SmoothSolution, left_out: LeftOut) -> Floats:
    """Relative deviation of the product of all factors at the nodes, for a pixel anywhere in the image.

    Deviation of the mean by the posterior and by leaving out frames, and how much places differ from it.
    """
    product = _product(rig, order)
    posterior = np.einsum("ij,jk,ik->i", product, solution.covariance, product).clip(min=0)
    by_parts = left_out.variance_of_mean(product) + left_out.variance_of_place(product)
    return np.asarray(np.sqrt(posterior + by_parts + MODEL_STD**2))


def _product(rig: Rig, order: int) -> Floats:
    """Relative change of the chain at the nodes by the unknowns, colours weighted by squared signal."""
    weight = chain_response(rig, order, UNKNOWNS.nodes_nm).sum(1) ** 2
    # Curves of colours that a monochrome camera does not have weigh nothing.
    weight[[colour for colour in range(3) if colour not in mosaic_colours(rig.sensor.bayer)]] = 0.0
    weight = weight / weight.sum(0).clip(min=1e-30)
    n = len(UNKNOWNS.nodes_nm)
    product = np.zeros((n, UNKNOWNS.count))
    product[:, UNKNOWNS.efficiency(order)] = np.eye(n)
    for colour in range(3):
        product[:, UNKNOWNS.response(colour)] = np.diag(weight[colour])
    product[:, UNKNOWNS.white] = 1
    return product


def _record(factors: Floats, solved: _Solved, scale: tuple[float, float]) -> ChainCorrection:
    def curve(block: slice) -> SpectralCurve:
        return SpectralCurve.of(UNKNOWNS.nodes_nm, factors[block], std=solved.solution.std[block])

    red, green, blue = (curve(UNKNOWNS.response(colour)) for colour in range(3))
    both = np.sqrt(np.mean([std**2 for std in solved.chain_std.values()], 0))
    return ChainCorrection(
        efficiency_factors={order: curve(UNKNOWNS.efficiency(order)) for order in ORDERS},
        response_factors=(red, green, blue),
        white_scale_factor=float(factors[UNKNOWNS.white]),
        white_scale_rel_std=solved.ratio_std,
        chain_rel_std=SpectralCurve.of(UNKNOWNS.nodes_nm, both),
        largest_correction=0.0,  # known when all rounds are done
        wavelength_scale=scale[0],
        wavelength_scale_std=scale[1],
        pixels=solved.pixels,
        chi_square=solved.chi_square,
    )
