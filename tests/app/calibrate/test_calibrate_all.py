"""All calibrations in order, unattended."""

from __future__ import annotations

from tests.app.calibrate.calibrate_bench import (
    CalibrateBench,
)


def test_everything_runs_in_order_and_stops_with_the_reason(bench: CalibrateBench) -> None:
    bench.control.run_everything()
    assert "cannot place its targets itself" in bench.told
    devices = bench.rig.state.devices.value
    assert devices is not None
    devices.place = lambda placement: None
    bench.wrong = {"largest_dn": 1.0}
    bench.control.run_everything()
    assert "Brightness is outside its limits" in bench.told
    assert "Open the aperture." in bench.told
    assert bench.row("selftest").has_candidate
    bench.wrong = {}
    bench.control.run_everything()
    assert "Everything is calibrated" in bench.state.note.value
    assert all(row.state.is_accepted for row in bench.state.rows.value)
    assert bench.library.names() == ("campaign",)
