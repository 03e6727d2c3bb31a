from __future__ import annotations

from pathlib import Path

import pytest

from dsl_core.errors import StoreError
from dsl_core.io.campaign_folder import CampaignFolder
from dsl_core.io.describe import describe
from dsl_core.io.plan_file import save_plan
from dsl_core.io.result.result_file import save_result
from dsl_core.io.rig_file import save_rig
from dsl_core.io.scan.folder import ScanReader
from dsl_core.model.plan import CapturePlan
from tests.cases.small_result import small_result
from tests.cases.small_rig import small_rig


def test_a_scan_says_what_is_stored_and_what_is_wrong(session: Path, plan: CapturePlan) -> None:
    found = describe(session, verify=True)
    assert (found["kind"], found["frames"], found["frames_stored"]) == (
        "session",
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
