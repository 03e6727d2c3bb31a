"""Choosing a plan: the front, the budget, the error, and the command that answers with a plan."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dsl_core.capture.preflight import find_obstacles
from dsl_core.cli import main
from dsl_core.cli.tradeoff import parse_seconds
from dsl_core.devices.base import DeviceRig
from dsl_core.devices.registry import open_rig
from dsl_core.errors import PlanError, StoreError
from dsl_core.io.plan_file import load_plan, save_plan
from dsl_core.model.plan import CapturePlan, GrayCode, LineComb, ScanLines
from dsl_core.model.rig import Rig
from dsl_core.planning.choice import (
    BRACKETS,
    LINES,
    Weighed,
    brackets_on,
    candidate_plans,
    choose,
    pareto,
    pattern_sets,
    possible_plans,
    weigh,
)
from dsl_core.planning.designed import DesignedSet, load_design, packed, save_design
from dsl_core.planning.expected import Prediction
from dsl_core.planning.report import write_tradeoff_report
from dsl_core.planning.samples import SamplePixels, plane_samples
from dsl_core.simulation.published_rig import published_rig
from dsl_core.solve.front import front


def weighed(seconds: float, error: float, coverage: float = 1.0) -> Weighed:
    expected = Prediction(
        frames=10, spectral_frames=5, seconds=seconds, raw_bytes=1, computing_s=1, rmse=error,
        pixel_rmse=error, angle_rad=0, pixel_angle_rad=0, delta_e=0, fwhm_nm=None, depth_std_mm=1,
        coverage=coverage, decided=1,
    )  # fmt: skip
    return Weighed(CapturePlan(name=f"{seconds:g} s"), expected)


PLANS = [weighed(10, 0.05), weighed(30, 0.02), weighed(40, 0.03), weighed(60, 0.01)]


def test_the_front_holds_what_nothing_beats() -> None:
    assert [each.plan.name for each in pareto(PLANS)] == ["10 s", "30 s", "60 s"]
    assert front([(1, 1), (1, 0.5), (2, 0.5)]) == [1]


def test_a_budget_gets_the_most_accurate_and_an_error_the_quickest() -> None:
    assert choose(PLANS, budget_s=45).plan.name == "30 s"
    assert choose(PLANS, error=0.035).plan.name == "30 s"
    assert choose(PLANS, budget_s=100).plan.name == "60 s"


def test_a_plan_that_leaves_most_of_the_picture_without_depth_is_no_choice() -> None:
    """Its error is that of the few pixels that it has left."""
    few = weighed(20, 0.001, coverage=0.3)
    assert choose([*PLANS, few], budget_s=45).plan.name == "30 s"
    assert choose([*PLANS, few], error=0.035).plan.name == "30 s"
    assert few not in pareto([*PLANS, few])
    assert choose([few, weighed(10, 0.01, coverage=0.31)]) is few


def test_what_cannot_be_had_is_refused_with_what_can() -> None:
    with pytest.raises(PlanError, match=r"'60 s', reaches 0\.0100"):
        choose(PLANS, error=0.001)
    with pytest.raises(PlanError, match=r"at most 5 s on this rig; the quickest, '10 s', takes 10 s"):
        choose(PLANS, budget_s=5)
    with pytest.raises(PlanError, match=r"error of 0\.01 within 40 s; the best, '30 s', reaches"):
        choose(PLANS, budget_s=40, error=0.01)


def test_plans_that_are_all_too_slow_are_not_predicted() -> None:
    plan = CapturePlan()
    told = rf"the quickest, '{plan.name}', takes {plan.duration_s(0.0):.0f} s"
    with pytest.raises(PlanError, match=told):
        weigh(published_rig(), [plan], budget_s=1.0)


@pytest.mark.parametrize("text", ["", "soon", "-3s", "0", "nan"])
def test_a_budget_that_is_no_time_is_refused(text: str) -> None:
    with pytest.raises(PlanError, match="60s or 2min"):
        parse_seconds(text)


@pytest.mark.slow
def test_real_plans_are_weighed_and_written(tmp_path: Path) -> None:
    rig = published_rig()
    quick = sorted(candidate_plans(rig), key=lambda plan: plan.duration_s(50))[:3]
    found = weigh(rig, quick, plane_samples(rig, grid=(3, 1)), latency_ms=50)
    best = choose(found)
    path = save_plan(best.plan, tmp_path / "plan.json")
    assert load_plan(path) == best.plan
    page = write_tradeoff_report(found, best, tmp_path / "page.html").read_text()
    assert best.plan.name in page
    assert "data:image/png" in page


def test_a_designed_set_survives_its_file(tmp_path: Path) -> None:
    levels = np.random.default_rng(1).integers(0, 256, (8, 640, 3), np.uint8)
    made = DesignedSet(
        name="set",
        rig="twin",
        command="",
        frames=8,
        width_px=640,
        lines="lines",
        comb_error=2,
        error=1,
        levels=packed(levels),
    )
    path = save_design(made, tmp_path / "set.json")
    assert np.array_equal(load_design(path).array, levels)
    path.write_text(json.dumps({"name": "set"}))
    with pytest.raises(StoreError, match="cannot be read"):
        load_design(path)


def _limited(longest_ms: float) -> DeviceRig:
    """A twin whose camera exposes no longer."""
    rig = open_rig("twin", {"size": "112x72"})
    info = replace(rig.camera.info, exposure_range_ms=(0.1, longest_ms))
    rig.camera._info = info  # type: ignore[attr-defined]
    return rig


@pytest.mark.parametrize("longest_ms", [50.0, 100.0, 200.0])
def test_plans_for_a_camera_expose_no_longer_than_it_can(longest_ms: float) -> None:
    with _limited(longest_ms) as devices:
        assert devices.calibration is not None
        able = possible_plans(devices, devices.calibration)
        assert all(not find_obstacles(devices, plan) for plan in able)
    sets = {plan.spectral for plan in candidate_plans(published_rig())}
    # All patterns are left, at exposures that keep their ratio as far as whole cycles can.
    assert {plan.spectral for plan in able} == sets
    assert len({plan.name for plan in able}) == len(able)
    bracket = brackets_on(published_rig(), longest_ms)[0]
    assert bracket[1][0] == int(longest_ms / published_rig().frame_period_ms)
    assert bracket[0][0] == pytest.approx(bracket[1][0] / 2, abs=0.5)


@pytest.mark.parametrize("rate_hz", [24.0, 50.0, 120.0])
def test_another_projector_exposes_as_long_in_whole_cycles_of_its_own(rate_hz: float) -> None:
    rig = published_rig().model_copy(update={"frame_period_ms": 1000 / rate_hz})
    settings = [plan.settings for plan in candidate_plans(rig)][1]
    assert [each.exposure_ms for each in settings] == pytest.approx([500 / 3, 1000 / 3], abs=500 / rate_hz)
    assert all((each.exposure_ms * rate_hz / 1000) % 1 == pytest.approx(0) for each in settings)


def test_exposures_follow_the_light_and_the_range_of_the_sensor() -> None:
    rig = published_rig()
    assert brackets_on(rig, math.inf) == list(BRACKETS)
    brighter = rig.model_copy(update={"white_scale": 8 * rig.white_scale})
    assert brackets_on(brighter, math.inf)[0] == ((1, 0.2), (2, 0.8))
    quickest = [min(plan.duration_s(50.0) for plan in candidate_plans(each)) for each in (rig, brighter)]
    assert quickest[1] < 0.75 * quickest[0]
    # Where there is less light, quick plans are still there.
    darker = rig.model_copy(update={"white_scale": rig.white_scale / 8})
    assert set(BRACKETS) | {((80, 0.2), (160, 0.8))} < set(brackets_on(darker, math.inf))
    deeper = {"bit_depth": 16, "black_level_dn": 16 * rig.sensor.black_level_dn}
    sixteen = {"sensor": rig.sensor.model_copy(update=deeper), "white_scale": 16 * rig.white_scale}
    assert brackets_on(rig.model_copy(update=sixteen), math.inf) == list(BRACKETS)
    near = {"reference_distance_mm": 2 * rig.reference_distance_mm}
    assert brackets_on(rig.model_copy(update=near), math.inf)[0] == ((2, 0.2), (5, 0.8))
    # Without a film nothing says how much light there is.
    assert brackets_on(rig.model_copy(update={"efficiency": {}}), math.inf) == list(BRACKETS)


def test_that_no_plan_is_possible_is_told() -> None:
    with _limited(1) as devices:
        assert devices.calibration is not None
        told = r"None of \d+ plans .* 16\.6667 ms, but the camera supports 0\.1 to 1 ms\. Use a camera that"
        with pytest.raises(PlanError, match=told):
            possible_plans(devices, devices.calibration)
        with pytest.raises(PlanError, match=r"'twin': the plan is for a camera of .* 112 x 72.* of one kind"):
            possible_plans(devices, published_rig())


def test_the_commands_write_no_plan_that_the_rig_refuses(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("dsl_core.devices.registry.open_rig", lambda *_: _limited(150))
    path = tmp_path / "plan.json"
    assert main(["tradeoff", "--budget", "14s", "--plan", str(path)]) == 0
    with _limited(150) as devices:
        assert find_obstacles(devices, load_plan(path)) == []
    designed = ["design", str(tmp_path / "set.json"), "--plan", str(tmp_path / "designed.json")]
    assert main(designed) == 2
    assert "the camera supports 0.1 to 150 ms" in capsys.readouterr().err
    assert not (tmp_path / "set.json").exists()


@pytest.mark.parametrize(("look", "told"), [([], True), (["--look", "seen.zarr"], False)])
def test_a_prediction_without_the_room_says_so(
    look: list[str], told: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def seen(rig: Rig, _: object) -> SamplePixels:
        return replace(plane_samples(rig, grid=(3, 1)), black_dn_per_ms=(1.0, 1.0, 1.0))

    monkeypatch.setattr("dsl_core.io.result.result_file.load_result", lambda _: "seen")
    monkeypatch.setattr("dsl_core.planning.samples.scene_samples", seen)
    monkeypatch.setattr("dsl_core.planning.choice.BRACKETS", (((2, 0.2), (8, 0.8)),))
    assert main(["tradeoff", "--budget", "12s", "-O", "size=112x72", *look]) == 0
    assert ("dark room" in capsys.readouterr().out) == told


@pytest.mark.slow
def test_a_designed_plan_has_the_size_of_the_rig(tmp_path: Path) -> None:
    path = tmp_path / "plan.json"
    command = ["design", str(tmp_path / "set.json"), "--frames", "8", "--orders", "1", "-O", "size=112x72"]
    assert main([*command, "--plan", str(path)]) == 0
    with open_rig("twin", {"size": "112x72"}) as devices:
        assert find_obstacles(devices, load_plan(path)) == []


def test_candidates_are_named_apart_and_fit_the_rig() -> None:
    plans = list(candidate_plans(published_rig()))
    assert len({plan.name for plan in plans}) == len(plans)
    assert plans[0].spectral_count == 318
    assert any(isinstance(p.spectral, LineComb) and p.spectral.shifts_px != (0, 0, 0) for p in plans)
    assert all(isinstance(plan.code, GrayCode) for plan in plans)


@pytest.mark.parametrize("width_px", [1280, 1920, 3840])
def test_lines_of_as_few_frames_are_offered_to_a_projector_of_more_columns(width_px: int) -> None:
    rig = published_rig()
    wide = rig.model_copy(update={"projector": rig.projector.resized(width_px, width_px * 9 // 16)})
    offered = pattern_sets(wide)
    for width, step in LINES:
        assert f"lines {width}x{step}" in offered
        times = width_px // 640
        assert offered[f"lines {times * width}x{times * step}"] == ScanLines(
            width_px=times * width, step_px=times * step
        )
    assert len([name for name in pattern_sets(rig) if name.startswith("lines")]) == len(LINES)
