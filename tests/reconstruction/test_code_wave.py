"""Waves that a wrong line spread leaves in columns, seen by the binary code."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core import pipeline
from dsl_core.model.options import Options
from dsl_core.model.presets import preset_plan
from dsl_core.optics.lines.line_set import LineSet
from dsl_core.optics.sensor import bayer_channels
from dsl_core.reconstruction.code_wave import CodeWave, OwnWidth, code_wave, with_varying_width
from dsl_core.reconstruction.columns.maps import ColumnMaps
from dsl_core.reconstruction.columns.spread_doubt import PLACES, SpreadDoubt
from dsl_core.simulation.sim_devices import open_twin
from tests.cases.small_rig import small_rig
from tests.cases.twin_scan import capture

RIG = small_rig()
LINES = LineSet(width_px=5, step_px=5, first_px=2.0, lines=40, frames=40)
PIXELS, WAVE_PX = 4000, 0.15
TRUE_PX = np.random.default_rng(5).uniform(3, 190, PIXELS)
NAMED_PX = np.round(TRUE_PX).astype(np.int32)
SINE = np.sin(2 * math.pi / LINES.step_px * (TRUE_PX - LINES.first_px))


def maps_of(column_px: NDArray[np.floating], std_px: float = 0.01) -> ColumnMaps:
    maps = ColumnMaps.empty(len(column_px))
    maps.column_px[:], maps.column_std_px[:], maps.refined[:] = column_px, std_px, True
    return maps


def test_a_wave_is_as_large_as_it_is() -> None:
    found = code_wave(LINES, NAMED_PX, maps_of(TRUE_PX - WAVE_PX * SINE))
    assert found is not None
    assert found.error_px == pytest.approx(WAVE_PX / math.sqrt(2), rel=0.3)
    # The boundaries to the right of the middle are half a column away, and one and a half.
    assert found.away_px == pytest.approx(-WAVE_PX * np.sin(2 * math.pi / 5 * np.array([0.5, 1.5])), abs=0.03)
    told = found.finding()
    assert told.significant
    assert told.part == "profile"


@pytest.mark.parametrize("moved_px", [0.0, 0.3])
def test_what_moves_all_columns_alike_is_no_wave(moved_px: float) -> None:
    found = code_wave(LINES, NAMED_PX, maps_of(TRUE_PX + moved_px))
    assert found is not None
    assert found.error_px == 0
    assert not found.finding().significant


def test_a_wave_that_chance_or_nobody_minds_widens_nothing() -> None:
    small = code_wave(LINES, NAMED_PX, maps_of(TRUE_PX + 0.055 * SINE))
    assert small is not None
    assert small.rms_px < 0.04
    assert small.error_px == 0


def test_nothing_is_said_where_nothing_is_known() -> None:
    waved = TRUE_PX + WAVE_PX * SINE
    assert code_wave(None, NAMED_PX, maps_of(waved)) is None
    # Lines that overlap show their spread; combs have other lines beneath them.
    assert code_wave(replace(LINES, width_px=6), NAMED_PX, maps_of(waved)) is None
    assert code_wave(replace(LINES, frames=8), NAMED_PX, maps_of(waved)) is None
    # Noise draws columns to the middles of lines.
    assert code_wave(LINES, NAMED_PX, maps_of(waved, std_px=0.2)) is None
    assert code_wave(LINES, np.full_like(NAMED_PX, -1), maps_of(waved)) is None
    unusual, coarse = maps_of(waved), maps_of(waved)
    unusual.unusual[:] = True
    coarse.refined[:] = False
    assert code_wave(LINES, NAMED_PX, unusual) is None
    assert code_wave(LINES, NAMED_PX, coarse) is None


@pytest.mark.parametrize(("share", "told"), [(0.2, False), (0.35, True)])
def test_a_boundary_that_few_pixels_know_is_left_out(share: float, told: bool) -> None:
    """Those few are the ones that noise has moved to where lines say more. A quarter more is farther off."""
    near = np.abs((TRUE_PX - LINES.first_px + 2.5) % 5 - 2.5) < 1.0
    some = near & (np.random.default_rng(1).random(PIXELS) > share)
    maps = maps_of(np.where(near, TRUE_PX + 0.15 * np.sign(SINE), TRUE_PX))
    maps.column_std_px[some] = 0.2
    found = code_wave(LINES, NAMED_PX, maps)
    assert found is not None
    assert (0.5 in found.off_px) == told
    assert bool(found.error_px) == told


def doubt_of(relative: float) -> SpreadDoubt:
    """Columns of a width twice as large would move by a sine of 1 px."""
    sine = np.sin(2 * math.pi * np.arange(PLACES) / PLACES)
    return SpreadDoubt(LINES, relative, sine, np.abs(sine))


@pytest.mark.parametrize("wider", [-0.1, 0.1])
def test_a_width_that_explains_the_wave_is_found(wider: float) -> None:
    # Too narrow a spread leaves columns where they would be moved from.
    found = code_wave(LINES, NAMED_PX, maps_of(TRUE_PX - wider * SINE))
    assert found is not None
    own = found.own_width(doubt_of(1.0))
    assert own.wider == pytest.approx(wider, abs=3 * own.std)
    assert 0.005 < own.std < 0.03
    assert own.changed
    assert own.known(doubt_of(1.0)).relative == own.std
    assert own.of(RIG).projector_response.blur_px == pytest.approx(0.6 * (1 + own.wider))
    assert ("wider" if wider > 0 else "narrower") in own.finding().sentence
    # Who knows the width already learns nothing new.
    known = found.own_width(doubt_of(0.001))
    assert known.std == pytest.approx(0.001, rel=0.01)
    assert abs(known.wider) < 0.002


def test_columns_as_the_code_names_them_change_no_width() -> None:
    found = code_wave(LINES, NAMED_PX, maps_of(TRUE_PX))
    assert found is not None
    own = found.own_width(doubt_of(0.06))
    assert not own.changed
    # What is seen and not followed is doubted; what was known better before stays.
    assert OwnWidth(0.02, 0.01, 0.01, 0.0).known(doubt_of(0.06)).relative == pytest.approx(
        math.hypot(0.02, 0.01)
    )
    assert OwnWidth(0.02, 0.01, 0.01, 0.0).known(doubt_of(0.005)).relative == 0.005


def test_a_width_that_takes_much_of_a_wave_away_is_followed_and_stays_unsure() -> None:
    # Near the middle of a line columns move by far more than in proportion to a width that is far off.
    wave = CodeWave(np.array([0.5, 1.5]), np.array([0.15, 0.11]), np.array([0.017, 0.014]))
    moved = np.interp(np.arange(PLACES) / PLACES, [0, 0.1, 0.3, 0.5, 0.7, 0.9], [0, -0.1, -1, 0, 1, 0.1])
    own = wave.own_width(SpreadDoubt(LINES, 0.06, moved, np.abs(moved)))
    assert own.wider == pytest.approx(0.12, abs=0.03)
    assert own.changed
    assert own.finding().significant
    assert own.std > 3 * own.noise


def test_a_wave_of_another_shape_says_less_of_the_width() -> None:
    found = code_wave(LINES, NAMED_PX, maps_of(TRUE_PX - 0.1 * SINE))
    assert found is not None
    other = replace(found, away_px=found.away_px * np.array([1.0, -1.0]))
    assert other.own_width(doubt_of(1.0)).std > 3 * found.own_width(doubt_of(1.0)).std


def test_widths_that_differ_over_the_picture_are_doubted() -> None:
    """Lines of the left part are wider, those of the right narrower: no width of all is off."""
    rng = np.random.default_rng(6)
    true_px = rng.uniform(3, 190, (60, 150))
    sine = np.sin(2 * math.pi / LINES.step_px * (true_px - LINES.first_px))
    wider = np.linspace(0.15, -0.15, 150)
    named = np.round(true_px).astype(np.int32)
    before, one_colour = doubt_of(0.01), np.ones(true_px.size, np.int64)
    varied, even = (
        with_varying_width(before, LINES, named, maps_of((true_px - each * sine).ravel()), one_colour)
        for each in (wider, 0.1)
    )
    # The means of three parts are .1, 0 and -.1; the middle is doubted as much as usual.
    assert varied.relative == before.relative
    assert varied.varies is not None
    parts = varied.varies.reshape(true_px.shape)[:, [10, 75, 140]]
    assert parts == pytest.approx(np.broadcast_to([0.1, 0.082, 0.1], parts.shape), rel=0.12)
    middle = float(LINES.first_px) + 1.0
    of_pixels = varied.at(np.full(true_px.size, middle)).reshape(true_px.shape)
    assert of_pixels[0, 10] > 8 * before.at(np.array([middle]))[0]
    assert even is before
    unknown = with_varying_width(before, LINES, np.full_like(named, -1), maps_of(true_px.ravel()), one_colour)
    assert unknown is before


def test_lines_that_are_wider_in_one_colour_are_doubted_there() -> None:
    rng = np.random.default_rng(7)
    true_px = rng.uniform(3, 190, (60, 150))
    sine = np.sin(2 * math.pi / LINES.step_px * (true_px - LINES.first_px))
    colours = bayer_channels("RGGB", *true_px.shape)
    named = np.round(true_px).astype(np.int32)
    before = doubt_of(0.01)
    wider = np.where(colours == 0, 0.24, 0.0)
    varied = with_varying_width(before, LINES, named, maps_of((true_px - wider * sine).ravel()), colours)
    assert varied.varies is not None
    # Relative to all pixels, of which a quarter are red.
    of_colours = [np.unique(varied.varies[colours.ravel() == colour]) for colour in range(3)]
    assert np.abs(np.concatenate(of_colours)) == pytest.approx([0.18, 0.06, 0.06], abs=0.02)


@pytest.mark.slow
def test_a_scan_with_wider_lines_says_so_and_follows_them() -> None:
    devices = open_twin({"size": "64x44", "foreign": "blur", "scene": "plane"})
    plan = preset_plan("coarse")
    assert plan is not None
    scan = capture(devices, pipeline.fit_plan(plan, devices))
    world = devices.camera.world  # type: ignore[attr-defined]
    found, as_calibrated = (
        pipeline.reconstruct(scan, world.rig, Options(spectra=False, as_calibrated=each))
        for each in (False, True)
    )
    assert "Between the middles of lines" in found.attrs["fit"]
    told = {each["name"]: each["value"] for each in json.loads(found.attrs["fit"])["findings"]}
    # They are 8 % wider. Pixels this coarse see some of that as their own.
    assert told["width of lines by the binary code"] == pytest.approx(8, abs=3.5)
    # What is left between the middles of lines is told as well.
    assert 0.0 < told["columns between lines against the binary code"] < 0.07
    off_mm, as_calibrated_off_mm = (
        np.nanmedian(np.abs(each["depth_mm"].values - world.truth.depth_mm))
        for each in (found, as_calibrated)
    )
    assert off_mm < 0.7 * as_calibrated_off_mm
    assert "Between the middles of lines" not in as_calibrated.attrs["fit"]
    assert "width of lines" not in as_calibrated.attrs["fit"]
