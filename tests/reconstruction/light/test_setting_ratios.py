"""Light of one setting relative to another one's, from raw counts."""

import numpy as np
import pytest

from dsl_core.model.plan import Role
from dsl_core.model.rig import Sensor
from dsl_core.optics.sensor import digitise
from dsl_core.reconstruction.hdr import BlackFrame
from dsl_core.reconstruction.light.setting_ratios import (
    Ratio,
    compare_settings,
    compared_rows,
    without_strange,
)

SENSOR, GAINS_MS = Sensor(), (4.0, 100.0)


def mosaics(level: float, share: float = 1.0) -> list[np.ndarray]:
    rng = np.random.default_rng(9)
    light = share * np.linspace(0, 60, 60 * 80, dtype=np.float32).reshape(60, 80)
    return [digitise(SENSOR, light * np.float32(gain), rng) for gain in (GAINS_MS[0] * level, GAINS_MS[1])]


@pytest.mark.parametrize("level", [1.0, 0.9, 1.15])
def test_a_fainter_shot_is_told(level: float) -> None:
    black = BlackFrame(np.full((60, 80), SENSOR.black_level_dn, np.float32), np.zeros((60, 80), np.float32))
    found, own = compare_settings(mosaics(level), [black, black], GAINS_MS, SENSOR)
    assert found is not None
    assert own is not None
    assert abs(found.log - np.log(level)) < 3.5 * found.std
    assert found.std < 0.01
    assert own.log == 0


def test_dark_pictures_say_nothing() -> None:
    black = BlackFrame(np.full((60, 80), SENSOR.black_level_dn, np.float32), np.zeros((60, 80), np.float32))
    assert compare_settings(mosaics(1.0, 0.001), [black, black], GAINS_MS, SENSOR)[0] is None


def black_of(shape: tuple[int, int], level: float) -> BlackFrame:
    return BlackFrame(np.full(shape, level, np.float32), np.zeros(shape, np.float32))


@pytest.mark.parametrize("gains", [(4.0, 10.0), (10.0, 4.0)])
def test_a_ratio_is_the_factor_of_the_brighter_setting_that_fits_the_fainter_one(
    gains: tuple[float, float],
) -> None:
    rng = np.random.default_rng(2)
    light = rng.uniform(30, 330, (6, 9))
    raws = [
        np.rint(260 + gain * light * level).astype(np.uint16)
        for gain, level in zip(gains, (1.03, 1.0), strict=True)
    ]
    raws[0][0, :3], raws[1][1, :3] = 3700, 3690
    # Too little or too much light to be compared: of 4095 counts, less than 41 above black or more than 3685.
    raws[gains.index(10.0)][2, :2] = 300, 302
    blacks = [black_of((6, 9), 260), black_of((6, 9), 260)]
    found, own = compare_settings(raws, blacks, gains, SENSOR)
    assert found is not None
    assert own is not None
    assert (own.log, own.std) == (0.0, 0.0)
    bright, faint = (raws[gains.index(gain)].astype(float) - 260 for gain in (10.0, 4.0))
    used = (bright > 40.95) & (raws[0] < 3685.5) & (raws[1] < 3685.5)
    assert 12 < used.sum() < 48
    x, y, scale = bright[used], faint[used], 0.4
    weight = 1 / (2 * (0.25 + 1 / 12) + scale * x / 10)
    power = weight @ (x**2 - x / 10 - 0.25 - 1 / 12)
    factor = weight @ (x * y) / power
    # The pixel of 302 DN contradicts all others, and is left out.
    assert weight @ (y**2 - factor * x * y) / used.sum() > 4
    agree = np.abs(y / x - np.median(y / x)) < 0.1
    assert (~agree).sum() == 1
    x, y, weight = x[agree], y[agree], weight[agree]
    power = weight @ (x**2 - x / 10 - 0.25 - 1 / 12)
    factor = weight @ (x * y) / power
    assert found.std == pytest.approx(1 / np.sqrt(power) / factor)
    assert found.log == pytest.approx(np.log(factor / scale) * (1 if gains[0] < gains[1] else -1))
    assert found.log == pytest.approx(np.log(1.03), abs=0.01)


@pytest.mark.parametrize(("rows", "told"), [(8, True), (30, False)])
def test_something_that_sits_down_between_settings_is_no_change_of_the_light(rows: int, told: bool) -> None:
    """It dims the brightest pixels to a third at the bright setting, where they were saturated before."""
    black = BlackFrame(np.full((60, 80), SENSOR.black_level_dn, np.float32), np.zeros((60, 80), np.float32))
    faint, bright = mosaics(1.0)
    light = (faint[-rows:] - SENSOR.black_level_dn) * (GAINS_MS[1] / GAINS_MS[0])
    bright[-rows:] = digitise(SENSOR, (light / 3).astype(np.float32), np.random.default_rng(4))
    found = compare_settings([faint, bright], [black, black], GAINS_MS, SENSOR)[0]
    assert (found is not None) == told
    if found is not None:
        assert abs(found.log) < 4 * found.std < 0.02


@pytest.mark.parametrize(("count", "told"), [(12, True), (11, False)])
def test_twelve_pixels_are_enough(count: int, told: bool) -> None:
    raws = [np.full((4, 5), 260, np.uint16) for _ in range(2)]
    for raw, light in zip(raws, (400, 1000), strict=True):
        raw.ravel()[:count] += light
    found = compare_settings(raws, [black_of((4, 5), 260)] * 2, (4.0, 10.0), SENSOR)[0]
    assert (found is not None) == told
    # Nothing at all of the fainter one.
    raws[0][:] = 255
    assert compare_settings(raws, [black_of((4, 5), 260)] * 2, (4.0, 10.0), SENSOR)[0] is None


def test_rows_are_spread_over_the_picture() -> None:
    assert compared_rows(5).tolist() == [0, 1, 2, 3, 4]
    rows = compared_rows(1000)
    assert (len(rows), rows[0], rows[-1]) == (145, 0, 999)
    assert set(np.diff(rows)) == {6, 7}


def test_pixels_that_contradict_most_others_are_left_out_and_leave_a_ratio_less_sure() -> None:
    """A few bright pixels that something came before, among many faint ones that nothing did."""
    gains, black = (4.0, 10.0), black_of((6, 80), 260)
    light = np.full((6, 80), 20.0)
    light[0, :20] = 300.0
    rng = np.random.default_rng(3)
    sound, covered = (
        [
            np.rint(260 + gain * light * np.asarray(share) + rng.normal(0, 2, light.shape)).astype(np.uint16)
            for gain, share in zip(gains, shares, strict=True)
        ]
        for shares in ((np.ones_like(light), 1.0), (np.where(light > 100, 2.5, 1.0), 1.0))
    )
    usual, wrong = (compare_settings(raws, [black, black], gains, SENSOR)[0] for raws in (sound, covered))
    assert usual is not None
    assert wrong is not None
    assert abs(usual.log) < 4 * usual.std
    assert abs(wrong.log) < 4 * wrong.std < 0.1
    assert wrong.std > usual.std


def ratios_of(logs: list[float]) -> dict[tuple[Role, int], tuple[Ratio | None, ...]]:
    return {("spectral", i): (Ratio(log, 0.001), Ratio(0.0, 0.0)) for i, log in enumerate(logs)}


def test_a_pattern_that_contradicts_all_others_says_nothing_of_the_light() -> None:
    """White that saturates but where something dark came before it: three pixels, fifty times the light."""
    ratios = ratios_of([0.01 * i for i in range(20)]) | {("white", 0): (Ratio(3.9, 0.0002), None)}
    found = without_strange(ratios)
    assert found.pop(("white", 0)) == (None, None)
    assert found == ratios_of([0.01 * i for i in range(20)])


@pytest.mark.parametrize("logs", [[0.0, 0.5] * 8, [0.0] * 15 + [0.3], [0.0] * 6 + [3.9]])
def test_light_that_flickers_and_few_patterns_are_left_as_they_are(logs: list[float]) -> None:
    assert without_strange(ratios_of(logs)) == ratios_of(logs)
