from __future__ import annotations

from dataclasses import replace
from itertools import islice
from pathlib import Path
from shutil import copytree

import pytest
from dsl_app.connection.state import RigChoice
from dsl_app.scan.forecast.controller import NO_CALIBRATION, ForecastController
from dsl_app.scan.forecast.job import ForecastBasis, ForecastJob, usual_candidates
from dsl_app.scan.forecast.state import ForecastPoint, ForecastState, identity, plan_title
from dsl_app.scan.state import Phase
from dsl_app.shared.jobs.base import Job

from dsl_core.capture.preflight import exposure_obstacles
from dsl_core.capture.runner import State, Status
from dsl_core.errors import PlanError
from dsl_core.io.result.result_file import load_result, save_result
from dsl_core.model.plan import CapturePlan, CodeSet, EnsembleCode, GrayCode, LineComb, NoSpectral, XorCode
from dsl_core.model.presets import PRESETS
from dsl_core.model.rig import Rig
from dsl_core.planning import prediction, samples
from dsl_core.planning.expected import Prediction
from dsl_core.planning.store import PredictionStore
from tests.app.support.doubles import InlineRunner
from tests.app.support.scan_bench import (
    COMB,
    SHORT,
    TWIN,
    ScanBench,
    made_up_prediction,
    make_bench,
    make_forecast,
    planned_bench,
)
from tests.app.support.small_result import write_small_result


def forecast(bench: ScanBench, folder: Path, automatic: bool = True) -> ForecastController:
    made = make_forecast(bench, ForecastState(), folder / "forecasts", automatic=automatic)
    made.open(True)
    return made


@pytest.fixture
def bench(tmp_path: Path) -> ScanBench:
    """A bench that plans a preset."""
    made = planned_bench(tmp_path)
    made.plan(SHORT)
    return made


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of plans that were predicted, by a prediction that takes no time."""
    seen = list[str]()

    def predict(rig: Rig, plan: CapturePlan, *_: object, latency_ms: float) -> Prediction:
        seen.append(plan.name)
        if isinstance(plan.spectral, NoSpectral):
            raise PlanError(f"The plan {plan.name!r} has no spectral patterns.")
        return made_up_prediction(rig, plan, latency_ms)

    monkeypatch.setattr(prediction, "predict", predict)
    return seen


@pytest.mark.slow
def test_the_planner_is_asked(bench: ScanBench, tmp_path: Path) -> None:
    work = ForecastJob(
        ForecastBasis(bench.calibration, 50.0, 1000 / 60), tmp_path, lambda basis: (), lambda: False
    )
    found = work._of(COMB, PredictionStore(tmp_path, bench.calibration, 50.0), "")
    assert isinstance(found, ForecastPoint)
    assert found.expected.spectral_frames == 32
    assert 0 < found.expected.rmse < found.expected.pixel_rmse < 1


def test_nothing_is_predicted_while_nobody_looks(
    bench: ScanBench, tmp_path: Path, counted: list[str]
) -> None:
    control = make_forecast(bench, ForecastState(), tmp_path / "forecasts", automatic=True)
    bench.rig.connect(RigChoice("twin", (*TWIN.options, ("sigma", "0.01"))))
    assert counted == []
    control.open(True)
    assert len(counted) == len(PRESETS) == len(control.state.points.value)
    control.open(False)
    bench.rig.connect(TWIN)
    assert len(counted) == len(PRESETS)


def test_presets_and_candidates_are_predicted_once_and_remembered(
    bench: ScanBench, tmp_path: Path, counted: list[str]
) -> None:
    control = forecast(bench, tmp_path)
    assert len(control.state.points.value) == len(PRESETS)
    assert control.state.depth_mm.value == bench.calibration.usual_depth_mm
    assert control.state.left.value == 1
    control.predict_all()
    points = control.state.points.value
    # The published candidate is the reference preset.
    assert len(points) == len(PRESETS) + 1
    assert control.state.left.value == 0
    assert control.state.published is not None
    assert control.state.published.expected.frames == 748
    assert control.state.current.value is not None
    assert control.state.current.value.preset == "preview"
    assert control.state.progress.value == (0, 0)
    done = len(counted)
    again = forecast(bench, tmp_path)
    assert len(again.state.points.value) == len(points)
    assert len(counted) == done
    again.close()
    control.close()


def test_an_own_plan_is_predicted_when_it_is_made(
    bench: ScanBench, tmp_path: Path, counted: list[str]
) -> None:
    control = forecast(bench, tmp_path)
    bench.scans.plans.change_plan(COMB.model_copy(update={"spectral": LineComb(period_px=70), "name": "own"}))
    assert counted[-1] == "own"
    current = control.state.current.value
    assert current is not None
    assert current.expected.spectral_frames == 35


def test_an_impossible_plan_says_why_until_it_is_left(
    bench: ScanBench, tmp_path: Path, counted: list[str]
) -> None:
    control = forecast(bench, tmp_path)
    bench.scans.plans.change_plan(COMB.model_copy(update={"spectral": NoSpectral()}))
    assert control.state.current.value is None
    assert "no spectral patterns" in control.state.refusal.value
    bench.undo.undo()
    assert [control.state.refusal.value] == [""]


def test_plans_that_the_camera_cannot_take_are_not_offered(
    bench: ScanBench, tmp_path: Path, counted: list[str]
) -> None:
    devices = bench.rig.state.devices.value
    assert devices is not None
    info = replace(devices.camera.info, exposure_range_ms=(0.02, 200.0))
    devices.camera._info = info  # type: ignore[attr-defined]
    control = forecast(bench, tmp_path)
    control._candidates = lambda basis: islice(usual_candidates(basis), 12)
    control.predict_all()
    points = control.state.points.value
    assert len(points) > 5
    assert not [obstacle for each in points for obstacle in exposure_obstacles((0.02, 200.0), each.plan)]
    for budget_s in (30, 60, 600):
        control.answer(budget_s=budget_s)
        facts = bench.state.facts.value
        assert facts is not None
        assert facts.obstacles == ()
    bench.scans.plans.choose_preset("coarse")
    assert control.state.current.value is None
    assert "exposes for 333.333 ms, but the camera supports 0.02 to 200 ms" in control.state.refusal.value


def test_wishes_choose_a_plan_or_say_what_could_be_had(
    bench: ScanBench, tmp_path: Path, counted: list[str]
) -> None:
    control = forecast(bench, tmp_path, automatic=False)
    control.answer(budget_s=60)
    assert "No plan has been predicted yet" in control.state.answer.value
    control.begin()
    control.answer(budget_s=20)
    assert bench.state.preset is PRESETS[0]
    assert "Preview" in control.state.answer.value
    best = min(control.state.points.value, key=lambda each: each.expected.pixel_rmse)
    control.answer(error=best.expected.pixel_rmse)
    assert identity(bench.state.plan.value) == identity(best.plan)
    control.answer(budget_s=1)
    assert "No plan takes at most 1 s" in control.state.answer.value
    control.answer(error=1e-6)
    assert "the best" in control.state.answer.value


def test_a_wish_during_a_scan_does_not_claim_a_choice(
    bench: ScanBench, tmp_path: Path, counted: list[str]
) -> None:
    control = forecast(bench, tmp_path)
    bench.state.phase.set(Phase.RUNNING)
    control.answer(error=min(each.expected.pixel_rmse for each in control.state.points.value))
    assert bench.state.preset is PRESETS[0]
    assert "Chosen" not in control.state.answer.value
    assert control.state.answer.value.startswith("The best plan would be ")
    assert "keeps its plan" in control.state.answer.value


def test_without_calibration_nothing_is_predicted_and_the_reason_said(
    tmp_path: Path, counted: list[str]
) -> None:
    bench = make_bench(tmp_path)
    control = forecast(bench, tmp_path)
    assert control.state.trouble.value == ""
    bench.rig.connect(RigChoice("twin", (*TWIN.options, ("truth", "4"))))
    assert control.state.trouble.value == NO_CALIBRATION
    assert (control.state.points.value, counted) == ((), [])
    bench.rig.connect(TWIN)
    assert control.state.trouble.value == ""
    assert control.state.points.value


def test_another_rig_is_predicted_anew(bench: ScanBench, tmp_path: Path, counted: list[str]) -> None:
    control = forecast(bench, tmp_path)
    first = control.state.published
    bench.rig.connect(RigChoice("twin", (*TWIN.options, ("sigma", "0.01"))))
    second = control.state.published
    assert first is not None
    assert second is not None
    assert second.expected.pixel_rmse > 1.2 * first.expected.pixel_rmse


def test_who_stops_it_gets_only_the_plan_at_hand(
    bench: ScanBench, tmp_path: Path, counted: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    control = forecast(bench, tmp_path, automatic=False)
    submit = control._runner.submit

    def cancelled(job: Job[None]) -> Job[None]:
        job.cancel()
        return submit(job)

    with monkeypatch.context() as stopping:
        stopping.setattr(control._runner, "submit", cancelled)
        control.begin()
    assert not control.state.points.value
    control.begin()
    assert [point.title for point in control.state.points.value] == ["Preview"]


def test_other_work_goes_first(bench: ScanBench, tmp_path: Path, counted: list[str]) -> None:
    control = forecast(bench, tmp_path, automatic=False)

    class Busy(InlineRunner):
        @property
        def active(self) -> tuple[Job[object], ...]:
            return (Job("Reconstruct", lambda progress: None),)

    control._runner = Busy()
    assert control._must_wait()


@pytest.mark.slow
def test_after_a_scan_what_it_was_stands_beside_what_was_expected(
    bench: ScanBench, tmp_path: Path, counted: list[str]
) -> None:
    control = forecast(bench, tmp_path, automatic=False)
    bench.scans.plans.choose_preset("quick")
    bench.state.then_reconstruct.set(True)
    bench.scans.start()
    found = control.state.measured.value
    assert found is not None
    assert (found.name, found.frames, found.seconds) == ("first", 154, None)
    assert found.depth_rmse_mm is not None
    assert found.coverage is not None
    assert found.coverage > 0.5


@pytest.mark.parametrize(("earlier", "seconds"), [(0, 12.0), (30, None)])
def test_the_time_of_a_scan_in_parts_is_not_that_of_its_last_one(
    bench: ScanBench, tmp_path: Path, earlier: int, seconds: float | None
) -> None:
    bench.rig.state.choice.set(RigChoice("twin", (*TWIN.options, ("realtime", "on"))))
    control = forecast(bench, tmp_path, automatic=False)
    bench.state.status.set(Status(State.FINISHED, done=72, total=72, elapsed_s=12.0, earlier=earlier))
    bench.state.phase.set(Phase.DONE)
    found = control.state.measured.value
    assert found is not None
    assert found.seconds == seconds


def test_a_damaged_store_is_made_anew(bench: ScanBench, tmp_path: Path) -> None:
    store = PredictionStore(tmp_path, bench.calibration, 50.0)
    store._path.write_text("[1")
    assert PredictionStore(tmp_path, bench.calibration, 50.0).find(COMB) is None
    store._path.write_text('{"a": {"frames": 1}}')
    assert PredictionStore(tmp_path, bench.calibration, 50.0).find(COMB) is None


def test_figures_of_an_xor_code_alone_are_said_to_be_of_the_gray_code(bench: ScanBench) -> None:
    def remark(code: CodeSet) -> str:
        plan = COMB.model_copy(update={"code": code})
        return ForecastPoint(plan, made_up_prediction(bench.calibration, plan, 50.0)).remark

    assert "Gray code" in remark(XorCode(rows=False))
    assert remark(GrayCode()) == remark(EnsembleCode()) == ""


def test_titles_have_typographic_signs() -> None:
    assert plan_title(COMB) == "comb 5×2×64"
    assert plan_title(COMB.model_copy(update={"name": "max box"})) == "max box"


def test_the_scene_of_a_result_can_be_planned_for(
    bench: ScanBench, tmp_path: Path, counted: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[object] = []

    def scene_samples(rig: Rig, result: object) -> str:
        seen.append(result)
        return "the scene"

    monkeypatch.setattr(samples, "scene_samples", scene_samples)
    control = forecast(bench, tmp_path)
    state, done = control.state, len(counted)
    look = save_result(load_result(write_small_result(tmp_path)).load(), tmp_path / "first.zarr")
    bench.state.result.emit(look)
    assert state.last_look.value == look
    control.look(look)
    assert len(seen) == 1
    assert len(counted) == 2 * done
    assert len(state.points.value) == done
    control.look(None)
    assert len(counted) == 2 * done
    control.look(look)
    assert (len(seen), len(counted)) == (1, 2 * done)


def test_predictions_for_the_last_scan_follow_each_further_scan(
    bench: ScanBench, tmp_path: Path, counted: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(samples, "scene_samples", lambda *_: "the scene")
    control, saved = forecast(bench, tmp_path), write_small_result(tmp_path)
    first, second, third = (copytree(saved, tmp_path / f"{name}.zarr") for name in ("a", "b", "c"))
    looks: list[Path | None] = []
    control.state.look.follow(looks.append)
    bench.state.result.emit(first)
    assert looks == [None]
    control.look(first)
    done = len(counted)
    bench.state.result.emit(second)
    assert looks == [None, first, second]
    assert len(counted) > done
    control.look(None)
    bench.state.result.emit(third)
    assert looks[3:] == [None]


def test_a_look_of_another_size_says_so(bench: ScanBench, tmp_path: Path, counted: list[str]) -> None:
    control = forecast(bench, tmp_path)
    control.look(write_small_result(tmp_path))
    assert control.state.points.value == ()
    assert "pixels; rig 'twin' takes pictures of 64 × 48. Name the rig" in control.state.trouble.value
    control.look(None)
    assert [control.state.trouble.value] == [""]
