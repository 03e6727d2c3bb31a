"""Levels of frames from the sum of light and the smoothness of first orders, on frames made by hand."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d
from scipy.stats import chi2

from dsl_core.model.plan import CapturePlan, Columns, GrayCode, ScanLines
from dsl_core.patterns.images import spectral_profiles
from dsl_core.reconstruction.light import line_levels as module
from dsl_core.reconstruction.light.line_levels import LineLevels, candidates, line_levels
from dsl_core.reconstruction.merge import LineStack, PickedLines

PLAN = CapturePlan(code=GrayCode(rows=False), spectral=ScanLines(), projector_size_px=(120, 60))
SHAPE = (24, 120)


def levels(
    gains: np.ndarray,
    plan: CapturePlan = PLAN,
    by_hit: float = 0.0,
    leak: float = 0.0,
    told: bool = True,
    room: float | None = None,
) -> LineLevels | None:
    """Of frames with this light: 85 % of each line straight, the rest spread over 40 columns beside it.

    By a share ``by_hit`` light beside a line depends on what it hits in the same row. A share ``leak`` of
    white is in black as well, and flickers as all light does, ``told`` or not. Light of a ``room`` is in
    black as well, and nobody knows how much of that leaks.
    """
    rng = np.random.default_rng(5)
    profiles = gaussian_filter1d(spectral_profiles(plan)[:, :, 0].astype(float), 0.9, axis=1)
    column = np.broadcast_to(np.arange(SHAPE[1]), SHAPE)
    surface = rng.uniform(5, 20, SHAPE)

    def seen(pattern: np.ndarray) -> np.ndarray:
        beside = np.roll(np.convolve(pattern, np.ones(40) / 40, mode="same"), 25)
        return (0.85 * pattern + 0.15 * beside) * surface

    light = np.array([seen(each) for each in profiles])
    sure = np.full(SHAPE, 0.02)
    white = seen(np.ones(SHAPE[1])) + 0.02 * rng.normal(size=SHAPE)
    away = np.abs(np.arange(SHAPE[1]) - np.arange(len(light))[:, None] * 2 - 2) > 8
    hit = 1 + by_hit * rng.uniform(-1, 1, (len(light), 4)).repeat(SHAPE[0] // 4, axis=1)
    light = light * np.where(away[:, None], hit[..., None], 1.0)
    dark = leak * surface
    # The black picture has been taken off.
    frames = light * gains[:, None, None] + (gains - 1)[:, None, None] * dark
    frames += 0.02 * rng.normal(size=light.shape)
    stack = LineStack(frames.astype(np.float32), np.full(light.shape, 0.02), np.zeros(SHAPE, np.float32))
    whites = (white, sure**2)
    seen_dark = (dark if told else 0.0) + (room or 0.0) * surface
    picked = stack.pick(candidates(column, whites))
    return line_levels(plan, column, whites, picked, seen_dark, is_calibrated=room is None)


def test_levels_of_flickering_frames_are_found() -> None:
    gains = 1 + 0.1 * np.random.default_rng(2).uniform(-1, 1, PLAN.spectral_count)
    found = levels(gains)
    assert found is not None
    inner = slice(4, -4)  # the outermost lines light few pixels
    off = (found.log - np.log(gains))[inner]
    assert np.std(off) < 0.15 * np.std(np.log(gains))
    assert np.std(off) < 2 * np.median(found.std)
    assert found.quick == pytest.approx(0.058, rel=0.3)


@pytest.mark.parametrize("told", [True, False])
def test_what_gets_through_the_projector_flickers_as_well(told: bool) -> None:
    """Where first orders are fainter than that, they seemed to flicker several times as much as the light."""
    gains = 1 + 0.02 * np.random.default_rng(2).uniform(-1, 1, PLAN.spectral_count)
    found = levels(gains, leak=0.02, told=told)
    assert found is not None
    assert (found.quick == pytest.approx(0.0115, rel=0.3)) == told
    assert (np.std((found.log - np.log(gains))[4:-4]) < 0.008) == told


@pytest.mark.parametrize(
    ("leak", "room"), [(0.0, 0.02), (0.0, 0.3), (0.02, 0.0), (0.02, 0.1), (0.005, 0.005)]
)
def test_frames_tell_what_of_black_flickers(leak: float, room: float) -> None:
    """All light of a room, taken for the projector's, made its flicker four times less and more."""
    gains = 1 + 0.1 * np.random.default_rng(2).uniform(-1, 1, PLAN.spectral_count)
    found = levels(gains, leak=leak, room=room)
    assert found is not None
    assert found.quick == pytest.approx(0.05, rel=0.2)
    assert np.std((found.log - np.log(gains))[4:-4]) < 0.008


@pytest.mark.parametrize(("leak", "room"), [(0.0, 0.1), (0.02, 0.0)])
def test_of_steady_frames_it_does_not_matter_what_flickers(leak: float, room: float) -> None:
    found = levels(np.ones(PLAN.spectral_count), leak=leak, room=room)
    assert found is not None
    assert found.quick < 0.003


def test_steady_frames_are_found_steady() -> None:
    found = levels(np.ones(PLAN.spectral_count))
    assert found is not None
    assert np.std(found.log[4:-4]) < 0.005
    assert found.quick < 0.004


def test_light_from_surface_to_surface_is_no_flicker() -> None:
    """What a line hits differs between the rows of a picture, and so does the light that comes from there."""
    assert levels(np.ones(PLAN.spectral_count), by_hit=0.2) is None


def test_patterns_that_cover_columns_unevenly_say_nothing() -> None:
    some = tuple(tuple((float(x < 6 * k), 0.5, 0.5) for x in range(120)) for k in range(10))
    plan = PLAN.model_copy(update={"spectral": Columns(levels=some)})
    assert levels(np.ones(10), plan) is None


def test_candidates_are_lit_pixels_that_have_a_column_and_not_all_of_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    column, light, variance = np.arange(40).reshape(4, 10), np.full((4, 10), 5.1), np.ones((4, 10))
    column[0, 0], variance[0, 1], light[0, 2], variance[1, 0] = -1, np.inf, 5.0, -1e-9
    wanted = [i for i in range(40) if i not in (0, 1, 2)]
    assert candidates(column, (light, variance)).tolist() == wanted
    monkeypatch.setattr(module, "PIXELS", 6)
    assert candidates(column, (light, variance)).tolist() == wanted[::3]


def test_the_pitch_is_that_of_neighbours_whose_columns_are_known() -> None:
    column = np.array([[10, 12, 14, -1, 90, 91], [5, 3, -1, 7, 4, -1]])
    assert module.pitch_of(column) == 2.0
    assert module.pitch_of(np.array([[4, -1, 9]])) == 1.0


def test_the_difference_of_neighbouring_frames_is_a_robust_deviation_less_noise() -> None:
    sums = 0.05 * np.sqrt(chi2.ppf((np.arange(400) + 0.5) / 400, 1))
    angle = np.pi / 4 + np.arccos(sums / np.sqrt(2))
    rows = 3.0 * np.stack([np.cos(angle), np.sin(angle)], 1)
    found = module._quick(rows, np.full(400, 3.0 * 0.02))
    assert found == pytest.approx(np.sqrt(0.05**2 - 0.02**2), rel=2e-3)
    assert module._quick(rows, np.full(400, 3.0)) == 0.0
    assert module._quick(rows[-7:], np.zeros(7)) == 0.0
    assert module._quick(rows[-8:], np.zeros(8)) > 0.0


def test_coverage_is_the_sum_of_the_frames_softened_as_a_line_is() -> None:
    profiles = spectral_profiles(PLAN).sum(0).mean(1).astype(float)
    assert module._coverage(PLAN) == pytest.approx(gaussian_filter1d(profiles, 0.9, mode="nearest"))

    def covered(light: np.ndarray) -> bool:
        levels = tuple(tuple((float(v), float(v), float(v)) for v in each) for each in light)
        return module._coverage(PLAN.model_copy(update={"spectral": Columns(levels=levels)})) is not None

    # A slow wave of 7 or 10 per cent is even enough or not, whatever the edges do; its rms is 0.71 of that.
    wave = np.sin(np.arange(120) / 3.0)
    wave[:7] = wave[-7:] = 5.0
    assert covered(np.tile((1 + 0.07 * wave) / 2, (8, 1)))
    assert not covered(np.tile((1 + 0.1 * wave) / 2, (8, 1)))
    assert not covered(np.full((7, 120), 0.5)), "too few frames"


def around_lines(count: int = 18) -> tuple[np.ndarray, np.ndarray, np.ndarray, CapturePlan]:
    """Columns, frames and variances of some pixels, and the plan."""
    rng = np.random.default_rng(3)
    column = rng.integers(0, 120, 300)
    return column, rng.uniform(5, 9, (300, count)), rng.uniform(0.1, 0.2, (300, count)), PLAN


def test_away_from_a_line_its_frame_is_interpolated_from_four_others() -> None:
    column, frames, variance, plan = around_lines()
    assert isinstance(plan.spectral, ScanLines)
    step, width, pitch = plan.spectral.step_px, plan.spectral.width_px, 1.5
    frames[:, 7] *= 0.002  # hidden by noise
    rows, stds = module._smooth_rows(plan, column, frames, variance, pitch)
    kept = [k for k in range(2, 16) if k != 7]
    assert rows.shape == (13, 18)
    for row, std, k in zip(rows, stds, kept, strict=True):
        away = np.abs(column - (k * step + width / 2)) > width / 2 + 2 * step + 6 + 1.5 * pitch
        light, noise = frames[away].sum(0), variance[away].sum(0)
        wanted = np.zeros(18)
        wanted[k - 2 : k + 3] = np.array([1, -4, 6, -4, 1]) / 6 * light[k - 2 : k + 3] / light[k]
        assert row == pytest.approx(wanted)
        chance = noise[k - 2 : k + 3] @ (np.array([1, 4, 6, 4, 1]) / 6) ** 2
        assert std == pytest.approx(np.hypot(0.0025, np.sqrt(chance) / light[k]))


def test_frames_count_from_ten_deviations_of_their_noise_and_sets_from_sixteen_frames() -> None:
    column, frames, variance, plan = np.full(4, 119), np.ones((4, 16)), np.zeros((4, 16)), PLAN
    # The lines are far away: the light is 4, and the squares of the shares add up to 70 / 36.
    for share, kept in ((0.99, 12), (1.01, 0)):
        variance[:] = 0.16 * share / 4 * 36 / 70
        assert len(module._smooth_rows(plan, column, frames, variance, 0.0)[0]) == kept
    assert len(module._smooth_rows(plan, column, frames[:, :15], variance[:, :15], 0.0)[0]) == 0
    assert module._smooth_rows(plan, column, frames[:, :15], variance[:, :15], 0.0)[0].shape == (0, 15)


@pytest.mark.parametrize("strong", [True, False])
def test_levels_are_those_of_weighted_least_squares(strong: bool) -> None:
    """The same by stacked equations: the sum of light, neighbours, and that levels are alike."""
    rng = np.random.default_rng(6)
    pixels, count = 60, 10
    frames = rng.uniform(1, 3, (pixels, count))
    total = frames @ rng.uniform(0.9, 1.1, count) * 1.3
    total[:3] *= 1.6
    noise = rng.uniform(0.5, 1.5, pixels) * (1e-3 if strong else 1.0)
    variance = rng.uniform(0.0, 1e-6, (pixels, count))
    smooth = np.eye(count) - 0.5 * np.eye(count, k=1) - 0.5 * np.eye(count, k=-1)
    smooth *= rng.uniform(0.8, 1.2, (count, count))
    smooth_std = rng.uniform(0.01, 0.03, count)
    found = module._solve(frames, variance, total, noise, smooth, smooth_std)
    spread = max(1.1 * module._quick(smooth, smooth_std), 0.01)
    weight = 1 / noise
    for _ in range(3):
        debt = np.diag((weight[:, None] * variance).sum(0))
        matrix, right = frames.T @ np.diag(weight) @ frames - debt, frames.T @ (weight * total)
        mean = right.sum() / matrix.sum()
        whole = matrix + smooth.T @ np.diag((mean * smooth_std) ** -2.0) @ smooth
        whole += np.eye(count) / (spread * mean) ** 2
        levels = np.linalg.solve(whole, right + mean / (spread * mean) ** 2)
        away = np.abs(frames @ levels - total) / np.sqrt(noise)
        usual = np.median(away) / 0.6744898
        weight = np.where(away > 2.5 * usual, 2.5 * usual / away, 1) / noise
    assert found.log == pytest.approx(-np.log(levels))
    assert found.std == pytest.approx(np.sqrt(np.diag(np.linalg.inv(whole))) * max(usual, 1) / mean)
    assert found.misfit == pytest.approx(np.median(np.abs(frames @ levels / total - 1)) / 0.6744898)
    assert found.quick == module._quick(smooth, smooth_std)
    assert (usual > 1) == strong


def test_the_sum_of_light_is_compared_with_what_goes_straight_and_what_is_spread(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rng = np.random.default_rng(8)
    count, pixels = PLAN.spectral_count, np.arange(0, 700, 2)
    column = rng.integers(0, 120, (7, 100))
    light = rng.uniform(3, 9, (7, 100))
    light_variance = 0.01 + 0.02 * light
    radiance = rng.uniform(0.5, 1.5, (count, 350)).astype(np.float32)
    std = rng.uniform(0.01, 0.02, (count, 350)).astype(np.float32)
    std[3, 10] = np.inf
    black = rng.uniform(0.001, 0.002, 350).astype(np.float32)
    given: list[np.ndarray] = []

    def keep(*arrays: np.ndarray) -> None:
        given.extend(arrays)

    monkeypatch.setattr(module, "_solve", keep)
    monkeypatch.setattr(module, "_agree", lambda *_: True)  # of random light no two halves do
    seen = PickedLines(pixels, radiance, std, black)
    line_levels(PLAN, column, (light, light_variance), seen)
    frames, variance, total, noise, rows, stds = given
    sound = np.delete(np.arange(350), 10)
    assert frames == pytest.approx(radiance[:, sound].T)
    assert variance == pytest.approx(std[:, sound].T ** 2, rel=1e-6)
    cover = module._coverage(PLAN)
    assert cover is not None
    own = column.ravel()[pixels][sound]
    white = light.ravel()[pixels][sound]
    assert total == pytest.approx(white * (0.85 * cover[own] + 0.15 * cover.mean()))
    summed = frames.sum(1) * total.sum() / frames.sum()
    line = np.polyfit(summed, 0.01 + 0.02 * white, 1)
    usual = np.maximum(np.polyval(line, summed), (0.01 + 0.02 * white).min())
    blacks = count * black[sound].astype(float)
    assert noise == pytest.approx((0.1 * summed) ** 2 + cover.mean() ** 2 * usual + blacks**2)
    pitch = float(np.median(np.abs(np.diff(column, axis=1))))
    again = module._smooth_rows(PLAN, own, frames, variance, pitch)
    assert rows == pytest.approx(again[0])
    assert stds == pytest.approx(again[1])
    given.clear()
    with monkeypatch.context() as fewer:
        fewer.setattr(module, "PIXELS", 116)
        fewer.setattr(module, "FEWEST", 116)
        line_levels(PLAN, column, (light, light_variance), seen)
    assert given[0] == pytest.approx(frames[::3])
    for few, told in ((301, True), (300, True), (299, False)):
        given.clear()
        line_levels(PLAN, column, (light, light_variance), seen.pick(pixels[sound[:few]]))
        assert bool(given) == told
