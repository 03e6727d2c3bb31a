"""Known predictions: those that come with the program are what would be predicted now."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from dsl_core.devices.registry import open_rig
from dsl_core.model.rig import Rig
from dsl_core.planning.prediction import predict
from dsl_core.planning.samples import plane_samples
from dsl_core.planning.shipped import shipped_plans
from dsl_core.planning.store import PredictionStore, rig_stamp


@pytest.fixture(scope="module")
def twin() -> Rig:
    with open_rig("twin") as devices:
        assert devices.calibration is not None
        return devices.calibration


@pytest.mark.slow
def test_shipped_predictions_are_what_is_predicted_now(twin: Rig, tmp_path: Path) -> None:
    store = PredictionStore(tmp_path, twin, 50.0)
    plans = sorted(shipped_plans(twin), key=lambda plan: plan.shot_count)
    assert all(store.find(plan) is not None for plan in plans)
    view = plane_samples(twin)
    for plan in (plans[0], plans[len(plans) // 4]):
        shipped = store.find(plan)
        assert shipped is not None
        found = predict(twin, plan, view, latency_ms=50.0).model_dump()
        # If this fails for what is predicted has changed: python -m dsl_core.planning.shipped
        assert found == pytest.approx(shipped.model_dump(), rel=2e-3), plan.name


def test_another_rig_latency_or_scene_has_predictions_of_its_own(twin: Rig, tmp_path: Path) -> None:
    plan = next(iter(shipped_plans(twin)))
    other = twin.model_copy(update={"white_scale": twin.white_scale * 1.001})
    named = twin.model_copy(update={"name": "the same"})
    assert PredictionStore(tmp_path, other, 50.0).find(plan) is None
    assert PredictionStore(tmp_path, twin, 51.0).find(plan) is None
    assert PredictionStore(tmp_path, twin, 50.0, "a scene").find(plan) is None
    assert PredictionStore(tmp_path, named, 50.0).find(plan) is not None
    rounded = twin.model_copy(update={"white_scale": twin.white_scale * (1 + 1e-14)})
    assert rig_stamp(rounded, 50.0) == rig_stamp(twin, 50.0)


def test_predictions_without_peaks_serve_where_none_are_asked_for(twin: Rig, tmp_path: Path) -> None:
    plan = next(iter(shipped_plans(twin)))
    store = PredictionStore(tmp_path, twin, 51.0)
    known = PredictionStore(tmp_path, twin, 50.0).find(plan)
    assert known is not None
    store.keep(plan, known.model_copy(update={"fwhm_nm": None}), peaks=False)
    store.save()
    again = PredictionStore(tmp_path, twin, 51.0)
    assert again.find(plan) is None
    found = again.find(plan, peaks=False)
    assert found is not None
    assert found.fwhm_nm is None


@pytest.mark.slow
def test_a_budget_on_the_twin_is_answered_without_torch(tmp_path: Path) -> None:
    code = (
        "import sys; from dsl_core.cli import main;"
        "code = main(['tradeoff', '--budget', '60s', '--json']);"
        "assert not {'torch', 'cv2', 'numba', 'matplotlib'} & set(sys.modules); sys.exit(code)"
    )
    environment = {**os.environ, "DSL_SCAN_HOME": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env=environment, check=True
    )
    assert json.loads(done.stdout)["expected"]["seconds"] <= 60
