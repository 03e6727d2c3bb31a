"""The camera's response follows from zero orders through bandpass filters."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dsl_core.calibration.common.spectral_nodes import NODES_NM, SMOOTHNESS
from dsl_core.calibration.orders.response import (
    BandSample,
    _place,
    _result,
    _usable,
    fit_response,
    shift_of_all,
)
from dsl_core.model.rig import Rgb, Rig
from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.filters import FINE_NM, nominal_filter, passed, through_filter
from dsl_core.optics.spectra import chain_response
from dsl_core.simulation.published_rig import published_rig
from dsl_core.solve.smooth_functions import Equations, SmoothSolution, solve_smooth

CENTRES = range(430, 661, 10)
NM = np.arange(440.0, 651.0, 10.0)


def true_rig() -> Rig:
    """Responses with smooth errors of some percent, and another white scale."""
    rig = published_rig()
    red, green, blue = (
        SpectralCurve.of(
            curve.wavelengths_nm,
            np.array(curve.values) * (1 + 0.04 * np.sin(np.array(curve.wavelengths_nm) / 40.0 + phase)),
        )
        for phase, curve in enumerate(rig.response)
    )
    response: Rgb = (red, green, blue)
    return rig.model_copy(update={"response": response, "white_scale": 1.08 * rig.white_scale})


def fitted(measured: bool, factor: float = 1.0) -> Rig:
    """Through filters that pass ``factor`` times what their curves say; noise of a thousandth."""
    known, truth, rng = published_rig(), true_rig(), np.random.default_rng(0)
    samples = []
    for nm in CENTRES:
        seen = factor * passed(truth, nominal_filter(nm)).sum(1) * (1 + 1e-3 * rng.standard_normal(3))
        samples.append(BandSample(seen, 1e-3 * seen, passed(known, nominal_filter(nm)), measured))
    white = chain_response(truth, 0, FINE_NM).sum((1, 2))
    return fit_response(known, samples, white, 1e-3 * white, np.ones(len(FINE_NM)))


@pytest.mark.parametrize(("measured", "factor"), [(True, 1.0), (False, 0.8)])
def test_response_times_scale_comes_near_the_truth(measured: bool, factor: float) -> None:
    known, truth, found = published_rig(), true_rig(), fitted(measured, factor)
    for colour in range(3):
        true = truth.white_scale * truth.response[colour].at(NM)
        bright = true > 0.2 * true.max()
        before = known.white_scale * known.response[colour].at(NM) / true - 1
        after = found.white_scale * found.response[colour].at(NM) / true - 1
        assert np.abs(before[bright]).max() > 0.05
        assert np.sqrt(np.mean(after[bright] ** 2)) < 0.012


@pytest.mark.slow
@pytest.mark.parametrize("off_nm", [-6.0, 0.0, 2.0])
@pytest.mark.parametrize("centres", [CENTRES, (450, 480, 540, 590, 640)])
def test_filters_that_are_all_off_alike_disagree_with_the_leds(off_nm: float, centres: Any) -> None:
    """The response is off as well, and none of it is taken for a shift."""
    known, truth, rng = published_rig(), true_rig(), np.random.default_rng(1)
    samples, through = [], []
    for nm in centres:
        seen = passed(truth, nominal_filter(nm + off_nm)).sum(1) * (1 + 1e-3 * rng.standard_normal(3))
        samples.append(BandSample(seen, 1e-3 * seen, passed(known, nominal_filter(nm)), True))
        through.append(through_filter(nominal_filter(nm)))
    white = chain_response(truth, 0, FINE_NM).sum((1, 2))
    found, std = shift_of_all(known, samples, through, white, 1e-3 * white, np.ones(len(FINE_NM)))
    assert abs(found - off_nm) < 0.4
    assert 0.5 / np.sqrt(len(samples)) <= std < 0.4


@pytest.mark.parametrize("off_nm", [0.0, 2.0])
def test_edges_of_a_response_that_look_like_a_shift_are_in_its_deviation(off_nm: float) -> None:
    """Red of the camera begins steeply; the rig so far knows a rounder one."""
    known = published_rig()
    nm = np.arange(396.0, 705.0, 2.0)
    red = 0.03 + 0.97 / (1 + np.exp(-(nm - 598.0) / 3.5)) * (1 - 0.7 / (1 + np.exp(-(nm - 640.0) / 5.0)))
    truth = known.model_copy(update={"response": (SpectralCurve.of(nm, red), *known.response[1:])})
    seen = [passed(truth, nominal_filter(each + off_nm)).sum(1) for each in CENTRES]
    samples = [
        BandSample(each, 1e-3 * each, passed(known, nominal_filter(nm)), True)
        for each, nm in zip(seen, CENTRES, strict=True)
    ]
    white = chain_response(truth, 0, FINE_NM).sum((1, 2))
    through = [through_filter(nominal_filter(each)) for each in CENTRES]
    found, std = shift_of_all(known, samples, through, white, 1e-3 * white, np.ones(len(FINE_NM)))
    assert abs(found - off_nm) < 2 * std


@pytest.mark.slow
def test_nominal_curves_say_less_of_a_shift_than_measured_ones() -> None:
    known = published_rig()
    found = []
    for measured in (True, False):
        lights = [passed(known, nominal_filter(nm)) for nm in CENTRES]
        samples = [BandSample(x.sum(1), 1e-3 * x.sum(1), x, measured) for x in lights]
        white = chain_response(known, 0, FINE_NM).sum((1, 2))
        through = [through_filter(nominal_filter(nm)) for nm in CENTRES]
        found.append(shift_of_all(known, samples, through, white, 1e-3 * white, np.ones(len(FINE_NM))))
    assert [abs(value) < 1e-6 for value, _ in found] == [True, True]
    assert found[1][1] > 2 * found[0][1]
    assert found[1][1] >= 1.5 / np.sqrt(len(CENTRES))


def test_what_white_makes_green_see_stays_in_the_response() -> None:
    known, found = published_rig(), fitted(True)
    light = chain_response(known, 0, FINE_NM).sum(1)[1]
    change = np.log(found.response[1].at(FINE_NM) / known.response[1].at(FINE_NM).clip(1e-12))
    assert float(light @ change / light.sum()) == pytest.approx(0.0, abs=2e-3)
    assert abs(found.white_scale / true_rig().white_scale - 1) < 0.04
    assert 1e-4 < found.white_scale_rel_std < 0.02


def test_deviations_of_the_response_hold() -> None:
    truth, found = true_rig(), fitted(True)
    scale = found.white_scale / truth.white_scale
    sigmas = []
    for curve, true in zip(found.response, truth.response, strict=True):
        bright = true.at(NM) > 0.2 * max(true.values)
        assert curve.std is not None
        std = np.interp(NM, curve.wavelengths_nm, curve.std)
        assert (std / true.at(NM))[bright].max() < 0.01
        sigmas.append(((scale * curve.at(NM) - true.at(NM)) / std)[bright])
    assert 0.1 < np.sqrt(np.mean(np.concatenate(sigmas) ** 2)) < 2.0


def test_the_scale_takes_what_white_makes_green_see_with_its_deviation() -> None:
    """Two filters: three functions, two factors, a drive level and the white scale."""
    rng, n = np.random.default_rng(2), len(NODES_NM)
    count = 3 * n + 4
    values, root = 0.02 * rng.standard_normal(count), 0.01 * rng.standard_normal((count, count))
    covariance = root @ root.T
    green = rng.random(n)
    green /= green.sum()
    rig = published_rig()
    found = _result(rig, SmoothSolution(values, covariance, 1.0, covariance, 0.0), green)
    mean = float(green @ values[n : 2 * n])
    assert found.white_scale == pytest.approx(rig.white_scale * np.exp(values[-1] + mean))
    sums = np.zeros(count)
    sums[n : 2 * n], sums[-1] = green, 1
    assert found.white_scale_rel_std == pytest.approx(np.sqrt(sums @ covariance @ sums))
    for colour, (old, new) in enumerate(zip(rig.response, found.response, strict=True)):
        change = values[colour * n : (colour + 1) * n] - mean
        assert new.at(NODES_NM) == pytest.approx(old.at(NODES_NM) * np.exp(change))
        part = np.zeros(count)
        part[colour * n + 7] += 1
        part[n : 2 * n] -= green
        assert new.std is not None
        stated = np.interp(NODES_NM[7], new.wavelengths_nm, new.std)
        assert stated == pytest.approx(new.at(NODES_NM[7:8])[0] * np.sqrt(part @ covariance @ part))


def test_colours_of_less_than_a_hundredth_of_the_brightest_say_nothing() -> None:
    light = np.ones((3, len(FINE_NM)))
    std = np.full(3, 0.1)
    assert _usable(BandSample(np.array([0.9, 100.0, 1.1]), std, light, True)) == [1, 2]
    assert _usable(BandSample(np.array([9.0, 100.0, 11.0]), np.array([0.1, np.inf, 0.1]), light, True)) == [
        0,
        2,
    ]
    dark = light.copy()
    dark[2] = 0.0
    assert _usable(BandSample(np.array([9.0, 100.0, 11.0]), std, dark, True)) == [0, 1]


def test_a_filters_signal_knows_its_factor_the_drive_level_and_the_scale() -> None:
    n = len(NODES_NM)
    row = np.arange(1.0, n + 1)
    one = _place(row, 1, 2, 1)
    assert one[n : 2 * n].tolist() == row.tolist()
    assert one[3 * n :].tolist() == [0, 1, 1, 1]
    assert np.count_nonzero(one) == n + 3
    white = _place(row, 2, 2, None)
    assert white[3 * n :].tolist() == [0, 0, 0, 1]
    assert white[2 * n : 3 * n].tolist() == row.tolist()


def test_everything_unknown_has_its_place_and_its_deviation_beforehand(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A measured filter, a nominal one, the drive level and the white scale, in this order."""
    asked = list[Any]()

    def noted(equations: Equations, *more: Any, **choices: Any) -> SmoothSolution:
        asked.append((equations, *more, choices))
        return solve_smooth(equations, *more, **choices)

    monkeypatch.setattr("dsl_core.calibration.orders.response.solve_smooth", noted)
    rig, light = published_rig(), passed(published_rig(), nominal_filter(540.0))
    white = 1.1 * chain_response(rig, 0, FINE_NM).sum((1, 2))
    filters = [BandSample(1.2 * light.sum(1), 0.01 * light.sum(1), light, known) for known in (True, False)]
    fit_response(rig, filters, white, 0.02 * white, np.ones(len(FINE_NM)))
    equations, functions, others, choices = asked[0]
    assert len(asked) == 3
    assert others == [0.005, 0.15, 0.01, 0.3]
    assert [(each.level_std, each.rise_std) for each in functions] == [(0.1, 0.1)] * 3
    assert choices == SMOOTHNESS
    # Three colours of each filter and of white, by logarithms and relative deviations.
    used = [_usable(each) for each in filters]
    assert equations.count == sum(map(len, used)) + 3
    squares = len(used[0] + used[1]) * np.log(1.2) ** 2 / ((0.01 / 1.2) ** 2 + 1e-6)
    squares += 3 * np.log(1.1) ** 2 / (0.02**2 + 1e-6)
    assert equations.square == pytest.approx(squares)
    # Whatever explains a signal, the white scale is in all of them and the drive level in those of filters.
    weights = len(used[0] + used[1]) / ((0.01 / 1.2) ** 2 + 1e-6), 3 / (0.02**2 + 1e-6)
    assert equations.normal[-1, -1] == pytest.approx(sum(weights))
    assert equations.normal[-2, -2] == pytest.approx(weights[0])
    assert equations.normal[-3, -3] == pytest.approx(weights[0] / 2)
