"""Bandpass filters in front of the camera: efficiency of the orders, response of the camera, blur and halo.

A flat white target stands still while filters change. Without filter, code and dense lines say which column
each pixel sees; through each filter, lines that tile the frame show how much light each order takes.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import numpy as np

from dsl_core.calibration.common.plane import bulge_figure
from dsl_core.calibration.light.chain import LineScan
from dsl_core.calibration.light.zero_order import ZeroOrderFit
from dsl_core.calibration.orders.bandpass import SeenFilter, fit_bandpass, plane_pixels, plane_profile
from dsl_core.calibration.orders.dispersion import widening
from dsl_core.calibration.orders.order_light import filter_light
from dsl_core.campaign.common.bounds import Count, FilterNm, Positive, Ratio, Reflectance
from dsl_core.campaign.common.depths import target_depth_mm
from dsl_core.campaign.common.flat_target import diffuser_lines, line_frames, scan_lines_of
from dsl_core.campaign.common.recipe import Bench, Recipe, Step, naming
from dsl_core.campaign.common.same_white import keep_white, require_same_white
from dsl_core.campaign.common.white_shot import (
    FWHM_NM,
    LONG_RATIO,
    FilterNote,
    WhiteLevel,
    bracket,
    bright_setting,
    colour_figure,
    film_light,
    note_of_filter,
    require_filter,
    require_width,
    shoot_white,
)
from dsl_core.errors import CalibrationError
from dsl_core.model.calibration.bandpass import BandpassCalibration, apply_bandpass
from dsl_core.model.conditions import COLOUR_NAMES
from dsl_core.model.figure import Figure, doubts
from dsl_core.model.placement import Placement
from dsl_core.model.plan import CapturePlan, GrayCode, NoCode, ScanLines, Setting
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.filters import nominal_filter, passed_width_nm
from dsl_core.optics.unlit import first_order_reach_px, unlit_px
from dsl_core.progress import Progress
from dsl_core.words import sentence

PLANE = "plane"
CURVE_NAME = "filter.json"
#: Filters may all be off by this much (nm), or by this many deviations, the larger.
MAX_OFF_NM, OFF_SIGMAS = 1.0, 3.0
#: A clear film passes at least this share of the light in all its orders; one that seems to pass less stands
#: before a target that reflects less than stated.
LEAST_PASSED = 0.7
#: Where the efficiency is judged, which spectra need between the filters as well, nm.
USED_NM = np.arange(430.0, 661.0, 5.0)
#: Where the share of the orders is judged, nm.
MIDDLE_NM = 550.0
#: A bulge over 300 mm at which the efficiency is off by .3 %, which is as well as it is known.
MAX_BULGE_MM = 3.0
FILTERS_NM = tuple(float(nm) for nm in range(430, 661, 10))


@dataclass(frozen=True)
class BandpassRecipe(Recipe[BandpassCalibration]):
    """The calibration with bandpass filters.

    ``filters_nm`` are the nominal centres of the filters; ``line_px`` is the width and step of the lines
    through a filter, which must tile the frame; ``long_ratio`` above 1 adds a second, longer exposure, for
    noisy cameras; ``pixels`` is how many camera pixels are used; ``depth_mm`` is the distance of the target,
    by default two fifths into the rig's depth range; ``reflectance`` is that of the target, by default that
    of the Spectralon; ``fwhm_nm`` is the width at half of their peak of filters whose transmission is not
    measured.
    """

    name = "bandpass"
    title = "Bandpass filters"
    #: Geometry for depth and shading, the LEDs' emission.
    needs = ("geometry", "spectralon")
    record_type = BandpassCalibration

    filters_nm: tuple[FilterNm, ...] = FILTERS_NM
    line_px: Count = 5
    long_ratio: Ratio = 1.0
    pixels: Count = 20_000
    depth_mm: Positive | None = None
    reflectance: Reflectance | None = None
    fwhm_nm: Positive = FWHM_NM

    def steps(self, bench: Bench) -> tuple[Step, ...]:
        """The target without filter, then through each filter, from blue to red."""
        if len(set(self.filters_nm)) < 2:
            raise CalibrationError("Bandpass filters: at least two different filters are needed.")
        require_width(self.fwhm_nm, "Bandpass filters")
        depth_mm = target_depth_mm(bench.rig, self.depth_mm)
        where: dict[str, float | str] = {"depth_mm": depth_mm}
        first = Step(
            PLANE,
            "White target without filter",
            "Mount the film in front of the projector. Place the Spectralon, or a white target whose"
            f" reflectance is set, about {depth_mm / 10:g} cm from the camera, facing it; it must not move"
            " until the last filter is done. No filter in front of the camera.",
            Placement(target="spectralon", film=True, options=where),
        )
        filtered = [
            Step(
                f"filter-{nm:g}",
                f"Filter of {nm:g} nm",
                f"Put the bandpass filter of {nm:g} nm flat in front of the camera's lens. Touch nothing"
                " else.",
                Placement(target="spectralon", film=True, filter_nm=nm, options=where),
            )
            for nm in sorted(set(self.filters_nm))
        ]
        return (first, *filtered)

    def look(self, bench: Bench, step: Step) -> tuple[Figure, ...]:
        """Brightness, other light and, through a filter, whether its colours are those of the right one."""
        white = shoot_white(bench)
        figures = film_light(white, bench.rig)
        nm = step.placement.filter_nm
        if nm is None:
            return figures
        return (*figures, colour_figure(bench.rig, white, note_of_filter(bench.devices, nm, self.fwhm_nm)))

    def measures_light(self, step: Step) -> bool:
        """The target without filter does, whatever the Spectralon said before."""
        return step.key == PLANE

    def acts_at_capture(self, step: Step) -> dict[str, float]:
        """Lines and exposures of the filters."""
        return {} if step.key == PLANE else {"line_px": self.line_px, "long_ratio": self.long_ratio}

    def capture(self, bench: Bench, step: Step, progress: Progress) -> None:
        """Choose exposures by a test shot and scan; a scan that was begun keeps its own exposures."""
        bench.scan(step, lambda: self._begin(bench, step), progress)
        require_same_white(bench, step)

    def fit(self, bench: Bench, progress: Progress) -> BandpassCalibration:
        """Calibrate from the captures of all steps."""
        first, *filtered = self.steps(bench)
        scan, profile = self._plane(bench, first, progress)
        rig = bench.rig.model_copy(update={"projector_response": profile.response})
        seen = []
        for done, step in enumerate(filtered):
            progress.report("filters", done, len(filtered))
            seen.append(self._filter(bench, rig, step, scan))
        progress.report("filters", len(filtered), len(filtered))
        record = fit_bandpass(rig, scan, profile, seen, self.reflectance)
        passed = record.white_scale / rig.white_scale * (1 + _in_orders(record))
        return record.model_copy(update={"bulge_mm": scan.bulge_mm, "passed": passed})

    def figures(self, record: BandpassCalibration, done: Collection[str] = ()) -> tuple[Figure, ...]:
        """Deviations of efficiency and response, blur and halo, and filters in doubt."""
        return bandpass_figures(record, done)

    def apply(self, record: BandpassCalibration, rig: Rig) -> Rig:
        """The rig with efficiencies, response, white scale, blur and halo."""
        return apply_bandpass(record, rig)

    def _begin(self, bench: Bench, step: Step) -> CapturePlan:
        """The plan of a step by a test shot; keeps what is known of its filter."""
        white = shoot_white(bench)
        keep_white(bench, step, white)
        nm = step.placement.filter_nm
        if nm is None:
            return self._plan(bench.rig, step, white)
        note = note_of_filter(bench.devices, nm, self.fwhm_nm)
        open_white = self._white_of(bench, self.steps(bench)[0])
        require_filter(bench.rig, white, note, step.title, open_white)
        plan = self._plan(bench.rig, step, white)
        bench.keep(step, CURVE_NAME, note)
        return plan

    def _white_of(self, bench: Bench, step: Step) -> float | None:
        """Brightness of a captured step's white frame (DN per ms at full drive), None if not captured."""
        if not self.is_captured(bench, step):
            return None
        from dsl_core.reconstruction.merge import MergedScan

        frame = MergedScan(bench.scan_of(step), bench.rig).merge("white", 0)
        return float(np.quantile(frame.radiance, 0.995))

    def _plan(self, rig: Rig, step: Step, white: WhiteLevel) -> CapturePlan:
        if step.placement.filter_nm is None:
            settings = bracket(rig, white, step.title, LONG_RATIO)
            return CapturePlan(
                name="white target without filter",
                code=GrayCode(),
                spectral=ScanLines(width_px=5, step_px=2),
                settings=settings,
                code_settings=(0,),
            )
        short = bright_setting(rig, white, step.title)
        settings = (short,)
        if self.long_ratio > 1:
            long_ms = round(short.exposure_ms * self.long_ratio / rig.frame_period_ms) * rig.frame_period_ms
            settings = (short, Setting(exposure_ms=long_ms, level=short.level))
        return CapturePlan(
            name=step.title,
            code=NoCode(),
            spectral=ScanLines(width_px=self.line_px, step_px=self.line_px),
            settings=settings,
            code_settings=(0,),
        )

    def _plane(self, bench: Bench, step: Step, progress: Progress) -> tuple[LineScan, ZeroOrderFit]:
        source = bench.scan_of(step)
        with naming(step):
            scan = diffuser_lines(source, bench.rig, progress, self.pixels)[1]
            profile = plane_profile(bench.rig, scan, progress)
            # Until the halo is known, the curve of the spread would hold it.
            rig = bench.rig.model_copy(update={"projector_response": profile.response})
            shown, scan = diffuser_lines(source, rig, progress, self.pixels)
            if shown.projector_response != profile.response:
                profile = plane_profile(shown, scan, progress)
            return scan, profile

    def _filter(self, bench: Bench, rig: Rig, step: Step, scan: LineScan) -> SeenFilter:
        note, source = bench.kept(step, CURVE_NAME, FilterNote), bench.scan_of(step)
        # A width that is stated after the capture counts as well.
        curve = note.transmission if note.measured else nominal_filter(note.filter_nm, self.fwhm_nm)
        lines = scan_lines_of(source)
        radiance, std = line_frames(source, rig, scan.pixels)
        light = filter_light(
            lines,
            plane_pixels(rig, scan, note.filter_nm),
            radiance,
            std,
            rig.projector_response,
            first_order_reach_px(rig),
            unlit_px(rig, lines.width_px),
            rig.projector.width_px,
            widening(rig, note.filter_nm, passed_width_nm(rig, curve)),
        )
        if light.saturated > 0.5:
            raise CalibrationError(
                f"{step.title}: the zero order is saturated in {light.saturated:.0%} of the pixels. Capture"
                " the step again with nothing changed since the test shot."
            )
        return SeenFilter(note.filter_nm, curve, note.measured, light)


def bandpass_figures(record: BandpassCalibration, done: Collection[str] = ()) -> tuple[Figure, ...]:
    """Deviations of efficiency and response, second orders, blur and halo, and filters in doubt."""
    centres = np.array([each.effective_nm for each in record.filters])
    figures = [
        Figure(
            name=f"efficiency of order {order:+d}, deviation",
            value=100 * float(np.median(_relative_std(record.efficiency[order], USED_NM))),
            unit="%",
            high=2.0,
            advice="Use more filters, spread from blue to red, or a longer second exposure (long_ratio).",
        )
        for order in (1, -1)
    ]
    figures += [
        Figure(
            name=f"{colour}, deviation",
            value=100 * float(np.median(_relative_std(curve, centres[_bright(curve, centres)]))),
            unit="%",
            high=5.0,
            advice=_response_advice(record, done),
        )
        for colour, curve in _responses(record).items()
    ]
    halo = 200 * record.halo_decay_px
    figures += [
        _plain(
            "second orders",
            "% of first",
            100 * record.second_order_share,
            100 * record.second_order_share_std,
        ),
        _plain("halo", "% of zero order", halo * record.halo_peak_per_px, halo * record.halo_peak_std_per_px),
        Figure(
            name="blur of the projector",
            value=record.blur_px,
            unit="px",
            std=record.blur_std_px,
            high=2.0,
            advice="Focus the projector on the target.",
        ),
        *_of_filters(record),
        *_passed(record),
        *bulge_figure("bulge of the target over 300 mm", record.bulge_mm, MAX_BULGE_MM),
        doubts("filters in doubt", record.warnings),
    ]
    return tuple(figures)


def _responses(record: BandpassCalibration) -> dict[str, SpectralCurve]:
    """The curves that were measured, by name: a monochrome camera has one, and no red or blue pixels."""
    seen = [any(each.zero_dn_per_ms[colour] for each in record.filters) for colour in range(3)]
    if sum(seen) == 1:
        return {"response": record.response[seen.index(True)]}
    return {f"response of {name}": record.response[i] for i, name in enumerate(COLOUR_NAMES) if seen[i]}


def _of_filters(record: BandpassCalibration) -> list[Figure]:
    """What all filters have in common: other wavelengths than stated, and a shift with the angle of view."""
    figures = []
    if record.filters_off_nm is not None:
        limit = max(MAX_OFF_NM, OFF_SIGMAS * record.filters_off_std_nm)
        figures.append(
            Figure(
                name="all filters against the LEDs' spectra",
                value=record.filters_off_nm,
                unit="nm",
                std=record.filters_off_std_nm,
                low=-limit,
                high=limit,
                advice="The filters pass other wavelengths than stated, each was in the place of the next,"
                " one passes less light, or the spectroradiometer's wavelengths are off. Check that they"
                " were captured in the order of the steps, that each is clean, alone in the beam and flat in"
                " front of the lens, and that the transmissions are those of these filters, seen straight on;"
                " check the spectroradiometer by a lamp with known lines.",
            )
        )
    if record.filter_index is not None:
        value, std = record.filter_index
        figures.append(_plain("refractive index of the filters, by angle of view", "", value, std))
    return figures


def _in_orders(record: BandpassCalibration) -> float:
    """Light of all other orders relative to the zero order, in the middle of the spectrum."""
    return float(sum(curve.at(MIDDLE_NM) for curve in record.efficiency.values()))


def _passed(record: BandpassCalibration) -> list[Figure]:
    """How much of white the film passes, as far as the target reflects what is stated."""
    if record.passed is None:
        return []
    return [
        Figure(
            name="white through the film in all orders, of that of the Spectralon without it",
            value=100 * record.passed,
            unit="%",
            low=100 * LEAST_PASSED,
            advice="The target is darker than the Spectralon, or the film takes light. Put the Spectralon"
            " there, or state the reflectance of the target (reflectance), as that of everything is relative"
            " to it; check that nothing shades camera or projector. If the film is a dark one, accept it.",
        )
    ]


def _response_advice(record: BandpassCalibration, done: Collection[str]) -> str:
    """What would make the response better known that has not been done yet."""
    ways = []
    if not all(each.curve_measured for each in record.filters):
        ways.append("measure the filters' transmissions")
    if "color-checker" not in done and len(_responses(record)) > 1:
        ways.append("calibrate with a Color Checker first")
    ways = ways or [
        "use more filters where this colour is bright",
        "set a second exposure (long_ratio)",
    ]
    return sentence(", or ".join(ways))


def _plain(name: str, unit: str, value: float, std: float) -> Figure:
    return Figure(name=name, value=value, unit=unit, std=std)


def _relative_std(curve: SpectralCurve, nm: Any) -> Any:
    std = curve.std or (0.0,) * len(curve.values)
    return np.interp(nm, curve.wavelengths_nm, std) / np.maximum(np.abs(curve.at(nm)), 1e-12)


def _bright(curve: SpectralCurve, nm: Any) -> Any:
    """Wavelengths at which a response is not negligible."""
    return curve.at(nm) > 0.05 * max(curve.values)
