"""A camera without colours goes through the calibrations, and those that compare colours are left out."""

from __future__ import annotations

from pathlib import Path

import pytest

from dsl_core.calibration.light.chain import chain_correction, largest_correction
from dsl_core.campaign.bandpass.recipe import BandpassRecipe
from dsl_core.campaign.common.flat_target import diffuser_lines
from dsl_core.campaign.drift_check import drift_figures, quick_plan
from dsl_core.campaign.guide import calibrate_all, omitted
from dsl_core.campaign.light_history import light_check
from dsl_core.campaign.recipes import campaign_recipes, load_recipe
from dsl_core.io.campaign_folder import CampaignFolder
from dsl_core.model.calibration.accepted import CalibrationNote
from dsl_core.model.figure import failures
from dsl_core.model.plan import CapturePlan, GrayCode, ScanLines
from dsl_core.model.rig import Rig
from dsl_core.progress import NoProgress
from dsl_core.simulation import sim_devices
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.sim_devices import open_twin
from tests.cases.fake_recipe import FakeRecipe
from tests.cases.film_bench import film_bench, take_all, truth_of
from tests.cases.twin_scan import twin_scan

from .test_session import Willing


def without_colours(rig: Rig) -> Rig:
    return rig.model_copy(update={"sensor": rig.sensor.model_copy(update={"bayer": "MONO"})})


@pytest.fixture(autouse=True)
def monochrome(monkeypatch: pytest.MonkeyPatch) -> None:
    """Twins have a camera without a mosaic."""
    monkeypatch.setattr(sim_devices, "published_rig", lambda: without_colours(published_rig()))


def test_filters_measure_the_one_curve_of_a_monochrome_camera(tmp_path: Path) -> None:
    known = (
        "camera",
        "projector",
        "pose",
        "emission",
        "response",
        "sensor",
        "flat_field",
        "white_scale",
        "projector_response",
    )
    bench = film_bench(tmp_path, 4, known)
    recipe = BandpassRecipe(filters_nm=(450.0, 500.0, 550.0, 600.0, 650.0), pixels=1500)
    record = recipe.fit(take_all(recipe, bench), NoProgress())
    figures = recipe.figures(record)
    assert [str(each) for each in failures(figures)] == []
    assert [each.name for each in figures if "response" in each.name] == ["response, deviation"]
    found, truth = recipe.apply(record, bench.rig), truth_of(bench.devices)
    for order in (1, -1):
        for nm in recipe.filters_nm:
            assert found.efficiency[order].at(nm) == pytest.approx(truth.efficiency[order].at(nm), rel=0.02)
    # What no pixel sees stays as it was.
    known_curves = bench.rig.response
    for colour in (0, 2):
        assert found.response[colour].at(540.0) == pytest.approx(known_curves[colour].at(540.0), rel=1e-3)


def test_a_diffuser_corrects_it_and_knows_its_white() -> None:
    plan = CapturePlan(code=GrayCode(rows=False), spectral=ScanLines(width_px=5, step_px=2))
    devices, scan = twin_scan(plan, size="112x72", scene="plane")
    assert devices.calibration is not None
    lines = diffuser_lines(scan, devices.calibration, pixels=1500)[1]
    record = chain_correction(devices.calibration, [lines])
    assert record.white_scale_rel_std < 0.01
    assert record.largest_correction < 0.05


def test_curves_of_colours_that_it_does_not_have_are_no_correction() -> None:
    rig = without_colours(published_rig())
    red, green, blue = rig.response
    twice = red.model_copy(update={"values": tuple(2 * value for value in red.values)})
    other = rig.model_copy(update={"response": (twice, green, blue)})
    assert largest_correction(rig, other) == 0.0


def test_a_drift_check_has_one_figure_for_its_light() -> None:
    devices, scan = twin_scan(quick_plan(), size="112x72", scene="plane")
    rig = devices.calibration
    assert rig is not None
    figures = drift_figures(scan, rig, spectralon=False, pixels=1500)
    assert failures(figures) == ()
    figures = drift_figures(scan, rig, spectralon=True, pixels=1500)
    light = [each for each in figures if each.name.startswith("white signal")]
    assert [each.name for each in light] == ["white signal, over calibration"]
    note = CalibrationNote(name="spectralon", title="Spectralon", accepted="2026-01-01T00:00:00+00:00")
    noted = rig.model_copy(update={"calibrations": (note,)})
    check = light_check(noted, figures, "2026-01-02T00:00:00+00:00")
    assert check is not None
    assert check.levels == (light[0].value,) * 3


def test_all_its_calibrations_are_those_but_the_color_checker(tmp_path: Path) -> None:
    campaign = CampaignFolder.begin(tmp_path / "campaign", "twin", {})
    reasons = omitted(campaign_recipes(campaign), open_twin({"size": "112x72"}))
    assert list(reasons) == ["color-checker"]
    assert "monochrome" in reasons["color-checker"]


def test_a_calibration_that_a_rig_goes_without_is_not_run(tmp_path: Path) -> None:
    class ForColours(FakeRecipe):
        def reason_to_omit(self, rig: Rig) -> str:
            return load_recipe("color-checker").reason_to_omit(rig)

    options = {"size": "32x24", "scene": "plane"}
    recipes = FakeRecipe(name="one"), ForColours(name="two")
    campaign = CampaignFolder.begin(tmp_path / "campaign", "twin", options)
    calibrate_all(campaign, open_twin(options), Willing(), NoProgress(), recipes=recipes)
    assert recipes[0].captured
    assert not recipes[1].captured
