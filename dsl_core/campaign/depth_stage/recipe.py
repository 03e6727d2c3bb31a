"""A flat target at a few positions of a stage: geometry refined, film, residual and chain of the spectra."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

from dsl_core.calibration.film.depth_stage import StageData, StageFilter, calibrate_depth_stage
from dsl_core.calibration.film.order_paths import LineFrames
from dsl_core.calibration.geometry.plane_refinement import lone_plane
from dsl_core.calibration.geometry.stage_planes import column_limit_px, require_steps
from dsl_core.campaign.common.bounds import Count, FilterNm, Finite, Positive, Reflectance
from dsl_core.campaign.common.depths import stage_depths_mm
from dsl_core.campaign.common.flat_target import (
    diffuser_lines,
)
from dsl_core.campaign.common.recipe import Bench, Recipe, Step, naming
from dsl_core.campaign.common.same_white import keep_white, require_same_white
from dsl_core.campaign.common.white_shot import (
    FWHM_NM,
    LONG_RATIO,
    LONGEST_MS,
    WhiteLevel,
    bracket,
    bright_setting,
    film_light,
    note_of_filter,
    require_width,
    shoot_white,
)
from dsl_core.campaign.depth_stage.figures import depth_stage_figures
from dsl_core.campaign.depth_stage.planes import SeenPlane, lines_on_plane, seen_plane, with_lateral_colour
from dsl_core.errors import CalibrationError
from dsl_core.model.base import Record
from dsl_core.model.calibration.chain import ChainCorrection
from dsl_core.model.calibration.depth_stage import DepthStageCalibration, apply_depth_stage
from dsl_core.model.figure import Figure
from dsl_core.model.geometry import Lens, Pose
from dsl_core.model.placement import Placement
from dsl_core.model.plan import CapturePlan, GrayCode, NoCode, ScanLines, Setting
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.filters import nominal_filter
from dsl_core.progress import Progress

STAGE_NOTE, PLANE_NOTE = "stage.json", "plane.json"
#: First orders are so much dimmer than white that lines may be exposed longer; the zero order saturates.
LONGER = 3.0
#: Usual positions are evenly between these shares of the rig's depth range.
NEAR, FAR, POSITIONS = 0.2, 0.8, 3
#: A plane that scatters this many times as much as those before it is the one that is wrong.
LESS_FLAT = 2.0


class StageNote(Record):
    """Where the stage said it was, and the filter of a step with its transmission."""

    position_mm: float
    filter_nm: float | None = None
    transmission: SpectralCurve | None = None
    measured: bool = False


class PlaneNote(Record):
    """Where a plane stands by the geometry of its time, which was that of the lenses and the pose.

    ``column_rms_px`` is the scatter of columns about it, which bends of the geometry are part of.
    """

    position_mm: float
    distance_mm: float
    column_rms_px: float
    column_limit_px: float
    camera: Lens
    projector: Lens
    pose: Pose


@dataclass(frozen=True)
class DepthStageRecipe(Recipe[DepthStageCalibration]):
    """The calibration with a plane on a stage.

    ``positions_mm`` are the positions of the stage; with none given there are three over the rig's depth
    range, as far as its stage reaches. ``stage_std_mm`` is the standard deviation of the stage's positions;
    ``filters_nm`` are the nominal centres of the bandpass filters. ``code_step_px`` is the step of the lines
    without filter, at most 5; ``filter_step_px`` is the step of the lines through filters, which may be far
    apart. ``reflectance`` is that of the target, by default that of the Spectralon; ``chain`` lets the
    plane correct the product of response, emission and efficiency; ``grid`` adds a model of the columns
    derived from the data, which needs three positions. ``fwhm_nm`` is the width at half of their peak of
    filters without measured transmission.
    """

    name = "depth-stage"
    title = "Depth stage"
    #: Geometry to refine, and the chain that weighs the wavelengths of a filter.
    needs = ("geometry", "spectralon", "bandpass")
    record_type = DepthStageCalibration

    positions_mm: tuple[Finite, ...] = ()
    filters_nm: tuple[FilterNm, ...] = (450.0, 540.0, 640.0)
    code_step_px: Count = 4
    filter_step_px: Count = 16
    stage_std_mm: Positive = 0.02
    reflectance: Reflectance | None = None
    chain: bool = True
    grid: bool = False
    fwhm_nm: float = FWHM_NM

    def steps(self, bench: Bench) -> tuple[Step, ...]:
        """At each position the plane without filter, then through each filter."""
        require_width(self.fwhm_nm, "Depth stage")
        positions, filters = self._positions_mm(bench), sorted(set(self.filters_nm))
        if len(positions) < 2 or not filters:
            raise CalibrationError(
                "Depth stage: at least two different positions and one filter are needed, given"
                f" {len(positions)} and {len(filters)}. Add some to positions_mm or filters_nm."
            )
        return tuple(
            step for position in positions for step in (_plain_step(position), *_filtered(position, filters))
        )

    def _positions_mm(self, bench: Bench) -> list[float]:
        """Those given, or the usual ones; raises `CalibrationError` for one that the stage does not reach."""
        stage = bench.devices.stage
        if not self.positions_mm:
            return sorted(set(stage_depths_mm(bench.rig, stage, NEAR, FAR, POSITIONS)))
        if stage is not None:
            low, high = stage.range_mm
            beyond = [each for each in self.positions_mm if not low <= each <= high]
            if beyond:
                named = ", ".join(f"{each:g}" for each in beyond)
                raise CalibrationError(
                    f"Depth stage: positions_mm names {named} mm; the stage moves from {low:g} to"
                    f" {high:g} mm. Name positions in between, or none for the usual ones."
                )
        return sorted(set(self.positions_mm))

    def look(self, bench: Bench, step: Step) -> tuple[Figure, ...]:
        """Brightness and other light."""
        self._move(bench, step)
        return film_light(shoot_white(bench), bench.rig)

    def measures_light(self, step: Step) -> bool:
        """The lines without filter do, where they correct the chain."""
        return self.chain and step.placement.filter_nm is None

    def acts_at_capture(self, step: Step) -> dict[str, float]:
        """The lines, with and without filter."""
        if step.placement.filter_nm is None:
            return {"code_step_px": self.code_step_px}
        return {"filter_step_px": self.filter_step_px}

    def capture(self, bench: Bench, step: Step, progress: Progress) -> None:
        """Move the stage, choose exposures by a test shot, and scan; a scan that was begun continues.

        Raises `CalibrationError` when the plane just captured is none, or stands elsewhere than the stage
        says: found at the end, it would cost all captures in between.
        """
        note = self._move(bench, step)
        bench.scan(step, lambda: self._begin(bench, step, note), progress)
        require_same_white(bench, step)
        if step.placement.filter_nm is None:
            self._check(bench, step, progress)

    def fit(self, bench: Bench, progress: Progress) -> DepthStageCalibration:
        """Calibrate from the captures of all steps."""
        steps = self.steps(bench)
        plain = [step for step in steps if step.placement.filter_nm is None]
        filtered = [step for step in steps if step.placement.filter_nm is not None]
        notes, count = (
            [bench.kept(step, STAGE_NOTE, StageNote) for step in plain],
            len(filtered) // len(plain),
        )
        seen = self._planes(bench, plain, progress)
        data = StageData(
            positions_mm=tuple(note.position_mm for note in notes),
            stage_std_mm=self.stage_std_mm,
            columns=tuple(each.columns for each in seen),
            filters=tuple(
                _filter_of(bench.kept(step, STAGE_NOTE, StageNote), self.fwhm_nm) for step in filtered[:count]
            ),
            frames=lambda position, name: self._lines(bench, filtered[position * count + name]),
            exposures=sum(bench.scan_of(step).plan.shot_count for step in steps),
        )
        rig, apart_px = with_lateral_colour(bench.rig, seen)
        # Focus changes with distance: what the middle of the range shows is off the least.
        response = seen[len(seen) // 2].response
        rig = rig.model_copy(update={"projector_response": response})
        found = calibrate_depth_stage(rig, data, progress, self.grid)
        found = found.model_copy(update={"colours_apart_px": apart_px})
        if not self.chain:
            return found
        return found.model_copy(update={"chain": self._chain(bench, plain, found, progress)})

    def figures(self, record: DepthStageCalibration, done: Collection[str] = ()) -> tuple[Figure, ...]:
        """Flatness, steps, held-out error and doubts."""
        return depth_stage_figures(record)

    def apply(self, record: DepthStageCalibration, rig: Rig) -> Rig:
        """The rig with refined geometry, film, residual and chain."""
        return apply_depth_stage(record, rig)

    def _move(self, bench: Bench, step: Step) -> StageNote:
        """Move the stage to a step's position; what is to be noted of the step."""
        position, nm = float(step.placement.options["depth_mm"]), step.placement.filter_nm
        if bench.devices.stage is not None:
            position = bench.devices.stage.move_to(position)
        if nm is None:
            return StageNote(position_mm=position)
        known = note_of_filter(bench.devices, nm, self.fwhm_nm)
        return StageNote(
            position_mm=position,
            filter_nm=nm,
            transmission=known.transmission,
            measured=known.measured,
        )

    def _begin(self, bench: Bench, step: Step, note: StageNote) -> CapturePlan:
        """The plan of a step by a test shot; keeps where the stage is and which filter this is."""
        white = shoot_white(bench)
        keep_white(bench, step, white)
        plan = self._plan(bench.rig, step, white)
        bench.keep(step, STAGE_NOTE, note)
        return plan

    def _plan(self, rig: Rig, step: Step, white: WhiteLevel) -> CapturePlan:
        if step.placement.filter_nm is None:
            return CapturePlan(
                name=step.title,
                code=GrayCode(rows=False),
                spectral=ScanLines(step_px=self.code_step_px),
                settings=bracket(rig, white, step.title, LONG_RATIO),
                code_settings=(0,),
            )
        bright = bright_setting(rig, white, step.title)
        cycles = int(min(LONGER * bright.exposure_ms, LONGEST_MS) / rig.frame_period_ms)
        return CapturePlan(
            name=step.title,
            code=NoCode(),
            spectral=ScanLines(step_px=self.filter_step_px, sparse=True),
            settings=(Setting(exposure_ms=max(cycles, 1) * rig.frame_period_ms, level=bright.level),),
            code_settings=(0,),
        )

    def _check(self, bench: Bench, step: Step, progress: Progress) -> None:
        """Compare a plane with those of the positions before it."""
        plain = [each for each in self.steps(bench) if each.placement.filter_nm is None]
        plain = [each for each in plain[: plain.index(step)] if bench.is_scanned(each)] + [step]
        planes = [self._plane(bench, each, progress, each is step) for each in plain]
        if len(planes) > 1:
            with naming(step):
                _require_steps(planes, self.stage_std_mm)

    def _plane(self, bench: Bench, step: Step, progress: Progress, new: bool) -> PlaneNote:
        """Where a position's plane stands, as noted when it was captured if the geometry is still that."""
        geometry = (bench.rig.camera, bench.rig.projector, bench.rig.pose)
        if not new and (bench.step_folder(step) / PLANE_NOTE).exists():
            note = bench.kept(step, PLANE_NOTE, PlaneNote)
            if (note.camera, note.projector, note.pose) == geometry:
                return note
        position_mm = bench.kept(step, STAGE_NOTE, StageNote).position_mm
        columns = self._plain(bench, step, progress).columns
        with naming(step):
            distance_mm, rms_px = lone_plane(bench.rig, position_mm, columns)
        camera, projector, pose = geometry
        note = PlaneNote(
            position_mm=position_mm,
            distance_mm=distance_mm,
            column_rms_px=rms_px,
            column_limit_px=column_limit_px(columns),
            camera=camera,
            projector=projector,
            pose=pose,
        )
        bench.keep(step, PLANE_NOTE, note)
        return note

    def _planes(self, bench: Bench, plain: list[Step], progress: Progress) -> list[SeenPlane]:
        """The planes, all with columns counted from the same place of a line.

        Where one position is bright enough to show an uneven spread of the lines and another is not, the
        other one is read with what the nearest of them shows: it is the same projector.
        """
        seen = [self._plain(bench, step, progress) for step in plain]
        uneven = [k for k, each in enumerate(seen) if each.response.spread is not None]
        for k in sorted(set(range(len(seen))) - set(uneven)) if uneven else ():
            nearest = min(uneven, key=lambda other: abs(other - k))
            rig = bench.rig.model_copy(update={"projector_response": seen[nearest].response})
            seen[k] = self._plain(replace(bench, rig=rig), plain[k], progress)
        return seen

    def _plain(self, bench: Bench, step: Step, progress: Progress) -> SeenPlane:
        with naming(step):
            return seen_plane(bench.scan_of(step), bench.rig, progress)

    def _lines(self, bench: Bench, step: Step) -> LineFrames:
        with naming(step):
            return lines_on_plane(bench.scan_of(step), bench.rig)

    def _chain(
        self, bench: Bench, plain: list[Step], found: DepthStageCalibration, progress: Progress
    ) -> ChainCorrection:
        """What the lines without filter say of the chain, once it is known where the light goes."""
        from dsl_core.calibration.light.chain import chain_correction

        rig = apply_depth_stage(found, bench.rig)
        scans = []
        for step in plain:
            with naming(step):
                scans.append(diffuser_lines(bench.scan_of(step), rig, progress)[1])
        progress.report("chain", 0, 1)
        return chain_correction(rig, scans, reflectance=self.reflectance)


def _require_steps(planes: Sequence[PlaneNote], stage_std_mm: float) -> None:
    """Raise `CalibrationError` when the last plane stands elsewhere than the stage says, and why it may."""
    last = planes[-1]
    try:
        places = [each.position_mm for each in planes], [each.distance_mm for each in planes]
        require_steps(*places, stage_std_mm)
    except CalibrationError as error:
        others_px = max(each.column_rms_px for each in planes[:-1])
        if last.column_rms_px < last.column_limit_px + LESS_FLAT * others_px:
            raise
        raise CalibrationError(
            f"The columns at the stage's position {last.position_mm:g} mm scatter by"
            f" {last.column_rms_px:.2f} px about a plane, those captured before by {others_px:.2f} px: the"
            " target is not flat, or something stands before it. Put a flat target in place and capture this"
            " position again."
        ) from error


def _plain_step(position_mm: float) -> Step:
    return Step(
        f"position-{position_mm:g}",
        f"Plane at {position_mm:g} mm",
        "Mount the film in front of the projector and put the Spectralon, or a flat white target whose"
        f" reflectance is set, on the stage at {position_mm:g} mm, facing the camera and filling its view. No"
        " filter in front of the camera.",
        Placement(target="spectralon", film=True, options={"depth_mm": position_mm}),
    )


def _filtered(position_mm: float, filters_nm: list[float]) -> list[Step]:
    return [
        Step(
            f"position-{position_mm:g}-filter-{nm:g}",
            f"Plane at {position_mm:g} mm, filter of {nm:g} nm",
            f"Put the bandpass filter of {nm:g} nm flat in front of the camera's lens. Move nothing else.",
            Placement(target="spectralon", film=True, filter_nm=nm, options={"depth_mm": position_mm}),
        )
        for nm in filters_nm
    ]


def _filter_of(note: StageNote, fwhm_nm: float) -> StageFilter:
    assert note.filter_nm is not None
    assert note.transmission is not None
    curve = note.transmission if note.measured else nominal_filter(note.filter_nm, fwhm_nm)
    return StageFilter(note.filter_nm, curve, note.measured)
