"""Stated deviations of classes hold where shapes of known area are put on the grid of pixels by chance."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.analysis.area_deviation import class_deviations
from dsl_core.analysis.class_table import class_table
from dsl_core.analysis.classification import Classification, PixelAreas
from dsl_core.analysis.classify import ClassMap, Limits, Measure, Scores

SIZE, FINE = 40, 8
MARGIN = 0.97


def _covered(shape: str, radius: float, centre: tuple[float, float]) -> np.ndarray:
    """Share of each pixel that a disc or a square covers, by many points in each."""
    y, x = ((np.mgrid[0 : SIZE * FINE, 0 : SIZE * FINE] + 0.5) / FINE).astype(float)
    dy, dx = y - centre[0], x - centre[1]
    inside = np.hypot(dx, dy) < radius if shape == "disc" else np.maximum(abs(dx), abs(dy)) < radius
    return np.asarray(inside.reshape(SIZE, FINE, SIZE, FINE).mean(axis=(1, 3)))


def _scores(
    best: np.ndarray, margin: np.ndarray | float = 1.0, measure: Measure = Measure.PROBABILITY
) -> Scores:
    ones = np.ones(best.shape, np.float32)
    return Scores(
        measure, ("one", "two"), (0, 1), best.astype(np.int16), (1 - best).astype(np.int16), ones,
        (ones * margin).astype(np.float32),
    )  # fmt: skip


@pytest.mark.parametrize("shape", ["disc", "square"])
@pytest.mark.parametrize("mixed", ["nearest", "none"])
def test_nine_of_ten_shapes_on_the_grid_are_within_their_two_deviations(shape: str, mixed: str) -> None:
    rng, held, ratios = np.random.default_rng(5), [], []
    for _ in range(40):
        radius, centre = rng.uniform(8, 13), rng.uniform(18, 22, 2)
        share = _covered(shape, radius, tuple(centre))
        scores = _scores(np.where(share > 0.5, 0, 1))
        if mixed == "none":
            # What an edge runs through is of neither colour.
            scores.fit[(share > 0.02) & (share < 0.98)] = 0
        shown = ClassMap.of(scores)
        found = class_deviations(scores, shown)
        assert found is not None
        off = (shown.values == 1).sum() - share.sum()
        held.append(abs(off) <= 2 * found.pixels[1])
        ratios.append(found.pixels[1] / (np.pi * radius**2))
    assert np.mean(held) >= 0.9
    # Nor is it an empty promise: by the nearest colour, a square of 21 pixels is off by 0.035 pi r^2.
    assert np.median(ratios) < (0.04 if mixed == "nearest" else 0.15)


@pytest.mark.parametrize("shape", ["disc", "square"])
def test_areas_are_not_too_small_where_edges_are_of_no_class(shape: str) -> None:
    rng, off, counted_off, held = np.random.default_rng(8), [], [], []
    for _ in range(40):
        radius, centre = rng.uniform(8, 13), rng.uniform(18, 22, 2)
        share = _covered(shape, radius, tuple(centre))
        scores = _scores(np.where(share > 0.5, 0, 1))
        scores.fit[(share > 0.02) & (share < 0.98)] = 0
        shown, areas = ClassMap.of(scores), np.full(share.shape, 2.0)
        row = class_table(shown, areas, class_deviations(scores, shown, areas))[0]
        assert row.area_mm2 is not None
        assert row.area_std_mm2 is not None
        off.append(row.area_mm2 / (2 * share.sum()) - 1)
        counted_off.append(row.pixels / share.sum() - 1)
        held.append(abs(row.area_mm2 - 2 * share.sum()) <= 2 * row.area_std_mm2)
    assert abs(np.mean(off)) < 0.02
    assert np.mean(counted_off) < -0.08
    assert np.mean(held) >= 0.9


def test_probabilities_and_depth_add_to_edges() -> None:
    best = np.zeros((SIZE, SIZE), int)
    scores = _scores(best, MARGIN)
    shown, areas = ClassMap.of(scores), np.full(best.shape, 2.0)
    found = class_deviations(scores, shown, areas, np.full(best.shape, 0.01))
    assert found is not None
    assert found.areas_mm2 is not None
    chance = SIZE * np.sqrt(MARGIN * (1 - MARGIN))
    assert found.pixels[1] == pytest.approx(chance, rel=1e-3)
    # One per cent of depth is two of the area.
    assert found.areas_mm2[1] == pytest.approx(2 * np.hypot(chance, 0.02 * SIZE**2), rel=1e-3)
    assert np.isnan(found.pixels[[0, shown.none, shown.unsure]]).all()


@pytest.mark.parametrize("is_judged", [False, True])
def test_pixels_without_a_point_may_hold_area_all_the_same(is_judged: bool) -> None:
    """Saturated pixels in a white patch have neither class nor depth, and the patch goes on in them."""
    scores = _scores(np.zeros((SIZE, SIZE), int))
    lost = np.zeros((SIZE, SIZE), bool)
    lost[4:36:4, 4:36:4] = True
    if not is_judged:
        scores.fit[lost] = 0
    found = class_deviations(scores, ClassMap.of(scores), np.where(lost, np.nan, 2.0))
    assert found is not None
    assert found.areas_mm2 is not None
    # Half of what has no class is counted as its area, and is as likely all of it as none.
    expected_mm2 = 2 * lost.sum() if is_judged else found.pixels[1]
    assert found.areas_mm2[1] == pytest.approx(expected_mm2, rel=1e-3)
    assert found.beside_mm2 is not None
    assert found.beside_mm2[1] == pytest.approx(0 if is_judged else lost.sum())


def test_what_is_undecided_may_be_of_either_class() -> None:
    best = np.zeros((SIZE, SIZE), int)
    scores = _scores(best, 0.6)
    shown = ClassMap.of(scores)
    found = class_deviations(scores, shown)
    assert found is not None
    np.testing.assert_allclose(found.pixels[1:3], [0.6 * SIZE**2, 0.4 * SIZE**2], rtol=1e-3)


@pytest.mark.parametrize(("has_point", "known"), [(True, False), (False, True)])
def test_a_class_without_pixels_is_not_known_to_be_none(has_point: bool, known: bool) -> None:
    best = np.zeros((SIZE, SIZE), int)
    best[10:20, 10:20] = -1
    scores = _scores(best)
    shown, areas = ClassMap.of(scores), np.full(best.shape, 2.0)
    if not has_point:
        areas[10:20, 10:20] = np.nan
    found = class_deviations(scores, shown, areas)
    assert found is not None
    assert found.areas_mm2 is not None
    assert np.isfinite([found.pixels[2], found.areas_mm2[2]]).tolist() == [known, known]
    told = Classification.of(scores, areas=PixelAreas(areas)).notes
    assert [each[:34] for each in told] == ([] if known else ["6% of the pixels were not judged ("])


def test_angles_are_no_probabilities() -> None:
    scores = _scores(np.zeros((4, 4), int), measure=Measure.ANGLE)
    assert class_deviations(scores, ClassMap.of(scores, Limits(2, 0))) is None
