"""Bandpass filters before the camera: efficiency of the orders, response of the camera, blur and halo.

A flat white target stands still while filters change. Without filter, code and dense lines say which column
each pixel sees; through each filter, lines that tile the frame show how much light each order takes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dsl_core.calibration.light.chain import LineScan
from dsl_core.calibration.light.zero_order import ZeroOrderFit
from dsl_core.calibration.orders.bandpass import (
    SeenFilter,
    fit_bandpass,
    plane_pixels,
    plane_profile,
)
from dsl_core.calibration.orders.order_light import filter_light
from dsl_core.campaign.bandpass.figures import bandpass_figures
from dsl_core.campaign.common.diffuser_lines import diffuser_lines
from dsl_core.campaign.common.exposures import WhiteLevel, bracket, bright_setting, measure_white
from dsl_core.campaign.common.filter_in_beam import FilterNote, colour_figure, note_of_filter, require_filter
from dsl_core.campaign.common.light_look import film_light
from dsl_core.campaign.common.recipe import Bench, Step
from dsl_core.campaign.common.step_scan import is_complete, naming, scan_of, scan_step
from dsl_core.errors import CalibrationError
from dsl_core.io.atomic import write_atomic
from dsl_core.io.campaign_folder import read_record
from dsl_core.model.base import Record
from dsl_core.model.calibration.bandpass import BandpassCalibration, apply_bandpass
from dsl_core.model.figure import Figure
from dsl_core.model.placement import Placement
from dsl_core.model.plan import CapturePlan, GrayCode, NoCode, ScanLines, Setting
from dsl_core.model.rig import Rig
from dsl_core.optics.unlit import first_order_reach_px, unlit_px
from dsl_core.progress import Progress

PLANE = "plane"
CURVE_NAME = "filter.json"
FILTERS_NM = tuple(float(nm) for nm in range(430, 661, 10))
#: The longer exposure of the scan without filter, which shows the halo, over the shorter one.
LONG_RATIO = 6.0


@dataclass(frozen=True)
class BandpassRecipe:
    """The calibration with bandpass filters.

    ``filters_nm`` are nominal centres; ``line_px`` is width and step of the lines through a filter, which
    must tile the frame; ``long_ratio`` above 1 adds a second, longer exposure, for noisy cameras;
    ``pixels`` is how many pixels of the camera are used; ``depth_mm`` is how far away the target stands;
    ``reflectance`` is that of the target.
    """

    filters_nm: tuple[float, ...] = FILTERS_NM
    line_px: int = 5
    long_ratio: float = 1.0
    pixels: int = 20_000
    depth_mm: float = 700.0
    reflectance: float = 0.99

    @property
    def name(self) -> str:
        """Name on the command line."""
        return "bandpass"

    @property
    def title(self) -> str:
        """Title of the wizard."""
        return "Bandpass filters"

    @property
    def needs(self) -> tuple[str, ...]:
        """Geometry for depth and shading, the LEDs' emission."""
        return ("geometry", "spectralon")

    @property
    def record_type(self) -> type[Record]:
        """The record that `fit` makes."""
        return BandpassCalibration

    def steps(self, bench: Bench) -> tuple[Step, ...]:
        """The target without filter, then through each filter, from blue to red."""
        if len(set(self.filters_nm)) < 2:
            raise CalibrationError("Bandpass filters: at least two different filters are needed.")
        where: dict[str, float | str] = {"depth_mm": self.depth_mm}
        first = Step(
            PLANE,
            "White target without filter",
            f"Mount the film before the projector. Place the Spectralon or another even white target about"
            f" {self.depth_mm / 10:g} cm from the camera, facing it; it must not move until the last filter"
            " is done. No filter before the camera.",
            Placement(target="spectralon", film=True, options=where),
        )
        filtered = [
            Step(
                f"filter-{nm:g}",
                f"Filter of {nm:g} nm",
                f"Put the bandpass filter of {nm:g} nm flat before the camera's lens. Touch nothing else.",
                Placement(target="spectralon", film=True, filter_nm=nm, options=where),
            )
            for nm in sorted(set(self.filters_nm))
        ]
        return (first, *filtered)

    def look(self, bench: Bench, step: Step) -> tuple[Figure, ...]:
        """Brightness, other light and, through a filter, whether its colours are those of the right one."""
        white = measure_white(bench.devices, bench.rig)
        figures = film_light(white, bench.rig)
        nm = step.placement.filter_nm
        if nm is None:
            return figures
        return (*figures, colour_figure(bench.rig, white, note_of_filter(bench.devices, nm)))

    def is_captured(self, bench: Bench, step: Step) -> bool:
        """Whether the scan of a step is complete."""
        return is_complete(bench.step_folder(step))

    def capture(self, bench: Bench, step: Step, progress: Progress) -> None:
        """Choose exposures by a test shot and scan; a scan that was begun goes on with its own exposures."""
        scan_step(bench.devices, bench.step_folder(step), lambda: self._begin(bench, step), progress)

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
        return fit_bandpass(rig, scan, profile, seen, self.reflectance)

    def figures(self, record: Record) -> tuple[Figure, ...]:
        """Deviations of efficiency and response, blur and halo, and filters in doubt."""
        assert isinstance(record, BandpassCalibration)
        return bandpass_figures(record)

    def apply(self, record: Record, rig: Rig) -> Rig:
        """The rig with efficiencies, response, white scale, blur and halo."""
        assert isinstance(record, BandpassCalibration)
        return apply_bandpass(record, rig)

    def _begin(self, bench: Bench, step: Step) -> CapturePlan:
        """The plan of a step by a test shot; keeps what is known of its filter."""
        white = measure_white(bench.devices, bench.rig)
        nm = step.placement.filter_nm
        if nm is None:
            return self._plan(bench.rig, step, white)
        note, folder = note_of_filter(bench.devices, nm), bench.step_folder(step)
        open_white = self._white_of(bench, self.steps(bench)[0])
        require_filter(bench.rig, white, note, step.title, open_white)
        plan = self._plan(bench.rig, step, white)
        folder.mkdir(parents=True, exist_ok=True)
        write_atomic(folder / CURVE_NAME, note.model_dump_json(indent=1).encode())
        return plan

    def _white_of(self, bench: Bench, step: Step) -> float | None:
        """Brightness of a captured step's white frame (DN per ms at full drive), None if not captured."""
        if not self.is_captured(bench, step):
            return None
        from dsl_core.reconstruction.merge import MergedScan

        frame = MergedScan(scan_of(bench.step_folder(step)), bench.rig).merge("white", 0)
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
        source = scan_of(bench.step_folder(step))
        with naming(step):
            scan = diffuser_lines(source, bench.rig, progress, self.pixels)
            return scan, plane_profile(bench.rig, scan, progress)

    def _filter(self, bench: Bench, rig: Rig, step: Step, scan: LineScan) -> SeenFilter:
        from dsl_core.reconstruction.merge import MergedScan, check_source

        folder = bench.step_folder(step)
        note = read_record(folder / CURVE_NAME, FilterNote)
        source = scan_of(folder)
        plan = check_source(source, rig)
        lines = plan.spectral
        assert isinstance(lines, ScanLines)
        merged = MergedScan(source, rig)
        radiance = np.empty((plan.spectral_count, len(scan.pixels)), np.float32)
        std = np.empty_like(radiance)
        for frame in range(plan.spectral_count):
            picture = merged.merge("spectral", frame)
            radiance[frame] = picture.radiance.ravel()[scan.pixels]
            std[frame] = np.sqrt(picture.variance.ravel()[scan.pixels])
        light = filter_light(
            lines,
            plane_pixels(rig, scan, note.filter_nm),
            radiance,
            std,
            rig.projector_response,
            first_order_reach_px(rig),
            unlit_px(rig, lines.width_px),
            rig.projector.width_px,
        )
        if light.saturated > 0.5:
            raise CalibrationError(
                f"{step.title}: the zero order is saturated in {light.saturated:.0%} of the pixels. Capture"
                " the step again with nothing changed since the test shot."
            )
        return SeenFilter(note.filter_nm, note.transmission, note.measured, light)
