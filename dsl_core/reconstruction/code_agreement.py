"""Whether the binary code agrees with refined columns, and its rows with depth, lenses and pose.

Depth follows from columns alone, so a lens or a pose that is not as calibrated displaces surfaces without a
trace in any column. Rows of the code are a second witness: with the depth that its column gives, a pixel
must be lit from the row that its code names. And lines are scanned long after the code: if projector, camera
or scene move meanwhile, refined columns are displaced from those of the code. A code names whole pixels,
but many pixels together tell a displacement to some hundredths.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from dsl_core.model.fit import FitFinding, Part, matters
from dsl_core.model.plan import BinaryCode, CapturePlan, EnsembleCode, GrayCode, XorCode
from dsl_core.model.result import Flag
from dsl_core.model.rig import Rig
from dsl_core.optics.correspondence import zero_order
from dsl_core.patterns.gray_code import DecodedCode
from dsl_core.reconstruction.geometry import Geometry
from dsl_core.reconstruction.named_rows import named_rows
from dsl_core.solve.thinned import thinned
from dsl_core.words import counted

Floats = NDArray[np.float64]

#: Tiles of the picture, down and across, whose rows are compared; columns of the projector compared together.
TILES, COLUMNS_PX = (4, 6), 8
#: Pixels that a group must have, groups that tell something, and how well a group must tell it (px).
FEWEST, FEWEST_GROUPS, TELLING_PX = 60, 4, 0.1
#: Pixels whose rows are compared, about.
MOST_PIXELS = 12_000
#: Displacements that are tried, px, and how finely.
MOST_PX, STEP_PX = 8.0, 0.02
#: Deviations of where a stripe of the code ends (px), and the share of pixels that may say anything. Pixels
#: that see several columns at once cannot tell the finest stripes, and name any of them.
EDGES_PX, STRAY = (0.08, 0.25, 0.5, 0.75, 1.0, 1.5), 0.02
#: Share of a group's pixels on either side of an end of the code's pixels that may be there by error alone.
ODD = 0.05
#: What a group is unsure of however many pixels it has: its pixels are wrong together.
GROUP_STD_PX = 0.02
#: Rms displacements that matter, px: of lines, whose light is not shaped as a stripe's edge, and of rows.
MOST_APART_PX, MOST_ROWS_PX = 0.1, 0.05
#: Where lines are blurred by more than this (rms, px), the finest stripes of a code have no contrast, or an
#: inverted one: it names columns that are off by one or two, by their place, and lines differ by as much.
BLURRED_PX, BLURRED_APART_PX = 1.4, 1.5
#: Groups whose mean is smooth, and the share of a disagreement that has to be smooth if something
#: moved; the share of its mean that changes over the columns if it moved while lines were captured.
SMOOTH_GROUPS, MOST_SMOOTH, CHANGES = 5, 0.5, 0.35
#: How far lines that are not even lie from their stripes at most, relative to the rms width of their light.
UNEVEN = 0.6
#: The most that a film that has moved displaces rows by, px.
MOST_BY_FILM_PX = 0.1
#: Share of the error of columns that is seen in rows: pictures are wider than high, and depth follows rows.
ROWS_TELL = 0.5
#: A number of columns is whole up to this, and explains rows but for this share of their displacement.
NEARLY_WHOLE, LEFT_OVER = 0.15, 0.3
#: Name of what is found of lines.
LINES_AGAINST_CODE = "lines against the binary code"
#: Name of what is found of rows.
ROWS_AGAINST_DEPTH = "rows of the binary code"
#: Pixels that say nothing: their column is not that of one surface, or is not refined.
_DOUBTFUL = Flag.NOT_REFINED | Flag.UNUSUAL_PEAK | Flag.DEPTH_EDGE


@dataclass(frozen=True)
class NamedPlaces:
    """Columns and rows of the projector that a code names, (rows, columns), -1 where it names none.

    What is kept of a decoded code until there is a depth. ``row`` is None where rows are not coded.
    """

    column: NDArray[np.int32]
    row: NDArray[np.int32] | None

    @classmethod
    def of(cls, code: DecodedCode) -> NamedPlaces:
        """Those of a decoded code."""
        return cls(code.column, code.row)


@dataclass(frozen=True)
class Disagreement:
    """By how much groups of pixels are off, with deviations, px: (groups,)."""

    shift_px: Floats
    std_px: Floats

    @classmethod
    def of(cls, shift_px: Floats, std_px: Floats) -> Disagreement | None:
        """Of the groups that tell something; None if these are too few."""
        with np.errstate(invalid="ignore"):
            telling = std_px < TELLING_PX
        return cls(shift_px[telling], std_px[telling]) if telling.sum() >= FEWEST_GROUPS else None

    @property
    def rms_px(self) -> float:
        """Root mean square of the shifts, less what their deviations explain."""
        return rms_beyond_chance(self.shift_px, self.std_px)[0]

    @property
    def rms_std_px(self) -> float:
        """Deviation of the root mean square."""
        return rms_beyond_chance(self.shift_px, self.std_px)[1]

    @property
    def beyond_chance_px(self) -> float:
        """What deviations have to hold of it, also where it is too small for words; 0 where it is chance.

        The mean of all groups is known better than the shift of any.
        """
        mean, std = self.mean_px, float(np.sum(self.std_px**-2.0) ** -0.5)
        told = (self.rms_px, self.rms_std_px), (abs(mean), std)
        return max(value if matters(value, deviation, 0.0) else 0.0 for value, deviation in told)

    @property
    def mean_px(self) -> float:
        """Mean shift, by what each group knows."""
        return float(np.average(self.shift_px, weights=self.std_px**-2.0))

    def smooth(self) -> Floats:
        """Shifts averaged over neighbouring groups, px: what moves does so along the columns, or at once."""
        size = min(SMOOTH_GROUPS, len(self.shift_px))
        weight = np.pad(self.std_px**-2.0, size // 2)
        total = np.convolve(np.pad(self.shift_px, size // 2) * weight, np.ones(size), "valid")
        return np.asarray(total / np.convolve(weight, np.ones(size), "valid"))

    @property
    def worst_px(self) -> float:
        """The largest shift, with its sign."""
        return float(self.shift_px[np.abs(self.shift_px).argmax()])


def code_agreement(
    rig: Rig,
    plan: CapturePlan,
    code: NamedPlaces,
    geometry: Geometry,
    window_px: int | None = None,
    blur_px: float = 0.0,
) -> tuple[Geometry, list[FitFinding]]:
    """Geometry whose deviations hold what the code disagrees by, and what was found.

    Codes of other programs, which may name parts of a pixel, are not asked. ``window_px`` is that of
    `reconstruct_geometry`, ``blur_px`` the rms width of lines as calibrated.
    """
    if not isinstance(plan.code, GrayCode | XorCode | EnsembleCode):
        return geometry, []
    usable = np.isfinite(geometry.depth_mm) & ((geometry.flags & int(_DOUBTFUL)) == 0)
    findings, error_px = [], 0.0
    for found in (
        _of_columns(code, geometry, usable, blur_px),
        _of_rows(rig, plan.code, code, geometry, usable),
    ):
        if found is not None:
            finding, beyond_px = found
            findings.append(finding)
            share = 1.0 if finding.name == LINES_AGAINST_CODE else ROWS_TELL
            off_px = max(finding.value * finding.significant, beyond_px)
            error_px = math.hypot(error_px, off_px / share)
    if error_px > 0:
        geometry = geometry.by(rig, np.full(geometry.depth_mm.shape, np.float32(error_px)), window_px)
    return geometry, findings


def rows_apart_px(findings: Iterable[FitFinding]) -> float | None:
    """By how much rows lie from where depth places them (px, rms), by what was found; None if not told."""
    return next((each.value for each in findings if each.name == ROWS_AGAINST_DEPTH), None)


def rms_beyond_chance(shift_px: Floats, std_px: Floats) -> tuple[float, float]:
    """Root mean square of shifts (n,), less what their deviations explain, and its deviation."""
    rms = math.sqrt(max(float(np.mean(shift_px**2 - std_px**2)), 0.0))
    return rms, float(np.sqrt(np.mean(std_px**2) / len(std_px)))


def displacement(
    named_px: NDArray[np.integer], exact_px: Floats, group: NDArray[np.integer], groups: int
) -> tuple[Floats, Floats]:
    """By how much ``exact_px`` must be moved to agree with the pixels that a code names, group by group.

    The first three are (n,); the displacement of each group and its deviation are (groups,), px, NaN where
    a group has too few pixels. A pixel says that the place is within half a pixel of the named one, and
    nothing about where: groups that see all of their pixels at one phase tell little, and their deviation
    says so. How sure pixels are of it is each group's own.
    """
    # An odd number of places, so that none is preferred.
    most = round((MOST_PX + 1) / STEP_PX)
    centres = STEP_PX * np.arange(-most, most + 1, dtype=np.float64)
    edges = np.append(centres - STEP_PX / 2, centres[-1] + STEP_PX / 2)
    log_likelihoods = [np.log(_named(centres, edge_px)) for edge_px in EDGES_PX]
    tried = centres[np.abs(centres) < MOST_PX - 0.5]
    shifts, stds = np.full((2, groups), np.nan)
    for each, away in enumerate(_by_group(named_px - exact_px, group, groups)):
        seen, _ = np.histogram(away, edges)
        if seen.sum() < FEWEST:
            continue
        score = np.array([_correlated(seen.astype(np.float64), log, len(tried)) for log in log_likelihoods])
        weight = np.exp(score - score.max()).sum(0)
        weight /= weight.sum()
        shifts[each] = weight @ tried
        stds[each] = math.hypot(math.sqrt(float(weight @ (tried - shifts[each]) ** 2)), GROUP_STD_PX)
    return shifts, stds


def _by_group(values: Floats, group: NDArray[np.integer], groups: int) -> list[Floats]:
    """The values (n,) of each group."""
    ends = np.cumsum(np.bincount(group, minlength=groups))
    return np.split(values[np.argsort(group, kind="stable")], ends[:-1])


def _gap_px(places_px: Floats) -> float:
    """How much farther from an end of the code's pixels places are than evenly spread ones, px.

    Where columns of both devices are parallel, a group sees few phases, and the code tells none between them.
    """
    below, above = np.quantile((places_px + 0.5) % 1, (1 - ODD, ODD)) if len(places_px) else (0.0, 1.0)
    return float(above + 1 - below - 2 * ODD)


def _named(away_px: Floats, edge_px: float) -> Floats:
    """Probability that a code names a pixel whose centre is so far from the place that it sees."""
    from scipy.special import ndtr

    inside = ndtr((away_px + 0.5) / edge_px) - ndtr((away_px - 0.5) / edge_px)
    return np.asarray((1 - STRAY) * inside + STRAY / (2 * MOST_PX))


def _correlated(seen: Floats, log_likelihood: Floats, tried: int) -> Floats:
    """Log likelihood of each displacement that is tried, (tried,)."""
    floor = float(log_likelihood.min())
    # Beyond the table there is nothing but stray pixels: the same floor.
    score = np.correlate(seen, log_likelihood - floor, mode="same") + floor * seen.sum()
    first = (len(seen) - tried) // 2
    return np.asarray(score[first : first + tried])


def _of_columns(
    code: NamedPlaces, geometry: Geometry, usable: NDArray[np.bool_], blur_px: float
) -> tuple[FitFinding, float] | None:
    """What is found of columns, and what deviations hold of it besides (px)."""
    usable = usable & (code.column >= 0)
    column = geometry.column_px[usable].astype(np.float64)
    group = (column.clip(0) / COLUMNS_PX).astype(int)
    groups = int(group.max(initial=0)) + 1
    shift, std = displacement(code.column[usable], column, group, groups)
    # Neighbouring groups may have the same gap, so that it counts in full.
    std = np.maximum(std, [_gap_px(places) for places in _by_group(column + shift[group], group, groups)])
    found = Disagreement.of(shift, std)
    if found is None:
        return None
    part, cause, advice = _cause_of(found, blur_px)
    told = FitFinding.judged(
        part,
        LINES_AGAINST_CODE,
        (found.rms_px, found.rms_std_px),
        "px",
        BLURRED_APART_PX if blur_px > BLURRED_PX else MOST_APART_PX,
        f"Lines lie {found.rms_px:.2f} columns (rms, at most {-found.worst_px:+.2f}) from where the binary"
        f" code saw the same points: {cause} Deviations of depth contain it.",
        advice,
    )
    # Stripes that are blurred disagree by themselves, and do so in every scan.
    return told, found.beyond_chance_px if blur_px <= BLURRED_PX else 0.0


def _cause_of(found: Disagreement, blur_px: float) -> tuple[Part, str, str]:
    """The part of the model that lines and code disagree about, the cause in words, and what to do.

    What moves displaces neighbouring columns alike. Where all are displaced alike, by less than light that is
    brighter on one side of a line can be, nobody can tell whether that or a motion is the cause.
    """
    smooth, mean = found.smooth(), found.mean_px
    if float(np.mean(smooth**2)) < MOST_SMOOTH * float(np.mean(found.shift_px**2)):
        unknown = "the model of the lines does not fit, and nothing that moved explains it."
        return (
            "geometry",
            unknown,
            "Look at the other findings; repeat the self-test in focus, and scan again.",
        )
    if float(np.std(smooth)) > CHANGES * abs(mean) or abs(mean) > UNEVEN * blur_px:
        moved = "the projector's picture, the camera or the scene moved between them."
        return "motion", moved, "Let projector and camera warm up, fix them and the scene, and scan again."
    either = (
        "the light of lines is less even than calibrated, or the projector's picture, the camera or the scene"
        " moved between them."
    )
    return (
        "geometry",
        either,
        "Scan again: only what has moved will have changed. If nothing has, calibrate again.",
    )


def _of_rows(
    rig: Rig, kind: BinaryCode, code: NamedPlaces, geometry: Geometry, usable: NDArray[np.bool_]
) -> tuple[FitFinding, float] | None:
    """What is found of rows, and what deviations hold of it besides (px): nothing.

    Lateral colour moves rows by a little that is no error of depth.
    """
    if code.row is None:
        return None
    pixels = np.flatnonzero(usable & (code.row >= 0))
    pixels = thinned(pixels, MOST_PIXELS)
    exact, expected = named_rows(rig, kind, pixels, geometry.depth_mm.ravel()[pixels])
    height, width = geometry.depth_mm.shape
    tiles = TILES[0] * TILES[1]
    tile = pixels // width * TILES[0] // height * TILES[1] + pixels % width * TILES[1] // width
    usual, unsure = displacement(expected, exact, tile, tiles)
    shift, std = displacement(code.row.ravel()[pixels], exact, tile, tiles)
    found = Disagreement.of(shift - usual, np.hypot(std, unsure))
    if found is None:
        return None
    slope = _rows_per_column(rig, pixels, geometry.depth_mm.ravel()[pixels])
    columns = whole_columns(shift - usual, np.hypot(std, unsure), _mean_of_groups(slope, tile, tiles))
    # A film that was turned moves the ends of stripes, but by no more.
    film = ", or the film," if found.rms_px < MOST_BY_FILM_PX else ""
    by = counted(abs(columns), "column")
    moved = f", or the projector's pattern moved by {by} before the code or within it" if columns else ""
    told = FitFinding.judged(
        "geometry",
        ROWS_AGAINST_DEPTH,
        (found.rms_px, found.rms_std_px),
        "px",
        MOST_ROWS_PX,
        f"Rows of the projector lie {found.rms_px:.2f} px (rms, at most {found.worst_px:+.2f}) from where"
        f" lenses, pose and depth place them: a lens or the pose{film} is not as calibrated{moved}."
        " Deviations of depth contain what rows can tell of that.",
        "Check focus, zoom and mounts of camera and projector, and that the projector does not move its"
        " picture. Scan again; if that does not help, calibrate the geometry again.",
    )
    return told, 0.0


def whole_columns(shift_px: Floats, std_px: Floats, rows_per_column: Floats) -> int:
    """The whole number of columns whose displacement explains that of rows (groups,), px; 0 if there is none.

    ``rows_per_column`` (groups,) says by how many rows the place of a pixel moves with its column.
    """
    known = np.isfinite(shift_px) & (std_px < TELLING_PX) & np.isfinite(rows_per_column)
    shift, slope = shift_px[known], rows_per_column[known]
    if known.sum() < FEWEST_GROUPS or float(slope @ slope) == 0:
        return 0
    columns = float(shift @ slope) / float(slope @ slope)
    left = shift - columns * slope
    is_whole = abs(columns - round(columns)) < NEARLY_WHOLE and left @ left < LEFT_OVER**2 * (shift @ shift)
    return round(columns) if is_whole else 0


def _rows_per_column(rig: Rig, pixels: NDArray[np.intp], depth_mm: Floats) -> Floats:
    """By how many rows of the projector the place of pixels moves with each of its columns, (n,)."""
    near, far = (
        zero_order(rig, torch.as_tensor(pixels), torch.as_tensor(depth_mm * share))
        for share in (0.999, 1.001)
    )
    return np.asarray(((far[1] - near[1]) / (far[0] - near[0])).numpy())


def _mean_of_groups(values: Floats, group: NDArray[np.integer], groups: int) -> Floats:
    """Means (groups,); NaN of groups without values."""
    count, total = (np.bincount(group, weights, groups) for weights in (None, values))
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)
