"""Which part of the model does not fit: findings from the probed pixels of a scan."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from dsl_core.model.fit import FitFinding
from dsl_core.reconstruction.spectral.causes import (
    MOST_GAIN,
    MOST_SHIFT_PX,
    SIGMAS,
    Causes,
    fit_causes,
    matters,
)
from dsl_core.reconstruction.spectral.film_motion import LEAST_MOTION_PX, FilmMotion
from dsl_core.reconstruction.spectral.line_probe import PROFILE
from dsl_core.reconstruction.spectral.probe import Probe

#: What matters of blur and tail of the lines, and of the light over the scan.
MOST_BLUR, MOST_TAIL, MOST_DRIFT = 0.03, 0.004, 0.014
#: Chi-square of most pixels above which no cause explains the frames.
MOST_CHI_SQUARE = 1.5
#: Said of what spectra already follow.
CORRECTED = " The spectra of this result are corrected for it."
#: Words, decimals and unit of the numbers of a film, as in `FIELDS`.
_MOTIONS = (
    ("tilted about the horizontal", 2, "°"),
    ("tilted about the vertical", 2, "°"),
    ("turned in its plane", 2, "°"),
    ("bent", 5, "/mm"),
    ("away from the projector", 2, " mm"),
)
_CALIBRATE = "Run the drift check; calibrate again the part that it names."


def cause_findings(
    probe: Probe, corrected: bool | None = None, motion: FilmMotion | None = None
) -> Iterator[FitFinding]:
    """What the probed pixels of a scan say about each part of the model.

    ``corrected`` results follow what was found of the orders' light; where that was tried and did not make
    the frames fit better (False), it is not a finding. ``motion`` is that of the film, which the model of
    the probe follows already.
    """
    causes = fit_causes(probe)
    if motion is not None:
        yield _motion(motion, probe)
    place = _film(causes, probe)
    yield place.model_copy(update={"significant": place.significant and probe.places})
    for finding in _gains(causes, bool(corrected)):
        refuted = corrected is False and finding.part == "orders"
        yield finding.model_copy(update={"significant": finding.significant and not refuted})
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


def _motion(motion: FilmMotion, probe: Probe) -> FitFinding:
    surely = np.abs(motion.values) > SIGMAS * motion.std
    clauses = [
        f"{words} by {value:+.{digits}f} ± {std:.{digits}f}{unit}"
        for (words, digits, unit), value, std, sure in zip(
            _MOTIONS, motion.values, motion.std, surely, strict=True
        )
        if sure
    ]
    return FitFinding(
        part="film",
        name="movement of the film",
        value=motion.shift_px,
        std=motion.shift_std_px,
        unit="px",
        limit=LEAST_MOTION_PX,
        significant=True,
        sentence=f"The film has moved since the calibration: {', '.join(clauses)}. This displaces wavelengths"
        f" by {motion.shift_px * probe.nm_per_px:.2f} nm." + CORRECTED,
        advice="Fix the film so that it cannot slip; if it moves further, repeat the depth-stage calibration."
        " The level of the light may have changed, too, which no scan can tell: the drift check with the"
        " Spectralon does.",
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


def _gains(causes: Causes, corrected: bool) -> Iterator[FitFinding]:
    plus, minus = causes.gain
    common = causes.common_gain
    yield _finding(
        ("orders", "difference between the gains of the orders", "1"),
        float(plus - minus),
        causes.difference_std,
        MOST_GAIN,
        f"Order +1 is {plus:+.1%} and order -1 {minus:+.1%} brighter than the zero order lets expect."
        + CORRECTED * corrected,
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
            "significant": matters(value, std, limit),
            "sentence": sentence,
            "advice": advice,
        }
    )
