"""How lines become light: profiles, halo, spectral integrals, and the sensor."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from scipy.ndimage import convolve1d

from dsl_core.model.rig import BayerPattern, ProjectorResponse, Sensor
from dsl_core.optics.lines.profile import (
    ProfileTable,
    band_profile,
    halo_integral,
    step_edge,
    zero_order_profile,
)
from dsl_core.optics.sensor import bayer_channels, digitise, raw_variance
from dsl_core.optics.spectra import chain_response, hat_moments
from dsl_core.simulation.published_rig import published_rig

HALO = ProjectorResponse(blur_px=0.7, halo_peak_per_px=0.002, halo_decay_px=12.0)


def test_zero_order_profile_keeps_the_light_of_the_line() -> None:
    columns = torch.arange(-300.0, 300.0, 0.01, dtype=torch.float64)
    profile = zero_order_profile(columns, -2.5, 2.5, HALO)
    halo_share = 2 * HALO.halo_peak_per_px * HALO.halo_decay_px
    assert float(profile.sum() * 0.01) == pytest.approx(5 * (1 + halo_share), rel=1e-6)
    assert float(zero_order_profile(torch.zeros(1), -250.0, 250.0, HALO)) == pytest.approx(
        1 + halo_share, rel=1e-5
    )


def test_halo_integral_has_the_halo_as_derivative() -> None:
    d = torch.tensor([-40.0, -3.0, -0.5, 0.5, 8.0, 60.0], dtype=torch.float64)
    h = 1e-5
    slope = (halo_integral(d + h, HALO) - halo_integral(d - h, HALO)) / (2 * h)
    expected = HALO.halo_peak_per_px * torch.exp(-d.abs() / HALO.halo_decay_px)
    assert (slope / expected - 1).abs().max() < 1e-6


def test_step_edge_is_half_at_the_edge_and_has_the_blur() -> None:
    edge = step_edge(torch.tensor([-0.7, 0.0, 0.7], dtype=torch.float64), 0.7)
    assert edge.tolist() == pytest.approx([0.15865525, 0.5, 0.84134475])


@pytest.mark.parametrize(("width", "blur", "band"), [(5.0, 0.6, 2.4), (1.0, 0.3, 1.0), (8.0, 1.5, 9.8)])
def test_band_profile_is_box_times_blur_times_triangle(width: float, blur: float, band: float) -> None:
    step = 0.01
    x = np.arange(-3000.0, 3001.0) * step
    triangle = np.clip(1 - np.abs(x) / band, 0, None) / band
    gauss = np.exp(-0.5 * (x / blur) ** 2) / (blur * np.sqrt(2 * np.pi))
    blurred = convolve1d(triangle, gauss[2000:4001] * step, mode="constant")
    # The box as the difference of two running integrals, exact at its edges.
    running = np.concatenate([[0.0], np.cumsum((blurred[1:] + blurred[:-1]) / 2)]) * step
    box = np.interp(x + width / 2, x, running) - np.interp(x - width / 2, x, running)
    assert np.abs(band_profile(x, width, blur, band) - box)[500:-500].max() < 1e-5


def test_profile_table_agrees_with_the_closed_form_and_ends_in_zero() -> None:
    table = ProfileTable(5.0, 0.6, 2.4, torch.device("cpu"), torch.float64)
    distance = torch.linspace(-12, 12, 2001, dtype=torch.float64)
    expected = band_profile(distance.numpy(), 5.0, 0.6, 2.4)
    assert np.abs(table.at(distance).numpy() - expected).max() < 1e-3
    assert float(table.at(torch.tensor([50.0, -50.0], dtype=torch.float64)).abs().max()) == 0


@pytest.mark.parametrize("order", [1, -1])
def test_band_moments_integrate_the_response_of_a_linear_spectrum(order: int) -> None:
    rig, step = published_rig(), 5.0
    centres = np.arange(430.0, 661.0, step)
    moments, centroids = hat_moments(rig, order, centres, step)
    assert moments.shape == (3, 3, 47)
    assert (np.abs(centroids - centres) < step / 2).all()
    # Hats and a spectrum that is linear between bands give the integral over the response exactly.
    fine = np.arange(centres[0] - step, centres[-1] + step + 1e-9, 0.125)
    spectrum = 0.2 + 0.003 * (centres - 430)
    padded = np.interp(fine, [fine[0], *centres, fine[-1]], [0, *spectrum, 0])
    integral = (chain_response(rig, order, fine) * padded).sum(-1) * 0.125
    assert moments @ spectrum == pytest.approx(integral, rel=2e-3)


def test_zero_order_moments_of_white_hold_all_light() -> None:
    rig = published_rig()
    centres = np.arange(430.0, 661.0, 5.0)
    moments, _ = hat_moments(rig, 0, centres, 5.0)
    fine = np.arange(390.0, 700.0, 0.125)
    assert moments.sum(-1) == pytest.approx(chain_response(rig, 0, fine).sum(-1) * 0.125, rel=2e-3)


def test_unknown_order_carries_no_light() -> None:
    assert not chain_response(published_rig(), 5, np.array([500.0])).any()


@pytest.mark.parametrize("signal", [0.0, 5.0, 800.0])
def test_variance_of_samples_is_the_one_stated(signal: float) -> None:
    sensor = Sensor(read_noise_dn=1.5, electrons_per_dn=8.0)
    raw = digitise(sensor, np.full((400, 400), signal, np.float32), np.random.default_rng(0)).astype(float)
    assert raw.mean() - sensor.black_level_dn == pytest.approx(signal, abs=0.1)
    assert raw.var() == pytest.approx(float(raw_variance(sensor, np.array(signal))), rel=0.02)


def test_too_much_light_reads_full_scale_and_too_little_zero() -> None:
    sensor = Sensor(bit_depth=10, black_level_dn=20)
    raw = digitise(sensor, np.array([[1e5, -100.0, 3.4]], np.float32), None)
    assert raw.tolist() == [[1023, 0, 23]]
    assert raw.dtype == np.uint16


@pytest.mark.parametrize(
    ("bayer", "tile"),
    [
        ("RGGB", [[0, 1], [1, 2]]),
        ("BGGR", [[2, 1], [1, 0]]),
        ("GRBG", [[1, 0], [2, 1]]),
        ("GBRG", [[1, 2], [0, 1]]),
    ],
)
def test_bayer_tiles(bayer: BayerPattern, tile: list[list[int]]) -> None:
    channels = bayer_channels(bayer, 5, 7)
    assert channels.shape == (5, 7)
    assert channels[2:4, 4:6].tolist() == tile
