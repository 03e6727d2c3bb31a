"""Black that changes slowly is followed between the black pictures that a scan takes again."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.model.fit import FitFinding
from dsl_core.model.plan import CapturePlan, GrayCode, ScanLines, Sentinels, Setting
from dsl_core.model.rig import Rig
from dsl_core.patterns.gray_code import DecodedCode
from dsl_core.reconstruction.hdr import MergedFrame
from dsl_core.reconstruction.light.followed import follow_light
from dsl_core.reconstruction.light.slow_black import UNEVEN, slow_black
from dsl_core.reconstruction.light.witnesses import blacks_again
from dsl_core.reconstruction.merge import Exposed
from dsl_core.reconstruction.rows.bands import bands_of
from dsl_core.reconstruction.rows.frames import ScanFrames
from tests.cases.twin_scan import MemoryScan, twin_scan

PLAN = CapturePlan(
    code=GrayCode(rows=False),
    spectral=ScanLines(step_px=5),
    settings=(Setting(exposure_ms=333.3, level=0.2),),
    code_settings=(0,),
    sentinels=Sentinels(),
)
PIXELS = np.arange(0, 64 * 48, 7)


@cache
def clean() -> tuple[Rig, MemoryScan]:
    devices, scan = twin_scan(PLAN, size="64x48", scene="stage")
    assert devices.calibration is not None
    return devices.calibration, scan


def fading(more_dn: float, of_white: bool = False) -> MemoryScan:
    """The scan with so much more black at its end; as light of the room if it is a share ``of_white``."""
    rig, scan = clean()
    white = next(shot.index for shot in scan.plan.shots() if shot.role == "white")
    light = scan.frames[white].astype(np.float64) - rig.sensor.black_level_dn
    where = light / light.mean() if of_white else np.ones(light.shape)
    rng = np.random.default_rng(5)
    shares = np.linspace(0, 1, len(scan.frames))
    frames = (
        np.clip(each + np.floor(share * more_dn * where + rng.random(where.shape)), 0, 4095)
        for share, each in zip(shares, scan.frames, strict=True)
    )
    return replace(scan, frames=tuple(each.astype(np.uint16) for each in frames))


def lines_of(scan: MemoryScan) -> tuple[NDArray[np.float32], tuple[FitFinding, ...]]:
    """Lines of some pixels as they would be in steady light, and what was found."""
    rig, _ = clean()
    frames = ScanFrames(scan, rig, bands_of(scan.plan))
    code, white = frames.decode()

    def also(code: DecodedCode, white: MergedFrame) -> NDArray[np.intp]:
        return PIXELS

    *_, told = follow_light(frames, code, white, also)
    return frames.pick(PIXELS).radiance, told


@pytest.mark.slow
@pytest.mark.parametrize("of_white", [False, True])
def test_a_slow_change_is_taken_off_the_lines_and_told(of_white: bool) -> None:
    right, nothing = lines_of(clean()[1])
    assert not any(each.name == "black taken again" and each.significant for each in nothing)
    found, told = lines_of(fading(12.0, of_white))
    off_dn = (found - right)[-10:].mean() * 333.3 * clean()[0].projector_response.radiance(0.2)
    assert abs(off_dn) < 1.0  # all of it would be 11
    (black,) = (each for each in told if each.name == "black taken again")
    assert black.significant
    assert "The frames are corrected for a change that is even" in black.sentence


def test_what_does_not_matter_is_left_alone() -> None:
    rig, scan = clean()
    frames = ScanFrames(scan, rig, ())
    assert slow_black(frames, blacks_again(frames), None) is None
    assert slow_black(frames, (), None) is None


def test_black_counts_from_the_black_frame_of_its_setting_and_may_be_uneven() -> None:
    rig, _ = clean()
    frames = ScanFrames(fading(12.0), rig, ())
    found = slow_black(frames, blacks_again(frames), None)
    assert found is not None
    exposed = found.exposed(frames, Exposed.as_planned(frames.plan.shot_count))
    (black,) = frames.shots_of("black", 0)
    assert exposed.black_dn[black.index] == 0
    assert exposed.black_std_dn == found.std_dn == pytest.approx(UNEVEN * 12.0, rel=0.2)
    assert exposed.black_dn[-1] == pytest.approx(12 * (1 - black.index / frames.plan.shot_count), rel=0.05)
