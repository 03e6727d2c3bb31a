"""Lenses that magnify colours differently: planes tell, so that the film is not bent to make up for it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dsl_core.campaign.common.recipe import Bench
from dsl_core.campaign.depth_stage.planes import seen_plane, with_lateral_colour
from dsl_core.campaign.depth_stage.recipe import DepthStageRecipe
from dsl_core.model.calibration.depth_stage import DepthStageCalibration
from dsl_core.progress import NoProgress
from tests.cases.film_bench import film_bench, take_all, truth_of

#: Their fixtures calibrate a rig; `tests/campaign/test_kept_figures.py` calibrates one in any run.
pytestmark = pytest.mark.slow

RECIPE = DepthStageRecipe(
    positions_mm=(650.0, 850.0), filters_nm=(450.0, 640.0), code_step_px=5, filter_step_px=24, chain=False
)
KNOWN = ("emission", "sensor", "flat_field", "response", "white_scale", "projector_response", "efficiency")


@pytest.fixture(scope="module")
def bench(module_folder: Path) -> Bench:
    known = (*KNOWN, "camera", "projector", "pose")
    return take_all(RECIPE, film_bench(module_folder, 1, known, foreign="lateral-colour", size="56x36"))


@pytest.fixture(scope="module")
def record(bench: Bench) -> DepthStageCalibration:
    return RECIPE.fit(bench, NoProgress())


def test_it_is_measured_and_goes_with_the_rig(bench: Bench, record: DepthStageCalibration) -> None:
    assert record.colours_apart_px is not None
    apart_px, std_px = record.colours_apart_px
    assert apart_px > 5 * std_px > 0
    (figure,) = (each for each in RECIPE.figures(record) if each.name == "red and blue light apart")
    assert (figure.value, figure.std, figure.unit) == (apart_px, std_px, "px")
    colour = RECIPE.apply(record, bench.rig).lateral_colour
    assert colour is not None
    assert colour == record.lateral_colour
    assert colour.camera[0] > colour.camera[2]
    assert colour.projector_per_nm > 0


def test_the_film_does_not_make_up_for_it(bench: Bench, record: DepthStageCalibration) -> None:
    truth = truth_of(bench.devices).film
    pulls = [
        (getattr(record.film, name) - getattr(truth, name)) / std for name, std in record.film_std.items()
    ]
    assert np.sqrt(np.mean(np.square(pulls))) < 1.5
    # Fitted to one colour of lens, the filters would seem 0.13 px off, in opposite directions.
    assert max(abs(shift) for each in record.filters for shift in each.shift_px) < 0.03


def test_planes_that_tell_nothing_leave_the_rig_as_it_was(bench: Bench) -> None:
    seen = seen_plane(bench.scan_of(RECIPE.steps(bench)[0]), bench.rig)
    assert seen.bends is not None
    assert with_lateral_colour(bench.rig, [replace(seen, bends=None)]) == (bench.rig, None)
