"""From accepted calibrations to a calibrated rig."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime

from pydantic import ValidationError

from dsl_core.campaign.common.recipe import AnyRecipe, Recipe, RecordT
from dsl_core.capture.overexposure import black_level_of
from dsl_core.devices.base import DeviceRig
from dsl_core.devices.conditions import current_conditions
from dsl_core.errors import CalibrationError
from dsl_core.io.campaign_folder import CampaignFolder
from dsl_core.model.base import problems_in_words
from dsl_core.model.calibration.accepted import AcceptedCalibration
from dsl_core.model.conditions import differences
from dsl_core.model.rig import Provenance, Rig

Accepted = Mapping[str, AcceptedCalibration]


def accepted_calibrations(campaign: CampaignFolder, recipes: Sequence[AnyRecipe]) -> Accepted:
    """What a campaign has accepted, by name and in order; raises `StoreError` for a damaged file."""
    found = {recipe.name: campaign.accepted(recipe.name) for recipe in recipes}
    return {name: each for name, each in found.items() if each is not None}


def nominal_rig(devices: DeviceRig) -> Rig:
    """What is known of a rig before anything is measured; raises `CalibrationError` when nothing is.

    The size, mosaic and frame period that the devices state replace those of the data sheet; its black level
    is not believed where it is of another number of bits.
    """
    start = devices.nominal or devices.calibration
    if start is None:
        raise CalibrationError(
            f"The rig {devices.name!r} does not describe its lenses, film and colours, so calibration has"
            " nothing to start from. State the values of the data sheets: 'nominal' of a profile names their"
            " file, and a package sets DeviceRig.nominal."
        )
    camera, projector = devices.camera.info, devices.projector.info
    own = {"bayer": camera.bayer, "bit_depth": camera.bit_depth}
    sensor = start.sensor.model_copy(update=own | {"black_level_dn": black_level_of(start.sensor, camera)})
    return start.model_copy(
        update={
            "camera": start.camera.resized(camera.width_px, camera.height_px),
            "projector": start.projector.resized(projector.width_px, projector.height_px),
            "sensor": sensor,
            "frame_period_ms": projector.frame_period_ms,
            "calibrations": (),
            "conditions": None,
        }
    )


def apply_records(accepted: Accepted, nominal: Rig, recipes: Sequence[AnyRecipe]) -> Rig:
    """The rig after all accepted calibrations, in the order of the recipes.

    Raises `CalibrationError` when one lacks what it needs, is of another version, or when two were captured
    with different devices or settings.
    """
    _refuse_mixture(accepted)
    rig = nominal
    for recipe in recipes:
        if recipe.name not in accepted:
            continue
        require_needs(recipe, accepted)
        rig = recipe.apply(record_of(recipe, accepted[recipe.name]), rig)
    return rig


def assemble(accepted: Accepted, nominal: Rig, recipes: Sequence[AnyRecipe], name: str = "") -> Rig:
    """The calibrated rig: what was found, under which conditions, when, and how well.

    Raises `CalibrationError` as `apply_records` does, and when nothing was accepted at all.
    """
    if not accepted:
        raise CalibrationError(
            "No calibration has been accepted yet, so there is no rig to assemble. Calibrate first."
        )
    rig = apply_records(accepted, nominal, recipes)
    ordered = [accepted[recipe.name] for recipe in recipes if recipe.name in accepted]
    conditions = next((each.conditions for each in reversed(ordered) if each.conditions), None)
    lacking = [recipe.name for recipe in recipes if recipe.name not in accepted]
    provenance = Provenance(
        created=datetime.now(UTC).isoformat(timespec="seconds"),
        source="campaign",
        camera_serial=conditions.camera.serial if conditions else "",
        projector_serial=conditions.projector.serial if conditions else "",
        notes=f"Not calibrated, as nominal: {', '.join(lacking)}." if lacking else "",
    )
    return rig.model_copy(
        update={
            "name": name or rig.name,
            "provenance": provenance,
            "conditions": conditions,
            "calibrations": tuple(each.note for each in ordered),
        }
    )


def require_needs(recipe: AnyRecipe, accepted: Accepted) -> None:
    """Raise `CalibrationError` when a calibration that this one needs was not accepted."""
    lacking = [name for name in recipe.needs if name not in accepted]
    if lacking:
        raise CalibrationError(
            f"The calibration {recipe.name} needs {' and '.join(lacking)}, which is not accepted yet."
            f" Calibrate {lacking[0]} first."
        )


def require_same_devices(accepted: Accepted, devices: DeviceRig) -> None:
    """Raise `CalibrationError` when what a calibration builds on was captured with other devices."""
    now = current_conditions(devices)
    for name, each in accepted.items():
        found = () if each.conditions is None else differences(each.conditions, now)
        if found:
            raise CalibrationError(
                f"The calibration {name} was captured with other devices or settings: {'; '.join(found)}."
                f" Set them back, calibrate {name} again, or start a new campaign."
            )


def record_of(recipe: Recipe[RecordT], accepted: AcceptedCalibration) -> RecordT:
    """The recipe's own record; raises `CalibrationError` when it is of another version."""
    try:
        return recipe.record_type.model_validate_json(json.dumps(accepted.record))
    except ValidationError as error:
        raise CalibrationError(
            f"The accepted calibration {recipe.name} of {accepted.accepted[:10]} is damaged or of another"
            f" version ({problems_in_words(error)})."
            " Fit it again; its captures are kept."
        ) from error


def _refuse_mixture(accepted: Accepted) -> None:
    known = [each for each in accepted.values() if each.conditions is not None]
    for other in known[1:]:
        assert known[0].conditions is not None
        assert other.conditions is not None
        found = differences(known[0].conditions, other.conditions)
        if found:
            raise CalibrationError(
                f"The calibrations {known[0].name} and {other.name} were captured with different devices or"
                f" settings: {'; '.join(found)}. Calibrate {other.name} again with those of {known[0].name}."
            )
