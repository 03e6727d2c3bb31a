"""What the probed pixels of a scan say about each part of the model, in sentences."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from dsl_core.model.fit import SIGMAS, FitFinding, matters
from dsl_core.reconstruction.calibration_age import CHANGED_REL_STD
from dsl_core.reconstruction.spectral.causes import (
    MOST_CURVES,
    MOST_DRIFT,
    MOST_GAIN,
    MOST_SECOND,
    MOST_SHIFT_PX,
    Causes,
    fit_causes,
)
from dsl_core.reconstruction.spectral.evenness import MOST_UNEVEN, fit_evenness
from dsl_core.reconstruction.spectral.film_motion import LEAST_MOTION_PX, FilmMotion, coarseness
from dsl_core.reconstruction.spectral.probing.curve_probe import USUAL_STEEPNESS, CurveMisfit
from dsl_core.reconstruction.spectral.probing.line_probe import PROFILE
from dsl_core.reconstruction.spectral.probing.probe import Probe
from dsl_core.reconstruction.spectral.turned import Turn
from dsl_core.solve.normal import BAND_95

#: Names of what is found of the light of both orders, and of one against the other.
GAIN_OF_BOTH = "gain of both orders against the zero order"
ORDERS_APART = "difference between the gains of the orders"
#: With less light of both first orders than this, relative to what is expected, there is no film.
WITHOUT_FILM = -0.7
#: Blur and tail of the lines below which neither is worth a finding.
MOST_BLUR, MOST_TAIL = 0.03, 0.004
#: Relative deviation of a blur beyond which lines, side by side in few frames, do not show it: what they seem
#: to show then is light that translucent surfaces spread.
UNSURE_BLUR = 0.06
#: Gains of the camera's colours that are worth a finding.
MOST_COLOUR_GAIN = 0.03
#: Second orders that are known no better, relative to the light of the first, are not told.
KNOWN_SECOND = 0.05
#: Chi-square of most pixels above which no cause explains the frames.
MOST_CHI_SQUARE = 1.5
#: Share of one order's displacement that the other's must have if uneven lines may be the cause.
ALIKE = 0.4
#: Name of what is found of the film as a whole.
MOVED = "movement of the film"
#: Name of what is found of the pose in its place.
TURNED = "turn of camera or projector"
#: Share of depth that a turn must put in doubt to be told beside a motion of the film.
LEAST_DEPTH_SHARE = 0.001
#: Name of what is left of a drift of the light.
DRIFT_LEFT = "change of the light over the scan"
#: Name of what is found of the light from the middle of the projector's frame to its sides.
EVENNESS = "evenness of the projector's light"
#: Name of what is found of the second orders.
SECONDS = "light of the second orders"
#: Names of what is found of the colours of the camera, and of all that frames and model differ by.
COLOURS_DISAGREE, COLOUR_GAINS = "disagreement of the colours", "gains of the camera's colours, blue from red"
MISFIT = "misfit of most pixels"
#: Added to findings whose effect the spectra of the result already allow for.
CORRECTED = " The spectra of this result are corrected for it."
#: Words, decimals and unit of the numbers of a film, as in `FIELDS`.
_MOTIONS = (
    ("tilted about the horizontal", 2, "°"),
    ("tilted about the vertical", 2, "°"),
    ("turned in its plane", 2, "°"),
    ("bent", 5, "/mm"),
    ("away from the projector", 2, " mm"),
)
_CALIBRATE = "run the drift check; calibrate again the part that it names."
#: Turned by 0.05 degrees, a camera displaces orders like a film 0.3 mm farther away, and depth by 1 %.
_OR_TURNED = (
    " A camera or projector that has turned a little displaces the orders alike, and then depth is off, too:"
    " measure a surface at a known distance."
)


def cause_findings(
    probe: Probe,
    corrected: bool | None = None,
    motion: FilmMotion | None = None,
    calibrated_px: float = 0.0,
    turn: Turn | None = None,
) -> Iterator[FitFinding]:
    """What the probed pixels of a scan say about each part of the model.

    ``corrected`` results follow what was found of the orders' light; where that was tried and did not make
    the frames fit better (False), it is not a finding. ``motion`` is that of the film, which the model of
    the probe follows already, and ``calibrated_px`` how far (rms) first orders lay from their places when
    these were calibrated, 0 where nobody noted it. ``turn`` is what of that may be a changed pose.
    """
    causes = fit_causes(probe)
    if causes.common_gain + SIGMAS * causes.common_std < WITHOUT_FILM:
        # All else that frames lack follows from that.
        yield _without_film(causes)
        return
    if motion is not None:
        of_film = _motion(motion, probe, calibrated_px, turn)
        if turn is None:
            yield of_film
        elif turn.instead:
            yield from (_turn(turn, motion), of_film)
        else:
            yield from (of_film, _turn(turn, motion))
    place = _film(causes, probe)
    # Light that has changed its colour is told as that.
    by_light = motion is not None and motion.by_light
    told = place.significant and probe.places and causes.displaced and not by_light
    yield place.model_copy(update={"significant": told})
    for finding in _gains(causes, bool(corrected)):
        unequal = corrected is not False and causes.unequal
        refuted = not (unequal if finding.part == "orders" else causes.brighter)
        yield finding.model_copy(update={"significant": finding.significant and not refuted})
    yield from _seconds(causes, corrected)
    if probe.lines is not None:
        for name, value, std in zip(PROFILE, probe.lines.values, probe.lines.std, strict=True):
            yield _profile(name, float(value), float(std))
    drift = FitFinding.judged(
        "light",
        DRIFT_LEFT,
        (causes.drift, causes.drift_std),
        "1",
        MOST_DRIFT,
        f"The light has changed by {causes.drift:+.1%} from the first line to the last.",
        "Let the projector warm up for longer.",
    )
    yield drift.model_copy(update={"significant": causes.drifts})
    yield from _evenness(probe)
    if probe.curves is not None:
        yield FitFinding.judged(
            "curves",
            COLOURS_DISAGREE,
            (probe.curves.rms, probe.curves.std),
            "1",
            MOST_CURVES,
            "The colours of the camera disagree about the same light: curves of camera and projector are off"
            f" by about {probe.curves.rms:.1%}, and so are spectra.",
            "Calibrate the curves on this rig; those of data sheets are typically off by 5 %.",
        )
        yield _wide_bands(probe, probe.curves)
    yield from _colour_gains(probe, told)
    usual = probe.usual_chi_square
    yield FitFinding.judged(
        "profile",
        MISFIT,
        float(np.sqrt(usual)),
        "deviations",
        MOST_CHI_SQUARE**0.5,
        f"Frames of most pixels differ from the model by {np.sqrt(usual):.1f} times their noise.",
        f"Surfaces that light each other, and translucent ones, do that. If there are none: {_CALIBRATE}",
    )


def _evenness(probe: Probe) -> Iterator[FitFinding]:
    light = fit_evenness(probe)
    if light is None:
        return
    found = FitFinding.judged(
        "light",
        EVENNESS,
        (light.change, light.std),
        "1",
        MOST_UNEVEN,
        "The projector's light, or the share of it that the film diffracts, changes by"
        f" {light.change:+.1%} from the middle of its frame to its left and right. Lines of one wavelength"
        f" are brighter than those of another: reflectances are off by about {light.error:.1%}, as stated.",
        "Scan with the object in the middle of the projector's frame, where its light is even; no flat field"
        " of the camera corrects this.",
    )
    yield found.model_copy(update={"significant": light.matters})


def _colour_gains(probe: Probe, displaced: bool) -> Iterator[FitFinding]:
    """Gains of colours; where orders are ``displaced``, the wavelengths of colours are as well."""
    gains = probe.colour_gains
    if gains is None:
        return
    value, std = gains.apart
    found = FitFinding.judged(
        "curves",
        COLOUR_GAINS,
        (value, std),
        "1",
        MOST_COLOUR_GAIN,
        f"Against red, the camera weighs blue by {value:+.1%} ± {std:.1%} otherwise than when it was"
        " calibrated: spectra are off by about as much.",
        "Switch off automatic white balance, set the gains of the camera's colours as they were, and scan"
        " again; or calibrate its response again.",
    )
    yield found.model_copy(update={"significant": found.significant and not displaced})


def _wide_bands(probe: Probe, curves: CurveMisfit) -> FitFinding:
    """Whether colours disagree because the light changes much from one band to the next."""
    fine_nm = probe.step_nm * USUAL_STEEPNESS / probe.steepness
    found = FitFinding.judged(
        "bands",
        "disagreement of the colours by bands",
        (curves.whole_rms, curves.std),
        "1",
        MOST_CURVES,
        f"The light of this rig's LEDs changes {probe.steepness / USUAL_STEEPNESS:.1f} times as fast with the"
        f" wavelength as is usual. Bands of {probe.step_nm:g} nm are coarse for it: where there is little"
        f" light, spectra are off by about {curves.whole_rms:.1%}, as stated.",
        f"Reconstruct with bands of at most {fine_nm:.2g} nm.",
    )
    # What no width of bands explains is told of the curves.
    by_curves = matters(curves.rms, curves.std, MOST_CURVES)
    return found.model_copy(update={"significant": found.significant and not by_curves})


def _turn(turn: Turn, motion: FilmMotion) -> FitFinding:
    """A turn of camera or projector, in the place of a motion of the film or as what that may be as well."""
    off, held = f"depth off by {turn.depth_share:.1%}", turn.believed * turn.depth_share
    if turn.instead:
        told, sentence, advice = (
            True,
            f"First orders lie {motion.shift_px:.2f} px (rms) from their places as if camera and projector"
            f" had moved against each other, which puts {off}: the calibration is of another rig, or of"
            " another pose or zoom. Deviations of depth and of reflectance contain it.",
            "See that the calibration is this rig's, and measure a surface at a known distance; then"
            " calibrate the geometry again.",
        )
    else:
        told, sentence, advice = (
            motion.sure and held > LEAST_DEPTH_SHARE,
            "Instead of the film, camera or projector may have turned a little: that displaces first orders"
            f" alike, and then puts {off}. Nothing in the scan says which. Deviations of depth contain"
            f" {held:.1%} of it for that.",
            "Measure a surface at a known distance; if depth is off, calibrate the geometry again. A plan"
            " whose code has rows tells both apart.",
        )
    return FitFinding(
        part="geometry",
        name=TURNED,
        value=motion.shift_px,
        std=motion.shift_std_px,
        unit="px",
        limit=LEAST_MOTION_PX,
        significant=told,
        sentence=sentence,
        advice=advice,
    )


def _motion(motion: FilmMotion, probe: Probe, calibrated_px: float, turn: Turn | None) -> FitFinding:
    surely = np.abs(motion.values) > SIGMAS * motion.std
    clauses = [
        f"{words} by {value:+.{digits}f} ± {std:.{digits}f}{unit}"
        for (words, digits, unit), value, std, sure in zip(
            _MOTIONS, motion.values, motion.std, surely, strict=True
        )
        if sure
    ]
    by_nm = f"This displaces wavelengths by {motion.shift_px * probe.nm_per_px:.2f} nm."
    # A dent that no record can say is there in every scan, and looks like a motion.
    or_dented = (
        f", or its shape is none that a calibration can record, which left first orders"
        f" {calibrated_px:.2f} px (rms) from their places"
        if motion.may_be_dent(calibrated_px)
        else ""
    )
    unsure = "The light has changed its colour, which looks alike" if motion.by_light else "It may be chance"
    moved = f"moved since the calibration{or_dented}: {', '.join(clauses)}. {by_nm}"
    return FitFinding(
        part="film",
        name=MOVED,
        value=motion.shift_px,
        std=motion.shift_std_px,
        unit="px",
        limit=LEAST_MOTION_PX,
        significant=motion.sure,
        sentence=f"The film has {moved}{CORRECTED}"
        if motion.sure
        else f"The film may have {moved} {unsure}, so that the spectra are not corrected for it."
        + _unsure_depth(turn),
        advice="Fix the film so that it cannot slip; if it moves further, repeat the depth-stage calibration."
        " The level and the colour of the light may have changed, too, which no scan can tell: reflectance"
        f" holds to {BAND_95 * CHANGED_REL_STD:.0%}, as stated, and the drift check with the Spectralon tells"
        " more." + ("" if turn is not None and turn.believed else _OR_TURNED),
    )


def _unsure_depth(turn: Turn | None) -> str:
    """What depth is unsure of by a motion that may be chance."""
    share = 0.0 if turn is None else turn.believed * turn.depth_share
    if share < LEAST_DEPTH_SHARE:
        return ""
    return f" Camera or projector may have turned instead: deviations of depth contain {share:.1%} for that."


def _film(causes: Causes, probe: Probe) -> FitFinding:
    plus, minus = causes.mean_px
    alike = min(abs(plus), abs(minus)) > ALIKE * max(abs(plus), abs(minus))
    too = ""
    if alike and plus * minus > 0:
        # Light that is brighter on one side of a line displaces both orders to that side.
        too = ", or the light of lines is less even than calibrated"
    elif alike:
        # Both orders seem to have other wavelengths, and so has light whose colours have changed.
        too = ", or the projector's colours are not as calibrated (night mode, picture mode, warmer LEDs)"
    return FitFinding.judged(
        "film",
        "place of the first orders",
        (causes.rms_px, causes.rms_std_px),
        "px",
        MOST_SHIFT_PX * coarseness(probe.step_nm),
        f"Wavelengths are off by {causes.rms_px * probe.nm_per_px:.2f} nm: order +1 lies {plus:+.3f} columns"
        f" from its place, order -1 {minus:+.3f}, on average; the film has moved or is bent"
        f" otherwise{too}.",
        "Run the drift check, and calibrate the depth stage again." + _OR_TURNED,
    )


def _without_film(causes: Causes) -> FitFinding:
    return FitFinding.judged(
        "film",
        GAIN_OF_BOTH,
        (causes.common_gain, causes.common_std),
        "1",
        MOST_GAIN,
        "First orders have no light: the film is missing, turned away, or another one than was calibrated."
        " Reflectance is not measured, whatever its deviations say; depth is not concerned.",
        "Mount the film in front of the projector as it was when calibrated, and scan again.",
    )


def _gains(causes: Causes, corrected: bool) -> Iterator[FitFinding]:
    plus, minus = causes.gain
    common = causes.common_gain
    yield FitFinding.judged(
        "orders",
        ORDERS_APART,
        (float(plus - minus), causes.difference_std),
        "1",
        MOST_GAIN,
        f"The brightness of order +1 differs by {plus:+.1%} and that of order -1 by {minus:+.1%} from what"
        " the zero order predicts." + CORRECTED * corrected,
        "Calibrate the efficiency of the orders again with the bandpass filters.",
    )
    yield FitFinding.judged(
        "response",
        GAIN_OF_BOTH,
        (common, causes.common_std),
        "1",
        MOST_GAIN,
        f"The brightness of both first orders differs by {common:+.1%} from what the zero order predicts: the"
        " response to level or exposure is not as calibrated. Deviations of reflectance contain it.",
        "Repeat the self-test.",
    )


def _seconds(causes: Causes, corrected: bool | None) -> Iterator[FitFinding]:
    """The light of second orders, where frames tell of it."""
    more, std = causes.second
    if std > KNOWN_SECOND:
        return
    found = FitFinding.judged(
        "orders",
        SECONDS,
        causes.second,
        "1",
        MOST_SECOND,
        f"Second orders are brighter than the calibration says by {more:+.1%} ± {std:.1%} of the light of the"
        " first." + CORRECTED * bool(corrected),
        "Calibrate the efficiency of the orders again with the bandpass filters.",
    )
    yield found.model_copy(update={"significant": causes.seconds_differ and corrected is not False})


def _profile(name: str, value: float, std: float) -> FitFinding:
    blur = name == "blur"
    made = FitFinding.judged(
        "profile",
        f"{name} of the lines",
        (value, std),
        "1",
        MOST_BLUR if blur else MOST_TAIL,
        f"The blur of lines differs by {value:+.1%} from that of the calibration."
        if blur
        else f"The tails of lines hold {abs(value):.1%} {'more' if value > 0 else 'less'} of their light than"
        " the calibration says.",
        "Repeat the self-test with the projector in focus.",
    )
    shows = not blur or std < UNSURE_BLUR
    return made.model_copy(update={"significant": made.significant and shows})
