"""Where Gray and XOR code disagree the scan lines decide, or the pixel says that it does not know."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, Literal

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from dsl_core.model.plan import (
    BinaryCode,
    CapturePlan,
    EnsembleCode,
    GrayCode,
    NoSpectral,
    ScanLines,
    Setting,
)
from dsl_core.model.result import REASONS, Flag
from dsl_core.model.rig import Rig
from dsl_core.optics.correspondence import zero_order
from dsl_core.optics.sensor import digitise
from dsl_core.patterns.images import pattern_image
from dsl_core.reconstruction.columns.code_dispute import is_dark, settle
from dsl_core.reconstruction.columns.maps import ColumnMaps
from dsl_core.reconstruction.geometry import Geometry, reconstruct_geometry
from dsl_core.reconstruction.hdr import MergedFrame
from dsl_core.reconstruction.merge import MergedScan, decode_columns, stack_lines
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.rendering.pattern_table import PatternTable
from tests.cases.twin_scan import MemoryScan

SIZE, DEPTH_MM = (64, 42), 700.0
SETTING = Setting(exposure_ms=100.0, level=1.0)
BOTH, GRAY = EnsembleCode(rows=False), GrayCode(rows=False)
#: DN per ms that a pixel gets straight from white, and from a place so many columns further on.
STRAIGHT, FURTHER_PX = 10.0, 150.0
Way = Literal["straight", "reflected", "only reflected"]


@dataclass(frozen=True)
class Wall:
    """A plane at a depth; half of its pixels get more light from another place than straight."""

    rig: Rig
    column: torch.Tensor
    upset: NDArray[np.bool_]
    straight: NDArray[np.float64]

    @classmethod
    def make(cls, way: Way) -> Wall:
        rig = published_rig()
        rig = rig.model_copy(update={"camera": rig.camera.resized(*SIZE)})
        pixels = torch.arange(SIZE[0] * SIZE[1])
        column, _ = zero_order(rig, pixels, torch.full((len(pixels),), DEPTH_MM))
        inside = ((column > 3) & (column < 630 - FURTHER_PX)).numpy()
        upset = inside & (np.arange(len(pixels)) % 2 == 0) & (way != "straight")
        straight = np.where(inside, STRAIGHT, 0.0)
        if way == "only reflected":
            straight[upset] = 0.0
        return cls(rig, column.float(), upset, straight)

    def scan(self, code: BinaryCode, lines: bool) -> MemoryScan:
        """Frames with noise."""
        plan = CapturePlan(
            camera_size_px=SIZE, code=code, spectral=ScanLines(step_px=3) if lines else NoSpectral(),
            settings=(SETTING,), code_settings=(0,),
        )  # fmt: skip
        rng = np.random.default_rng(7)
        frames = []
        for shot in plan.shots():
            signal = self.light(pattern_image(plan, shot)[:1, :, :1]) * SETTING.exposure_ms
            frames.append(digitise(self.rig.sensor, signal.reshape(SIZE[::-1]).astype(np.float32), rng))
        return MemoryScan(plan, tuple(frames))

    def light(self, image: NDArray[np.uint8]) -> NDArray[np.float64]:
        """DN per ms of every pixel."""
        response, device = self.rig.projector_response, torch.device("cpu")
        radiance = response.radiance(image / 255)
        spread = response.model_copy(update={"blur_px": 15.0})
        sharp, smooth = (PatternTable.of(radiance, each, device) for each in (response, spread))
        row = torch.zeros_like(self.column)
        straight = self.straight * sharp.at(0, self.column, row).numpy()
        further = smooth.at(0, self.column + FURTHER_PX, row).numpy()
        return np.asarray(straight + np.where(self.upset, 2 * STRAIGHT, 0.0) * further)

    def found(self, code: BinaryCode, lines: bool = True) -> Geometry:
        """What is reconstructed of a scan."""
        scan = self.scan(code, lines)
        merged = MergedScan(scan, self.rig)
        decoded, white = decode_columns(merged)
        return reconstruct_geometry(
            self.rig, scan.plan, decoded, white, stack_lines(merged), refine_columns=lines
        )

    def wrong(self, found: Geometry) -> NDArray[np.bool_]:
        """Pixels with a column that is none of the two beside the truth."""
        with np.errstate(invalid="ignore"):
            return np.asarray(np.abs(found.column_px.ravel() - self.column.numpy()) > 1)


@pytest.mark.slow
@pytest.mark.parametrize(("lines", "share"), [(False, 0.7), (True, 0.97)])
def test_reflections_upset_the_gray_code_and_not_the_ensemble(lines: bool, share: float) -> None:
    wall = Wall.make("reflected")
    gray, both = (wall.found(code, lines) for code in (GRAY, BOTH))
    assert not np.isfinite(gray.depth_mm.ravel()[wall.upset]).any()
    known = np.isfinite(both.depth_mm.ravel())
    assert not wall.wrong(both).any()
    assert known[wall.upset].mean() > share
    # Hardly a pixel is unknown for another reason: two codes that agree by chance, on a depth out of range.
    disagree = (both.flags.ravel() & int(Flag.CODES_DISAGREE)) != 0
    lit = wall.straight > 0
    assert not (disagree & known).any()
    assert (lit & ~known & ~disagree).sum() <= 3
    # Without lines the few pixels stay in dispute that lie at the edges of fine stripes.
    assert disagree[lit & ~wall.upset].mean() <= (0.0 if lines else 0.01)


@pytest.mark.slow
def test_light_that_comes_by_another_way_only_is_flagged_with_the_reason() -> None:
    wall = Wall.make("only reflected")
    found = wall.found(BOTH)
    depth, flags = found.depth_mm.ravel(), found.flags.ravel()
    assert not np.isfinite(depth[wall.upset]).any()
    disagree = (flags & int(Flag.CODES_DISAGREE)) != 0
    assert disagree[wall.upset].mean() > 0.9
    assert not disagree[(wall.straight > 0) & ~wall.upset].any()
    assert "another path" in REASONS[Flag.CODES_DISAGREE]


@pytest.mark.slow
def test_without_reflections_the_ensemble_finds_what_the_gray_code_finds() -> None:
    wall = Wall.make("straight")
    gray, both = (wall.found(code) for code in (GRAY, BOTH))
    assert not (both.flags & int(Flag.CODES_DISAGREE)).any()
    np.testing.assert_array_equal(np.isfinite(both.depth_mm), np.isfinite(gray.depth_mm))
    errors = [np.sqrt(np.nanmean((found.depth_mm - DEPTH_MM) ** 2)) for found in (gray, both)]
    assert errors[1] < 1.05 * errors[0]
    assert errors[1] < 1


def test_without_lines_an_edge_that_both_codes_name_is_known_better_than_a_column() -> None:
    wall = Wall.make("straight")
    found = wall.found(BOTH, lines=False)
    spread = found.column_std_px.ravel() / np.float32(12**-0.5)
    at_edge = np.isfinite(spread) & (spread < 0.9)
    error = (found.column_px.ravel() - wall.column.numpy())[at_edge]
    assert at_edge.sum() > 10
    assert np.sqrt(np.mean(error**2)) < 1.2 * float(found.column_std_px.ravel()[at_edge].mean())


def test_lines_are_dark_that_surely_bring_less_than_a_fifth_of_the_white_light() -> None:
    maps = ColumnMaps.empty(6)
    maps.amplitude[:] = [1.0, 1.8, 1.0, 1.0, 0.1, 9.0]
    maps.amplitude_std[:] = [0.3, 0.1, 0.34, 0.3, np.inf, 0.0]
    maps.refined[:] = [False, False, False, True, False, False]
    saturated = np.array([False] * 6)
    white = MergedFrame(np.full(6, 10.0, np.float32), np.ones(6, np.float32), saturated)
    assert is_dark(maps, white).tolist() == [True, False, False, False, False, False]
    assert not is_dark(maps, MergedFrame(white.radiance, white.variance, ~saturated)).any()


@pytest.mark.parametrize(
    ("times", "apart_px", "taken", "disagree"),
    [
        (0.4, 100.0, False, False),
        (0.6, 100.0, False, True),
        (1.9, 100.0, False, True),
        (2.1, 100.0, True, False),
        (1.0, 0.4, False, False),
        (1.0, 0.6, False, True),
    ],
)
def test_of_two_places_one_is_right_with_twice_the_peak_of_the_other(
    times: float, apart_px: float, taken: bool, disagree: bool
) -> None:
    def found(column_px: float, amplitude: float) -> ColumnMaps:
        maps = ColumnMaps.empty(1)
        maps.column_px[:], maps.amplitude[:], maps.refined[:] = column_px, amplitude, True
        return maps

    white = MergedFrame(
        radiance=np.full((1, 1), 2.0, np.float32),
        variance=np.zeros((1, 1), np.float32),
        saturated=np.zeros((1, 1), bool),
    )
    finder: Any = SimpleNamespace(
        profiles="lines", white=white, find=lambda *_, **__: found(100.0 + apart_px, times)
    )
    code: Any = SimpleNamespace(straight=None, rival_column=np.full((1, 1), 7))
    maps = found(100.0, 1.0)
    settled = settle(code, maps, finder, np.ones(1, bool))
    assert (maps.column_px[0] > 100.0) == taken
    assert settled.disagree.tolist() == [disagree]
    assert settled.straight.tolist() == [not disagree]
