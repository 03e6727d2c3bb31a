from __future__ import annotations

from pathlib import Path

import pytest

from dsl_core.errors import StoreError
from dsl_core.io.scan.estimate import (
    COMPRESSED_SHARE,
    MARGIN_BYTES,
    Estimate,
    check_space,
    estimate,
    needed_bytes,
)
from dsl_core.model.plan import CapturePlan


def test_an_estimate_counts_frames_seconds_and_bytes(
    tmp_path: Path, plan: CapturePlan, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[Path] = []

    def usage(place: Path) -> object:
        asked.append(place)
        return type("Usage", (), {"free": 123_456_789})()

    monkeypatch.setattr("shutil.disk_usage", usage)
    found = estimate(plan, tmp_path / "not" / "there" / "scan.dsl", latency_ms=50.0)
    assert asked == [tmp_path]
    assert found.frames == plan.shot_count
    assert found.seconds == pytest.approx(plan.duration_s() + 0.05 * plan.shot_count)
    assert found.needed_bytes == int(COMPRESSED_SHARE * plan.raw_bytes) + MARGIN_BYTES
    assert str(found).endswith(f"{found.needed_bytes / 1e6:.0f} MB of 123 MB free")


def test_only_the_missing_frames_need_room(
    tmp_path: Path, plan: CapturePlan, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert needed_bytes(plan, 0) == MARGIN_BYTES
    large = plan.model_copy(update={"camera_size_px": (4000, 3000)})
    free = needed_bytes(large, 3)
    monkeypatch.setattr("shutil.disk_usage", lambda place: type("Usage", (), {"free": free})())
    check_space(tmp_path, large, 3)
    with pytest.raises(StoreError, match=r"for 4 frames, but .* Free some space or choose another drive"):
        check_space(tmp_path, large, 4)


def test_an_estimate_is_said_in_minutes_and_megabytes() -> None:
    found = Estimate(frames=340, seconds=4530.0, needed_bytes=1_234_000_000, free_bytes=5_000_000_000)
    assert str(found) == "340 frames, 75.5 min on the rig, 1234 MB of 5000 MB free"


def test_frames_are_compressed_to_three_fifths_beside_a_margin_of_64_mib(plan: CapturePlan) -> None:
    assert needed_bytes(plan, 0) == 64 * 2**20
    assert needed_bytes(plan, plan.shot_count) == int(0.6 * plan.raw_bytes) + 64 * 2**20


def test_the_disk_is_known_of_a_place_that_cannot_be_seen(tmp_path: Path) -> None:
    barred = tmp_path / ("ü" * 140) / "scan.dsl"
    assert estimate(CapturePlan(), barred, latency_ms=50.0).free_bytes > 0
