"""Columns of lines that do not overlap are as sure as the calibrated width of the line spread."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from dsl_core.model.rig import ProjectorResponse
from dsl_core.optics.lines.line_set import LineSet
from dsl_core.optics.lines.profile import zero_order_profile
from dsl_core.optics.spread.fit import SpreadFit
from dsl_core.reconstruction.columns.column import refine
from dsl_core.reconstruction.columns.line_peaks import LinePeaks, smooth_peaks
from dsl_core.reconstruction.columns.spread_doubt import FOCUS_STD, SpreadDoubt, spread_doubt
from dsl_core.reconstruction.merge import PickedLines
from tests.cases.small_rig import small_rig

RIG = small_rig()
RESPONSE = RIG.projector_response
LINES = LineSet(width_px=5, step_px=5, first_px=2.0, lines=128, frames=128)
SHAPE = ROWS, COLUMNS = 30, 80
#: A pixel is 5.7 columns of the projector.
COLUMN = 60 + 5.7 * np.arange(COLUMNS) + 0.13 * np.arange(ROWS)[:, None]


def lines_seen(response: ProjectorResponse) -> tuple[np.ndarray, np.ndarray]:
    """Lines of all pixels (frames, pixels), and their deviation."""
    away = torch.as_tensor(COLUMN.ravel()) - LINES.centre_px(torch.arange(LINES.lines))[:, None]
    light = zero_order_profile(away, -2.5, 2.5, response).numpy()
    return light, np.full_like(light, 0.002)


def doubt(found: SpreadFit | None, lines: LineSet | None = LINES) -> SpreadDoubt | None:
    light, std = lines_seen(RESPONSE)
    known = np.zeros(SHAPE, bool)
    code = SimpleNamespace(undecided=known, likely_column=COLUMN.round())
    white = SimpleNamespace(saturated=known, radiance=np.ones(SHAPE))

    def pick(pixels: np.ndarray) -> PickedLines:
        return PickedLines(pixels, light[:, pixels], std[:, pixels], np.zeros(len(pixels), np.float32))

    stack = SimpleNamespace(pick=pick)
    peaks = smooth_peaks(RIG, lines, code, white, stack)  # type: ignore[arg-type]
    return spread_doubt(peaks, found)


def width_found(rel_std: float, changed: bool = True) -> SpreadFit:
    return SpreadFit(RESPONSE, changed, rel_std * RESPONSE.blur_px, 1.0, 1.0, 900)


def test_deviations_are_what_a_width_off_by_one_deviation_moves() -> None:
    stated = doubt(None)
    assert stated is not None
    seen, std = (torch.as_tensor(each) for each in lines_seen(RESPONSE.with_gaussian(0.6 * (1 + FOCUS_STD))))
    moved = refine(LinePeaks(torch.as_tensor(COLUMN.ravel().round()), seen, std, LINES, RESPONSE))
    sure = (moved.refined & (moved.std_px < 0.05)).numpy()
    off = np.abs(moved.column_px.numpy() - COLUMN.ravel())[sure]
    by_place = stated.at(COLUMN.ravel())[sure]
    assert off.max() > 0.05
    assert np.median(off / by_place) == pytest.approx(1.0, abs=0.1)
    assert np.corrcoef(off, by_place)[0, 1] > 0.9


def test_what_a_scan_says_of_the_width_counts_and_where_it_is_sure_nothing_is_doubted() -> None:
    alone, together = doubt(None), doubt(width_found(FOCUS_STD))
    assert alone is not None
    assert together is not None
    assert together.relative == pytest.approx(alone.relative / np.sqrt(2))
    assert together.rms_px == pytest.approx(alone.rms_px)
    assert not together.is_sure
    surely = doubt(width_found(0.001))
    assert surely is not None
    assert surely.is_sure
    # One width for all that is sure may be none of its parts'.
    assert not replace(surely, varies=np.full(ROWS * COLUMNS, 0.05)).is_sure
    assert doubt(None, None) is None


def test_lines_side_by_side_that_look_as_calibrated_leave_the_width_open() -> None:
    # Columns explain what another width would change, so that a fit seems sure of any.
    stated = doubt(width_found(0.001, changed=False))
    assert stated is not None
    assert stated.relative == FOCUS_STD


def test_columns_that_nobody_knows_are_not_doubted_further() -> None:
    found = SpreadDoubt(LINES, 0.1, np.zeros(16), np.linspace(0.1, 1.6, 16))
    middle = float(LINES.centre_px(torch.tensor(20)))
    assert found.at(np.array([np.nan, middle, middle + 5.0, middle - 5 / 16])).tolist() == pytest.approx(
        [0.0, 0.01, 0.01, 0.16]
    )


def test_a_wider_spread_moves_columns_as_it_moves_those_that_were_seen() -> None:
    stated = doubt(None)
    assert stated is not None
    seen, std = (torch.as_tensor(each) for each in lines_seen(RESPONSE))
    peaks = LinePeaks(torch.as_tensor(COLUMN.ravel().round()), seen, std, LINES, RESPONSE)
    moved_px = (refine(peaks.wider(1.02)).column_px.numpy() - COLUMN.ravel()) / 0.02
    off_px = (COLUMN.ravel() - LINES.first_px) % LINES.step_px
    # Where columns move much and not by chance: to the sides of the middle between two lines.
    sides = (np.abs(off_px - 1.5) < 0.3) | (np.abs(off_px - 3.5) < 0.3)
    assert np.abs(stated.moved_at(off_px)[sides]).min() > 0.1
    assert np.median(moved_px[sides] / stated.moved_at(off_px)[sides]) == pytest.approx(1.0, abs=0.2)
    assert stated.moved_at(off_px + LINES.step_px) == pytest.approx(stated.moved_at(off_px))
