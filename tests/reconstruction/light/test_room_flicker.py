"""A room or a black level that differs from frame to frame is told from a projector that flickers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from dsl_core import pipeline
from dsl_core.model.fit import Fit
from dsl_core.model.plan import CapturePlan, Columns, ScanLines, Setting
from dsl_core.model.rig import Rig
from dsl_core.reconstruction.light.line_levels import candidates
from dsl_core.reconstruction.light.room_flicker import RoomFlicker, room_flicker
from dsl_core.reconstruction.merge import Exposed
from dsl_core.reconstruction.rows.bands import bands_of
from dsl_core.reconstruction.rows.frames import ScanFrames
from tests.cases.twin_scan import MemoryScan, twin_scan

PLAN = CapturePlan(
    spectral=ScanLines(step_px=5), settings=(Setting(exposure_ms=333.0, level=0.4),), code_settings=(0,)
)


@dataclass(frozen=True)
class Seen:
    rig: Rig
    scan: MemoryScan
    #: Indices of the shots of lines, in the order of their patterns.
    lines: list[int]

    def with_(self, more: np.ndarray) -> MemoryScan:
        """The scan with so many DN more, (shots, 1 or rows, 1 or columns), in steps of one at random."""
        dither = np.random.default_rng(0)
        shape = self.scan.frames[0].shape
        frames = tuple(
            np.floor(frame + dn + dither.random(shape)).clip(0, 4095).astype(np.uint16)
            for frame, dn in zip(self.scan.frames, more, strict=True)
        )
        return MemoryScan(self.scan.plan, frames)

    def flicker(self, scan: MemoryScan, before: Exposed | None = None) -> RoomFlicker | None:
        frames = ScanFrames(scan, self.rig, bands_of(scan.plan, None, 2))
        code, white = frames.decode()
        pixels = candidates(code.column, (white.radiance, white.variance))
        frames.look(pixels)
        return room_flicker(frames, code.column, frames.pick(pixels), before)


def quick(values: np.ndarray) -> float:
    """The rms of what changes from frame to frame, but for the outermost ones."""
    return float(np.diff(values[4:-4], 2).std())


@pytest.fixture(scope="module")
def seen() -> Seen:
    devices, scan = twin_scan(PLAN, size="80x52", scene="color-checker")
    assert devices.calibration is not None
    return Seen(devices.calibration, scan, [s.index for s in scan.plan.shots() if s.role == "spectral"])


def test_steady_frames_and_a_flickering_projector_are_no_flicker_of_the_room(seen: Seen) -> None:
    assert seen.flicker(seen.scan) is None
    shots = seen.scan.plan.shots()
    black = next(seen.scan.frames[shot.index] for shot in shots if shot.role == "black")
    gains = 1 + 0.05 * np.random.default_rng(3).standard_normal(len(seen.scan.frames))
    light = np.stack(seen.scan.frames).astype(float) - black
    assert seen.flicker(seen.with_(light * (gains[:, None, None] - 1))) is None


@pytest.mark.slow
def test_what_all_pixels_have_more_is_found_frame_by_frame(seen: Seen) -> None:
    more = np.random.default_rng(3).normal(0, 0.8, (len(seen.scan.frames), 1, 1))
    moved = seen.with_(more)
    found = seen.flicker(moved)
    assert found is not None
    assert not found.share
    wanted = more[seen.lines, 0, 0]
    # What frames have in common is what their black picture lacked.
    black = next(shot.index for shot in seen.scan.plan.shots() if shot.role == "black")
    off = [found.dn[at] for at in seen.lines] - (wanted - more[black, 0, 0])
    assert np.abs(off[16:-16]).max() < 0.35
    assert np.abs(np.mean(off[16:-16])) < 0.15
    assert quick([found.dn[at] for at in seen.lines] - wanted) < 0.15 * quick(wanted)
    assert found.rms_dn == pytest.approx(0.8, rel=0.3)
    assert found.finding.significant
    assert not RoomFlicker({}, {}, 0.19, 0.01).finding.significant
    # What is known already is not found again.
    exposed = found.exposed(Exposed.as_planned(len(more)))
    assert exposed.black_dn[seen.lines] == pytest.approx([found.dn[at] for at in seen.lines])
    assert not exposed.black_dn[: min(seen.lines)].any()
    again = seen.flicker(moved, exposed)
    assert again is None or again.rms_dn < 0.2 * found.rms_dn


def test_a_room_that_flickers_is_a_share_of_what_it_lights(seen: Seen) -> None:
    # Most lines are far from a pixel.
    room = np.median([seen.scan.frames[at] for at in seen.lines], axis=0) - seen.rig.sensor.black_level_dn
    share = np.random.default_rng(3).normal(0, 0.08, len(seen.scan.frames))
    share[[shot.index for shot in seen.scan.plan.shots() if shot.role == "black"]] = 0.0
    found = seen.flicker(seen.with_(share[:, None, None] * room))
    assert found is not None
    assert not found.dn
    wanted = share[seen.lines]
    assert quick([found.share[at] for at in seen.lines] - wanted) < 0.25 * quick(wanted)
    assert found.rms_dn == pytest.approx(0.08 * np.median(room), rel=0.3)


@pytest.mark.slow
def test_lamps_that_flicker_and_light_for_every_pixel_are_told_apart(seen: Seen) -> None:
    room = np.median([seen.scan.frames[at] for at in seen.lines], axis=0) - seen.rig.sensor.black_level_dn
    rng = np.random.default_rng(3)
    share, more = rng.normal(0, 0.08, len(seen.scan.frames)), rng.normal(0, 0.8, len(seen.scan.frames))
    black = [shot.index for shot in seen.scan.plan.shots() if shot.role == "black"]
    share[black] = more[black] = 0.0
    found = seen.flicker(seen.with_(share[:, None, None] * room + more[:, None, None]))
    assert found is not None
    for name, kind, wanted in (("dn", found.dn, more), ("share", found.share, share)):
        off = quick([kind[at] for at in seen.lines] - wanted[seen.lines])
        assert off < 0.35 * quick(wanted[seen.lines]), name


def test_patterns_other_than_single_lines_say_nothing(seen: Seen) -> None:
    some = Columns(levels=tuple(tuple((float(x % 2), 0.5, 0.5) for x in range(640)) for _ in range(20)))
    plan = PLAN.model_copy(update={"spectral": some, "camera_size_px": (80, 52)})
    frames = ScanFrames(MemoryScan(plan, ()), seen.rig, ())
    nothing = frames.pick(np.empty(0, np.intp))
    assert room_flicker(frames, np.zeros((52, 80), int), nothing, None) is None


@pytest.mark.slow
def test_depth_and_sentences_are_those_of_a_steady_room(seen: Seen) -> None:
    more = np.random.default_rng(1).normal(0, 0.8, (len(seen.scan.frames), 1, 1))
    options = pipeline.Options(spectra=False)
    steady = pipeline.reconstruct(seen.scan, seen.rig, options)
    moved = pipeline.reconstruct(seen.with_(more), seen.rig, options)
    fit = Fit.read(moved.attrs)
    assert fit is not None
    assert {finding.name for finding in fit.significant} == {"flicker of the room"}
    off = np.abs(moved["depth_mm"].values - steady["depth_mm"].values)
    assert np.nanmedian(off) < 0.5 * np.nanmedian(steady["depth_std_mm"].values)
