"""Everything found about the fit of a result: by its flags, its bands and its scan's probed pixels."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import astuple, dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.fit import SIGMAS, Fit, FitFinding, Part, matters
from dsl_core.model.plan import CapturePlan
from dsl_core.model.result import DEPTH_INVALID, Flag, Reach
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.optics.correspondence import GratingModel
from dsl_core.optics.lines.line_set import LineSet
from dsl_core.optics.spectra import ORDERS
from dsl_core.reconstruction.spectral.causes import (
    MOST_CURVES,
    MOST_DRIFT,
    MOST_GAIN,
    MOST_SHIFT_PX,
    Causes,
    fit_causes,
)
from dsl_core.reconstruction.spectral.evenness import MOST_UNEVEN, fit_evenness
from dsl_core.reconstruction.spectral.film_motion import LEAST_MOTION_PX, FilmMotion, coarseness
from dsl_core.reconstruction.spectral.model_error import ModelError
from dsl_core.reconstruction.spectral.probing.curve_probe import USUAL_STEEPNESS, CurveMisfit
from dsl_core.reconstruction.spectral.probing.line_probe import PROFILE
from dsl_core.reconstruction.spectral.probing.probe import Probe
from dsl_core.reconstruction.spectral.self_correction import Followed

#: Shares of pixels above which a scan is not what the twin's scenes lead to expect.
MOST_POOR, MOST_AT_BOUND, MOST_LOST, MOST_UNDECIDED, MOST_UNUSUAL = 0.4, 0.1, 0.1, 0.5, 0.02
#: Side of an area (px), pixels of it that count at least, and their share that makes it an area of a kind;
#: the shares of the picture that such areas may have.
AREA_PX, AREA_PIXELS, AREA_SHARE, MOST_POOR_AREA, MOST_COARSE_AREA = 5, 15, 0.8, 0.02, 0.05
MOST_UNUSUAL_AREA = 0.003
#: Mean of a band that no matt surface exceeds: a spectrum at the upper bound says something only where its
#: deviation excludes all below.
BRIGHTEST = 0.99
#: Bands wider than this many lines leave structure in the data that straight pieces cannot follow.
WIDEST_BAND = 1.25
#: Fewer pixels say nothing.
FEWEST = 50
#: Blur and tail of the lines below which neither is worth a finding.
MOST_BLUR, MOST_TAIL = 0.03, 0.004
#: Relative deviation of a blur beyond which lines, side by side in few frames, do not show it: what they seem
#: to show then is light that translucent surfaces spread.
UNSURE_BLUR = 0.1
#: Chi-square of most pixels above which no cause explains the frames.
MOST_CHI_SQUARE = 1.5
#: Share of one order's displacement that the other's must have if uneven lines may be the cause.
ALIKE = 0.4
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


@dataclass(frozen=True)
class SpectralCounts:
    """Of spectra: pixels that measured ``poor`` fits or are ``at_bound``, and what there are of bands.

    Spectra that fit poorly touch bounds as well, as along edges: these count as ``poor`` alone. Those of dark
    surfaces touch 0 by their noise: only the upper bound counts. ``reached`` are bands of pixels that lines
    reach, ``undecided`` those of them that the prior decides.
    """

    poor: int = 0
    at_bound: int = 0
    reached: int = 0
    undecided: int = 0

    def __add__(self, other: SpectralCounts) -> SpectralCounts:
        return SpectralCounts(*(a + b for a, b in zip(astuple(self), astuple(other), strict=True)))


def count_spectra(
    flags: NDArray[np.integer],
    data_share: NDArray[np.floating],
    reach: NDArray[np.integer],
    reflectance: NDArray[np.floating],
    std: NDArray[np.floating],
) -> SpectralCounts:
    """Counts of the flags (rows, columns) of a result with spectra, or of some rows of it.

    ``data_share``, ``reach``, ``reflectance`` and its deviation ``std`` (bands, rows, columns) are NaN where
    there is no spectrum, and ``reach`` is 0.
    """
    _, measured = _lit_and_measured(flags)
    reached = (reach & int(Reach.PLUS_ONE | Reach.MINUS_ONE) != 0) & np.isfinite(data_share)
    poor, at_bound = ((flags & int(flag)) != 0 for flag in (Flag.POOR_FIT, Flag.AT_BOUND))
    at_bound &= (reflectance - 2 * std > BRIGHTEST).any(0)
    return SpectralCounts(
        poor=int(np.count_nonzero(measured & poor)),
        at_bound=int(np.count_nonzero(measured & at_bound & ~poor)),
        reached=int(np.count_nonzero(reached)),
        undecided=int(np.count_nonzero(reached & (data_share < 0.5))),
    )


def fit_of(
    rig: Rig,
    plan: CapturePlan,
    grid: WavelengthGrid,
    depth_mm: NDArray[np.floating],
    flags: NDArray[np.integer],
    spectra: SpectralCounts | None,
    followed: Followed | None = None,
    error: ModelError | None = None,
    earlier: Iterable[FitFinding] = (),
) -> Fit:
    """The verdict on a result with these depths and flags (rows, columns), and what was found on the way.

    ``followed`` is what its scan says of the model, where it can say anything, and ``error`` what is left.
    """
    findings = [*earlier]
    blurred = any(finding.significant and finding.part == "focus" for finding in findings)
    findings += share_findings(flags, spectra, blurred)
    width_nm = line_width_nm(rig, plan, grid, depth_mm)
    if spectra is not None and width_nm is not None:
        findings += band_findings(grid.step_nm, width_nm, spectra)
    if followed is not None:
        findings += cause_findings(followed.probe, followed.balanced, followed.motion)
    return Fit.of(findings, () if error is None else np.round(error.relative, 4).tolist())


def line_width_nm(
    rig: Rig, plan: CapturePlan, grid: WavelengthGrid, depth_mm: NDArray[np.floating]
) -> float | None:
    """Width of a projected line over wavelength at the median depth of the picture's middle.

    None where patterns are no lines or no order reaches the middle.
    """
    import torch

    lines = LineSet.of(plan)
    known = depth_mm[np.isfinite(depth_mm)]
    if lines is None or known.size == 0:
        return None
    height, width = depth_mm.shape
    pixel = torch.tensor([height // 2 * width + width // 2])
    depth = torch.tensor([float(np.median(known))], dtype=torch.float64)
    ends = np.array([grid.start_nm, grid.stop_nm], np.float64)
    slopes = []
    for order in ORDERS:
        columns = GratingModel(rig).trace(pixel, depth, order, ends).columns
        slopes.append(float((columns[1] - columns[0]).abs().max()) / float(ends[1] - ends[0]))
    dispersion = max((slope for slope in slopes if np.isfinite(slope)), default=0.0)
    return lines.width_px / dispersion if dispersion > 0 else None


def _lit_and_measured(flags: NDArray[np.integer]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    lit = (flags & int(Flag.NO_LIGHT)) == 0
    return lit, lit & ((flags & int(DEPTH_INVALID)) == 0)


def share_findings(
    flags: NDArray[np.integer], spectra: SpectralCounts | None, blurred: bool = False
) -> Iterator[FitFinding]:
    """Findings from the flags (rows, columns) of a result, and from what was counted of its spectra.

    Where the camera is known to be ``blurred``, lines of another shape along edges are no news.
    """
    is_lit, is_measured = _lit_and_measured(flags)
    lit, measured = int(np.count_nonzero(is_lit)), int(np.count_nonzero(is_measured))
    if lit >= FEWEST:
        too_bright = int(np.count_nonzero(is_lit & ~is_measured & ((flags & int(Flag.SATURATED)) != 0)))
        yield _share(
            "exposure",
            "overexposed pixels without a depth",
            too_bright / lit,
            MOST_LOST,
            "{0} of the lit pixels have no depth because they are overexposed in every setting.",
            "Expose for a shorter time or with a lower level, or add a darker setting to the plan.",
        )
        lost = lit - measured - too_bright
        yield _share("coverage", "lit pixels without a depth", lost / lit, MOST_LOST, *_of_lost(flags, lost))
    if measured >= FEWEST:
        shape = _share(
            "profile",
            "lines of another shape",
            int(np.count_nonzero((flags & int(Flag.UNUSUAL_PEAK)) != 0)) / measured,
            MOST_UNUSUAL,
            "Lines have another shape in {0} of the pixels than in most: surfaces out of focus, steep,"
            " translucent or glossy ones, or light from surface to surface. Depth is less sure there, as"
            " stated, and reflectances lack the light that leaves a surface next to the line.",
            "Look at the flags; narrow the aperture or move the object nearer to the focus.",
        )
        yield shape.model_copy(update={"significant": shape.significant and not blurred})
        areas = _share(
            "profile",
            "areas of lines of another shape",
            in_areas((flags & int(Flag.UNUSUAL_PEAK)) != 0, is_measured) / measured,
            MOST_UNUSUAL_AREA,
            "Lines have another shape in areas that hold {0} of the pixels: light leaves a translucent"
            " surface elsewhere than where it entered, and depth there is less sure, as stated.",
            "Look at a picture of the flags; a matt coat, such as chalk spray, shows the surface itself.",
        )
        yield areas.model_copy(update={"significant": areas.significant and not blurred})
        coarse = (flags & int(Flag.NOT_REFINED | Flag.SATURATED)) == int(Flag.NOT_REFINED)
        yield _share(
            "profile",
            "areas without refined columns",
            in_areas(coarse, is_measured) / measured,
            MOST_COARSE_AREA,
            "In areas that hold {0} of the pixels, lines have no peak that tells columns better than the"
            " binary code does: surfaces are too dark, translucent, glossy or far out of focus there.",
            "Depth is coarse there, as stated. Expose dark surfaces for longer; see the flags.",
        )
    if spectra is None or measured < FEWEST:
        return
    of_areas = in_areas((flags & int(Flag.POOR_FIT)) != 0, is_measured)
    yield _share(
        "surfaces",
        "poor fit of whole areas",
        of_areas / measured,
        MOST_POOR_AREA,
        "No spectrum explains the line frames of whole areas, which hold {0} of the pixels: surfaces there"
        " are fluorescent, translucent, glossy or finer than pixels, or receive light from other surfaces.",
        "Look at a picture of the flags: reflectances there are not to be trusted beyond their deviations.",
    )
    yield _share(
        "mixed pixels",
        "poor fit",
        (spectra.poor - of_areas) / measured,
        MOST_POOR,
        "No spectrum explains the line frames of {0} of the pixels, here and there.",
        "Look at a picture of the flags: along edges a pixel sees two materials, and more pixels help.",
    )
    yield _share(
        "light",
        "at the upper bound",
        spectra.at_bound / measured,
        MOST_AT_BOUND,
        "The spectra of {0} of the pixels touch 1.5, and more than by their noise.",
        "Look for highlights and for light that the scan's black frames do not have.",
    )


def in_areas(is_kind: NDArray[np.bool_], is_measured: NDArray[np.bool_]) -> int:
    """How many measured pixels (rows, columns) belong to whole areas of a kind, not to edges."""
    from scipy.ndimage import uniform_filter

    cells = AREA_PX**2
    of_kind, measured = (
        uniform_filter(mask.astype(np.float64), AREA_PX, mode="constant") * cells
        for mask in (is_kind & is_measured, is_measured)
    )
    inside = is_kind & is_measured & (measured > AREA_PIXELS - 0.5) & (of_kind > AREA_SHARE * measured)
    return int(np.count_nonzero(inside))


def _of_lost(flags: NDArray[np.integer], lost: int) -> tuple[str, str]:
    """What is said of so many lit pixels without a depth, and what to do."""
    known = (flags & int(DEPTH_INVALID)) == int(Flag.OUT_OF_RANGE)
    if np.count_nonzero(known) > lost / 2:
        return (
            "{0} of the lit pixels have no depth, most of them for it is not among those that the rig is"
            " calibrated for.",
            "Nothing is wrong if they show a background, or what is nearer. If not, something moved, or the"
            " calibration is of another rig.",
        )
    return (
        "{0} of the lit pixels have no depth.",
        "See the flags: codes that disagree or a depth out of range tell of motion, of surfaces that"
        " light each other, or of another rig's calibration.",
    )


def _share(part: Part, name: str, share: float, limit: float, sentence: str, advice: str) -> FitFinding:
    return FitFinding.judged(part, name, share, "share", limit, sentence.format(f"{share:.0%}"), advice)


def band_findings(step_nm: float, line_nm: float, spectra: SpectralCounts) -> Iterator[FitFinding]:
    """Whether bands of ``step_nm`` suit lines that are ``line_nm`` wide, and what data there are."""
    wide = step_nm / line_nm
    yield FitFinding.judged(
        "bands",
        "width of a band in lines",
        wide,
        "1",
        WIDEST_BAND,
        f"Bands of {step_nm:g} nm are coarse for lines that are {line_nm:.0f} nm wide.",
        f"Reconstruct with bands of at most {line_nm:.0f} nm.",
    )
    if spectra.reached < FEWEST:
        return
    undecided = spectra.undecided / spectra.reached
    yield FitFinding.judged(
        "bands",
        "bands that lines reach and the prior decides",
        undecided,
        "share",
        MOST_UNDECIDED,
        f"Bands of {step_nm:g} nm are too fine for the data, which leave {undecided:.0%} open.",
        "Reconstruct with wider bands, or expose longer.",
    )


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
    told = place.significant and probe.places and causes.displaced
    yield place.model_copy(update={"significant": told})
    for finding in _gains(causes, bool(corrected)):
        unequal = corrected is not False and causes.unequal
        refuted = not (unequal if finding.part == "orders" else causes.brighter)
        yield finding.model_copy(update={"significant": finding.significant and not refuted})
    for index, (value, std) in enumerate(zip(probe.lines.values, probe.lines.std, strict=True)):
        yield _profile(PROFILE[index], float(value), float(std))
    drift = FitFinding.judged(
        "light",
        "change of the light over the scan",
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
            "disagreement of the colours",
            (probe.curves.rms, probe.curves.std),
            "1",
            MOST_CURVES,
            "The colours of the camera disagree about the same light: curves of camera and projector are off"
            f" by about {probe.curves.rms:.1%}, and so are spectra.",
            "Calibrate the curves on this rig; those of data sheets are typically off by 5 %.",
        )
        yield _wide_bands(probe, probe.curves)
    usual = probe.usual_chi_square
    yield FitFinding.judged(
        "profile",
        "misfit of most pixels",
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
        "evenness of the projector's light",
        (light.change, light.std),
        "1",
        MOST_UNEVEN,
        f"The projector's light changes by {light.change:+.1%} from the middle of its frame to its left and"
        f" right. Lines of one wavelength are brighter than those of another: reflectances are off by about"
        f" {light.error:.1%}, as stated.",
        "Scan with the object in the middle of the projector's frame, where its light is even; no flat field"
        " of the camera corrects this.",
    )
    yield found.model_copy(update={"significant": light.matters})


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
        " Spectralon does." + _OR_TURNED,
    )


def _film(causes: Causes, probe: Probe) -> FitFinding:
    plus, minus = causes.mean_px
    # Light that is brighter on one side of a line displaces both orders to that side.
    alike = plus * minus > 0 and min(abs(plus), abs(minus)) > ALIKE * max(abs(plus), abs(minus))
    lines = ", or the light of lines is less even than calibrated" if alike else ""
    return FitFinding.judged(
        "film",
        "place of the first orders",
        (causes.rms_px, causes.rms_std_px),
        "px",
        MOST_SHIFT_PX * coarseness(probe.step_nm),
        f"Wavelengths are off by {causes.rms_px * probe.nm_per_px:.2f} nm: order +1 lies {plus:+.3f} columns"
        f" from its place, order -1 {minus:+.3f}, on average; the film has moved or is bent"
        f" otherwise{lines}.",
        "Run the drift check, and calibrate the depth stage again." + _OR_TURNED,
    )


def _gains(causes: Causes, corrected: bool) -> Iterator[FitFinding]:
    plus, minus = causes.gain
    common = causes.common_gain
    yield FitFinding.judged(
        "orders",
        "difference between the gains of the orders",
        (float(plus - minus), causes.difference_std),
        "1",
        MOST_GAIN,
        f"The brightness of order +1 differs by {plus:+.1%} and that of order -1 by {minus:+.1%} from what"
        " the zero order predicts." + CORRECTED * corrected,
        "Calibrate the efficiency of the orders again with the bandpass filters.",
    )
    yield FitFinding.judged(
        "response",
        "gain of both orders against the zero order",
        (common, causes.common_std),
        "1",
        MOST_GAIN,
        f"The brightness of both first orders differs by {common:+.1%} from what the zero order predicts: the"
        " response to level or exposure is not as calibrated. Deviations of reflectance contain it.",
        "Repeat the self-test.",
    )


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
