"""Where columns start, which pixels are lit, and what is said when hardly any can be decoded."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dsl_core.errors import DecodeError
from dsl_core.model.calibration.lateral_colour import LateralColour
from dsl_core.model.plan import CapturePlan, GrayCode, ScanLines
from dsl_core.model.projector.line_spread import LineSpread
from dsl_core.model.result import Flag
from dsl_core.optics.lines.line_set import LineSet
from dsl_core.reconstruction import geometry
from dsl_core.reconstruction.columns.maps import ColumnMaps
from dsl_core.reconstruction.geometry import (
    ColumnSearch,
    FoundColumns,
    geometry_of,
    require_light,
    require_pixels,
)
from dsl_core.reconstruction.hdr import MergedFrame
from dsl_core.simulation.published_rig import published_rig

SHAPE = (12, 16)
COUNT = SHAPE[0] * SHAPE[1]


def code_of(**more: Any) -> Any:
    fields = {"likely_column": np.arange(6).reshape(2, 3), "at_edge": None, "fine_column_px": None}
    return SimpleNamespace(**fields | {"fine_std_px": None} | more)


def test_columns_start_at_the_decoded_ones_and_between_two_that_codes_name() -> None:
    start, std = geometry._start(code_of())
    assert start.tolist() == [0, 1, 2, 3, 4, 5]
    assert std == pytest.approx(1 / np.sqrt(12))
    edge = np.array([[False, True, False], [False, False, True]])
    start, std = geometry._start(code_of(at_edge=edge))
    assert start.tolist() == [0, 1.5, 2, 3, 4, 5.5]
    assert std == pytest.approx(np.where(edge.ravel(), 0.15, 1 / np.sqrt(12)))
    fine = np.linspace(0, 5, 6).reshape(2, 3) + 0.3
    start, std = geometry._start(code_of(fine_column_px=fine, fine_std_px=0.1 * fine))
    assert start.tolist() == fine.ravel().tolist()
    assert std.tolist() == (0.1 * fine).ravel().tolist()


def test_light_stands_eight_deviations_above_black_or_is_too_much() -> None:
    light = np.array([[8.1, 7.9, 5.0, -9.0]])
    saturated = np.array([[False, False, True, False]])
    variance = np.array([[1.0, 1.0, np.inf, 1.0]])
    assert geometry._lit(MergedFrame(light, variance, saturated)).tolist() == [True, False, True, False]


def maps_of(**more: Any) -> ColumnMaps:
    """Columns of a plane at 700 mm, all of them refined."""
    made = ColumnMaps.empty(COUNT)
    values = {
        "column_px": 100.0, "column_std_px": 0.03, "amplitude": 5.0, "amplitude_std": 0.1, "offset": 0.0,
        "offset_std": 0.0, "refined": True, "unusual": False, "depth_mm": 700.0, "slope_mm_per_px": 2.0,
    }  # fmt: skip
    for name, value in (values | more).items():
        getattr(made, name)[:] = value
    return made


def test_depth_is_as_sure_as_the_column_and_what_all_columns_share() -> None:
    rig = published_rig()
    rig = rig.model_copy(update={"camera": rig.camera.resized(16, 12), "column_std_px": 0.04})
    flags = np.zeros(COUNT, np.uint16)
    flags[5] = int(Flag.NO_LIGHT)
    for shared, std_px in ((True, 0.05), (False, 0.03)):
        found = geometry_of(rig, None, FoundColumns(maps_of(), flags), SHAPE, 5, shared_errors=shared)
        good = np.ones(SHAPE, bool)
        good.ravel()[5] = False
        assert found.column_std_px[good] == pytest.approx(std_px, rel=1e-5)
        assert found.depth_std_mm[good] == pytest.approx(2 * std_px, rel=1e-5)
        for values in (found.column_px, found.column_std_px, found.depth_mm, found.depth_std_mm):
            assert np.isnan(values.ravel()[5])
        assert (found.depth_mm[good] == 700.0).all()
        assert (found.amplitude[good] == 5.0).all()
        assert found.flags.ravel()[5] & int(Flag.NO_LIGHT)
        np.testing.assert_array_equal((found.flags & int(Flag.DEPTH_EDGE)) > 0, found.surface.edge)


def test_depth_is_as_unsure_as_the_code_says_of_columns_that_lines_refined() -> None:
    rig = published_rig()
    rig = rig.model_copy(update={"camera": rig.camera.resized(16, 12), "column_std_px": 0.0})
    coarse = np.arange(COUNT) < 20
    maps = FoundColumns(maps_of(refined=~coarse), np.zeros(COUNT, np.uint16))
    found = geometry_of(rig, None, maps, SHAPE, 5, code_wave_px=0.1)
    assert found.column_std_px.ravel()[coarse] == pytest.approx(0.03)
    assert found.column_std_px.ravel()[~coarse] == pytest.approx(np.hypot(0.03, 0.1))


def test_depth_is_less_sure_where_a_peak_is_unusual_or_materials_move_it() -> None:
    rig = published_rig()
    rig = rig.model_copy(update={"camera": rig.camera.resized(16, 12), "column_std_px": 0.0})
    unusual = np.zeros(SHAPE, bool)
    unusual[6, 0] = True
    maps = maps_of(unusual=unusual.ravel())
    found = geometry_of(rig, None, FoundColumns(maps, np.zeros(COUNT, np.uint16)), SHAPE, 5)
    assert found.column_std_px[6, 0] == pytest.approx(np.hypot(0.03, 1.0)), "nothing is known on its left"
    assert found.column_std_px[~unusual] == pytest.approx(0.03)
    colour = LateralColour(camera=(0.0, 0.0, 0.0), projector_per_nm=1e-5, white_nm=(610.0, 540.0, 470.0))
    rig = rig.model_copy(update={"lateral_colour": colour})
    found = geometry_of(rig, None, FoundColumns(maps_of(), np.zeros(COUNT, np.uint16)), SHAPE, 5)
    off_px = 15.0 * 1e-5 * abs(100.0 - rig.projector.cx_px)
    assert found.column_std_px == pytest.approx(np.hypot(0.03, off_px), rel=1e-4)


def test_an_uneven_spread_leaves_open_where_its_zero_is() -> None:
    rig = published_rig()
    assert geometry._zero_std_px(rig) == 0.0
    spread = LineSpread.of(np.exp(-np.arange(40) / 5.0), 0.125)
    uneven = rig.model_copy(update={"projector_response": rig.projector_response.with_spread(spread)})
    assert geometry._zero_std_px(uneven) == pytest.approx(abs(spread.lean_px) / np.sqrt(3))
    assert spread.lean_px > 0.05
    fitted = uneven.model_copy(update={"fitted_lean_px": spread.lean_px - 0.01})
    assert geometry._zero_std_px(fitted) == pytest.approx(0.01 / np.sqrt(3)), "the geometry has followed"


def flagged(has_patterns: bool = True, **more: Any) -> list[int]:
    """Flags of five pixels: lit with a column, without light, too bright, not a number, undecided."""
    count = 5
    light = np.array([9.0, 0.1, 9.0, np.nan, 9.0])
    white = MergedFrame(light, np.full(count, 0.01), np.array([False, False, True, False, False]))
    maps = ColumnMaps.empty(count)
    values = {"amplitude": 9.0, "refined": [True, True, False, True, False], "depth_mm": 700.0} | more
    for name, value in values.items():
        getattr(maps, name)[:] = value
    nothing = np.zeros(count, bool)
    settled: Any = SimpleNamespace(straight=nothing, disagree=np.array([False, False, False, False, True]))
    code: Any = SimpleNamespace(undecided=np.array([True, True, False, False, True]))
    lit = np.array([True, False, True, False, True])
    found = geometry._flags(published_rig(), code, white, maps, settled, lit, has_patterns)
    return [int(flag) for flag in found]


def test_each_pixel_gets_the_reasons_why_it_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(geometry, "has_peak", lambda maps, where, white: np.ones(5, bool))
    monkeypatch.setattr(geometry, "is_dark", lambda maps, white: np.zeros(5, bool))
    refined, saturated = int(Flag.NOT_REFINED), int(Flag.SATURATED | Flag.NOT_REFINED)
    dark, nan = int(Flag.NO_LIGHT), int(Flag.NON_FINITE)
    disagree = int(Flag.CODE_UNSURE | Flag.CODES_DISAGREE)
    assert flagged() == [0, dark, saturated, nan, disagree | refined]
    assert flagged(has_patterns=False) == [0, dark, saturated & ~refined, nan, disagree]
    assert flagged(unusual=[True, True, False, True, False])[:2] == [int(Flag.UNUSUAL_PEAK), dark]
    too_bright = [True, False, False, False, False]
    assert flagged(saturated=too_bright)[0] == int(Flag.SATURATED), "a column of its slopes alone"
    low, high = published_rig().depth_range_mm
    far = int(Flag.OUT_OF_RANGE)
    assert flagged(depth_mm=[low, 1, high, 1, high + 1])[4] == disagree | refined | far
    assert flagged(depth_mm=[low, 1, high, 1, high])[:3] == [0, dark, saturated]
    assert flagged(depth_mm=[low - 1, 1, np.nan, 1, high])[0] == far
    assert flagged(depth_mm=[low - 1, 1, np.nan, 1, high])[2] == saturated | far


def test_columns_without_a_peak_or_with_dark_lines_have_no_light(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(geometry, "has_peak", lambda maps, where, white: np.zeros(5, bool))
    monkeypatch.setattr(geometry, "is_dark", lambda maps, white: np.zeros(5, bool))
    assert flagged()[0] == int(Flag.NO_LIGHT)
    assert flagged()[4] & int(Flag.NO_LIGHT) == 0, "it was never refined"
    monkeypatch.setattr(geometry, "has_peak", lambda maps, where, white: np.ones(5, bool))
    monkeypatch.setattr(geometry, "is_dark", lambda maps, white: np.ones(5, bool))
    assert flagged()[0] == int(Flag.NO_LIGHT)


def test_a_scan_fails_when_one_pixel_in_a_thousand_is_decoded_and_says_why() -> None:
    flags = np.full((40, 50), int(Flag.NO_LIGHT), np.uint16)
    flags.ravel()[:2] = 0
    require_pixels(flags)
    flags.ravel()[1] = int(Flag.CODE_UNSURE)
    with pytest.raises(DecodeError, match=r"0\.05% of the pixels.*100% of them.*projector is on"):
        require_pixels(flags)
    flags.ravel()[: COUNT * 7] |= np.uint16(int(Flag.SATURATED))
    with pytest.raises(DecodeError, match=r"67% of them.*Lower the exposure"):
        require_pixels(flags)
    # Of several reasons that half of the pixels have, the gravest.
    flags[:] |= np.uint16(int(Flag.CODE_UNSURE))
    with pytest.raises(DecodeError, match=r"67% of them.*Lower the exposure"):
        require_pixels(flags)
    rare = np.full(2000, int(Flag.CODE_UNSURE), np.uint16)
    rare[:900], rare[900:1400] = int(Flag.OUT_OF_RANGE), int(Flag.NO_LIGHT)
    with pytest.raises(DecodeError, match="45% of them"):
        require_pixels(rare)


@pytest.mark.parametrize(("dark", "fails"), [(2, False), (1, True)])
def test_a_white_frame_may_not_be_saturated_all_over(dark: int, fails: bool) -> None:
    white, saturated = np.ones((40, 50), np.float32), np.ones((40, 50), bool)
    saturated.ravel()[:dark] = False
    if fails:
        with pytest.raises(DecodeError, match="saturated in 100% of its pixels"):
            require_light(white, saturated)
        saturated.ravel()[:3] = False
        white.ravel()[:2] = np.nan
        with pytest.raises(DecodeError, match="do this"):
            require_light(white, saturated, "do this")
    else:
        require_light(white, saturated)


def test_columns_are_refined_by_lines_unless_somebody_asks_otherwise() -> None:
    rig = published_rig()
    lines = CapturePlan(code=GrayCode(rows=False), spectral=ScanLines(step_px=5))
    search = ColumnSearch(rig, lines)
    assert search.lines == LineSet.of(lines)
    assert search._profiles is not None
    assert search._profiles.shape[0] == lines.spectral_count
    decoded = ColumnSearch(rig, lines, refine_columns=False)
    assert decoded.lines is None
    assert decoded._profiles is None
