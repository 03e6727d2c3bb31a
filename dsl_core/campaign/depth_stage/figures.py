"""What a person judges the depth-stage calibration by."""

from __future__ import annotations

import numpy as np

from dsl_core.calibration.film.form import FilmForm
from dsl_core.model.calibration.accepted import HELD_OUT_ORDERS
from dsl_core.model.calibration.chain import ChainCorrection
from dsl_core.model.calibration.depth_stage import DepthStageCalibration, StagePosition
from dsl_core.model.figure import Figure, doubts

#: Error of columns that a fit never saw, px.
MAX_HELD_OUT_PX = 0.3
#: One plane scatters for itself when all others have less than this share of its scatter of columns.
ALONE = 0.5
#: How far planes may move the geometry, in its deviations, before it is in doubt.
MAX_PULL = 1.8
#: Bulge of the target at all positions, mm over 300 mm and in its deviations: the larger is allowed.
MAX_BOW_MM, BOW_SIGMAS = 0.2, 3.0
#: Filters and LEDs may disagree by this much (nm, at a wavelength) or this many deviations, the larger.
#: The film's line density makes up for filters that are all off by one share; only the LEDs' spectra tell.
MAX_FILTERS_NM, FILTER_SIGMAS, MIDDLE_NM = 0.8, 3.0, 550.0
#: Patches of a chart are smooth: of a camera whose red begins within 16 nm they left red 11 % off, filters
#: without them 1 % (a drawn rig of the twin with a foreign camera).
CURVES_ADVICE = (
    "Calibrate Spectralon, Color Checker and bandpass filters again. If that changes nothing, colours of the"
    " camera may begin more steeply than its data sheet says, which a chart does not show: calibrate in a new"
    " campaign without the Color Checker."
)
#: Largest correction of the chain: curves of response, emission and efficiency that are each off their data
#: sheet by 5 % come to 16 % together, and second orders beyond what filters show to some percent more.
MAX_CORRECTION_PERCENT = 20.0
#: What two indices of one set of filters may differ by, or in deviations, the larger: at the corners of the
#: picture this one shifts light by a nm and a half.
MAX_INDEX, INDEX_SIGMAS = 0.1, 4.0
#: Orders of a film that was turned over change by opposite shares that differ by this much (logarithm).
TURNED_OVER = 0.2


def depth_stage_figures(record: DepthStageCalibration) -> tuple[Figure, ...]:
    """Flatness, steps, what depth leaves open, held-out error, the film, and doubts."""
    flat = max(record.positions, key=lambda each: each.column_rms_px / each.column_limit_px)
    step = max(record.positions, key=lambda each: abs(each.step_error_mm))
    film = [
        Figure(
            name=name,
            value=getattr(record.film, field),
            unit=unit,
            std=record.film_std[field],
        )
        for name, field, unit in (
            ("film's lines", "lines_per_mm", "1/mm"),
            ("film's distance", "distance_mm", "mm"),
            ("film's tilt about x", "tilt_x_deg", "degrees"),
            ("film's tilt about y", "tilt_y_deg", "degrees"),
            ("film's rotation in its plane", "roll_deg", "degrees"),
            ("film's curvature", "bend_per_mm", "1/mm"),
        )
    ]
    return (
        Figure(
            name="residual about the plane, rms",
            value=flat.plane_rms_mm,
            unit="mm",
            high=flat.plane_limit_mm,
            advice=_plane_advice(record, flat),
        ),
        Figure(
            name="error of the stage's steps",
            value=abs(step.step_error_mm),
            unit="mm",
            std=step.step_std_mm,
            high=step.step_limit_mm,
            advice=f"Check the stage at {step.position_mm:g} mm; if its positions are read less well than"
            " stated, say so (stage_std_mm); repeat the geometry with more poses.",
        ),
        Figure(
            name="correction of the geometry by the planes",
            value=record.geometry_pull,
            unit="standard deviations",
            high=MAX_PULL,
            advice="Use a flatter target, check the stage's scale and the board's printed size, or calibrate"
            " the geometry again: one of them is wrong.",
        ),
        *_bow(record),
        Figure(name="standard deviation of depth from the geometry", value=record.depth_std_mm, unit="mm"),
        Figure(
            name=HELD_OUT_ORDERS,
            value=record.held_out_px,
            unit="px",
            high=MAX_HELD_OUT_PX,
            advice="Use more filters or positions, lines closer together, or longer exposures.",
        ),
        *film,
        *_shape(record),
        *_colours(record),
        *_filter_index(record),
        *_chain(record),
        doubts("captures in doubt", record.warnings),
    )


def _shape(record: DepthStageCalibration) -> tuple[Figure, ...]:
    """How steep the film is where it is no cylinder."""
    if record.film.shape is None:
        return ()
    steepest = FilmForm.of(record.projector, record.film, shaped=True).steepest(record.film)
    return (Figure(name="film's largest slope beyond curvature", value=np.degrees(steepest), unit="degrees"),)


def _colours(record: DepthStageCalibration) -> tuple[Figure, ...]:
    """How far the lenses put red and blue apart, where that was measured."""
    if record.colours_apart_px is None:
        return ()
    apart_px, std_px = record.colours_apart_px
    return (Figure(name="red and blue light apart", value=apart_px, unit="px", std=std_px),)


def _plane_advice(record: DepthStageCalibration, worst: StagePosition) -> str:
    """What may be wrong: the target where one plane is worse than all others, else the models as well."""
    others = [each.column_rms_px for each in record.positions if each is not worst]
    what = f"Columns scatter by {worst.column_rms_px:.3f} px, worst at {worst.position_mm:g} mm"
    if max(others, default=0.0) < ALONE * worst.column_rms_px:
        return f"{what} and much less elsewhere: check the target there and capture this position again."
    return (
        f"{what}, alike at all positions: the model of the line profile or of the lenses may be too simple"
        " for this rig, or the target is not flat. Check the focus, and compare with another target."
    )


def _chain(record: DepthStageCalibration) -> tuple[Figure, ...]:
    chain = record.chain
    if chain is None:
        return ()
    correction = Figure(
        name="largest correction of response, emission and efficiency",
        value=100 * chain.largest_correction,
        unit="%",
        high=MAX_CORRECTION_PERCENT,
        advice=_turned_over(chain) or CURVES_ADVICE,
    )
    if chain.wavelength_scale is None:
        return (correction,)
    # The LEDs say which wavelength the film's fit is off by, which it knows no better than its line density.
    density_std = record.film_std["lines_per_mm"] / record.film.lines_per_mm
    std_nm = MIDDLE_NM * float(np.hypot(chain.wavelength_scale_std, density_std))
    limit = max(MAX_FILTERS_NM, FILTER_SIGMAS * std_nm)
    filters = Figure(
        name=f"filters against the LEDs' spectra, at {MIDDLE_NM:g} nm",
        value=MIDDLE_NM * chain.wavelength_scale,
        unit="nm",
        std=std_nm,
        low=-limit,
        high=limit,
        advice="All filters pass other wavelengths than stated, shorter ones when they are tilted. Put them"
        " flat in front of the lens, and check their transmissions and the spectroradiometer's wavelengths.",
    )
    return correction, filters


def _turned_over(chain: ChainCorrection) -> str:
    """What the orders say of a film that was turned over since the filters, empty where they do not.

    A film that is turned over sends the light of one first order to the other: what one gains, the other
    loses.
    """
    plus, minus = (
        float(np.mean(np.log(chain.efficiency_factors[order].values)))
        if order in chain.efficiency_factors
        else 0.0
        for order in (1, -1)
    )
    if abs(plus - minus) < TURNED_OVER or abs(plus + minus) > ALONE * abs(plus - minus):
        return ""
    changes = " and ".join(
        f"order {order:+d} {abs(np.expm1(value)):.0%} {'brighter' if value > 0 else 'darker'}"
        for order, value in ((1, plus), (-1, minus))
    )
    return (
        f"Since the bandpass filters were captured, {changes}: the film was probably turned over or"
        " exchanged. Mount it as it was and capture these positions again, or calibrate the bandpass filters"
        " again."
    )


def _filter_index(record: DepthStageCalibration) -> tuple[Figure, ...]:
    if record.filter_index is None:
        return ()
    value, std = record.filter_index
    found = Figure(name="refractive index of the filters, by angle of view", value=value, unit="", std=std)
    if record.filter_index_before is None:
        return (found,)
    before, before_std = record.filter_index_before
    apart_std = float(np.hypot(std, before_std))
    limit = max(MAX_INDEX, INDEX_SIGMAS * apart_std)
    apart = Figure(
        name="refractive index of the filters, change since the bandpass filters",
        value=value - before,
        unit="",
        std=apart_std,
        low=-limit,
        high=limit,
        advice="The filters' light shifts otherwise with the angle of view than before: they are others, or"
        " stood askew at one of the two. Put the same filters flat in front of the lens, and capture the step"
        " again at which they were not.",
    )
    return found, apart


def _bow(record: DepthStageCalibration) -> tuple[Figure, ...]:
    if record.bow_mm is None:
        return ()
    limit = max(MAX_BOW_MM, BOW_SIGMAS * record.bow_std_mm)
    return (
        Figure(
            name="bulge of the target over 300 mm",
            value=record.bow_mm,
            unit="mm",
            std=record.bow_std_mm,
            low=-limit,
            high=limit,
            advice="Use a flatter target. If it is flat, the lenses were not measured well: repeat the"
            " geometry with poses that fill the picture.",
        ),
    )
