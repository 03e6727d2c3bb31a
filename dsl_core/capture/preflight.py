"""A plan fitted to a rig, and whether it is possible there, asked before anything moves."""

from __future__ import annotations

from collections.abc import Iterator

from dsl_core.devices.base import DeviceRig
from dsl_core.devices.conditions import check_conditions
from dsl_core.errors import PlanError
from dsl_core.model.plan import CapturePlan
from dsl_core.model.presets import has_usual_exposures, on_columns, on_cycles
from dsl_core.model.rig import Rig
from dsl_core.optics.lines.reach import MOST_UNREACHED, unreached_share, unreached_words
from dsl_core.optics.parallax import parallax_of


def fit_plan(plan: CapturePlan, rig: DeviceRig, *, keeps_patterns: bool = False) -> CapturePlan:
    """The plan for the image sizes of a rig's camera and projector.

    Exposures that nobody chose, those of a preset, become whole colour cycles, as the calibration measured
    them or else as the projector claims; others are left as they are. A preset's comb becomes as wide as the
    projector's columns ask, unless the plan ``keeps_patterns``.
    """
    camera, projector = rig.camera.info, rig.projector.info
    if has_usual_exposures(plan):
        known = rig.calibration or projector
        plan = on_cycles(plan, known.frame_period_ms)
    if not keeps_patterns:
        plan = on_columns(plan, projector.width_px)
    return plan.sized(camera, projector)


def find_obstacles(rig: DeviceRig, plan: CapturePlan) -> list[str]:
    """Everything that keeps the rig from doing the plan, one clause each; empty when it can start."""
    return [
        *_sizes(rig, plan),
        *exposure_obstacles(rig.camera.info.exposure_range_ms, plan),
        *_calibration(rig),
    ]


def find_remarks(calibration: Rig | None) -> list[str]:
    """What a scan with a calibration will suffer from although it can start, in sentences."""
    if calibration is None:
        return []
    found, unreached = parallax_of(calibration), unreached_share(calibration)
    remarks = [f"{found.sentence} {found.advice}"] if found.is_small else []
    return [*remarks, " ".join(unreached_words(unreached))] if unreached > MOST_UNREACHED else remarks


def require_possible(rig: DeviceRig, plan: CapturePlan) -> None:
    """Raise `PlanError` naming all obstacles at once."""
    obstacles = find_obstacles(rig, plan)
    if obstacles:
        raise PlanError(
            f"The plan {plan.name!r} is impossible on the rig {rig.name!r}: {'; '.join(obstacles)}."
        )


def _sizes(rig: DeviceRig, plan: CapturePlan) -> Iterator[str]:
    camera, projector = rig.camera.info, rig.projector.info
    for name, wanted, found in (
        ("camera", plan.camera_size_px, (camera.width_px, camera.height_px)),
        ("projector", plan.projector_size_px, (projector.width_px, projector.height_px)),
    ):
        if wanted != found:
            yield (
                f"the plan is for a {name} of {wanted[0]} x {wanted[1]} pixels,"
                f" this one has {found[0]} x {found[1]} (make the plan with this {name}'s size)"
            )


def exposure_obstacles(range_ms: tuple[float, float], plan: CapturePlan) -> Iterator[str]:
    """A clause for each setting that a camera which exposes in this range cannot take."""
    shortest, longest = range_ms
    for i, setting in enumerate(plan.settings):
        if not shortest <= setting.exposure_ms <= longest:
            yield (
                f"setting {i} exposes for {setting.exposure_ms:g} ms, but the camera supports {shortest:g}"
                f" to {longest:g} ms"
            )


def _calibration(rig: DeviceRig) -> Iterator[str]:
    known = rig.calibration
    if known is None:
        return
    camera, projector = rig.camera.info, rig.projector.info
    for name, lens, found in (
        ("camera", known.camera, (camera.width_px, camera.height_px)),
        ("projector", known.projector, (projector.width_px, projector.height_px)),
    ):
        if (lens.width_px, lens.height_px) != found:
            yield (
                f"the calibration is for a {name} of {lens.width_px} x {lens.height_px} pixels,"
                f" this one has {found[0]} x {found[1]}"
                " (calibrate again, or load the calibration of this size)"
            )
    if (known.sensor.bayer, known.sensor.bit_depth) != (camera.bayer, camera.bit_depth):
        yield (
            f"the calibration is for a {known.sensor.bayer} mosaic of {known.sensor.bit_depth} bits,"
            f" the camera delivers {camera.bayer} of {camera.bit_depth} bits"
            " (set the camera, or calibrate again)"
        )
    for clause in check_conditions(known, rig):
        yield f"since the calibration, {clause} (set it back, or calibrate again)"
