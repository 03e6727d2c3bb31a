"""The camera's response follows from zero orders through bandpass filters."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.calibration.orders.response import BandSample, fit_response
from dsl_core.model.rig import Rgb, Rig
from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.filters import FINE_NM, nominal_filter, passed
from dsl_core.optics.spectra import chain_response
from dsl_core.simulation.published_rig import published_rig

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
    return fit_response(known, samples, white, 1e-3 * white, 1.0)


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
