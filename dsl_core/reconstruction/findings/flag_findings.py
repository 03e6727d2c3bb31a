"""What flags of a result and its spectra, counted, say of how well the model fits."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import astuple, dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.fit import FitFinding, Part
from dsl_core.model.result import DEPTH_INVALID, Flag, Reach

#: Shares of pixels above which a scan is not what the twin's scenes lead to expect.
MOST_POOR, MOST_AT_BOUND, MOST_LOST, MOST_UNUSUAL = 0.4, 0.1, 0.1, 0.02
#: Side of an area (px), pixels of it that count at least, and their share that makes it an area of a kind;
#: the shares of the picture that such areas may have.
AREA_PX, AREA_PIXELS, AREA_SHARE, MOST_POOR_AREA, MOST_COARSE_AREA = 5, 15, 0.8, 0.02, 0.05
MOST_UNUSUAL_AREA = 0.003
#: Mean of a band that no matt surface exceeds: a spectrum at the upper bound says something only where its
#: deviation excludes all below.
BRIGHTEST = 0.99
#: Fewer pixels say nothing.
FEWEST = 50
#: Names of what is found of spectra that do not explain the frames, in areas, and here and there.
POOR_AREAS, POOR_FIT = "poor fit of whole areas", "poor fit"


@dataclass(frozen=True)
class SpectralCounts:
    """Of spectra: pixels that measured ``poor`` fits or are ``at_bound``, and what there are of bands.

    Spectra that fit poorly touch bounds as well, as along edges: these count as ``poor`` alone. Those of dark
    surfaces touch 0 by their noise: only the upper bound counts. ``reached`` are bands of pixels that lines
    reach, ``undecided`` those of them that the prior decides, and ``unreached`` those of no first order.
    """

    poor: int = 0
    at_bound: int = 0
    reached: int = 0
    undecided: int = 0
    unreached: int = 0

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
        unreached=int(np.count_nonzero(np.isfinite(data_share) & ~reached)),
    )


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
        yield from _of_coverage(flags, is_lit, is_measured)
    if measured < FEWEST:
        return
    for finding in _of_peaks(flags, is_measured):
        yield finding.model_copy(update={"significant": finding.significant and not blurred})
    yield _of_columns(flags, is_measured)
    if spectra is not None:
        yield from _of_spectra(flags, is_measured, spectra)


def _of_coverage(
    flags: NDArray[np.integer], is_lit: NDArray[np.bool_], is_measured: NDArray[np.bool_]
) -> Iterator[FitFinding]:
    """Lit pixels without a depth."""
    lit, measured = int(np.count_nonzero(is_lit)), int(np.count_nonzero(is_measured))
    # Of a depth that is out of range, light was enough to find it.
    cause = flags & int(Flag.SATURATED | Flag.OUT_OF_RANGE)
    too_bright = int(np.count_nonzero(is_lit & ~is_measured & (cause == int(Flag.SATURATED))))
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


def _of_peaks(flags: NDArray[np.integer], is_measured: NDArray[np.bool_]) -> Iterator[FitFinding]:
    """Lines that have another shape than in most pixels, here and there and in whole areas."""
    measured, unusual = int(np.count_nonzero(is_measured)), (flags & int(Flag.UNUSUAL_PEAK)) != 0
    yield _share(
        "profile",
        "lines of another shape",
        int(np.count_nonzero(unusual)) / measured,
        MOST_UNUSUAL,
        "Lines have another shape in {0} of the pixels than in most: surfaces out of focus, steep,"
        " translucent or glossy ones, or light from surface to surface. Depth is less sure there, as"
        " stated, and reflectances lack the light that leaves a surface next to the line.",
        "Look at the flags; narrow the aperture or move the object nearer to the focus.",
    )
    yield _share(
        "profile",
        "areas of lines of another shape",
        in_areas(unusual, is_measured) / measured,
        MOST_UNUSUAL_AREA,
        "Lines have another shape in areas that hold {0} of the pixels: light leaves a translucent"
        " surface elsewhere than where it entered, and depth there is less sure, as stated.",
        "Look at a picture of the flags; a matt coat, such as chalk spray, shows the surface itself.",
    )


def _of_columns(flags: NDArray[np.integer], is_measured: NDArray[np.bool_]) -> FitFinding:
    coarse = (flags & int(Flag.NOT_REFINED | Flag.SATURATED)) == int(Flag.NOT_REFINED)
    return _share(
        "profile",
        "areas without refined columns",
        in_areas(coarse, is_measured) / int(np.count_nonzero(is_measured)),
        MOST_COARSE_AREA,
        "In areas that hold {0} of the pixels, lines have no peak that tells columns better than the"
        " binary code does: surfaces are too dark, translucent, glossy or far out of focus there.",
        "Depth is coarse there, as stated. Expose dark surfaces for longer; see the flags.",
    )


def _of_spectra(
    flags: NDArray[np.integer], is_measured: NDArray[np.bool_], spectra: SpectralCounts
) -> Iterator[FitFinding]:
    """Spectra that do not explain the frames, and those at the upper bound."""
    measured = int(np.count_nonzero(is_measured))
    of_areas = in_areas((flags & int(Flag.POOR_FIT)) != 0, is_measured)
    yield _share(
        "surfaces",
        POOR_AREAS,
        of_areas / measured,
        MOST_POOR_AREA,
        "No spectrum explains the line frames of whole areas, which hold {0} of the pixels: surfaces there"
        " are fluorescent, translucent, glossy or finer than pixels, or receive light from other surfaces; or"
        " dirt on the film dims an order there.",
        "Look at a picture of the flags: reflectances there are not to be trusted beyond their deviations."
        " Areas that stay where they are with another target are of the film: clean it.",
    )
    yield _share(
        "mixed pixels",
        POOR_FIT,
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
