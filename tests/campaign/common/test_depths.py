"""Targets stand where a rig is for, whatever its distance."""

from __future__ import annotations

from pathlib import Path

import pytest

from dsl_core.campaign.common.depths import seen_whole_mm
from dsl_core.campaign.common.recipe import AnyRecipe, Bench
from dsl_core.campaign.recipes import load_recipe
from dsl_core.errors import CalibrationError
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.sim_devices import open_twin


@pytest.mark.parametrize("name", ["spectralon", "color-checker", "bandpass"])
@pytest.mark.parametrize(
    ("depth_range_mm", "depth_mm"),
    [((500.0, 1000.0), 700.0), ((280.0, 580.0), 400.0), ((1050.0, 2175.0), 1500.0)],
)
def test_flat_targets_stand_within_the_depths_of_their_rig(
    name: str, depth_range_mm: tuple[float, float], depth_mm: float, tmp_path: Path
) -> None:
    rig = published_rig().model_copy(update={"depth_range_mm": depth_range_mm})
    bench = Bench(open_twin({"size": "30x20"}), tmp_path, rig)

    def where(recipe: AnyRecipe) -> set[object]:
        return {step.placement.options["depth_mm"] for step in recipe.steps(bench)}

    assert where(load_recipe(name)) == {depth_mm}
    assert all(
        f"about {depth_mm / 10:g} cm" in step.instruction for step in load_recipe(name).steps(bench)[:1]
    )
    assert where(load_recipe(name, {"depth_mm": "655"})) == {655.0}
    for far_mm in (depth_range_mm[0] / 2, 2 * depth_range_mm[1]):
        with pytest.raises(CalibrationError, match=rf"depth_mm={far_mm:g}; .* for {depth_range_mm[0]:g} to"):
            load_recipe(name, {"depth_mm": str(far_mm)}).steps(bench)


def test_a_chart_stands_farther_away_where_a_narrow_view_shows_all_of_it(tmp_path: Path) -> None:
    rig = published_rig()
    longer = {"fx_px": 1.25 * rig.camera.fx_px, "fy_px": 1.25 * rig.camera.fy_px}
    narrow = rig.model_copy(update={"camera": rig.camera.model_copy(update=longer)})
    (step,) = load_recipe("color-checker").steps(Bench(open_twin({"size": "30x20"}), tmp_path, narrow))
    assert step.placement.options["depth_mm"] == 800.0
    assert seen_whole_mm(narrow, (370.0, 208.0)) == 950.0
    # What nothing shows as a whole stands where the rig has most room.
    assert seen_whole_mm(narrow, (900.0, 208.0)) == 700.0
