"""Light and black that change at once in the middle of a scan are found when they do, and taken off."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core import pipeline
from dsl_core.model.fit import Fit
from dsl_core.model.plan import CapturePlan, GrayCode, ScanLines, Sentinels, Setting
from dsl_core.model.rig import Rig, Sensor
from dsl_core.reconstruction.light.neighbour_steps import NeighbourSteps, pair_against_white
from dsl_core.reconstruction.light.step_date import Change
from dsl_core.reconstruction.light.sudden import _gained
from dsl_core.reconstruction.rows.frames import ScanFrames
from tests.cases.twin_scan import MemoryScan, twin_scan

PLAN = CapturePlan(
    code=GrayCode(rows=False),
    spectral=ScanLines(step_px=5),
    settings=(Setting(exposure_ms=333.3, level=0.2),),
    code_settings=(0,),
    sentinels=Sentinels(),
)


@cache
def clean() -> tuple[Rig, MemoryScan]:
    devices, scan = twin_scan(PLAN, size="64x48", scene="stage")
    assert devices.calibration is not None
    return devices.calibration, scan


def changed(at: int, factor: float = 1.0, more_dn: float = 0.0, until: int = 10_000) -> MemoryScan:
    """The scan with ``factor`` times the light and so much more black from a shot on."""
    rig, scan = clean()
    black = rig.sensor.black_level_dn

    def frame(index: int, pixels: NDArray[np.uint16]) -> NDArray[np.uint16]:
        if not at <= index < until:
            return pixels
        moved = np.rint(black + factor * (pixels - black) + more_dn)
        return np.asarray(np.clip(moved, 0, 4095), np.uint16)

    return replace(scan, frames=tuple(frame(i, each) for i, each in enumerate(scan.frames)))


def reconstructed(scan: MemoryScan) -> tuple[NDArray[np.float32], dict[str, str]]:
    """Depth, and sentences of what was found by name."""
    rig, _ = clean()
    result = pipeline.reconstruct(scan, rig, pipeline.Options(spectra=False))
    fit = Fit.read(result.attrs)
    assert fit is not None
    return result["depth_mm"].values, {each.name: each.sentence for each in fit.significant}


@pytest.mark.slow
@pytest.mark.parametrize(("factor", "more_dn"), [(1.0, 16.0), (1.2, 0.0), (0.8, -5.0)])
def test_a_change_at_once_leaves_depth_as_it_was(factor: float, more_dn: float) -> None:
    usual, said = reconstructed(clean()[1])
    assert not said.keys() & {"black taken again", "step of the light"}
    depth, said = reconstructed(changed(100, factor, more_dn))
    known = np.isfinite(usual)
    assert (np.abs(depth - usual)[known] < 0.5).mean() > 0.9
    assert "from frame 101 on" in said["black taken again"]
    assert ("from frame 101 on" in said.get("step of the light", "")) == (factor != 1.0)
    assert "drift of the light" not in said


def test_a_code_of_other_light_than_white_is_no_change_at_once() -> None:
    """So do projectors whose light depends on the picture: lines may have that of neither."""
    white = clean()[1].plan.references()["white"].index
    assert "step of the light" not in reconstructed(changed(0, 0.8, until=white))[1]
    assert (
        f"from frame {white - 1} on"
        in reconstructed(changed(0, 0.8, until=white - 2))[1]["step of the light"]
    )


def test_a_share_that_old_shots_hardly_tell_is_between_theirs_and_none() -> None:
    sensor = Sensor()
    picture = np.full((4, 6), sensor.black_level_dn + 40.0)
    parts = SimpleNamespace(
        plan=PLAN, rig=SimpleNamespace(sensor=sensor), source=SimpleNamespace(read=lambda shot: picture)
    )
    scan = cast("ScanFrames", parts)
    for std, share in ((1.0, 0.25), (1e-3, 0.5), (np.inf, 0.0)):
        steps = cast("NeighbourSteps", None)  # which are not asked before the step of the light is known
        found = _gained(scan, steps, 100, Change(90, 110, 16.0), (0.5, std), None)
        assert found.share == pytest.approx(share, abs=1e-3)
        assert found.dn + found.share * 40 == pytest.approx(16.0, abs=1e-6)


def test_a_change_among_pictures_of_the_code_is_seen_by_their_sum() -> None:
    scan = ScanFrames(changed(0, 0.8, 3.0, until=8), clean()[0], ())
    for number, (factor, more_dn) in {0: (0.8, 3.0), 6: (1.0, 0.0)}.items():
        (log, log_std), (dn, dn_std) = pair_against_white(scan, 0, number)
        # Light of the room is in black, which is less in a darker picture as well.
        assert np.exp(log) == pytest.approx(factor, abs=0.01 + 5 * log_std)
        assert dn == pytest.approx(more_dn, abs=5 * dn_std + (1 - factor) * 40)
