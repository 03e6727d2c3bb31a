"""What a container or a batch system grants is what counts."""

from __future__ import annotations

import os
from pathlib import Path

import psutil
import pytest

from dsl_core.solve import limits


def grant(monkeypatch: pytest.MonkeyPatch, root: Path, own: str, files: dict[str, str]) -> None:
    """As if this process were in groups of which files tell."""
    for name, text in {**files, "own": own}.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    monkeypatch.setattr(limits, "_GROUPS", root)
    monkeypatch.setattr(limits, "_OWN", root / "own")
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: set(range(8)), raising=False)


@pytest.mark.parametrize(
    ("own", "files", "cores", "free"),
    [
        ("0::/job/step\n", {"job/cpu.max": "250000 100000", "job/step/cpu.max": "max 100000"}, 2, None),
        ("0::/\n", {"cpu.max": "20000 100000", "memory.max": "max", "memory.current": "7"}, 1, None),
        (
            "0::/\n",
            {"memory.max": "1000", "memory.current": "900", "memory.stat": "anon 500\ninactive_file 300\n"},
            8,
            400.0,
        ),
        (
            "4:memory:/of/the/host\n2:cpu,cpuacct:/of/the/host\n",
            {
                "memory/memory.limit_in_bytes": "1000",
                "memory/memory.usage_in_bytes": "1200",
                "cpu,cpuacct/cpu.cfs_quota_us": "300000",
                "cpu,cpuacct/cpu.cfs_period_us": "100000",
            },
            3,
            0.0,
        ),
        ("2:cpu:/\n", {"cpu/cpu.cfs_quota_us": "-1"}, 8, None),
        ("", {}, 8, None),
    ],
)
def test_what_a_group_is_granted_is_what_counts(
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    own: str,
    files: dict[str, str],
    cores: int,
    free: float | None,
) -> None:
    grant(monkeypatch, tmp_path, own, files)
    assert limits.usable_cores() == cores
    if free is None:
        assert limits.free_memory_bytes() > 1e6
    else:
        assert limits.free_memory_bytes() == free


def test_nothing_is_free_beyond_what_the_system_has() -> None:
    assert 0 < limits.free_memory_bytes() <= psutil.virtual_memory().total
    assert 1 <= limits.usable_cores() <= (os.cpu_count() or 1)
