"""The bench of a recipe: scans and records of a step, and errors that name it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from dsl_core.campaign.common.recipe import Bench, Step, naming
from dsl_core.campaign.common.white_shot import FilterNote, note_of_filter
from dsl_core.errors import CalibrationError, Cancelled, DecodeError, DeviceError, StoreError
from dsl_core.model.placement import Placement
from dsl_core.model.plan import CapturePlan, Columns, NoCode, Setting
from dsl_core.progress import NoProgress
from tests.cases.faults import FaultPlan, with_faults
from tests.cases.film_bench import film_bench
from tests.cases.rounding import Rounding

STEP = Step("one", "Step one", "Place it.", Placement(target="spectralon"))


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return film_bench(tmp_path, 1, (), size="32x24")


def test_a_scan_is_planned_once_and_complete_afterwards(bench: Bench) -> None:
    planned = []

    def plan() -> CapturePlan:
        planned.append(True)
        levels = (((1.0,) * 3,) * bench.devices.projector.info.width_px,)
        settings = (Setting(exposure_ms=5.0, level=1.0),)
        return CapturePlan(
            name="one", code=NoCode(), spectral=Columns(levels=levels), settings=settings, code_settings=(0,)
        )

    assert not bench.is_scanned(STEP)
    made = bench.scan(STEP, plan, NoProgress())
    assert bench.is_scanned(STEP)
    entries = bench.scan_of(STEP).entries
    assert bench.scan(STEP, plan, NoProgress()) == made
    assert bench.scan_of(STEP).entries == entries
    assert len(planned) == 1


def test_a_fit_reads_the_exposures_in_force_and_a_scan_goes_on_with_its_plan(bench: Bench) -> None:
    rounded = Rounding(bench.devices.camera, lambda ms: 1.045)
    bench = replace(bench, devices=replace(bench.devices, camera=rounded))
    levels = (((1.0,) * 3,) * bench.devices.projector.info.width_px,)
    settings = (Setting(exposure_ms=20.0, level=1.0),)
    plan = CapturePlan(
        name="one", code=NoCode(), spectral=Columns(levels=levels), settings=settings, code_settings=(0,)
    )
    bench.scan(STEP, lambda: plan, NoProgress())
    assert bench.scan_of(STEP).plan.settings[0].exposure_ms == pytest.approx(20.9)
    assert bench.scan(STEP, lambda: plan, NoProgress()).settings == settings


def test_a_step_that_fails_does_not_speak_of_a_scan(bench: Bench) -> None:
    """Who calibrates has no scan to resume."""
    failing = replace(bench, devices=with_faults(bench.devices, FaultPlan(camera_gone_at=0)))
    levels = (((1.0,) * 3,) * bench.devices.projector.info.width_px,)
    settings = (Setting(exposure_ms=5.0, level=1.0),)
    plan = CapturePlan(
        name="one", code=NoCode(), spectral=Columns(levels=levels), settings=settings, code_settings=(0,)
    )
    with pytest.raises(DeviceError, match="Capture this step again when the device works again") as caught:
        failing.scan(STEP, lambda: plan, NoProgress())
    assert "scan" not in str(caught.value).replace("scan line", "")


def test_a_record_is_kept_next_to_the_scan(bench: Bench) -> None:
    note = note_of_filter(bench.devices, 450.0)
    bench.keep(STEP, "filter.json", note)
    assert bench.kept(STEP, "filter.json", FilterNote) == note
    with pytest.raises(StoreError, match=r"other\.json"):
        bench.kept(STEP, "other.json", FilterNote)


def test_errors_name_the_step() -> None:
    with pytest.raises(CalibrationError, match="Step one: no light"), naming(STEP):
        raise DecodeError("no light")


@pytest.mark.parametrize("kind", [Cancelled, StoreError])
def test_cancelling_and_bad_files_stay_what_they_are(kind: type[Exception]) -> None:
    with pytest.raises(kind, match=r"^as it was$"), naming(STEP):
        raise kind("as it was")
