"""Patterns are what their records say, and the Gray code is OpenCV's to the bit."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.errors import PlanError
from dsl_core.model.plan import CapturePlan, Columns, GrayCode, LineComb, ScanLines, Shot
from dsl_core.patterns.gray_code import code_image, frame_count
from dsl_core.patterns.images import pattern_image, spectral_profiles
from dsl_core.patterns.multiplexed import profile, profiles
from tests.cases.code_frames import code_images

SIZE = (640, 360)


@pytest.mark.parametrize("size", [SIZE, (1024, 768), (37, 20)])
def test_gray_code_is_bit_identical_to_opencv(size: tuple[int, int]) -> None:
    cv2 = pytest.importorskip("cv2")
    generator = cv2.structured_light.GrayCodePattern.create(*size)
    theirs = list(generator.generate()[1])
    blank = np.zeros(size[::-1], np.uint8)
    black, white = generator.getImagesForShadowMasks(blank.copy(), blank.copy())
    expected = np.stack([*theirs, white, black])
    ours = code_images(GrayCode(), size)
    assert ours.dtype == np.uint8
    np.testing.assert_array_equal(ours, expected)


def test_published_frame_counts() -> None:
    assert code_images(GrayCode(), SIZE).shape == (40, 360, 640)
    assert code_images(GrayCode(rows=False), SIZE).shape == (22, 360, 640)
    np.testing.assert_array_equal(
        code_images(GrayCode(rows=False), SIZE)[:20], code_images(GrayCode(), SIZE)[:20]
    )


@pytest.mark.parametrize("index", [-1, 40])
def test_code_index_outside(index: int) -> None:
    with pytest.raises(PlanError, match="does not exist"):
        code_image(GrayCode(), SIZE, index)


def test_code_of_a_projector_too_small() -> None:
    with pytest.raises(PlanError, match="at least 2 x 2"):
        frame_count(GrayCode(), (1, 360))


def test_published_lines() -> None:
    lines = profiles(ScanLines(), 640)
    assert lines.shape == (318, 640, 3)
    assert lines.dtype == np.float32
    for i in (0, 1, 317):
        np.testing.assert_array_equal(np.flatnonzero(lines[i, :, 1]), np.arange(2 * i, 2 * i + 5))
    covered = lines[:, :, 0].sum(0)
    assert (covered[:639] > 0).all()
    assert covered[639] == 0  # the published set leaves the last column dark


def test_comb_lights_the_same_columns_equally_often() -> None:
    spec = LineComb(width_px=6, step_px=3, period_px=30)
    comb = profiles(spec, 640)
    assert comb.shape == (10, 640, 3)
    x = np.arange(640)
    for k in range(10):
        np.testing.assert_array_equal(comb[k, :, 2], (x - 3 * k) % 30 < 6)
    np.testing.assert_array_equal(comb.sum(0), 2)


def test_own_columns_pass_through() -> None:
    levels = np.random.default_rng(3).random((4, 8, 3)).astype(np.float32)
    spec = Columns(levels=tuple(tuple(map(tuple, p)) for p in levels.tolist()))
    np.testing.assert_array_equal(profiles(spec, 8), levels)


@pytest.mark.parametrize(
    ("spec", "why"),
    [
        (ScanLines(width_px=2, step_px=3), "leave columns"),
        (ScanLines(width_px=700, step_px=800, sparse=True), "do not fit"),
        (ScanLines(width_px=65), "do not fit"),
        (LineComb(width_px=3, step_px=4, period_px=20), "leave columns"),
        (LineComb(period_px=65), "at most one line"),
        (Columns(levels=(((0.0, 0.5, 1.0),) * 63,)), "63 columns"),
        (Columns(levels=(((0.0, 0.5, 1.5),) * 64,)), "between 0 and 1"),
        (Columns(levels=()), "no spectral patterns"),
    ],
)
def test_sets_that_make_no_sense_say_why(spec: ScanLines | LineComb | Columns, why: str) -> None:
    with pytest.raises(PlanError, match=why):
        profiles(spec, 64)


def test_profile_index_outside() -> None:
    with pytest.raises(PlanError, match="there are 318"):
        profile(ScanLines(), 640, 318)


@pytest.mark.parametrize("spec", [ScanLines(), LineComb(), LineComb(width_px=7, step_px=3, period_px=100)])
def test_plan_and_patterns_count_alike(spec: ScanLines | LineComb) -> None:
    plan = CapturePlan(spectral=spec)
    assert len(spectral_profiles(plan)) == plan.spectral_count
    assert frame_count(GrayCode(), plan.projector_size_px) == plan.code_count + 2


def test_every_shot_has_its_drive_levels() -> None:
    size = (64, 36)
    grey = Columns(levels=(((0.1, 0.5, 1.0),) * 64,))
    plan = CapturePlan(projector_size_px=size, spectral=grey)
    code = code_images(GrayCode(), size)
    for shot in plan.shots():
        image = pattern_image(plan, shot)
        assert image.shape == (36, 64, 3)
        assert image.dtype == np.uint8
        drive = round(255 * shot.level)
        wanted = {
            "code": (code[shot.pattern, :, :, None] // 255) * drive,
            "white": drive,
            "black": 0,
            "spectral": np.round(255 * shot.level * np.array([0.1, 0.5, 1.0])),
        }[shot.role]
        np.testing.assert_array_equal(image, np.broadcast_to(np.asarray(wanted), image.shape))


def test_line_of_a_shot() -> None:
    plan = CapturePlan()
    image = pattern_image(plan, Shot(0, "spectral", 100, 1, 333.3, 0.8))
    np.testing.assert_array_equal(np.unique(image[:, 200:205]), [204])
    assert image[:, :200].max() == image[:, 205:].max() == 0
