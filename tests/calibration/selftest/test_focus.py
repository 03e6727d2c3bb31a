"""The blur of projected bars is measured without bias."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.special import ndtr

from dsl_core.calibration.selftest.focus import (
    BAR_PX,
    BarFrames,
    Floats,
    _blur,
    _Edges,
    _find_edges,
    _shares,
    bar_levels,
    check_focus,
)
from dsl_core.errors import CalibrationError

BLACK_DN = 260.0


def bar_frames(blur_px: float, pitch_px: float, noise: bool = True) -> BarFrames:
    """Bars with slanted, blurred edges under uneven light, as a camera sees them."""
    rng = np.random.default_rng(0)
    row, column = np.mgrid[:120, :300]
    place = column + 0.13 * row + 2.0
    edges = pitch_px * np.arange(-2, 300 / pitch_px + 4)
    sign = np.where(np.arange(len(edges)) % 2, -1.0, 1.0)
    share = sum(s * ndtr((place - e) / blur_px) for e, s in zip(edges, sign, strict=True))
    light = 2000 * (1 - 0.3 * column / 300)

    def frame(part: NDArray[np.float64]) -> NDArray[np.uint16]:
        signal = light * part
        shot = rng.standard_normal(signal.shape) * np.sqrt(signal / 10 + 1) if noise else 0.0
        return np.asarray(np.rint(BLACK_DN + signal + shot), np.uint16)

    return BarFrames((frame(share), frame(share)), (frame(1 - share), frame(1 - share)))


@pytest.mark.parametrize(("blur_px", "pitch_px"), [(0.3, 17.8), (1.07, 30.0), (2.5, 71.6)])
def test_the_blur_of_edges_is_measured_without_bias(blur_px: float, pitch_px: float) -> None:
    found = check_focus(bar_frames(blur_px, pitch_px), BLACK_DN)
    assert found.camera_px.value == pytest.approx(blur_px, abs=0.02 + 0.02 * blur_px)
    assert abs(found.camera_px.value - blur_px) < 5 * found.camera_px.std + 0.01 * blur_px
    assert found.projector_px.value == pytest.approx(found.camera_px.value * BAR_PX / pitch_px, rel=0.02)
    assert found.worst_px.value >= found.projector_px.value * 0.99


def test_a_camera_on_its_side_sees_bars_that_lie() -> None:
    upright = bar_frames(1.07, 30.0)
    lying = BarFrames((upright.bars[0].T, upright.bars[1].T), (upright.inverse[0].T, upright.inverse[1].T))
    assert check_focus(lying, BLACK_DN) == check_focus(upright, BLACK_DN)


def test_a_picture_without_edges_is_refused() -> None:
    flat = np.full((100, 200), 1000, np.uint16)
    with pytest.raises(CalibrationError, match="No clear edges"):
        check_focus(BarFrames((flat, flat), (flat, flat)), BLACK_DN)
    with pytest.raises(CalibrationError, match="Focus"):
        check_focus(bar_frames(25.0, 30.0), BLACK_DN)


def test_bars_and_inverse_fill_the_picture() -> None:
    bars, inverse = bar_levels(640, 200, False), bar_levels(640, 200, True)
    assert (bars.astype(int) + inverse == 200).all()
    assert (np.diff(bars.astype(int)) != 0).sum() == 15


def edges_of(blur_px: Floats, row: NDArray[np.int64] | None = None) -> _Edges:
    count = len(blur_px)
    rows = np.arange(count) if row is None else row
    return _Edges(rows, np.zeros(count, np.int64), blur_px, 20.0)


def test_blur_is_a_mean_whose_deviation_comes_from_eight_bands_of_rows() -> None:
    values = np.random.default_rng(3).normal(0.8, 0.3, 80)
    found = _blur(edges_of(values), np.ones(80, bool))
    bands = values.reshape(8, 10).mean(1)
    assert found.value == pytest.approx(values.mean())
    assert found.std == pytest.approx(bands.std(ddof=1) / np.sqrt(8))
    # Bands are of rows, in whatever order edges were found.
    order = np.random.default_rng(4).permutation(80)
    assert _blur(edges_of(values[order], order), np.ones(80, bool)).std == pytest.approx(found.std)
    chosen = np.arange(80) % 2 == 0
    assert _blur(edges_of(values), chosen).value == pytest.approx(values[::2].mean())
    assert _blur(edges_of(values[:1]), np.ones(1, bool)).std == 0.0
    assert _blur(edges_of(-values), np.ones(80, bool)).value == 0.0


def test_shares_of_light_are_those_of_each_pair_where_there_is_a_fifth_of_the_usual_light() -> None:
    bars, inverse = np.full((10, 10), 700.0), np.full((10, 10), 300.0)
    bars[0], inverse[0] = 100 + 142, 100.0
    bars[1], inverse[1] = 100 + 146, 100.0
    frame = [np.asarray(each, np.uint16) for each in (bars, inverse)]
    first, second, light = _shares(
        BarFrames((frame[0], frame[0] + np.uint16(40)), (frame[1], frame[1])), 100.0
    )
    assert light[:, 0].tolist() == [False, True] + [True] * 8
    # White is 800 and 840 in turn, 820 in the mean of both.
    assert first[5, 5] == pytest.approx((600 + 820 - 200) / 1640)
    assert second[5, 5] == pytest.approx((640 + 820 - 200) / 1640)


def test_thirds_of_a_picture_are_told_apart_and_the_worst_is_named() -> None:
    soft, sharp = bar_frames(1.6, 20.0, noise=False), bar_frames(0.8, 20.0, noise=False)

    def half(each: NDArray[np.uint16], other: NDArray[np.uint16]) -> NDArray[np.uint16]:
        return np.concatenate([each[:, :200], other[:, 200:]], 1)

    frames = BarFrames(
        (half(sharp.bars[0], soft.bars[0]), half(sharp.bars[1], soft.bars[1])),
        (half(sharp.inverse[0], soft.inverse[0]), half(sharp.inverse[1], soft.inverse[1])),
    )
    found = check_focus(frames, BLACK_DN)
    assert found.worst_px.value == pytest.approx(1.6 * BAR_PX / 20, rel=0.04)
    assert found.camera_px.value == pytest.approx((0.8 * 2 + 1.6) / 3, rel=0.05)


def test_bars_are_forty_columns_wide_and_the_inverse_begins_dark() -> None:
    assert bar_levels(100, 7, False).tolist() == [7] * 40 + [0] * 40 + [7] * 20
    assert bar_levels(100, 7, True).tolist() == [0] * 40 + [7] * 40 + [0] * 20


def stepped(count: int = 60, columns: tuple[int, ...] = (20, 40, 60, 80), middle: float = 0.6) -> Floats:
    """Shares of sharp bars whose edges each have one pixel in between, right of these columns."""
    row = np.zeros(100)
    for i, column in enumerate(columns):
        row[column + 1 :] = (i + 1) % 2
        row[column] = middle if i % 2 == 0 else 1 - middle
    return np.tile(row, (count, 1))


LIT = np.ones((60, 100), bool)


def test_an_edge_is_a_crossing_of_one_half_with_the_products_around_it() -> None:
    share = stepped()
    found = _find_edges(share, share, LIT)
    assert len(found.row) == 240
    assert sorted(set(found.column.tolist())) == [19, 39, 59, 79]
    assert found.pitch_px == 20.0
    assert found.blur_px == pytest.approx(np.full(240, np.sqrt(np.pi) * 0.6 * 0.4))


def test_two_pictures_are_multiplied_and_stray_light_of_the_plateaus_taken_away() -> None:
    first, second = 0.05 + 0.85 * stepped(middle=0.5), 0.05 + 0.85 * stepped(middle=0.8)
    found = _find_edges(first, second, LIT)
    a, b = 0.05 + 0.85 * 0.5, 0.05 + 0.85 * 0.8
    # Eleven pixels of the dark plateau, ten of the bright one, and the mean of both taken off 22 times.
    left = 11 * 0.05 * 0.95 + 10 * 0.9 * 0.1 + (a + b - 2 * a * b) / 2 - 11 * (0.05 * 0.95 + 0.9 * 0.1)
    assert found.blur_px[found.column == 19] == pytest.approx(np.full(60, np.sqrt(np.pi) * left))


def test_a_bar_is_the_mean_of_those_within_a_quarter_of_the_usual_one() -> None:
    share = stepped(columns=(20, 40, 60, 87))
    assert _find_edges(share, share, LIT).pitch_px == 20.0
    share = stepped(columns=(20, 40, 62, 82))
    assert _find_edges(share, share, LIT).pitch_px == pytest.approx(62 / 3)


def test_deviations_are_scaled_to_the_projector_with_their_values() -> None:
    found = check_focus(bar_frames(1.07, 30.0), BLACK_DN)
    scale = found.projector_px.value / found.camera_px.value
    assert found.projector_px.std == pytest.approx(found.camera_px.std * scale)
    assert 1.0 < found.worst_px.std / found.projector_px.std < 3.0


@pytest.mark.parametrize(("at", "seen"), [(29, 240), (30, 180), (31, 240)])
def test_plateaus_begin_eleven_pixels_before_and_after_an_edge(at: int, seen: int) -> None:
    # Bars of 20 pixels; an edge at 19 uses columns 9 to 30, one at 39 columns 29 to 50.
    share = stepped()
    share[:, at] = 0.75
    dark = LIT.copy()
    dark[:, at] = False
    assert len(_find_edges(share, share, LIT).row) == {29: 120, 30: 120, 31: 240}[at]
    assert len(_find_edges(stepped(), stepped(), dark).row) < 240


def test_a_soft_edge_that_crosses_twice_counts_never() -> None:
    share = stepped()
    share[:, 24], share[:, 25] = 0.4, 0.9
    found = _find_edges(share, share, LIT)
    assert 19 not in found.column
    assert 59 in found.column


def test_edges_too_near_to_the_border_have_no_plateau() -> None:
    # One edge a row: it needs 49 pixels on both sides.
    for column, seen in ((50, True), (49, False), (51, False)):
        share = stepped(columns=(column,), middle=1.0)
        if seen:
            assert len(_find_edges(share, share, LIT).row) == 60
        else:
            with pytest.raises(CalibrationError, match="No clear edges"):
                _find_edges(share, share, LIT)


@pytest.mark.parametrize(("rows", "enough"), [(50, True), (49, False)])
def test_fifty_edges_are_needed(rows: int, enough: bool) -> None:
    share = stepped(rows, (50,), 1.0)
    if enough:
        found = _find_edges(share, share, LIT[:rows])
        assert found.pitch_px == 98.0, "without a second edge in a row the window stands for a bar"
    else:
        with pytest.raises(CalibrationError, match="No clear edges"):
            _find_edges(share, share, LIT[:rows])


def test_a_bar_that_is_missing_does_not_stretch_the_others() -> None:
    share = stepped()
    share[:10] = stepped(columns=(20, 40))[0]
    assert _find_edges(share, share, LIT).pitch_px == 20.0
