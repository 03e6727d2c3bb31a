"""The bench of a recipe: scans and records of a step, and errors that name it."""

from __future__ import annotations

from pathlib import Path

import pytest

from dsl_core import pipeline
from dsl_core.campaign.common.recipe import Bench, Step, naming
from dsl_core.campaign.common.white_shot import FilterNote, note_of_filter
from dsl_core.capture.proven.wrong_pictures import PictureError
from dsl_core.errors import CalibrationError, Cancelled, DecodeError, StoreError
from dsl_core.model.placement import Placement
from dsl_core.model.plan import CapturePlan, Columns, NoCode, Setting
from dsl_core.progress import NoProgress
from tests.cases.film_bench import film_bench

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


def test_a_step_that_fails_does_not_speak_of_a_scan(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    """Who calibrates has no scan to resume."""

    def fails(*_: object) -> None:
        raise PictureError("White is dim. Check the lamp, and resume the scan.", has_changed=True)

    monkeypatch.setattr(pipeline, "scan", fails)
    levels = (((1.0,) * 3,) * bench.devices.projector.info.width_px,)
    plan = CapturePlan(
        name="one",
        code=NoCode(),
        spectral=Columns(levels=levels),
        settings=(Setting(exposure_ms=5.0, level=1.0),),
        code_settings=(0,),
    )
    with pytest.raises(PictureError, match=r"lamp, and capture this step again\.$") as caught:
        bench.scan(STEP, lambda: plan, NoProgress())
    assert caught.value.has_changed


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
