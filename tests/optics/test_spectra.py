"""Response of the whole chain and the bands of a model, from the curves of a rig."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from dsl_core.model.spectral import SpectralCurve, WavelengthGrid
from dsl_core.optics.spectra import FADING_NM, PAD_NM, Bands, chain_response, hat_moments, pads_nm
from dsl_core.simulation.published_rig import published_rig

RIG = published_rig()
CENTRES = np.arange(430.0, 661.0, 10.0)


def test_the_chain_is_camera_times_led_times_film() -> None:
    nm = np.array([440.0, 512.5, 633.0])
    for order in (0, 1, -1):
        film = RIG.efficiency[order].at(nm) if order else np.ones(3)
        found = chain_response(RIG, order, nm)
        for channel, led in np.ndindex(3, 3):
            wanted = RIG.white_scale * RIG.response[channel].at(nm) * RIG.emission[led].at(nm) * film
            assert found[channel, led] == pytest.approx(wanted)
    assert not chain_response(RIG, 7, nm).any()


@pytest.mark.parametrize("order", [0, 1, -1])
def test_a_band_weighs_the_response_by_its_hat_and_ends_take_what_is_beyond(order: int) -> None:
    moments, centroids = hat_moments(RIG, order, CENTRES, 10.0)
    beyond = np.arange(0, 40, 0.25)
    for band in (0, 5, len(CENTRES) - 1):
        nm = CENTRES[band] + np.linspace(-10, 10, 41)
        weight = chain_response(RIG, order, nm) * (1 - np.abs(nm - CENTRES[band]) / 10)
        whole = weight.sum((0, 1))
        assert centroids[band] == pytest.approx(whole @ nm / whole.sum())
        wanted = np.trapezoid(weight, nm, axis=-1)
        if order == 0 and band != 5:
            side = -1 if band == 0 else 1
            light = chain_response(RIG, 0, CENTRES[band] + side * beyond)
            wanted = wanted + (light * np.minimum(beyond / 10, 1)).sum(-1) * 0.25
        assert moments[..., band] == pytest.approx(wanted)


def test_a_band_without_light_is_where_it_is() -> None:
    moments, centroids = hat_moments(RIG, 7, CENTRES, 10.0)
    assert not moments.any()
    assert centroids.tolist() == CENTRES.tolist()


@pytest.mark.parametrize(("step_nm", "pad"), [(5.0, 3), (10.0, 2), (2.0, 8), (23.0, 1)])
def test_bands_go_fifteen_nanometres_beyond_the_grid(step_nm: float, pad: int) -> None:
    grid = WavelengthGrid(step_nm=step_nm)
    bands = Bands.of(RIG, grid)
    assert bands.reported == slice(pad, pad + grid.count)
    assert bands.centres_nm[bands.reported] == pytest.approx(grid.centres_nm)
    assert np.diff(bands.centres_nm) == pytest.approx(step_nm)
    assert bands.count == grid.count + 2 * pad == len(bands.centres_nm)
    assert sorted(bands.moments) == [-2, -1, 0, 1, 2]
    moments, centroids = hat_moments(RIG, -1, bands.centres_nm, step_nm)
    assert bands.moments[-1] == pytest.approx(moments)
    assert bands.centroids_nm[-1] == pytest.approx(centroids)


def test_bands_go_as_far_beyond_a_narrow_grid_as_there_is_light() -> None:
    grid = WavelengthGrid(start_nm=480.0, stop_nm=600.0)
    bands = Bands.of(RIG, grid)
    assert bands.centres_nm[bands.reported] == pytest.approx(grid.centres_nm)
    nm = np.arange(390.0, 711.0)
    light = chain_response(RIG, 1, nm).sum(1).max(0)
    outside = (nm < bands.centres_nm[0]) | (nm > bands.centres_nm[-1])
    assert light[outside].max() < 0.02 * light.max()
    assert bands.centres_nm[0] > 395
    assert bands.centres_nm[-1] < 700


def test_bands_end_where_the_curves_of_a_lamp_were_no_longer_measured() -> None:
    flat = SpectralCurve.of([400, 700], [1, 1])
    lamp = RIG.model_copy(update={"emission": (flat,) * 3, "response": (flat,) * 3})
    assert pads_nm(lamp, WavelengthGrid()) == pytest.approx((30 + FADING_NM, 40 + FADING_NM))


@pytest.mark.parametrize(("share", "above_nm"), [(0.01, PAD_NM), (0.02, 40 + FADING_NM)])
def test_light_counts_from_one_and_a_half_percent_of_the_brightest_on(share: float, above_nm: float) -> None:
    flat = SpectralCurve.of([400, 700], [1, 1])
    faint = SpectralCurve.of([400, 659, 661, 700], [1, 1, share, share])
    even = {"response": (flat,) * 3, "efficiency": dict.fromkeys((1, -1), flat)}
    lamp = RIG.model_copy(update=even | {"emission": (faint,) * 3})
    assert pads_nm(lamp, WavelengthGrid(start_nm=400.0)) == pytest.approx((PAD_NM, above_nm), abs=1.0)


def test_second_orders_count_where_the_rig_knows_them() -> None:
    efficiency = {m: RIG.efficiency[m] for m in (1, -1)}
    plain = Bands.of(RIG.model_copy(update={"efficiency": efficiency}), WavelengthGrid())
    assert plain.orders == (1, -1)
    more = RIG.model_copy(update={"efficiency": efficiency | {-2: RIG.efficiency[1]}})
    assert Bands.of(more, WavelengthGrid()).orders == (1, -1, -2)


@pytest.mark.parametrize(("slope", "steps"), [(0.52, 26), (-0.531, 27), (0.005, 1)])
def test_bands_are_as_wide_as_the_mean_dispersion_in_steps(slope: float, steps: int) -> None:
    bands = Bands.of(RIG, WavelengthGrid())
    nm = torch.as_tensor(bands.centres_nm)[:, None]
    columns = 100 + slope * nm * torch.tensor([0.9, 1.1], dtype=torch.float64)
    assert bands.half_width_px(columns) == pytest.approx(steps * 0.02 * 5.0)
    own = [max(round(abs(slope) * share / 0.02), 1) * 0.02 * 5.0 for share in (0.9, 1.1)]
    assert bands.half_widths_px(columns).tolist() == pytest.approx(own)


def test_a_band_that_no_film_sends_there_is_not_as_wide_as_the_picture() -> None:
    bands = Bands.of(RIG, WavelengthGrid())
    columns = torch.tensor([[100.0, 100.0], [250.0, 39061.0]], dtype=torch.float64)
    usual, most = bands.half_widths_px(columns).tolist()
    along_axis = 5.0 * RIG.projector.fx_px * RIG.film.lines_per_mm / 1e6
    assert usual < most == pytest.approx(8 * along_axis, abs=0.05)
    assert bands.half_width_px(columns) < most
