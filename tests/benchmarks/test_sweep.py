"""A sweep keeps what it measured."""

from __future__ import annotations

from pathlib import Path

import pytest

from dsl_core.model.plan import CapturePlan
from dsl_core.simulation.published_rig import published_rig
from tests.benchmarks import sweep


def test_a_sweep_resumes_where_it_stopped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    measured: list[str] = []

    def measure(rig: object, case: sweep.Case, latency_ms: float) -> sweep.Point:
        measured.append(case.name)
        if case.name == "b" and measured.count("b") == 1:
            raise KeyboardInterrupt
        return sweep.Point(name=case.name, frames=1, spectral_frames=1, seconds=2.0, raw_bytes=3)

    monkeypatch.setattr(sweep, "measure", measure)
    cases = [sweep.Case(name=name, plan=CapturePlan(name=name)) for name in "abc"]
    with pytest.raises(KeyboardInterrupt):
        sweep.run_sweep(published_rig(), cases, tmp_path, 50)
    points = sweep.run_sweep(published_rig(), cases, tmp_path, 50)
    assert measured == ["a", "b", "b", "c"]
    assert [point.name for point in points] == ["a", "b", "c"]
    table = sweep.write_csv(points, tmp_path / "points.csv").read_text().splitlines()
    assert table[0].startswith("name,frames")
    assert len(table) == 4
