from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest

from dsl_core.errors import StoreError
from dsl_core.io.campaign_folder import CampaignFolder
from dsl_core.io.describe import _sentinel_fact, describe
from dsl_core.io.plan_file import save_plan
from dsl_core.io.result.result_file import save_result
from dsl_core.io.rig_file import save_rig
from dsl_core.io.scan.folder import ScanReader
from dsl_core.model.plan import CapturePlan, ScanLines, Sentinels
from tests.cases.small_result import COLUMNS, ROWS, WAVELENGTHS_NM, small_result
from tests.cases.small_rig import small_rig


def test_a_scan_says_what_is_stored_and_what_is_wrong(session: Path, plan: CapturePlan) -> None:
    found = describe(session, verify=True)
    assert (found["kind"], found["frames"], found["frames_stored"]) == (
        "scan",
        plan.shot_count,
        plan.shot_count,
    )
    assert (found["complete"], found["problems"]) == (True, [])
    ScanReader(session).store.path(3).unlink()
    lacking = describe(session)
    assert (lacking["complete"], lacking["frames_stored"]) == (False, plan.shot_count - 1)
    assert "lacks 1 of" in lacking["problems"][0]
    assert lacking["bytes"] < found["bytes"]


def test_every_kind_is_known_by_its_files(tmp_path: Path, plan: CapturePlan) -> None:
    result = small_result()
    kinds = {
        save_result(result, tmp_path / "result.zarr"): "result",
        save_rig(small_rig(), tmp_path / "rig.json"): "rig",
        save_plan(plan, tmp_path / "plan.json"): "plan",
        CampaignFolder.begin(tmp_path / "campaign", "twin", {"scene": "plane"}).path: "campaign",
    }
    found = {path: describe(path) for path in kinds}
    assert {path: facts["kind"] for path, facts in found.items()} == kinds
    assert found[tmp_path / "plan.json"]["settings"] == ["10 ms at level 0.4", "20 ms at level 0.8"]
    assert found[tmp_path / "rig.json"]["camera_px"] == [890, 580]
    assert found[tmp_path / "campaign"]["options"] == {"scene": "plane"}
    depth = result["depth_mm"].values
    low, _, high = found[tmp_path / "result.zarr"]["depth_mm"]
    assert low <= high
    assert found[tmp_path / "result.zarr"]["size_px"] == [depth.shape[1], depth.shape[0]]


def test_what_is_none_of_these_is_refused(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match="does not exist"):
        describe(tmp_path / "nowhere")
    with pytest.raises(StoreError, match="is neither a scan"):
        describe(tmp_path)
    (tmp_path / "other.json").write_text("{}")
    with pytest.raises(StoreError, match="neither a rig nor a plan"):
        describe(tmp_path / "other.json")
    (tmp_path / "cut.json").write_text("{")
    with pytest.raises(StoreError, match="is not JSON"):
        describe(tmp_path / "cut.json")


def test_sentinels_are_counted_in_rounds_and_as_a_share(plan: CapturePlan) -> None:
    assert _sentinel_fact(plan) == "none"
    often = plan.model_copy(update={"spectral": ScanLines(step_px=1), "sentinels": Sentinels(every=8)})
    shots = [shot.index for shot in often.shots() if shot.role == "sentinel"]
    rounds = 1 + sum(later - earlier > 1 for earlier, later in itertools.pairwise(shots))
    assert 1 < rounds < len(shots)
    share = f"{100 * len(shots) / often.shot_count:.1f}"
    assert _sentinel_fact(often) == f"{len(shots)} repeats in {rounds} rounds ({share} %)"


def test_a_result_says_its_bands_and_depths(tmp_path: Path) -> None:
    result = small_result()
    path = tmp_path / "result.zarr"
    save_result(result, path)
    facts = describe(path)
    depth = result["depth_mm"].values
    known = depth[np.isfinite(depth)]
    assert facts["bands"] == f"{len(WAVELENGTHS_NM)} from {WAVELENGTHS_NM[0]:g} to {WAVELENGTHS_NM[-1]:g} nm"
    assert facts["pixels_with_depth"] == round(known.size / depth.size, 4)
    assert facts["depth_mm"] == [round(float(v), 2) for v in (known.min(), np.median(known), known.max())]
    assert facts["size_px"] == [COLUMNS, ROWS]
