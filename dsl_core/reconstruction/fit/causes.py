"""Which part of the model does not fit: findings from the probed pixels of a scan."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.fit import FitFinding
from dsl_core.reconstruction.spectral.line_probe import PROFILE
from dsl_core.reconstruction.spectral.probe import PARAMETERS, PRIOR_STD, Probe

Floats = NDArray[np.float64]

#: What matters of each: place of the orders (px), gains, blur and tail of the lines, light over the scan.
MOST_SHIFT_PX, MOST_GAIN, MOST_BLUR, MOST_TAIL, MOST_DRIFT = 0.035, 0.015, 0.03, 0.004, 0.014
#: Chi-square of most pixels above which no cause explains the frames.
MOST_CHI_SQUARE = 1.5
#: How many deviations of its own a figure must be away from zero.
SIGMAS = 3.0
#: Terms of the shift of an order over the picture: up to second degree.
_TERMS = 6
_CALIBRATE = "Run the drift check; calibrate again the part that it names."


@dataclass(frozen=True)
class Causes:
    """The parameters of the model fitted to a whole scan, with deviations from the scatter over cells.

    ``shift_px`` (n, 2) of both orders at the probed pixels, their root mean square and its deviation;
    ``gain`` (2,) of both orders, with the deviations of their mean and difference; ``drift`` of the light
    from the first line to the last.
    """

    shift_px: Floats
    rms_px: float
    rms_std_px: float
    gain: Floats
    common_std: float
    difference_std: float
    drift: float
    drift_std: float


def fit_causes(probe: Probe) -> Causes:
    """Fit all parameters at once; shifts are smooth over the picture, all others equal everywhere."""
    x, y = probe.place[:, 1], probe.place[:, 0]
    terms = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], 1)
    count, rest = len(x), len(PARAMETERS) - 2
    design = np.zeros((count, len(PARAMETERS), 2 * _TERMS + rest))
    design[:, 0, :_TERMS] = design[:, 1, _TERMS : 2 * _TERMS] = terms
    design[:, 2:, 2 * _TERMS :] = np.eye(rest)
    used, weight = probe.sound, probe.weight
    score = np.einsum("npk,np->nk", design, probe.score)[used] * weight[used, None]
    normal = np.einsum("npk,npq,nql->nkl", design, probe.normal, design)[used] * weight[used, None, None]
    prior = np.r_[np.full(2 * _TERMS, PRIOR_STD[0]), PRIOR_STD[2:]] ** -2.0
    inverse = np.linalg.inv(normal.sum(0) + np.diag(prior))
    found = inverse @ score.sum(0)
    covariance = inverse * _excess(score - normal @ found, normal, prior, probe.cell[used])
    shift = design[:, :2] @ found
    spread = np.einsum("npk,kl,npl->np", design[:, :2], covariance, design[:, :2])
    # Noise adds its own square to that of the shift.
    square, noise = float(np.mean(shift[used] ** 2)), float(np.mean(spread[used]))
    first = 2 * _TERMS
    pair = np.array([[0.5, 0.5], [1.0, -1.0]])
    common, difference = np.sqrt(
        np.diag(pair @ covariance[first : first + 2, first : first + 2] @ pair.T)
    ).tolist()
    return Causes(
        shift_px=shift,
        rms_px=float(np.sqrt(max(square - noise, 0.0))),
        rms_std_px=float(np.sqrt(noise / (2 * _TERMS))),
        gain=found[first : first + 2],
        common_std=common,
        difference_std=difference,
        drift=float(found[-1]),
        drift_std=float(np.sqrt(covariance[-1, -1])),
    )


def _excess(left: Floats, normal: Floats, prior: Floats, cell: NDArray[np.intp]) -> float:
    """By how much what cells (n,) ask for scatters more than their noise does: at least 1."""
    ratios = []
    for index in np.unique(cell):
        here = cell == index
        asked, information = left[here].sum(0), normal[here].sum(0)
        solved = np.linalg.solve(information + np.diag(prior), asked)
        known = np.trace(np.linalg.solve(information + np.diag(prior), information))
        ratios.append(float(asked @ solved) / max(known, 1.0))
    return max(float(np.mean(ratios)), 1.0)


def cause_findings(probe: Probe) -> Iterator[FitFinding]:
    """What the probed pixels of a scan say about each part of the model."""
    causes = fit_causes(probe)
    yield _film(causes, probe)
    yield from _gains(causes)
    for index, (value, std) in enumerate(zip(probe.lines.values, probe.lines.std, strict=True)):
        yield _profile(PROFILE[index], float(value), float(std))
    yield _finding(
        ("light", "change of the light over the scan", "1"),
        causes.drift,
        causes.drift_std,
        MOST_DRIFT,
        f"The light has changed by {causes.drift:+.1%} from the first line to the last.",
        "Let the projector warm up for longer.",
    )
    usual = float(np.median(probe.chi_square))
    yield FitFinding(
        part="profile",
        name="chi-square of most pixels",
        value=usual,
        unit="1",
        limit=MOST_CHI_SQUARE,
        significant=usual > MOST_CHI_SQUARE,
        sentence=f"Frames of most pixels differ from the model by {np.sqrt(usual):.1f} times their noise.",
        advice=_CALIBRATE,
    )


def _film(causes: Causes, probe: Probe) -> FitFinding:
    plus, minus = causes.shift_px[probe.sound].mean(0)
    return _finding(
        ("film", "place of the first orders", "px"),
        causes.rms_px,
        causes.rms_std_px,
        MOST_SHIFT_PX,
        f"Wavelengths are off by {causes.rms_px * probe.nm_per_px:.2f} nm: order +1 lies {plus:+.3f} columns"
        f" from its place, order -1 {minus:+.3f}, on average; the film has moved or is bent otherwise.",
        "Run the drift check, and calibrate the depth stage again.",
    )


def _gains(causes: Causes) -> Iterator[FitFinding]:
    plus, minus = causes.gain
    # What both orders share is between them and the zero order, which other settings measure.
    common = float(np.sign(plus) * min(abs(plus), abs(minus))) if plus * minus > 0 else 0.0
    yield _finding(
        ("orders", "difference between the gains of the orders", "1"),
        float(plus - minus),
        causes.difference_std,
        MOST_GAIN,
        f"Order +1 is {plus:+.1%} and order -1 {minus:+.1%} brighter than the zero order lets expect.",
        "Calibrate the efficiency of the orders again with the bandpass filters.",
    )
    yield _finding(
        ("response", "gain of both orders against the zero order", "1"),
        common,
        causes.common_std,
        MOST_GAIN,
        f"Both first orders are {common:+.1%} brighter than the zero order lets expect: the response to level"
        " or exposure is not as calibrated.",
        "Repeat the self-test.",
    )


def _profile(name: str, value: float, std: float) -> FitFinding:
    blur = name == "blur"
    return _finding(
        ("profile", f"{name} of the lines", "1"),
        value,
        std,
        MOST_BLUR if blur else MOST_TAIL,
        f"Lines are {value:+.1%} more blurred than the calibration says."
        if blur
        else f"{abs(value):.1%} of the light of a line lies {'' if value > 0 else 'less '}in its tails.",
        "Repeat the self-test with the projector in focus.",
    )


def _finding(
    what: tuple[str, str, str], value: float, std: float, limit: float, sentence: str, advice: str
) -> FitFinding:
    part, name, unit = what
    return FitFinding.model_validate(
        {
            "part": part,
            "name": name,
            "value": value,
            "std": std,
            "unit": unit,
            "limit": limit,
            "significant": abs(value) > max(limit, SIGMAS * std),
            "sentence": sentence,
            "advice": advice,
        }
    )
