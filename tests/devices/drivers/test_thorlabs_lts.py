"""The LTS stage against an emulator in memory: moves, refusals, and every fault that must not be believed."""

from __future__ import annotations

import pytest

from dsl_core.devices.base import Stage
from dsl_core.devices.conformance import StageConformance
from dsl_core.devices.driver_table import read_settings
from dsl_core.devices.drivers.serial_line import SerialLine
from dsl_core.devices.drivers.thorlabs_lts import LtsSettings, ThorlabsLts
from dsl_core.errors import DeviceError
from tests.devices.emulators.lts import STAGE_FAULTS, Lts
from tests.devices.emulators.ports import FAULTS, FakePort, Faulty, Instrument, ends


def lts(inner: Instrument, **settings: object) -> ThorlabsLts:
    port = FakePort(inner)
    line = SerialLine(port, "The stage on COM4", port.clock)
    chosen = LtsSettings.model_validate({"port": "COM4", **settings})
    return ThorlabsLts(line, chosen, clock=port.clock, sleep=port.sleep)


class TestLts(StageConformance):
    tolerance_mm = 0.01

    def open_stage(self) -> Stage:
        return lts(Lts())


def test_the_published_scale_is_used() -> None:
    inner = Lts()
    with lts(inner) as stage:
        assert stage.position_mm == 60
        assert stage.move_to(10.0) == 10
    assert inner.target == 10


def test_positions_are_distances_from_the_camera() -> None:
    inner = Lts()
    with lts(inner, target_at_zero_mm=900.0, towards_camera=True) as stage:
        assert stage.range_mm == (750.0, 900.0)
        assert stage.position_mm == pytest.approx(840.0)
        assert stage.move_to(800.0) == pytest.approx(800.0)
        assert inner.target == 100
        with pytest.raises(DeviceError, match="moves from 750 to 900 mm, not to 100 mm"):
            stage.move_to(100.0)


def test_a_stage_without_reference_finds_it_only_when_asked() -> None:
    with pytest.raises(DeviceError, match=r"has not found its reference .* set home to true"):
        lts(Lts(is_homed=False))
    with lts(Lts(is_homed=False), home=True) as stage:
        assert stage.position_mm == 0


def test_other_models_and_too_long_ways_are_refused() -> None:
    with pytest.raises(DeviceError, match="is a BSC201, not an LTS150"):
        lts(Lts(model=b"BSC201"))
    with pytest.raises(DeviceError, match="moves 150 mm, range_mm goes to 300 mm"):
        lts(Lts(), range_mm=(0, 300))
    with pytest.raises(DeviceError, match="within 0 to 300 mm"):
        read_settings("stage", "thorlabs-lts", {"port": "COM4", "range_mm": [5, 2]})


@pytest.mark.parametrize(
    ("fault", "told"),
    [
        ("blocked", "was to move to 100 mm, but stays at 76.000 mm"),
        ("ignores moves", "but stays at 60.000 mm"),
        ("loses position", "lost its position"),
        ("overload", "drew too much current"),
        ("creeps back", "to move to 100 mm|is now at"),
        ("refuses", "refused what it was asked .no such move."),
        ("short", "stays at 0.000 mm"),
    ],
)
def test_a_stage_that_does_not_arrive_says_where_it_is(fault: str, told: str) -> None:
    with lts(Lts(fault)) as stage, pytest.raises(DeviceError, match=told):
        stage.move_to(100.0)


def test_a_pulled_cable_is_named_and_closing_still_works() -> None:
    faulty = Faulty(Lts(), "dropped", 6, 0)
    stage = lts(faulty)
    with pytest.raises(DeviceError, match="no longer answers on its port"):
        stage.move_to(100.0)
    stage.close()
    with pytest.raises(DeviceError, match="is closed"):
        stage.move_to(100.0)


@pytest.mark.parametrize("fault", [*FAULTS, *STAGE_FAULTS])
def test_no_fault_is_believed(fault: str) -> None:
    for seed in range(3):
        inner = Lts(fault if fault in STAGE_FAULTS else "")
        line = inner if fault in STAGE_FAULTS else Faulty(inner, fault, 1 + 5 * seed, seed)
        ending = ends(lambda line=line: lts(line).move_to(75.0), lambda mm: abs((mm or 0) - 75) < 0.02)  # type: ignore[misc]
        assert ending in ("right", "stopped"), f"{fault}, seed {seed}"
        if ending == "right":
            assert abs(inner.position_mm(1e6) - 75) < 0.02
